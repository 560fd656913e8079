"""The target seen through windows: what of each window shot can touch.

Notation
    p     middle of a window                                           (points, (p,))
    l     radius of the window: pi l² is the gauge [m]                 (radius)
    A     area of the window that a ball can touch [m²]                (area, (p,))

Places that no ball can touch, because something is in the ball's way, count as bare and belong to
no window. Convex creases have windows of their own, pieces of the crease.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.coverage.field.crease_bands import (
    CreaseBand,
    CreasePieces,
    crease_pieces,
    find_band,
)
from chamberopt.coverage.field.smooth_faces import Creases, find_faces
from chamberopt.coverage.field.surface_points import (
    ball_fits,
    sampling_error,
    sparse_points,
    spread_points,
)
from chamberopt.geometry.triangles import unit_normals

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.coverage.field.windows import Places, Windows
    from chamberopt.coverage.part_impacts import Hits
    from sim_core import TriangleMesh

OF_WIDE = 0.125  # of the number of windows, for those of twice the radius, which overlap more
# By points, on average, the area of a window is measured. With 12 the mean comes out 0.01 too high.
POINTS_PER_WINDOW = 36
MAX_POINTS = 8_000_000
MAX_POINTS_OFF_TARGET = 400_000  # which are for pictures alone


class WindowSetting(NamedTuple):
    """What windows depend on, but for the chamber.

    Attributes:
        gauge: area of a window [m²].
        points: number of windows; figures are means over them.
        ball: diameter of the smallest ball [m].
        largest_dent: diameter [m].
    """

    gauge: float
    points: int
    ball: float
    largest_dent: float


@dataclass(frozen=True)
class Gauge:
    """The windows of one size round some points."""

    windows: Windows
    area: np.ndarray  # that a ball can touch in each window [m²], (p,)
    band: CreaseBand | None  # None if no point is near a crease


@dataclass(frozen=True)
class TargetField:
    """A part in its chamber, ready to be looked at through windows."""

    setting: WindowSetting
    face: np.ndarray  # smooth face of each part triangle, (m,)
    on_target: np.ndarray  # marks the part triangles of the target, (m,)
    corners: np.ndarray  # of the part triangles [m], (m, 3, 3)
    normals: np.ndarray  # unit vectors out of the part, (m, 3)
    creases: Creases
    pieces: CreasePieces
    has_windows: np.ndarray  # marks the part triangles whose dents can be in a window, (m,)
    touched: Places  # points that a ball can touch, spread evenly over the target
    touched_area: np.ndarray  # that each of them stands for [m²]
    reachable: float  # share of the target's area that a ball can touch
    reachable_error: float  # its standard error, by the choice of points

    @property
    def radius(self) -> float:
        """Radius of a window [m]."""
        return float(np.sqrt(self.setting.gauge / np.pi))

    @cached_property
    def gauge(self) -> Gauge:
        """Windows of the gauge round points of the target."""
        return self.gauge_round(self.some_points(self.setting.points), self.radius)

    @cached_property
    def wide(self) -> Gauge:
        """Windows of twice the radius round points of the target."""
        return self.gauge_round(
            self.some_points(int(OF_WIDE * self.setting.points)), 2.0 * self.radius
        )

    def gauge_round(self, points: Places, radius: float) -> Gauge:
        """Windows of a radius [m] round points of the part."""
        from chamberopt.coverage.field.windows import Windows

        windows = Windows(points, radius)
        area = windows.sums(self.touched, self.touched_area)
        area[area == 0.0] = np.inf  # nothing can be touched there, so nothing covers it
        band = find_band(windows, self.creases, self.pieces, 0.5 * self.setting.largest_dent)
        return Gauge(windows, area, band)

    def some_points(self, count: int) -> Places:
        """So many of the points that a ball can touch, or all, spread evenly over the target."""
        there = len(self.touched.place)
        rows = np.linspace(0, there - 1, min(count, there)).round().astype(int)
        return self.touched.select(rows)

    def places_of(self, hits: Hits, rows: np.ndarray) -> Places:
        """The contacts of some impacts."""
        from chamberopt.coverage.field.windows import Places

        triangle = hits.triangle[rows]
        return Places(hits.place[rows].astype(float), self.normals[triangle], self.face[triangle])


def find_target_field(chamber: Chamber, mesh: TriangleMesh, setting: WindowSetting) -> TargetField:
    """Prepare a chamber's target.

    Args:
        mesh: of the chamber.

    Raises:
        InputError: the windows are too small for so large a target.
    """
    part, gauge = chamber.part, setting.gauge
    area = np.where(part.target, part.area, 0.0)
    wanted = POINTS_PER_WINDOW * area.sum() / gauge
    if wanted > MAX_POINTS:
        least = 1e6 * gauge * wanted / MAX_POINTS
        raise InputError(
            f"process.accuracy.gauge_mm2: given {1e6 * gauge:g}, too small for a target of "
            f"{1e6 * area.sum():.4g} mm²; give at least {least:.2g}"
        )
    face, creases = find_faces(part.vertices, part.triangles, part.target)
    radius = float(np.sqrt(gauge / np.pi))
    count = int(max(setting.points, wanted))
    touched, fits = _touched(chamber, mesh, area, count, face, setting.ball)
    return TargetField(
        setting=setting,
        face=face,
        on_target=part.target,
        corners=part.vertices[part.triangles],
        normals=unit_normals(part.vertices[part.triangles]),
        creases=creases,
        pieces=crease_pieces(creases, mesh, 0.5 * setting.ball, radius),
        has_windows=part.target | (creases.at_corner >= 0).any(axis=1),
        touched=touched,
        touched_area=np.full(len(touched.place), area.sum() / count),
        reachable=float(fits.mean()),
        reachable_error=sampling_error(np.array([some.mean() for some in sparse_points(fits)])),
    )


def with_whole_part(field: TargetField, chamber: Chamber, mesh: TriangleMesh) -> TargetField:
    """The same field with points on the rest of the exposed part too, for pictures."""
    from chamberopt.coverage.field.windows import Places

    area = np.where(chamber.part.target, 0.0, chamber.exposed_area)
    if not area.any():
        return field
    wanted = POINTS_PER_WINDOW * area.sum() / field.setting.gauge
    count = int(np.clip(wanted, 1, MAX_POINTS_OFF_TARGET))
    rest, _ = _touched(chamber, mesh, area, count, field.face, field.setting.ball)
    return replace(
        field,
        has_windows=np.ones(len(area), dtype=bool),
        touched=Places(*map(np.concatenate, zip(field.touched, rest, strict=True))),
        touched_area=np.concatenate(
            [field.touched_area, np.full(len(rest.place), area.sum() / count)]
        ),
    )


def _touched(
    chamber: Chamber,
    mesh: TriangleMesh,
    area: np.ndarray,
    count: int,
    face: np.ndarray,
    ball: float,
) -> tuple[Places, np.ndarray]:
    """Of points spread over the part by area (m,), those that a ball can touch; and which."""
    from chamberopt.coverage.field.windows import Places

    spread = spread_points(chamber.part.vertices, chamber.part.triangles, area, count)
    fits = ball_fits(mesh, spread.place, spread.normal, 0.5 * ball)
    return Places(spread.place[fits], spread.normal[fits], face[spread.triangle[fits]]), fits
