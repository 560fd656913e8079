"""The target seen through windows: where shot can touch, and how much each dent covers of a window.

Notation
    p     middle of a window                                          (points, (p,))
    l     radius of the window: pi l² is the gauge [m]                 (radius)
    A     area of the window that a ball can touch [m²]                (area, (p,))
    s     area of a dent, pi a², a its radius [m]                      (dent_radius)
    w     footprint: share of the window of p that one dent takes      (weight)

A dent on a smooth face takes w = s / A of every window that it lies in. Convex creases collect
many dents, in a band as narrow as a dent: spread over a window they would count as if they covered
all of it. So there a dent is spread along the crease alone. At a distance h < a from it it takes

    w = 2 sqrt(a² - h²) / (length of the crease nearer than CREASE_LENGTH l)

on both sides of the crease, which is exact across it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.coverage.field.smooth_faces import Creases, find_faces
from chamberopt.geometry.triangles import unit_normals

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.coverage.field.windows import Places, Windows
    from chamberopt.coverage.part_impacts import Hits
    from sim_core import TriangleMesh

POINTS = 20_000  # at least, on the target; figures are means over them
POINTS_OF_WIDE = 5_000  # for windows of twice the radius, which overlap more
# By points, on average, the area of a window is measured. With 12 the mean comes out 0.01 too high.
POINTS_PER_WINDOW = 36
MAX_POINTS = 8_000_000
# A dent takes more of a line than of an area. Along creases the windows are longer, so that as many
# dents are in them.
CREASE_LENGTH = 3.0
PIECES_PER_WINDOW = 32  # of a crease, by which its length is measured
PLASTIC_NUMBER = 1.32471795724474602596  # real root of x³ = x + 1
# Share of its radius that a ball may reach into a surface, as in chamber/reach.
OVERLAP = 0.01
ON_CREASE = 1e-6  # m: contacts nearer to a crease than this are on it


class SurfacePoints(NamedTuple):
    """Points spread evenly over some triangles.

    Attributes:
        place: [m], shape (p, 3).
        normal: unit vectors out of the part, shape (p, 3).
        triangle: shape (p,).
    """

    place: np.ndarray
    normal: np.ndarray
    triangle: np.ndarray


def spread_points(
    vertices: np.ndarray, triangles: np.ndarray, area: np.ndarray, count: int
) -> SurfacePoints:
    """Spread points evenly over the triangles that have an area, the same ones every time.

    The triangles are taken along a Morton curve through space, and every 1/count of their area
    gets a point. Within a triangle the points follow the additive recurrence of the plastic number.

    Args:
        area: of the triangles [m²], shape (m,); 0 where no points are wanted.

    Sources: G. M. Morton, "A computer oriented geodetic data base", IBM 1966. M. Roberts, "The
    unreasonable effectiveness of quasirandom sequences", 2018.
    """
    chosen = np.flatnonzero(area > 0.0)
    chosen = chosen[np.argsort(_morton(vertices[triangles[chosen]].mean(axis=1)), kind="stable")]
    upto = np.cumsum(area[chosen])
    owner = np.searchsorted(upto, (np.arange(count) + 0.5) / count * upto[-1])
    number = np.arange(count)
    u, v = ((number / PLASTIC_NUMBER**power + 0.5) % 1.0 for power in (1, 2))
    folded = u + v > 1.0
    u, v = np.where(folded, 1.0 - u, u), np.where(folded, 1.0 - v, v)
    triangle = chosen[np.minimum(owner, len(chosen) - 1)]
    a, b, c = (vertices[triangles[triangle, k]] for k in range(3))
    place = a + u[:, None] * (b - a) + v[:, None] * (c - a)
    return SurfacePoints(place, unit_normals(vertices[triangles])[triangle], triangle)


def _morton(places: np.ndarray) -> np.ndarray:
    """Position of places (n, 3) along a Morton curve: the bits of their coordinates in turn."""
    low = places.min(axis=0)
    cells = ((places - low) / max(float(np.ptp(places, axis=0).max()), 1e-12) * 1023).astype(int)
    code = np.zeros(len(places), dtype=np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return code


def ball_fits(
    mesh: TriangleMesh, place: np.ndarray, normal: np.ndarray, radius: float
) -> np.ndarray:
    """Whether a ball fits at places on the surface of the cavity, (p,) bool.

    Args:
        mesh: the surface of the cavity.
        place: [m], shape (p, 3); where they are not on the surface, no ball fits.
        normal: unit vectors into the cavity, shape (p, 3).
        radius: of the ball [m].
    """
    from sim_core import closest_points

    found = closest_points(mesh, place + radius * normal, radius * (1.0 + 1e-6))
    return (found.triangle >= 0) & (found.distance >= radius * (1.0 - OVERLAP))


class CreaseBand(NamedTuple):
    """Points near creases, a row for each point and each line that it is near.

    Attributes:
        point: index of the point, shape (b,).
        height: distance from the crease [m], shape (b,).
        length: of the crease in the window round the point's foot on it [m], shape (b,).
        windows: along the lines, round the feet.
    """

    point: np.ndarray
    height: np.ndarray
    length: np.ndarray
    windows: Windows


@dataclass(frozen=True)
class Gauge:
    """The windows of one size round points of the target that a ball can touch."""

    windows: Windows
    area: np.ndarray  # that a ball can touch in each window [m²], (p,)
    band: CreaseBand | None  # None if no point is near a crease


@dataclass(frozen=True)
class TargetField:
    """The target of a chamber, ready to be looked at through windows."""

    face: np.ndarray  # smooth face of each part triangle, (m,)
    creases: Creases
    corners: np.ndarray  # of the part triangles [m], (m, 3, 3)
    reachable: float  # share of the target's area that a ball can touch
    gauge: Gauge  # windows as the user chose them
    wide: Gauge  # windows of twice the radius


class Footprints(NamedTuple):
    """Dents in windows: pairs of a point and a share of its window that a dent takes."""

    point: np.ndarray
    weight: np.ndarray


def target_field(
    chamber: Chamber, mesh: TriangleMesh, ball_diameter: float, gauge: float, max_dent: float
) -> TargetField:
    """Prepare a chamber's target.

    Args:
        mesh: of the chamber.
        ball_diameter: of the smallest ball [m].
        gauge: area of a window [m²].
        max_dent: diameter of the largest dent [m].

    Raises:
        InputError: the windows are too small for so large a target.
    """
    part = chamber.part
    radius = float(np.sqrt(gauge / np.pi))
    area = np.where(part.target, part.area, 0.0)
    wanted = POINTS_PER_WINDOW * area.sum() / gauge
    if wanted > MAX_POINTS:
        least = 1e6 * gauge * wanted / MAX_POINTS
        raise InputError(
            f"process.accuracy.gauge_mm2: given {1e6 * gauge:g}, too small for a target of "
            f"{1e6 * area.sum():.4g} mm²; give at least {least:.2g}"
        )
    face, creases = find_faces(part.vertices, part.triangles, part.target)
    spread = spread_points(part.vertices, part.triangles, area, int(max(POINTS, wanted)))
    fits = ball_fits(mesh, spread.place, spread.normal, 0.5 * ball_diameter)
    from chamberopt.coverage.field.windows import Places

    touched = Places(spread.place[fits], spread.normal[fits], face[spread.triangle[fits]])
    share = area.sum() / len(fits)  # that each point stands for
    pieces = _crease_pieces(creases, mesh, 0.5 * ball_diameter, radius)
    return TargetField(
        face=face,
        creases=creases,
        corners=part.vertices[part.triangles],
        reachable=float(fits.mean()),
        gauge=_gauge(touched, share, radius, POINTS, creases, pieces, max_dent),
        wide=_gauge(touched, share, 2.0 * radius, POINTS_OF_WIDE, creases, pieces, max_dent),
    )


class _Pieces(NamedTuple):
    """Short pieces of creases that a ball can touch: their places on lines, edges and lengths."""

    places: Places
    edge: np.ndarray
    length: np.ndarray


def _crease_pieces(
    creases: Creases, mesh: TriangleMesh, ball_radius: float, radius: float
) -> _Pieces:
    from chamberopt.coverage.field.windows import Places

    start, end = creases.ends[:, 0], creases.ends[:, 1]
    length = np.linalg.norm(end - start, axis=1)
    count = np.maximum(1, np.ceil(length / (2.0 * radius) * PIECES_PER_WINDOW)).astype(int)
    edge = np.repeat(np.arange(len(count)), count)
    number = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
    place = start[edge] + ((number + 0.5) / count[edge])[:, None] * (end - start)[edge]
    fits = ball_fits(mesh, place, creases.outward[edge], ball_radius)
    edge, place = edge[fits], place[fits]
    lines = Places(place, np.zeros((len(place), 3)), creases.line[edge])
    return _Pieces(lines, edge, (length / count)[edge])


def _gauge(
    touched: Places,
    share: float,
    radius: float,
    points: int,
    creases: Creases,
    pieces: _Pieces,
    max_dent: float,
) -> Gauge:
    """Windows round some of the points that a ball can touch.

    Args:
        share: area that each point stands for [m²].
        points: number of windows.
    """
    from chamberopt.coverage.field.windows import Windows

    count = len(touched.place)
    rows = np.unique(np.linspace(0, count - 1, min(points, count)).round().astype(int))
    windows = Windows(touched.select(rows), radius)
    area = windows.sums(touched, np.full(count, share))
    return Gauge(windows, area, _band(windows, creases, pieces, 0.5 * max_dent))


def _band(
    windows: Windows, creases: Creases, pieces: _Pieces, dent_radius: float
) -> CreaseBand | None:
    """The points that dents on creases reach, with radii of at most dent_radius [m]."""
    from scipy.spatial import cKDTree

    from chamberopt.coverage.field.windows import Places, Windows

    points = windows.points
    if not len(pieces.edge) or not len(points.place):
        return None
    far = dent_radius + 0.5 * float(pieces.length.max())
    near = cKDTree(points.place).sparse_distance_matrix(
        cKDTree(pieces.places.place), far, output_type="ndarray"
    )
    point, edge = near["i"], pieces.edge[near["j"]]
    beside = (creases.faces[edge] == points.face[point][:, None]).any(axis=1)
    point, edge = np.unique(np.column_stack([point, edge])[beside], axis=0).T
    start, end = creases.ends[edge, 0], creases.ends[edge, 1]
    along = end - start
    share = ((points.place[point] - start) * along).sum(axis=1) / (along**2).sum(axis=1)
    foot = start + np.clip(share, 0.0, 1.0)[:, None] * along
    height = np.linalg.norm(points.place[point] - foot, axis=1)
    # Of several edges of one line the nearest counts.
    order = np.lexsort([height, creases.line[edge], point])
    key = np.column_stack([point, creases.line[edge]])[order]
    first = np.ones(len(key), dtype=bool)
    first[1:] = (key[1:] != key[:-1]).any(axis=1)
    rows = order[first]
    rows = rows[height[rows] < dent_radius]
    if not len(rows):
        return None
    line = creases.line[edge[rows]]
    feet = Places(foot[rows], np.zeros((len(rows), 3)), line)
    round_feet = Windows(feet, CREASE_LENGTH * windows.radius)
    length = round_feet.sums(pieces.places, pieces.length)
    return CreaseBand(point[rows], height[rows], np.maximum(length, dent_radius), round_feet)


def footprints(field: TargetField, gauge: Gauge, hits: Hits) -> Footprints:
    """The dents of one replica in windows of one size; dents off the target count nothing."""
    from chamberopt.coverage.field.windows import Places

    dents = np.flatnonzero(hits.dent > 0.0)
    place, triangle = hits.place[dents].astype(float), hits.triangle[dents]
    radius = 0.5 * hits.dent[dents].astype(float)
    edge = _crease_of_contacts(field, place, triangle)
    on_face = edge < 0
    normal = unit_normals(field.corners)
    flat = Places(place[on_face], normal[triangle[on_face]], field.face[triangle[on_face]])
    size = np.pi * radius[on_face] ** 2
    points, weights = [], []
    for point, contact in gauge.windows.pairs(flat):
        points.append(point)
        weights.append(size[contact] / gauge.area[point])
    band = gauge.band
    if band is not None and not on_face.all():
        own = np.flatnonzero(~on_face)
        line = Places(place[own], np.zeros((len(own), 3)), field.creases.line[edge[own]])
        for row, contact in band.windows.pairs(line):
            half = radius[own[contact]] ** 2 - band.height[row] ** 2
            covered = half > 0.0
            row, half = row[covered], half[covered]
            points.append(band.point[row])
            weights.append(2.0 * np.sqrt(half) / band.length[row])
    return Footprints(
        np.concatenate(points) if points else np.zeros(0, dtype=int),
        np.concatenate(weights) if weights else np.zeros(0),
    )


def _crease_of_contacts(field: TargetField, place: np.ndarray, triangle: np.ndarray) -> np.ndarray:
    """The crease on which each contact lies, (k,); -1 for contacts on a smooth face."""
    creases = field.creases
    found = np.full(len(place), -1)
    near = np.flatnonzero((creases.at_corner[triangle] >= 0).any(axis=1))
    at, own = place[near], triangle[near]
    corners = field.corners[own]
    for side in range(3):
        corner = creases.at_corner[own, side]
        touches = (corner >= 0) & (np.linalg.norm(at - corners[:, side], axis=1) < ON_CREASE)
        found[near[touches]] = corner[touches]
    for side in range(3):
        crease = creases.of_triangle[own, side]
        start, along = corners[:, side], corners[:, (side + 1) % 3] - corners[:, side]
        away = np.linalg.norm(np.cross(at - start, along), axis=1) / np.maximum(
            np.linalg.norm(along, axis=1), 1e-12
        )
        touches = (crease >= 0) & (away < ON_CREASE)
        found[near[touches]] = crease[touches]
    return found
