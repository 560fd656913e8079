"""The columns of the table of impacts, and their values for one replica, piece by piece.

A ball meets the surface in one point, the nearest to its centre; that point is the impact's place. On a turning part
place and velocity are seen from the part, as its mesh stands.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.coverage.dents import dent_diameters, impact_angle_deg
from chamberopt.geometry.triangles import closest_points

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from chamberopt.output.export.frame import Frame
    from chamberopt.output.resimulate.impacts import ReplicaImpacts

PIECE = 1 << 16  # rows at once, also of a Parquet row group


class Column(NamedTuple):
    """name, its unit last · dtype as stored · text: how a .csv writes it · meaning."""

    name: str
    dtype: str
    text: str
    meaning: str


def columns_of(frame: Frame) -> tuple[Column, ...]:
    """The columns in their order."""
    place = [
        Column(f"{x}_{frame.unit}", "float64", "%.9g", f"contact point, {x} [{frame.unit}]")
        for x in "xyz"
    ]
    velocity = [
        Column(
            f"v{x}_m_s",
            "float32",
            "%.7g",
            f"velocity before the impact, against the surface, {x} [m/s]",
        )
        for x in "xyz"
    ]
    return (
        Column("replica", "int32", "%d", "replica, from 0; each is a simulation of its own"),
        Column("time_s", "float64", "%.10g", "time since its replica's warm-up ended [s]"),
        Column(
            "triangle",
            "int32",
            "%d",
            "the part's triangle that was hit, from 0, in the order of coverage.vtp",
        ),
        Column(
            "element",
            "int64",
            "%d",
            "the element of the part's file that was hit, as in coverage.vtp",
        ),
        *place,
        *velocity,
        Column("normal_speed_m_s", "float32", "%.7g", "speed across the surface [m/s]"),
        Column(
            "angle_deg",
            "float32",
            "%.6g",
            "between path and surface [degrees]: 90 is head on, 0 grazing",
        ),
        Column("ball_diameter_mm", "float32", "%.6g", "diameter of the ball [mm]"),
        Column(
            "dent_diameter_um",
            "float32",
            "%.6g",
            "diameter of its dent [um]; 0 below the part's yield speed",
        ),
    )


def rows(
    impacts: ReplicaImpacts,
    chamber: Chamber,
    design: Design,
    frame: Frame,
    columns: tuple[Column, ...],
) -> Iterator[list[np.ndarray]]:
    """The values of each column, PIECE rows at a time; in the order of `columns`."""
    log = impacts.log
    ball = np.asarray(design.shot.diameters, dtype=float)
    dents = dent_diameters(log, design)
    for begin in range(0, len(log), PIECE):
        piece = slice(begin, begin + PIECE)
        velocity, speed = log.velocity[piece], log.normal_speed[piece]
        corners = chamber.vertices[chamber.triangles[log.triangle[piece]]]
        triangle = impacts.part_triangle[piece]
        values = [
            np.full(len(triangle), impacts.number),
            log.time[piece],
            triangle,
            chamber.part.elements[triangle],
            *frame.places(closest_points(corners, log.position[piece])).T,
            *frame.directions(velocity).T,
            speed,
            impact_angle_deg(velocity, speed),
            ball[log.ball[piece]] * 1e3,
            dents[piece] * 1e6,
        ]
        yield [value.astype(column.dtype) for value, column in zip(values, columns, strict=True)]
