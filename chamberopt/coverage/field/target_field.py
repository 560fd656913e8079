"""Place measuring windows on the target, and find the area of each that the shot can touch.

Notation
    window: disc of the surface in which dents are counted
    p     middle of a window                                           (points, (p,))
    l     radius of the window: pi l² is the gauge [m]                 (radius)
    A     area of the window that a ball can touch [m²]                (area, (p,))

A point that no ball can touch, because an obstacle is in the ball's way, counts as bare and belongs
to no window. Convex creases have their own windows, which are pieces of the crease. If n points are
equivalent by symmetry, their windows are one window with n times the area (symmetry.py).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.number_text import plain
from chamberopt.coverage.field.crease_bands import (
    CreaseBand,
    CreasePieces,
    crease_pieces,
    find_band,
)
from chamberopt.coverage.field.smooth_faces import Creases, Faces, find_faces
from chamberopt.coverage.field.surface_points import Reach, ball_fits, reach_from, spread_points
from chamberopt.coverage.field.symmetry import TOLERANCE, Symmetry, find_symmetry
from chamberopt.geometry.triangles import areas, unique_rows, unit_normals
from sim_core import computed_once

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.coverage.field.smooth_faces import Places
    from chamberopt.coverage.field.surface_points import Rooms
    from chamberopt.coverage.field.window_areas import SurfacePieces
    from chamberopt.coverage.field.windows import Windows
    from chamberopt.coverage.part_impacts import Hits
    from sim_core import TriangleMesh

OF_WIDE = 0.125  # number of windows of twice the radius, which overlap more, over all windows
# Area of all windows together [m²], or over the target's area, whichever is more. A few windows
# nearly as wide as the target tell all.
MOST_AREA, MOST_OVERLAP, FEWEST_WINDOWS = 0.2, 20.0, 200
POINTS_OF_ZONE = 1000  # points of a zone that are tested for a ball before any work
POINTS_PER_CHOSEN = 2  # points tested for a ball, for each middle of a window
SAME_NORMAL = 1e-3  # rad between normals of points that are one after a turn
MIN_WINDOWS = 2.0  # windows side by side on a target, to show its evenness
PIECES_PER_WINDOW = 6  # most pieces of surface, far from the border of the touchable surface
MAX_PIECES, MAX_PIECES_OFF_TARGET = 3e6, 4e5  # pieces off the target are only for pictures


class WindowSetting(NamedTuple):
    """Size and number of the measuring windows, and the sizes of balls and dents.

    Attributes:
        gauge: area of a window, a disc of the surface in which dents are counted [m²].
        points: number of windows; results are means over them.
        ball: diameter of the smallest ball [m].
        largest_dent: diameter of the largest dent [m].
        symmetric: true if all motion keeps the chamber's symmetry about its axis.
    """

    gauge: float
    points: int
    ball: float
    largest_dent: float
    symmetric: bool = False


@dataclass(frozen=True)
class Gauge:
    """Measuring windows of one size round points of the target.

    Each window also stands for the windows that a turn by the chamber's symmetry makes of it.
    """

    windows: Windows
    area: np.ndarray  # touchable area of each window and its alike windows [m²], (p,)
    band: CreaseBand | None  # None if no point is near a crease


@dataclass(frozen=True)
class TargetField:
    """A part in its chamber, with all that is needed to measure coverage in windows on it."""

    setting: WindowSetting
    faces: Faces
    on_target: np.ndarray  # marks the part triangles of the target, (m,)
    corners: np.ndarray  # of the part triangles [m], (m, 3, 3)
    normals: np.ndarray  # unit vectors out of the part, (m, 3)
    creases: Creases
    pieces: CreasePieces
    has_windows: np.ndarray  # marks the part triangles whose dents can be in a window, (m,)
    touched: Places  # points that a ball can touch, spread evenly over the target
    surface: SurfacePieces  # pieces of the target, or of the whole part, in and near the sector
    reach: Reach  # share of the target's area that a ball can touch, and its error
    symmetry: Symmetry | None  # None where no two places are alike

    @property
    def face(self) -> np.ndarray:
        """Index of the smooth face of each part triangle, (m,), by the division into most faces."""
        return self.faces.of_triangle

    @property
    def drawn_face(self) -> np.ndarray:
        """Index of the smooth face of each part triangle, (m,), by the division for pictures."""
        return np.asarray(self.faces.joined[self.faces.middle][self.face])

    @property
    def reachable(self) -> float:
        """Share of the target's area that a ball can touch."""
        return self.reach.share

    @property
    def alike(self) -> int:
        """Number of points of the target that symmetry makes equivalent; 1 without symmetry."""
        return self.symmetry.copies if self.symmetry else 1

    @property
    def radius(self) -> float:
        """Radius of a window [m]."""
        return float(np.sqrt(self.setting.gauge / np.pi))

    def with_largest_dent(self, diameter: float) -> TargetField:
        """Return the field for dents up to another diameter [m], with the same points.

        Windows that are measured already are not measured again: only the bands beside creases
        depend on the dents.
        """
        if diameter == self.setting.largest_dent:
            return self
        other = replace(self, setting=self.setting._replace(largest_dent=diameter))
        for name in {"gauge", "wide"} & set(vars(self)):
            gauge: Gauge = vars(self)[name]
            vars(other)[name] = replace(gauge, band=other._band(gauge.windows))
        return other

    @cached_property
    def target_area(self) -> float:
        """Area of the target [m²]."""
        corners = self.corners[self.on_target].reshape(-1, 3)
        return float(areas(corners, np.arange(len(corners)).reshape(-1, 3)).sum())

    @property
    def is_one_window(self) -> bool:
        """True if each window covers most of the target, so that windows show no differences."""
        of_window = float(np.median(self.gauge.area)) / self.alike
        return self.reachable * self.target_area < MIN_WINDOWS * of_window

    @cached_property
    def gauge(self) -> Gauge:
        """Windows of the size that the design sets (gauge_mm2), round points of the target."""
        return self._gauge_of(self.setting.points, self.radius)

    @cached_property
    def wide(self) -> Gauge:
        """Windows (discs in which dents are counted) of twice the design's radius, round points."""
        return self._gauge_of(int(OF_WIDE * self.setting.points), 2.0 * self.radius)

    def _gauge_of(self, count: int, radius: float) -> Gauge:
        """Return windows of a radius [m] round at most `count` points of the target.

        The windows use the divisions of the part into smooth faces in turn.
        """
        gauge = math.pi * radius**2
        most = max(MOST_AREA, MOST_OVERLAP * self.target_area) / gauge
        points = self.some_points(min(count, max(int(most), FEWEST_WINDOWS)))
        return self.gauge_round(points, radius, self.faces.divisions(len(points.place)))

    def gauge_round(
        self, points: Places, radius: float, division: np.ndarray | None = None
    ) -> Gauge:
        """Return windows of a radius [m] round given points of the part.

        Args:
            division: index of the division of the part into faces that each window uses; None for
                the division that pictures use.
        """
        from chamberopt.coverage.field.window_areas import window_areas

        windows = self.windows_round(points, radius, division)
        area = self.alike * window_areas(windows, self.surface)
        area[area == 0.0] = np.inf  # a window without touchable area stays bare
        return Gauge(windows, area, self._band(windows))

    def _band(self, windows: Windows) -> CreaseBand | None:
        """Return the windows beside creases; None if there are none."""
        band = find_band(windows, self.creases, self.pieces, 0.5 * self.setting.largest_dent)
        return None if band is None else band._replace(length=self.alike * band.length)

    def windows_round(
        self, points: Places, radius: float, division: np.ndarray | None = None
    ) -> Windows:
        """Return the windows of `gauge_round`, without their areas."""
        from chamberopt.coverage.field.windows import Windows

        if division is None:
            division = np.full(len(points.place), self.faces.middle)
        return Windows(self._points_in_sector(points), radius, self.faces.joined, division)

    def some_points(self, count: int) -> Places:
        """Return at most `count` points that a ball can touch, spread evenly over the target."""
        there = len(self.touched.place)
        rows = np.linspace(0, there - 1, min(count, there)).round().astype(int)
        return self.touched.select(rows)

    def in_sector(self, hits: Hits) -> Hits:
        """Return the impacts turned into the sector of the chamber in which the windows lie.

        Without symmetry all impacts stay as they are. Impacts outside the cavity, which no
        simulation makes, stay in their place.
        """
        if self.symmetry is None:
            return hits
        margin = 2.0 * self.radius + self.setting.largest_dent
        rows, turn = self.symmetry.into_sector(hits.place, margin)
        place = self.symmetry.turned(hits.place[rows], turn)
        triangle = np.where(turn == 0, hits.triangle[rows], self.symmetry.triangles_at(place))
        lost = triangle < 0
        if (self.symmetry.triangles_at(hits.place[rows[lost]], TOLERANCE) >= 0).any():
            raise RuntimeError("an impact is beside the part after a turn that changes nothing")
        place[lost], triangle[lost] = hits.place[rows[lost]], hits.triangle[rows[lost]]
        return replace(
            hits.select(rows), place=place.astype(np.float32), triangle=triangle.astype(np.int32)
        )

    def distinct(self, points: Places) -> tuple[np.ndarray, np.ndarray]:
        """Return rows of points (k,) no two of which a turn of a symmetric chamber makes one, and
        for each point (p,) its number among them.

        Windows round alike points have the same figures, so that one of them tells all.
        """
        if self.symmetry is None:
            every = np.arange(len(points.place))
            return every, every
        place, normal, face = self._points_in_sector(points)
        return unique_rows(
            np.column_stack([np.round(place / TOLERANCE), np.round(normal / SAME_NORMAL), face])
        )

    def _points_in_sector(self, points: Places) -> Places:
        if self.symmetry is None:
            return points
        from chamberopt.coverage.field.smooth_faces import Places

        _, turn = self.symmetry.into_sector(points.place)
        place, normal = (self.symmetry.turned(one, turn) for one in (points.place, points.normal))
        return Places(place, normal, self._faces_after(self.symmetry)[turn, points.face])

    def _faces_after(self, symmetry: Symmetry) -> np.ndarray:
        """Return where the symmetry's turns bring the smooth faces, (n, faces).

        Row k has, for each smooth face, the number of the face on which it lies after k turns.
        """
        after = np.tile(np.arange(int(self.face.max()) + 1), (symmetry.copies, 1))
        middles, triangles = symmetry.on_each(self.face)
        faces = self.face[triangles]
        for turn in range(1, symmetry.copies):
            after[turn, faces] = self.face[
                symmetry.triangles_at(symmetry.turned(middles, np.array(turn)))
            ]
        return after

    def sharpness(self, edge: np.ndarray) -> np.ndarray:
        """Return the share of the windows that treat each edge as a crease, (k,).

        Args:
            edge: indices of edges, (k,).
        """
        return np.asarray((self.faces.shares @ (self.creases.line >= 0))[edge])

    def places_of(self, hits: Hits, rows: np.ndarray) -> Places:
        """Return positions, normals and smooth faces of the impacts in the given rows."""
        from chamberopt.coverage.field.smooth_faces import Places

        triangle = hits.triangle[rows]
        return Places(hits.place[rows].astype(float), self.normals[triangle], self.face[triangle])


def require_wide_gauge(chamber: Chamber, setting: WindowSetting) -> None:
    """Raise InputError if windows are so small that the target must be cut into too many pieces."""
    area, gauge = float(chamber.part.area[chamber.part.target].sum()), setting.gauge
    wanted = PIECES_PER_WINDOW * area / gauge
    if wanted > MAX_PIECES:
        least = 1e6 * gauge * wanted / MAX_PIECES
        raise InputError(
            f"process.accuracy.gauge_mm2: given {1e6 * gauge:g}, too small for a target of "
            f"{plain(1e6 * area)} mm²; give at least {plain(least, 2)}"
        )


def require_narrow_gauge(chamber: Chamber, setting: WindowSetting) -> None:
    """Raise InputError if the windows are too wide to show differences within the target."""
    area, gauge = float(chamber.part.area[chamber.part.target].sum()), setting.gauge
    if gauge * MIN_WINDOWS > area:
        raise InputError(
            f"process.accuracy.gauge_mm2: given {1e6 * gauge:g}, so wide that a target of "
            f"{plain(1e6 * area)} mm² has fewer than {MIN_WINDOWS:g} windows side by side; give at "
            f"most {plain(1e6 * area / MIN_WINDOWS)}"
        )


def require_touchable_zones(chamber: Chamber, mesh: Rooms, ball: float) -> None:
    """Raise InputError for a zone of the part that no ball with the radius `ball` [m] can touch.

    The test takes POINTS_OF_ZONE points of each zone. A zone of which a ball touches less than a
    thousandth may be refused too.
    """
    part = chamber.part
    for name, zone in part.zones.items():
        area = np.where(zone, chamber.exposed_area, 0.0)
        spread = spread_points(part.vertices, part.triangles, area, POINTS_OF_ZONE)
        normal = part.normals_at(spread.triangle, spread.place)
        if not ball_fits(mesh, spread.place, normal, ball).any():
            raise InputError(
                f"zones: {name}: a ball of {2e3 * ball:g} mm touches nothing of it, so it has no "
                "figures; leave the zone out, or use smaller balls"
            )


def find_target_field(chamber: Chamber, mesh: Rooms, setting: WindowSetting) -> TargetField:
    """Return a chamber's target with all that is needed to measure coverage in windows on it.

    Args:
        mesh: surface of the chamber, or the rooms of all steps.
    """
    part, gauge = chamber.part, setting.gauge
    area = np.where(part.target, part.area, 0.0)
    faces, creases = _faces(chamber)
    face = faces.of_triangle
    radius, corners = float(np.sqrt(gauge / np.pi)), part.vertices[part.triangles]
    ball = 0.5 * setting.ball
    touched, fits = _touched(chamber, mesh, area, face, setting)
    one_room = None if isinstance(mesh, tuple) or not setting.symmetric else mesh
    symmetry = None if one_room is None else find_symmetry(chamber, one_room)
    longest = _longest_side(setting, float(area.sum()), MAX_PIECES)
    if symmetry is None and not isinstance(mesh, tuple):
        surface = _whole_surface(chamber, mesh, ball, longest)
    else:
        wanted = _near_windows(symmetry, part.target, corners, radius)
        surface = _pieces(chamber, wanted, face, mesh, ball, longest)
    return TargetField(
        setting=setting,
        faces=faces,
        on_target=part.target,
        corners=corners,
        normals=unit_normals(corners),
        creases=creases,
        pieces=crease_pieces(creases, mesh, ball, radius),
        has_windows=part.target | (creases.at_corner >= 0).any(axis=1),
        touched=touched,
        surface=surface,
        reach=reach_from(fits),
        symmetry=symmetry,
    )


@computed_once(4)
def _faces(chamber: Chamber) -> tuple[Faces, Creases]:
    """Return the smooth faces of a chamber's part, and the creases of its target."""
    part = chamber.part
    return find_faces(part.vertices, part.triangles, part.target)


@computed_once(4)
def _whole_surface(
    chamber: Chamber, mesh: TriangleMesh, ball: float, longest: float
) -> SurfacePieces:
    """Return the pieces of a target: the same for windows of all sizes that are larger than a ball.

    Args:
        ball: radius of the smallest ball [m].
        longest: longest side of a piece [m].
    """
    face = _faces(chamber)[0].of_triangle
    return _pieces(chamber, chamber.part.target, face, mesh, ball, longest)


def _pieces(
    chamber: Chamber, wanted: np.ndarray, face: np.ndarray, mesh: Rooms, ball: float, longest: float
) -> SurfacePieces:
    from chamberopt.coverage.field.window_areas import surface_pieces

    corners = chamber.part.corners_with_normals[wanted]
    return surface_pieces(corners, face[wanted], mesh, ball, longest)


def with_whole_part(field: TargetField, chamber: Chamber, mesh: Rooms) -> TargetField:
    """Return the field extended from the target to the rest of the part in the chamber, for
    pictures.
    """
    from chamberopt.coverage.field.window_areas import joined_pieces

    rest = ~chamber.part.target & (chamber.exposed_area > 0.0)
    if not rest.any():
        return field
    area = float(chamber.part.area[rest].sum())
    wanted = _near_windows(field.symmetry, rest, field.corners, field.radius)
    longest = _longest_side(field.setting, area, MAX_PIECES_OFF_TARGET)
    pieces = _pieces(chamber, wanted, field.face, mesh, 0.5 * field.setting.ball, longest)
    return replace(
        field,
        has_windows=np.ones(len(rest), dtype=bool),
        surface=joined_pieces(field.surface, pieces),
    )


def _near_windows(
    symmetry: Symmetry | None, chosen: np.ndarray, corners: np.ndarray, radius: float
) -> np.ndarray:
    """Return those of the `chosen` triangles (m,) bool that windows of `radius` [m] may meet.

    All windows lie in one sector of a symmetric chamber. The margin is twice the radius of the wide
    windows.
    """
    if symmetry is None:
        return chosen
    return np.asarray(chosen & symmetry.reaches_sector(corners, 4.0 * radius))


def _longest_side(setting: WindowSetting, area: float, most: float) -> float:
    """Return the longest side [m] that a piece of the surface may have.

    It is the diameter of a window or of a ball, whichever is less, or longer so that there are at
    most `most` pieces on the area [m²].
    """
    size = min(math.sqrt(setting.gauge / math.pi), 0.5 * setting.ball)
    return 2.0 * max(size, math.sqrt(PIECES_PER_WINDOW / math.pi * area / most))


def _touched(
    chamber: Chamber, mesh: Rooms, area: np.ndarray, face: np.ndarray, setting: WindowSetting
) -> tuple[Places, np.ndarray]:
    """Return the points that a ball can touch, and marks of them among all points that were tried.

    Args:
        area: area of each triangle of the part over which points are spread [m²]; 0 for the other
            triangles, (m,).
        face: smooth face of each triangle, (m,).
    """
    from chamberopt.coverage.field.smooth_faces import Places

    part = chamber.part
    spread = spread_points(part.vertices, part.triangles, area, POINTS_PER_CHOSEN * setting.points)
    normal = part.normals_at(spread.triangle, spread.place)
    fits = ball_fits(mesh, spread.place, normal, 0.5 * setting.ball)
    return Places(spread.place[fits], spread.normal[fits], face[spread.triangle[fits]]), fits
