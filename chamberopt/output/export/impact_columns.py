"""The columns of the table of impacts: to add one, add a line here."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.coverage.dents import dent_diameters, impact_angle_deg
from chamberopt.geometry.triangles import closest_on_each

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from chamberopt.output.export.frame import Frame
    from chamberopt.output.resimulate.impacts import ReplicaImpacts
    from sim_core import ImpactLog

ROWS_AT_ONCE = 1 << 16  # also the rows of a Parquet row group


class ImpactRows(NamedTuple):
    """A piece of the impacts of one replica, from which columns are computed.

    Args:
        replica: number of the replica.
        log: impacts of the piece, (n,) each.
        triangle: triangle of the part that was hit, shape (n,).
        position: contact point in the frame of the table, shape (n, 3). A ball touches the surface
            at the point that is nearest to its centre.
        velocity: velocity before the impact [m/s], in the frame of the table, shape (n, 3). On a
            turning part position and velocity are relative to the part as its mesh stands.
        dent: diameter of the dent [m], shape (n,).
        ball: diameter of the ball [m], shape (n,).
        element: element of the part's file that was hit, shape (n,).
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
    """A column of the table.

    Args:
        name: with the unit at its end.
        dtype: as stored.
        text: printf format in a .csv file.
        meaning: a sentence for the file's own description.
        values: computes the column, shape (n,).
    """

    name: str
    dtype: str
    text: str
    meaning: str
    values: Callable[[ImpactRows], np.ndarray]


def columns_of(frame: Frame) -> tuple[Column, ...]:
    """Return the columns in their order."""
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
    """Split the impacts of a replica into pieces of ROWS_AT_ONCE rows."""
    ball = np.asarray(design.shot.diameters, dtype=float)
    dents = dent_diameters(impacts.log, design)
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
