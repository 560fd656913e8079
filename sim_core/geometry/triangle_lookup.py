"""Search for the triangle of a flat face that a ball has hit, in a grid over each face."""

from typing import NamedTuple

import numpy as np

from sim_core.geometry.flat_faces import LONE, FlatFaces
from sim_core.geometry.mesh import normals_towards_shot
from sim_core.numerics.jit import jit
from sim_core.numerics.vec3 import Vec3

TRIANGLES_PER_SQUARE = 2.0


class TriangleLookup(NamedTuple):
    """Grids over k flat faces that find the triangle at a point, in a mesh of m triangles."""

    of_triangle: np.ndarray  # flat face of each triangle, shape (m,) int32, as in FlatFaces
    frames: np.ndarray  # frames of the flat faces, shape (k, 3, 3), as in FlatFaces
    origin: np.ndarray  # lower corner of each grid [m], shape (k, 2)
    # squares of each grid per metre along both axes [1/m], shape (k, 2)
    squares_per_metre: np.ndarray
    shape: np.ndarray  # number of squares of each grid along both axes, shape (k, 2) int32
    first: np.ndarray  # number of each grid's first square, shape (k,) int32
    starts: np.ndarray  # first entry of each square in ``members``, shape (squares + 1,) int32
    members: np.ndarray  # the triangles that reach each square, int32
    corners: np.ndarray  # corners of the triangles in their flat face's frame [m], shape (m, 6)


def build_lookup(corners: np.ndarray, flat_faces: FlatFaces, face_overlap: float) -> TriangleLookup:
    """Build the grids over all flat faces.

    Args:
        corners: corner positions of the mesh [m], shape (m, 3, 3).
        flat_faces: the flat faces of the mesh.
        face_overlap: largest distance of an impact outside its flat face [m].
    """
    count = len(flat_faces.seed)
    inside = np.flatnonzero(flat_faces.of_triangle != LONE)
    own = flat_faces.of_triangle[inside]
    frame = flat_faces.frames[own]
    plan = np.zeros((len(corners), 3, 2))
    plan[inside] = np.einsum("tka,tja->tkj", corners[inside] - frame[:, None, 0], frame[:, 1:])
    margin = 2.0 * face_overlap
    low, high = plan[inside].min(axis=1) - margin, plan[inside].max(axis=1) + margin
    origin, top = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
    np.minimum.at(origin, own, low)
    np.maximum.at(top, own, high)
    size = np.maximum(top - origin, 1e-300)
    squares = np.maximum(np.bincount(own, minlength=count) / TRIANGLES_PER_SQUARE, 1.0)
    per_metre = np.sqrt(squares / size.prod(axis=1)) if count else np.zeros(0)
    shape = np.maximum(np.floor(size * per_metre[:, None]).astype(np.int64), 1)
    scale = shape / size
    first = np.concatenate([[0], np.cumsum(shape.prod(axis=1))])
    # every triangle is a member of all squares that its box touches, numbered by rank in its box
    a = np.clip(((low - origin[own]) * scale[own]).astype(np.int64), 0, shape[own] - 1)
    b = np.clip(((high - origin[own]) * scale[own]).astype(np.int64), 0, shape[own] - 1)
    wide = b - a + 1
    copies = wide.prod(axis=1)
    triangle = np.repeat(np.arange(len(inside)), copies)
    rank = np.arange(len(triangle)) - np.repeat(np.cumsum(copies) - copies, copies)
    x = a[triangle, 0] + rank % wide[triangle, 0]
    y = a[triangle, 1] + rank // wide[triangle, 0]
    square = first[own[triangle]] + y * shape[own[triangle], 0] + x
    order = np.argsort(square, kind="stable")
    starts = np.searchsorted(square[order], np.arange(first[-1] + 1))
    return TriangleLookup(
        flat_faces.of_triangle,
        flat_faces.frames,
        origin,
        scale,
        shape.astype(np.int32),
        first[:-1].astype(np.int32),
        starts.astype(np.int32),
        inside[triangle[order]].astype(np.int32),
        plan.reshape(-1, 6),
    )


@jit
def find_triangle(lookup: TriangleLookup, seed: int, at: Vec3) -> int:
    """Return the triangle of a flat face that holds a point of its plane, or is nearest to it.

    ``seed``: any triangle of the flat face. ``at``: the point [m].
    """
    flat = lookup.of_triangle[seed]
    if flat == LONE:
        return seed
    frame = lookup.frames
    dx, dy, dz = at.x - frame[flat, 0, 0], at.y - frame[flat, 0, 1], at.z - frame[flat, 0, 2]
    u = dx * frame[flat, 1, 0] + dy * frame[flat, 1, 1] + dz * frame[flat, 1, 2]
    v = dx * frame[flat, 2, 0] + dy * frame[flat, 2, 1] + dz * frame[flat, 2, 2]
    x = int((u - lookup.origin[flat, 0]) * lookup.squares_per_metre[flat, 0])
    y = int((v - lookup.origin[flat, 1]) * lookup.squares_per_metre[flat, 1])
    x = min(max(x, 0), lookup.shape[flat, 0] - 1)
    y = min(max(y, 0), lookup.shape[flat, 1] - 1)
    square = lookup.first[flat] + y * lookup.shape[flat, 0] + x
    nearest, least = seed, np.inf
    for k in range(lookup.starts[square], lookup.starts[square + 1]):
        triangle = lookup.members[k]
        outside = _distance_outside(lookup.corners, triangle, u, v)
        if outside < least:
            nearest, least = triangle, outside
    return nearest


def find_triangles(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Find the triangle of a plane that holds each point, or is nearest to the point.

    Args:
        corners: corner positions of triangles in one plane [m], shape (m, 3, 3), wound as in a
            TriangleMesh: normals away from the shot.
        points: positions [m], shape (n, 3). A point off the plane is projected along its normal.

    Returns:
        Index of the triangle, shape (n,).
    """
    corners, points = (np.ascontiguousarray(x, np.float64) for x in (corners, points))
    normals, doubled = normals_towards_shot(corners)
    seed = int(doubled.argmax())
    edge = corners[seed, 1] - corners[seed, 0]
    edge /= np.linalg.norm(edge)
    frame = np.stack([corners[seed, 0], edge, np.cross(normals[seed], edge)])
    all_in_one, seeds = np.zeros(len(corners), dtype=np.int32), np.array([seed], dtype=np.int32)
    lookup = build_lookup(corners, FlatFaces(all_in_one, seeds, frame[None], []), 0.0)
    found = np.zeros(len(points), dtype=np.int64)
    _find_each(lookup, seed, points, found)
    return found


@jit
def _find_each(lookup: TriangleLookup, seed: int, points: np.ndarray, found: np.ndarray) -> None:
    for i in range(len(points)):
        found[i] = find_triangle(lookup, seed, Vec3(points[i, 0], points[i, 1], points[i, 2]))


@jit
def _distance_outside(corners: np.ndarray, triangle: int, u: float, v: float) -> float:
    """Return how far [m] point (u, v) is outside a clockwise triangle; negative inside it."""
    worst = -np.inf
    for k in range(3):
        a, b = 2 * k, 2 * ((k + 1) % 3)
        start_u, start_v = corners[triangle, a], corners[triangle, a + 1]
        side_u, side_v = corners[triangle, b] - start_u, corners[triangle, b + 1] - start_v
        turn = side_u * (v - start_v) - side_v * (u - start_u)
        length = np.sqrt(side_u * side_u + side_v * side_v)
        worst = max(worst, turn / length if length > 0.0 else -np.inf)
    return worst
