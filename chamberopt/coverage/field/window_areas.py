"""Exact areas of windows (discs of the surface), and the part of each that a ball can touch.

The surface is divided into pieces about as large as a window. Pieces are finer at the border of the
touchable surface. A window meets the plane of a piece in a circle, so its share of the piece is the
common area of a circle and a triangle.

Notation
    p        middle of the window [m]; n_p the unit normal there
    n_t      unit normal of the piece, c a corner of it
    theta    angle between the normals
    a        height of p over the plane of the piece, (p - c).n_t [m]
    l        radius of the window [m]

The distance along the surface (windows.py) unfolds the two planes. It turns p about their common
edge into the plane of the piece. There the circle of radius l is centred on

    p - a n_t - a / (1 + cos theta) (n_p - cos theta n_t).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.coverage.field.smooth_faces import Places
from chamberopt.coverage.field.surface_points import ball_fits, within_each
from chamberopt.coverage.field.windows import Windows
from chamberopt.geometry.triangles import unit_normals, unit_vectors
from sim_core import jit

if TYPE_CHECKING:
    from chamberopt.coverage.field.surface_points import Rooms

FINEST = 0.5  # share of the longest side, for pieces at the border of the touchable surface
NEAR_CORNERS = 0.1  # share of the way from corner to middle where a piece is tested for a border
PLACES_AT_BORDER = 4  # places that measure the touchable share of a piece at a border
FAR_SIDE = -0.9  # cosine of the angle beyond which a piece is the far side of a thin body


class SurfacePieces(NamedTuple):
    """Triangular pieces of the part's surface, and the share of each that a ball can touch.

    Attributes:
        corners: corners of each piece [m], shape (c, 3, 3).
        normal: unit vectors out of the part, shape (c, 3).
        face: smooth face of each piece, shape (c,).
        area: area of each piece [m²], shape (c,).
        touched: share of each piece that a ball can touch, shape (c,).
    """

    corners: np.ndarray
    normal: np.ndarray
    face: np.ndarray
    area: np.ndarray
    touched: np.ndarray


def surface_pieces(
    corners: np.ndarray, face: np.ndarray, mesh: Rooms, ball_radius: float, longest: float
) -> SurfacePieces:
    """Divide triangles into pieces, and find the touchable share of each piece.

    Args:
        corners: position [m] of each corner, and normal there of the surface that a ball touches,
            shape (m, 3, 6).
        face: smooth face of each triangle, shape (m,).
        mesh: surface of the chamber.
        ball_radius: radius of the ball [m].
        longest: longest side that a piece may have [m].
    """
    corners, owner = _halved_until(corners, np.arange(len(corners)), longest)
    middle = corners.mean(axis=1)
    beside = corners + NEAR_CORNERS * (middle[:, None] - corners)
    shares = _touched_share(np.stack([middle, *beside.swapaxes(0, 1)]), mesh, ball_radius)
    mixed = (shares > 0.0) & (shares < 1.0)
    finer, finer_owner = _halved_until(corners[mixed], owner[mixed], FINEST * longest)
    fine = _touched_share(within_each(finer, PLACES_AT_BORDER), mesh, ball_radius)
    corners = np.concatenate([corners[~mixed], finer])
    owner = np.concatenate([owner[~mixed], finer_owner])
    corners = corners[..., :3]
    shares = np.concatenate([shares[~mixed], fine])
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * np.linalg.norm(cross, axis=1)
    return SurfacePieces(corners, unit_normals(corners), face[owner], area, shares)


def joined_pieces(one: SurfacePieces, two: SurfacePieces) -> SurfacePieces:
    return SurfacePieces(*(np.concatenate(both) for both in zip(one, two, strict=True)))


def window_areas(windows: Windows, pieces: SurfacePieces) -> np.ndarray:
    """Return the area [m²] of each window (disc of the surface) that a ball can touch, (p,)."""
    middle = pieces.corners.mean(axis=1)
    size = float(np.linalg.norm(pieces.corners - middle[:, None], axis=2).max(initial=0.0))
    kept = pieces.touched > 0.0
    near = windows.with_radius(windows.radius + size)
    area = np.zeros(len(windows.points.place))
    columns = [np.ascontiguousarray(column[kept]) for column in pieces]
    places = Places(middle[kept], np.zeros((int(kept.sum()), 3)), pieces.face[kept])
    for point, piece in near.pairs(places):
        _add_common_areas(
            area, point, piece, windows.points, SurfacePieces(*columns), windows.radius
        )
    return area


def _halved_until(
    corners: np.ndarray, owner: np.ndarray, longest: float
) -> tuple[np.ndarray, np.ndarray]:
    """Halve triangles (m, 3, 6) across their longest sides until no side is longer than `longest`
    [m].

    Returns:
        The smaller triangles, and for each the `owner` of the triangle from which it was cut.
    """
    done, owners = [], []
    while len(corners):
        place = corners[..., :3]
        sides = np.linalg.norm(place - np.roll(place, -1, axis=1), axis=2)
        long = sides.max(axis=1) > longest
        done.append(corners[~long])
        owners.append(owner[~long])
        corners, owner, sides = corners[long], owner[long], sides[long]
        first = sides.argmax(axis=1)
        rows = np.arange(len(corners))
        a, b, c = (corners[rows, (first + k) % 3] for k in range(3))
        middle = 0.5 * (a + b)
        corners = np.concatenate([np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)])
        owner = np.tile(owner, 2)
    return np.concatenate([np.zeros((0, 3, 6)), *done]), np.concatenate(
        [np.zeros(0, dtype=np.int64), *owners]
    )


def _touched_share(places: np.ndarray, mesh: Rooms, ball_radius: float) -> np.ndarray:
    """Return for each of n triangles the share of its k points that a ball can touch, (n,).

    Args:
        places: positions [m] of the points, and normals of the surface there, (k, n, 6).
    """
    place, normal = np.split(places.reshape(-1, 6), 2, axis=1)
    fits = ball_fits(mesh, place, unit_vectors(normal), ball_radius)
    return np.asarray(fits.reshape(places.shape[:2]).mean(axis=0))


@jit
def _add_common_areas(area, point, piece, points, pieces, radius):  # type: ignore[no-untyped-def]
    """Add to `area` (p,), for each pair of a window and a piece of the surface, the touchable area
    [m²] that they have in common.
    """
    for pair in range(len(point)):
        i, t = point[pair], piece[pair]
        p, n_p, n_t = points.place[i], points.normal[i], pieces.normal[t]
        corner = pieces.corners[t]
        cosine = n_p[0] * n_t[0] + n_p[1] * n_t[1] + n_p[2] * n_t[2]
        if cosine < FAR_SIDE:
            continue
        a = 0.0
        for k in range(3):
            a += (p[k] - corner[0, k]) * n_t[k]
        fold = a / (1.0 + cosine)
        # Axes in the plane: along the first side, and across it.
        ux = corner[1, 0] - corner[0, 0]
        uy = corner[1, 1] - corner[0, 1]
        uz = corner[1, 2] - corner[0, 2]
        length = np.sqrt(ux * ux + uy * uy + uz * uz)
        if length == 0.0:
            continue
        ux, uy, uz = ux / length, uy / length, uz / length
        vx = n_t[1] * uz - n_t[2] * uy
        vy = n_t[2] * ux - n_t[0] * uz
        vz = n_t[0] * uy - n_t[1] * ux
        cx = p[0] - a * n_t[0] - fold * (n_p[0] - cosine * n_t[0])
        cy = p[1] - a * n_t[1] - fold * (n_p[1] - cosine * n_t[1])
        cz = p[2] - a * n_t[2] - fold * (n_p[2] - cosine * n_t[2])
        ax, ay, az = corner[0, 0] - cx, corner[0, 1] - cy, corner[0, 2] - cz
        bx, by, bz = corner[1, 0] - cx, corner[1, 1] - cy, corner[1, 2] - cz
        ex, ey, ez = corner[2, 0] - cx, corner[2, 1] - cy, corner[2, 2] - cz
        common = _common_area(
            (ax * ux + ay * uy + az * uz, ax * vx + ay * vy + az * vz),
            (bx * ux + by * uy + bz * uz, bx * vx + by * vy + bz * vz),
            (ex * ux + ey * uy + ez * uz, ex * vx + ey * vy + ez * vz),
            radius,
        )
        area[i] += pieces.touched[t] * common


@jit
def _common_area(one, two, three, radius):  # type: ignore[no-untyped-def]
    """Return the common area of a circle of this radius round the origin, and of the triangle with
    these corners (x, y).
    """
    # Many of the pairs are apart, which saves them three arcs.
    if _is_beyond(one, two, three, radius):
        return 0.0
    if _is_beyond(two, three, one, radius) or _is_beyond(three, one, two, radius):
        return 0.0
    sectors = _sector(one[0], one[1], two[0], two[1], radius)
    sectors += _sector(two[0], two[1], three[0], three[1], radius)
    return abs(sectors + _sector(three[0], three[1], one[0], one[1], radius))


@jit
def _is_beyond(start, end, third, radius):  # type: ignore[no-untyped-def]
    """Return True if the circle of `_common_area` and a triangle's third corner are on two sides of
    the line through its other corners.
    """
    dx, dy = end[0] - start[0], end[1] - start[1]
    third_side = dx * (third[1] - start[1]) - dy * (third[0] - start[0])
    centre_side = dy * start[0] - dx * start[1]
    return centre_side * third_side < 0.0 and centre_side * centre_side >= radius * radius * (
        dx * dx + dy * dy
    )


@jit
def _sector(ax, ay, bx, by, radius):  # type: ignore[no-untyped-def]
    """Return the signed common area of a circle of this radius round the origin, and of the
    triangle with the corners (0, 0), (ax, ay) and (bx, by).
    """
    dx, dy = bx - ax, by - ay
    square = dx * dx + dy * dy
    if square == 0.0:
        return 0.0
    # |a + t d|² = radius² at t = middle - half and middle + half.
    middle = -(ax * dx + ay * dy) / square
    disc = middle * middle - (ax * ax + ay * ay - radius * radius) / square
    whole = 0.5 * radius * radius
    if disc <= 0.0:
        return whole * np.arctan2(ax * by - ay * bx, ax * bx + ay * by)
    half = np.sqrt(disc)
    first, last = max(middle - half, 0.0), min(middle + half, 1.0)
    if first >= last:
        return whole * np.arctan2(ax * by - ay * bx, ax * bx + ay * by)
    fx, fy, lx, ly = ax + first * dx, ay + first * dy, ax + last * dx, ay + last * dy
    common = 0.5 * (fx * ly - fy * lx)
    if first > 0.0:
        common += whole * np.arctan2(ax * fy - ay * fx, ax * fx + ay * fy)
    if last < 1.0:
        common += whole * np.arctan2(lx * by - ly * bx, lx * bx + ly * by)
    return common
