"""Every impact of a result as a table, for solvers of residual stress: .parquet, .csv, .csv.gz."""

from __future__ import annotations

import gzip
import json
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.files import atomic_write, check_new_file, write_text
from chamberopt.common.versions import versions
from chamberopt.output.export.formats import FrameName
from chamberopt.output.export.frame import SAID, Frame, frame_of
from chamberopt.output.export.impact_columns import Column, columns_of, rows
from chamberopt.output.resimulate.impacts import RebuiltChamber, replica_count, simulate_impacts

if TYPE_CHECKING:
    from chamberopt.common.progress import Progress
    from chamberopt.output.results.load import Result

PARQUET = ".parquet"
ABOUT = "chamberopt"  # key of a Parquet file's metadata
PACKED = 3  # level of gzip: 6 takes three times as long for 6 % less
BESIDE = (
    ".json"  # a .csv has its header alone; what else there is to know of it stands in FILE.json
)

Put = Callable[[Sequence[np.ndarray]], None]


def write_impacts(
    files: Sequence[Path], result: Result, ground: RebuiltChamber, executor: Executor, *, frame: FrameName = "part",
    replicas: int | None = None, progress: Progress | None = None,
) -> int:  # fmt: skip
    """Simulate the result again, write all its impacts into each file, by its ending; how many there are.

    A row an impact, replica after replica, in order of time; columns: impact_columns.py. Files appear whole, or not at
    all where the replicas do not give the result's own figures: InputError then, and where pyarrow is missing.
    """
    design, chamber = result.design, ground.chamber
    seen = frame_of(frame, design, chamber)
    columns = columns_of(seen)
    about = _about(result, ground, seen, columns, replica_count(result, replicas))
    written = 0
    with ExitStack() as stack:
        puts = [stack.enter_context(_sink(file)(file, columns, about)) for file in files]
        for impacts in simulate_impacts(result, ground, executor, replicas, progress):
            for values in rows(impacts, chamber, design, seen, columns):
                for put in puts:
                    put(values)
            written += len(impacts.log)
    return written


def require_writable(files: Sequence[Path]) -> None:
    """InputError where a file asked for needs pyarrow and it is not installed, or one is there already."""
    for file in files:
        if _is_parquet(file):
            _pyarrow()
        else:
            check_new_file(beside(file))


def _pyarrow() -> Any:
    try:
        import pyarrow.parquet
    except ImportError:
        raise InputError(
            "impacts-parquet: pyarrow is not installed: pip install 'chamberopt[parquet]'"
        ) from None
    return pyarrow


def _about(
    result: Result, ground: RebuiltChamber, frame: Frame, columns: Sequence[Column], replicas: int
) -> dict[str, Any]:
    """What to know of the rows: where they come from, and in what they are written."""
    design = result.design
    return {
        "result": result.folder.resolve().name,
        "frame": f"{frame.name}: {SAID[frame.name]}",
        "length_unit": frame.unit,
        "columns": {column.name: column.meaning for column in columns},
        "replicas": replicas,
        "simulated_time_s": replicas * design.process.recorded_time,
        "treatment_time_s": design.process.treatment_time,
        "same_as_result": replicas == result.data["replicas"],
        "seed": result.seeds[0],
        "stream": result.seeds[1],
        "analytic": ground.cavity is not None,
        "part_sha256": result.part_sha256,
        "part_triangles": len(ground.chamber.part.triangles),
        "design": result.data["design"],
        "versions": versions(),
    }


def _is_parquet(file: Path) -> bool:
    return file.suffix.lower() == PARQUET


def _sink(file: Path) -> Callable[..., Any]:
    return _parquet if _is_parquet(file) else _csv


@contextmanager
def _parquet(file: Path, columns: Sequence[Column], about: dict[str, Any]) -> Iterator[Put]:
    pyarrow = _pyarrow()
    fields = [
        pyarrow.field(
            column.name,
            pyarrow.from_numpy_dtype(np.dtype(column.dtype)),
            False,
            {"meaning": column.meaning},
        )
        for column in columns
    ]
    schema = pyarrow.schema(fields, {ABOUT: json.dumps(about)})
    smooth = [
        column.name
        for column in columns
        if column.dtype.startswith("float") and "diameter" not in column.name
    ]
    settings = {
        "compression": "zstd",
        "use_dictionary": False,
        "column_encoding": dict.fromkeys(smooth, "BYTE_STREAM_SPLIT"),
    }
    with (
        atomic_write(file) as temporary,
        pyarrow.parquet.ParquetWriter(temporary, schema, **settings) as writer,
    ):
        yield lambda values: writer.write_batch(pyarrow.record_batch(list(values), schema=schema))


@contextmanager
def _csv(file: Path, columns: Sequence[Column], about: dict[str, Any]) -> Iterator[Put]:
    line = ",".join(column.text for column in columns) + "\n"
    with atomic_write(file) as temporary, open(temporary, "wb") as plain, ExitStack() as stack:
        # Without a name and a time in it the same impacts give the same bytes.
        out = (
            stack.enter_context(gzip.GzipFile("", "wb", PACKED, plain, 0))
            if file.suffix.lower() == ".gz"
            else plain
        )
        out.write((",".join(column.name for column in columns) + "\n").encode())

        def put(values: Sequence[np.ndarray]) -> None:
            lists = [value.tolist() for value in values]
            out.write("".join([line % row for row in zip(*lists, strict=True)]).encode())

        yield put
    write_text(beside(file), json.dumps(about, indent=2) + "\n")


def beside(file: Path) -> Path:
    """Where there is said what a .csv holds."""
    return file.with_name(file.name + BESIDE)
