"""Write a table of every impact of a result for residual stress solvers.

The formats are .parquet, .csv and .csv.gz.
"""

from __future__ import annotations

import gzip
import json
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, NamedTuple

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.files import check_new_file, new_file, remove_file, write_text
from chamberopt.common.versions import versions
from chamberopt.coverage.dents import dent_diameters, impact_angle_deg
from chamberopt.export.formats import FrameName
from chamberopt.export.frame import MEANING, Frame, frame_of
from chamberopt.results.impacts import replica_count, simulate_impacts
from chamberopt.results.rebuild import RebuiltChamber

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.common.progress import Progress
    from chamberopt.design.load import Design
    from chamberopt.export.frame import Frame
    from chamberopt.results.impacts import ReplicaImpacts
    from chamberopt.results.load import Result
    from sim_core import ImpactLog

ROWS_AT_ONCE = 1 << 16  # also the rows of a Parquet row group


class ImpactRows(NamedTuple):
    """Some of the impacts of one replica, from which rows of the table are computed.

    Args:
        replica: number of the replica.
        log: the n impacts as the simulator recorded them.
        triangle: triangle of the part that each impact hit, shape (n,).
        position: contact point in the frame of the table, shape (n, 3). It is the surface point
            nearest to the centre of the ball.
        velocity: velocity before the impact [m/s], in the frame of the table, shape (n, 3). On a
            turning part, both are in the frame of the part's mesh, which turns with the part.
        dent: diameter of the dent [m], shape (n,).
        ball: diameter of the ball [m], shape (n,).
        element: element of the part's file at the contact point, shape (n,).
    """

    replica: int
    log: ImpactLog
    triangle: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    dent: np.ndarray
    ball: np.ndarray
    element: np.ndarray


class Column(NamedTuple):
    """A column of the table of impacts, and how it is computed.

    Args:
        name: name of the column, which ends with the unit.
        dtype: type of the values in the file.
        text: printf format of the values in a .csv file.
        meaning: a sentence for the file's own description.
        values: function that computes the column, shape (n,).
    """

    name: str
    dtype: str
    text: str
    meaning: str
    values: Callable[[ImpactRows], np.ndarray]


def columns_of(frame: Frame) -> tuple[Column, ...]:
    """Return the columns of the table of impacts in order; add new columns here."""
    unit = frame.unit
    return (
        Column(
            "replica", "int32", "%d", "replica, from 0; each is a simulation of its own",
            lambda rows: np.full(len(rows.triangle), rows.replica),
        ),
        Column(
            "time_s", "float64", "%.10g", "time since the warm-up of its replica ended [s]",
            lambda rows: rows.log.time,
        ),
        Column(
            "triangle", "int32", "%d",
            "the part's triangle that was hit, from 0, in the order of part.vtp",
            lambda rows: rows.triangle,
        ),
        Column(
            "element", "int64", "%d",
            "the element of the part's file that was hit, as in part.vtp",
            lambda rows: rows.element,
        ),
        *(
            Column(
                f"{x}_{unit}", "float64", "%.9g", f"contact point, {x} [{unit}]",
                lambda rows, axis=axis: rows.position[:, axis],  # type: ignore[misc]
            )
            for axis, x in enumerate("xyz")
        ),
        *(
            Column(
                f"v{x}_m_s", "float32", "%.7g",
                f"velocity before the impact, relative to the surface, {x} [m/s]",
                lambda rows, axis=axis: rows.velocity[:, axis],  # type: ignore[misc]
            )
            for axis, x in enumerate("xyz")
        ),
        Column(
            "normal_speed_m_s", "float32", "%.7g", "speed normal to the surface [m/s]",
            lambda rows: rows.log.normal_speed,
        ),
        Column(
            "angle_deg", "float32", "%.6g",
            "angle between path and surface [degrees]: 90 is head on, 0 grazing",
            lambda rows: impact_angle_deg(rows.log.velocity, rows.log.normal_speed),
        ),
        Column(
            "ball_diameter_mm", "float32", "%.6g", "diameter of the ball [mm]",
            lambda rows: rows.ball * 1e3,
        ),
        Column(
            "dent_diameter_um", "float32", "%.6g",
            "diameter of its dent [um]; 0 below the part's yield speed",
            lambda rows: rows.dent * 1e6,
        ),
    )  # fmt: skip


def impact_rows(
    impacts: ReplicaImpacts, chamber: Chamber, design: Design, frame: Frame
) -> Iterator[ImpactRows]:
    """Yield the impacts of a replica in pieces of at most ROWS_AT_ONCE impacts."""
    from sim_core import closest_on_each

    ball = np.asarray(design.shot.diameters, dtype=float)
    dents = dent_diameters(impacts.log, chamber, design)
    for begin in range(0, len(impacts.log), ROWS_AT_ONCE):
        piece = np.arange(begin, min(begin + ROWS_AT_ONCE, len(impacts.log)))
        log = impacts.log.only(piece)
        triangle = impacts.part_triangle[piece]
        corners = chamber.vertices[chamber.triangles[log.triangle]]
        yield ImpactRows(
            impacts.number,
            log,
            triangle,
            frame.positions(closest_on_each(corners, log.position)),
            frame.directions(log.velocity),
            dents[piece],
            ball[log.ball],
            chamber.part.elements[triangle],
        )


PARQUET = ".parquet"
METADATA_KEY = "chamberopt"  # of a Parquet file
GZIP_LEVEL = 3  # level 6 takes three times as long and saves 6 %
METADATA_ENDING = ".json"  # the description of FILE.csv is in FILE.csv.json

WriteRows = Callable[[Sequence[np.ndarray]], None]


class ImpactTable(NamedTuple):
    """The table of the impacts of a result, computed piece by piece.

    It has one row for each impact, replica after replica, in order of time.

    Args:
        columns: the columns in order.
        metadata: description of the table, as JSON values.
        pieces: the values of each column for some rows, piece after piece. The replicas are
            simulated as the pieces are taken.
    """

    columns: tuple[Column, ...]
    metadata: dict[str, object]
    pieces: Iterator[list[np.ndarray]]


def impact_table(
    result: Result, rebuilt: RebuiltChamber, executor: Executor, *,
    frame: FrameName = "part", replicas: int | None = None, progress: Progress | None = None,
) -> ImpactTable:  # fmt: skip
    """Return the table of the impacts of a result, which is simulated again.

    Raises:
        InputError: the number of replicas is not one of the result's. After the last piece, if the
            new replicas differ from the replicas of the result.
    """
    design, chamber = result.design, rebuilt.chamber
    axes = frame_of(frame, chamber.part)
    columns = columns_of(axes)
    metadata = _metadata(result, rebuilt, axes, columns, replica_count(result, replicas))
    pieces = (
        [column.values(rows).astype(column.dtype) for column in columns]
        for impacts in simulate_impacts(result, rebuilt, executor, replicas, progress)
        for rows in impact_rows(impacts, chamber, design, axes)
    )
    return ImpactTable(columns, metadata, pieces)


def write_impacts(
    files: Sequence[Path], result: Result, rebuilt: RebuiltChamber, executor: Executor, *,
    frame: FrameName = "part", replicas: int | None = None, progress: Progress | None = None,
) -> int:  # fmt: skip
    """Simulate a result again, and write its impacts into files in the formats of their endings.

    Files appear complete or not at all.

    Returns:
        The number of impacts.

    Raises:
        InputError: the new replicas differ from the replicas of the result, or pyarrow is missing.
    """
    columns, metadata, pieces = impact_table(
        result, rebuilt, executor, frame=frame, replicas=replicas, progress=progress
    )
    written = 0
    with ExitStack() as stack:
        writers = [stack.enter_context(_open_table(file, columns, metadata)) for file in files]
        for values in pieces:
            for write_rows in writers:
                write_rows(values)
            written += len(values[0])
    return written


def require_writable(files: Sequence[Path]) -> None:
    """Raise InputError if a table cannot be written.

    The reasons are that pyarrow is missing for a .parquet file, or that the JSON file that
    describes a .csv file exists already.
    """
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
) -> dict[str, object]:
    """Return a description of the table of impacts: origin, frame, unit of length, columns."""
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
    file: Path, columns: Sequence[Column], metadata: dict[str, object]
) -> AbstractContextManager[WriteRows]:
    return (_parquet if _is_parquet(file) else _csv)(file, columns, metadata)


@contextmanager
def _parquet(
    file: Path, columns: Sequence[Column], metadata: dict[str, object]
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
def _csv(file: Path, columns: Sequence[Column], metadata: dict[str, object]) -> Iterator[WriteRows]:
    line = ",".join(column.text for column in columns) + "\n"
    try:
        with new_file(file) as plain:
            with ExitStack() as stack:
                out: BinaryIO | gzip.GzipFile = plain
                if file.suffix.lower() == ".gz":
                    # No name and time inside, so the same impacts give the same bytes.
                    out = stack.enter_context(gzip.GzipFile("", "wb", GZIP_LEVEL, plain, 0))
                out.write((",".join(column.name for column in columns) + "\n").encode())

                def write_rows(values: Sequence[np.ndarray]) -> None:
                    lists = [value.tolist() for value in values]
                    out.write("".join([line % row for row in zip(*lists, strict=True)]).encode())

                yield write_rows
            write_text(beside(file), json.dumps(metadata, indent=2) + "\n")
    except BaseException:
        remove_file(beside(file))  # a table and its description belong together
        raise


def beside(file: Path) -> Path:
    """Return the path of the JSON file that describes a .csv file and lies beside it."""
    return file.with_name(file.name + METADATA_ENDING)
