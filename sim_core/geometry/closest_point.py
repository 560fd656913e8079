"""Find the surface points closest to many places (positions in the cavity) at once.

The walk through the tree of boxes leaves out boxes that are farther than the closest point found so
far. The distance of a place is also the radius of the largest ball that fits with its centre there.

Source: C. Ericson, Real-Time Collision Detection (2005), section 5.1.5, for the closest point of a
triangle.
"""

import math
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from sim_core.errors import SceneError
from sim_core.geometry.bvh import STACK, Tree, build_tree
from sim_core.geometry.mesh import TriangleMesh
from sim_core.geometry.obstacles import FACE, ObstacleTable
from sim_core.numerics.computed_once import computed_once
from sim_core.numerics.jit import jit
from sim_core.numerics.simd import BOXES
from sim_core.numerics.vec3 import Vec3, add_scaled, dot, sub

PER_THREAD = 20_000  # places; a thread takes some 20 ms for them, and 0.1 ms to begin


class ClosestPoints(NamedTuple):
    """Surface points closest to n places, which are positions in the cavity.

    If no surface is within the reach of the search from a place, the distance is the reach, the
    triangle -1 and the point the place itself.

    Args:
        distance: distance from the place [m], shape (n,).
        triangle: triangle of the surface, shape (n,) int32.
        point: point on the triangle [m], shape (n, 3).
    """

    distance: np.ndarray
    triangle: np.ndarray
    point: np.ndarray


def closest_points(
    mesh: TriangleMesh, places: np.ndarray, reach: float | np.ndarray, tag: int | None = None
) -> ClosestPoints:
    """Find the surface point closest to each place, many places on all cores.

    Args:
        mesh: the surface.
        places: positions [m], shape (n, 3).
        reach: largest distance that is searched [m], one for all places or shape (n,).
        tag: surface tag of the triangles that count; None means all triangles.
    """
    middle = mesh.middle
    found = ClosestPoints(
        np.array(np.broadcast_to(np.asarray(reach, dtype=np.float64), len(places))),
        np.full(len(places), -1, dtype=np.int32),
        np.ascontiguousarray(places, dtype=np.float64) - middle,
    )
    tree = tree_of(mesh, tag)

    def find(rows: slice) -> None:
        part = ClosestPoints(*(column[rows] for column in found))  # views
        _find(tree, part, np.zeros(STACK, dtype=np.int32), np.zeros(STACK))

    on_threads(find, len(places))
    return found._replace(point=found.point + middle)


def on_threads(work: Callable[[slice], None], count: int) -> None:
    """Call ``work`` with slices of so many rows, several at once; compiled code does not wait."""
    parts = [slice(k, k + PER_THREAD) for k in range(0, count, PER_THREAD)]
    if len(parts) <= 1:
        work(slice(None))
        return
    with ThreadPoolExecutor(min(len(parts), os.cpu_count() or 1), "closest points") as threads:
        [*threads.map(work, parts)]


def closest_on_each(corners: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return the point on each triangle that is closest to this triangle's given place, (n, 3) [m].

    Args:
        corners, places: corners (n, 3, 3) and given place (n, 3) of each triangle [m].
    """
    numbers = np.ascontiguousarray(corners, dtype=np.float64).reshape(len(corners), 9)
    found = np.array(places, dtype=np.float64)
    _move_to_each(numbers, found)
    return found


@jit
def _move_to_each(numbers: np.ndarray, place: np.ndarray) -> None:
    """Move each place to the closest point of the triangle in the same row of ``numbers``."""
    for i in range(len(place)):
        point = point_on_triangle(numbers, i, Vec3(place[i, 0], place[i, 1], place[i, 2]))
        place[i, 0], place[i, 1], place[i, 2] = point.x, point.y, point.z


@computed_once(8)
def tree_of(mesh: TriangleMesh, tag: int | None) -> Tree:
    """Return a search tree of the triangles of one tag; None means all triangles.

    Each obstacle holds a triangle's nine coordinates.
    """
    own = np.flatnonzero((mesh.tags == tag) | (tag is None)).astype(np.int32)
    if not len(own):
        raise SceneError(f"the mesh has no triangle of tag {tag}")
    corners = mesh.corners[own] - mesh.middle
    numbers = np.ascontiguousarray(corners.reshape(len(own), 9))
    triangles = np.repeat(own[:, None], 2, axis=1)
    kinds = np.full(len(own), FACE, dtype=np.uint8)
    table = ObstacleTable(numbers, kinds, triangles, corners.min(axis=1), corners.max(axis=1))
    return build_tree(table, 0.0)


@jit
def _find(tree: Tree, found: ClosestPoints, stack: np.ndarray, entry: np.ndarray) -> None:
    """Find the closest surface points, and write them into ``found``.

    ``found`` holds the reach of each search as distance, and each place as point, until a closer
    point is found. ``stack`` and ``entry``: working arrays for nodes and their squared distances
    [m²].
    """
    for i in range(len(found.distance)):
        at = Vec3(found.point[i, 0], found.point[i, 1], found.point[i, 2])
        least = found.distance[i] * found.distance[i]
        size = 1
        stack[0], entry[0] = 0, 0.0
        while size > 0:
            size -= 1
            if entry[size] >= least:
                continue
            node = stack[size]
            first = size
            for child in range(BOXES):
                away = box_distance_squared(tree.bounds, node, child, at)
                if away >= least:
                    continue
                number = tree.children[node, child]
                if number >= 0:
                    stack[size], entry[size] = number, away
                    size += 1
                    continue
                point = point_on_triangle(tree.numbers, -1 - number, at)
                offset = sub(at, point)
                if dot(offset, offset) < least:
                    least = dot(offset, offset)
                    found.triangle[i] = tree.triangles[-1 - number, 0]
                    found.point[i, 0], found.point[i, 1], found.point[i, 2] = (
                        point.x,
                        point.y,
                        point.z,
                    )
            for k in range(first, size - 1):  # the closest of the new nodes is visited next
                if entry[k] < entry[size - 1]:
                    stack[k], stack[size - 1] = stack[size - 1], stack[k]
                    entry[k], entry[size - 1] = entry[size - 1], entry[k]
        if found.triangle[i] >= 0:
            found.distance[i] = math.sqrt(least)


@jit
def box_distance_squared(bounds: np.ndarray, node: int, child: int, at: Vec3) -> float:
    x = max(bounds[node, 0, child] - at.x, at.x - bounds[node, 3, child], 0.0)
    y = max(bounds[node, 1, child] - at.y, at.y - bounds[node, 4, child], 0.0)
    z = max(bounds[node, 2, child] - at.z, at.z - bounds[node, 5, child], 0.0)
    return float(x * x + y * y + z * z)


@jit
def point_on_triangle(numbers: np.ndarray, row: int, at: Vec3) -> Vec3:
    """Return the point of triangle ``row`` that is closest to the place ``at`` [m]."""
    a = Vec3(numbers[row, 0], numbers[row, 1], numbers[row, 2])
    b = Vec3(numbers[row, 3], numbers[row, 4], numbers[row, 5])
    c = Vec3(numbers[row, 6], numbers[row, 7], numbers[row, 8])
    ab, ac, ap = sub(b, a), sub(c, a), sub(at, a)
    bb, bc, cc, pb, pc = dot(ab, ab), dot(ab, ac), dot(ac, ac), dot(ap, ab), dot(ap, ac)
    det = bb * cc - bc * bc
    if det > 0.0:
        v, w = (cc * pb - bc * pc) / det, (bb * pc - bc * pb) / det
        if v >= 0.0 and w >= 0.0 and v + w <= 1.0:
            return add_scaled(add_scaled(a, v, ab), w, ac)
    # the place is outside the face: take the closest point of its three sides
    best = _point_on_side(a, b, at)
    for other in (_point_on_side(b, c, at), _point_on_side(c, a, at)):
        offset, so_far = sub(at, other), sub(at, best)
        if dot(offset, offset) < dot(so_far, so_far):
            best = other
    return best


@jit
def _point_on_side(a: Vec3, b: Vec3, at: Vec3) -> Vec3:
    """Return the point of the segment from a to b that is closest to the place ``at`` [m]."""
    side = sub(b, a)
    length = dot(side, side)
    share = 0.0
    if length > 0.0:
        share = min(max(dot(sub(at, a), side) / length, 0.0), 1.0)
    return add_scaled(a, share, side)
