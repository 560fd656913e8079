"""Which triangle of a flat a ball has hit: a grid of squares over the flat, each with the triangles that reach it."""

from typing import NamedTuple

import numpy as np

from sim_core.geometry.flat_faces import LONE, Flats
from sim_core.geometry.mesh import towards_shot
from sim_core.numerics.jit import jit
from sim_core.numerics.vec3 import Vec3

TRIANGLES_A_SQUARE = 2.0


class Locator(NamedTuple):
    """``flat`` (m,) int32 and ``frames`` (k, 3, 3) as in Flats. Of each flat: ``squares`` (k, 4) float64, the grid's
    lower corner [m] and squares per metre along both axes; ``counts`` (k, 3) int32, squares along both, and the number
    of the first. ``starts`` (squares + 1,) int32 into ``members``, triangles; ``plan`` (m, 6) float64 [m]: the
    triangles' corners in their flat's frame.
    """

    flat: np.ndarray
    frames: np.ndarray
    squares: np.ndarray
    counts: np.ndarray
    starts: np.ndarray
    members: np.ndarray
    plan: np.ndarray


def build_locator(corners: np.ndarray, flats: Flats, seam: float) -> Locator:
    """The grids of all flats; ``corners`` (m, 3, 3) [m]. A hit may lie up to ``seam`` [m] outside a flat."""
    flat_count = len(flats.seed)
    owner = flats.flat
    inside = np.flatnonzero(owner != LONE)
    frame = flats.frames[owner[inside]]
    offset = corners[inside] - frame[:, None, 0]
    plan = np.zeros((len(corners), 3, 2))
    plan[inside] = np.einsum("tka,tja->tkj", offset, frame[:, 1:])
    low, high = plan[inside].min(axis=1) - 2.0 * seam, plan[inside].max(axis=1) + 2.0 * seam
    floor, top = np.full((flat_count, 2), np.inf), np.full((flat_count, 2), -np.inf)
    np.minimum.at(floor, owner[inside], low)
    np.maximum.at(top, owner[inside], high)
    size = np.maximum(top - floor, 1e-300)
    squares = np.maximum(np.bincount(owner[inside], minlength=flat_count) / TRIANGLES_A_SQUARE, 1.0)
    per_metre = np.sqrt(squares / size.prod(axis=1)) if flat_count else np.zeros(0)
    shape = np.maximum(np.floor(size * per_metre[:, None]).astype(np.int64), 1)
    scale = shape / size
    first = np.concatenate([[0], np.cumsum(shape.prod(axis=1))])
    # every triangle goes to all squares its box touches
    own = owner[inside]
    a = np.clip(((low - floor[own]) * scale[own]).astype(np.int64), 0, shape[own] - 1)
    b = np.clip(((high - floor[own]) * scale[own]).astype(np.int64), 0, shape[own] - 1)
    wide = b - a + 1
    copies = wide.prod(axis=1)
    triangle = np.repeat(np.arange(len(inside)), copies)
    rank = np.arange(len(triangle)) - np.repeat(np.cumsum(copies) - copies, copies)
    x = a[triangle, 0] + rank % wide[triangle, 0]
    y = a[triangle, 1] + rank // wide[triangle, 0]
    square = first[own[triangle]] + y * shape[own[triangle], 0] + x
    order = np.argsort(square, kind="stable")
    starts = np.searchsorted(square[order], np.arange(first[-1] + 1))
    return Locator(
        owner,
        flats.frames,
        np.concatenate([floor, scale], axis=1),
        np.column_stack([shape, first[:-1]]).astype(np.int32),
        starts.astype(np.int32),
        inside[triangle[order]].astype(np.int32),
        plan.reshape(-1, 6),
    )


@jit
def triangle_at(locator: Locator, seed: int, at: Vec3) -> int:
    """The triangle of the seed's flat that holds a point of its plane, or is nearest to it; a lone one is itself."""
    flat = locator.flat[seed]
    if flat == LONE:
        return seed
    dx, dy, dz = (
        at.x - locator.frames[flat, 0, 0],
        at.y - locator.frames[flat, 0, 1],
        at.z - locator.frames[flat, 0, 2],
    )
    u = (
        dx * locator.frames[flat, 1, 0]
        + dy * locator.frames[flat, 1, 1]
        + dz * locator.frames[flat, 1, 2]
    )
    v = (
        dx * locator.frames[flat, 2, 0]
        + dy * locator.frames[flat, 2, 1]
        + dz * locator.frames[flat, 2, 2]
    )
    across, along = locator.counts[flat, 0], locator.counts[flat, 1]
    x = int((u - locator.squares[flat, 0]) * locator.squares[flat, 2])
    y = int((v - locator.squares[flat, 1]) * locator.squares[flat, 3])
    x, y = min(max(x, 0), across - 1), min(max(y, 0), along - 1)
    square = locator.counts[flat, 2] + y * across + x
    nearest, least = seed, np.inf
    for k in range(locator.starts[square], locator.starts[square + 1]):
        triangle = locator.members[k]
        outside = _outside(locator.plan, triangle, u, v)
        if outside < least:
            nearest, least = triangle, outside
    return nearest


def find_triangles(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Which of the triangles (m, 3, 3) [m] of one plane holds each point (n, 3) [m] of it, or is nearest to it: (n,).

    Triangles wound as in a TriangleMesh, normals away from the shot; a point off the plane is seen along its normal.
    """
    corners, points = (
        np.ascontiguousarray(corners, np.float64),
        np.ascontiguousarray(points, np.float64),
    )
    normals, doubled = towards_shot(corners)
    seed = int(doubled.argmax())
    along = corners[seed, 1] - corners[seed, 0]
    along /= np.linalg.norm(along)
    frame = np.stack([corners[seed, 0], along, np.cross(normals[seed], along)])
    flats = Flats(
        np.zeros(len(corners), dtype=np.int32), np.array([seed], dtype=np.int32), frame[None], []
    )
    found = np.zeros(len(points), dtype=np.int64)
    _locate(build_locator(corners, flats, 0.0), seed, points, found)
    return found


@jit
def _locate(locator: Locator, seed: int, points: np.ndarray, found: np.ndarray) -> None:
    for i in range(len(points)):
        found[i] = triangle_at(locator, seed, Vec3(points[i, 0], points[i, 1], points[i, 2]))


@jit
def _outside(plan: np.ndarray, triangle: int, u: float, v: float) -> float:
    """How far a point lies outside a triangle's sides [m]; negative inside. Corners run clockwise."""
    worst = -np.inf
    for k in range(3):
        a, b = 2 * k, 2 * ((k + 1) % 3)
        along_u, along_v = (
            plan[triangle, b] - plan[triangle, a],
            plan[triangle, b + 1] - plan[triangle, a + 1],
        )
        turn = along_u * (v - plan[triangle, a + 1]) - along_v * (u - plan[triangle, a])
        length = np.sqrt(along_u * along_u + along_v * along_v)
        worst = max(worst, turn / length if length > 0.0 else -np.inf)
    return worst
