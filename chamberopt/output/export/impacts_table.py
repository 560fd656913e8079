"""The table of every impact of a result, for residual stress solvers: .parquet, .csv, .csv.gz."""

from __future__ import annotations

import gzip
import json
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.files import check_new_file, new_file, remove_file, write_text
from chamberopt.common.versions import versions
from chamberopt.output.export.formats import FrameName
from chamberopt.output.export.frame import MEANING, Frame, frame_of
from chamberopt.output.export.impact_columns import Column, columns_of, impact_rows
from chamberopt.output.resimulate.impacts import RebuiltChamber, replica_count, simulate_impacts

if TYPE_CHECKING:
    from chamberopt.common.progress import Progress
    from chamberopt.output.results.load import Result

PARQUET = ".parquet"
METADATA_KEY = "chamberopt"  # of a Parquet file
GZIP_LEVEL = 3  # level 6 takes three times as long and saves 6 %
METADATA_ENDING = ".json"  # the description of FILE.csv is in FILE.csv.json

WriteRows = Callable[[Sequence[np.ndarray]], None]


def write_impacts(
    files: Sequence[Path], result: Result, rebuilt: RebuiltChamber, executor: Executor, *,
    frame: FrameName = "part", replicas: int | None = None, progress: Progress | None = None,
) -> int:  # fmt: skip
    """Simulate a result again and write its impacts into each file, in the format of its ending.

    The table has one row for each impact, replica after replica, in order of time. Its columns are
    in impact_columns.py. Files appear complete or not at all.

    Returns:
        The number of impacts.

    Raises:
        InputError: the replicas do not give the result's own figures, or pyarrow is missing.
    """
    design, chamber = result.design, rebuilt.chamber
    axes = frame_of(frame, chamber.part)
    columns = columns_of(axes)
    metadata = _metadata(result, rebuilt, axes, columns, replica_count(result, replicas))
    written = 0
    with ExitStack() as stack:
        writers = [stack.enter_context(_open_table(file, columns, metadata)) for file in files]
        for impacts in simulate_impacts(result, rebuilt, executor, replicas, progress):
            for rows in impact_rows(impacts, chamber, design, axes):
                values = [column.values(rows).astype(column.dtype) for column in columns]
                for write_rows in writers:
                    write_rows(values)
            written += len(impacts.log)
    return written


def require_writable(files: Sequence[Path]) -> None:
    """Raise InputError where a file needs pyarrow and it is missing, or where a file exists."""
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


def _metadata(
    result: Result, rebuilt: RebuiltChamber, frame: Frame, columns: Sequence[Column], replicas: int
) -> dict[str, Any]:
    """Describe the rows: their origin, their frame and unit, their columns."""
    design = result.design
    return {
        "result": result.folder.resolve().name,
        "frame": f"{frame.name}: {MEANING[frame.name]}",
        "length_unit": frame.unit,
        "columns": {column.name: column.meaning for column in columns},
        "replicas": replicas,
        "simulated_time_s": replicas * design.process.recorded_time,
        "treatment_time_s": design.process.treatment_time,
        "same_as_result": replicas == result.record.replicas,
        "seed": result.seeds[0],
        "stream": result.seeds[1],
        "analytic": rebuilt.cavity is not None,
        "part_sha256": result.record.part_sha256,
        "part_triangles": len(rebuilt.chamber.part.triangles),
        "design": result.record.design,
        "versions": versions(),
    }


def _is_parquet(file: Path) -> bool:
    return file.suffix.lower() == PARQUET


def _open_table(
    file: Path, columns: Sequence[Column], metadata: dict[str, Any]
) -> AbstractContextManager[WriteRows]:
    return (_parquet if _is_parquet(file) else _csv)(file, columns, metadata)


@contextmanager
def _parquet(
    file: Path, columns: Sequence[Column], metadata: dict[str, Any]
) -> Iterator[WriteRows]:
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
    schema = pyarrow.schema(fields, {METADATA_KEY: json.dumps(metadata)})
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
        new_file(file) as content,
        pyarrow.parquet.ParquetWriter(content, schema, **settings) as writer,
    ):
        yield lambda values: writer.write_batch(pyarrow.record_batch(list(values), schema=schema))


@contextmanager
def _csv(file: Path, columns: Sequence[Column], metadata: dict[str, Any]) -> Iterator[WriteRows]:
    line = ",".join(column.text for column in columns) + "\n"
    try:
        with new_file(file) as plain:
            with ExitStack() as stack:
                out: Any = plain
                if file.suffix.lower() == ".gz":
                    # Without a name and a time inside, the same impacts give the same bytes.
                    out = stack.enter_context(gzip.GzipFile("", "wb", GZIP_LEVEL, plain, 0))
                out.write((",".join(column.name for column in columns) + "\n").encode())

                def write_rows(values: Sequence[np.ndarray]) -> None:
                    lists = [value.tolist() for value in values]
                    out.write("".join([line % row for row in zip(*lists, strict=True)]).encode())

                yield write_rows
            write_text(beside(file), json.dumps(metadata, indent=2) + "\n")
    except BaseException:
        remove_file(beside(file))  # a table and what describes it are one
        raise


def beside(file: Path) -> Path:
    """Return the path of the JSON file that describes a .csv file."""
    return file.with_name(file.name + METADATA_ENDING)
