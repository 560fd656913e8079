"""Find the largest ball that touches a surface at a point and crosses the surface nowhere.

A large ball that touches at the point is shrunk until it clears an obstacle, again and again until
no obstacle is left. Each smaller ball lies inside the larger ones, all of which touch at the point.
So one walk through the tree of boxes is enough: what the ball did not meet it will not meet.

Source: J. Ma, S. W. Bae, S. Choi, The Visual Computer 28 (2012) 7, for the shrinking.

Notation
    p, n, R   point, unit normal into the cavity there, and radius of the ball with centre p + R n
    o         depth to which the ball may reach into a surface
    q         point of an obstacle closest to the centre: the ball is in its way if
              |q - p - R n| < R - o
"""

import numpy as np

from sim_core.geometry.bvh import STACK, Tree
from sim_core.geometry.closest_point import (
    box_distance_squared,
    on_threads,
    point_on_triangle,
    tree_of,
)
from sim_core.geometry.mesh import TriangleMesh
from sim_core.numerics.jit import jit
from sim_core.numerics.simd import BOXES
from sim_core.numerics.vec3 import Vec3, add_scaled, dot, sub

MAX_SHRINKS = 50  # by one obstacle; 2 are usual
HARDLY = 1e-9  # share of its radius by which a ball shrinks no more


def largest_balls(
    mesh: TriangleMesh, point: np.ndarray, normal: np.ndarray, max_radius: float, overlap: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the largest ball that touches a mesh at each point, on all cores.

    Returns its radius [m], the triangle that limits it (-1 if none does), and the cosine between
    the normals of point and triangle where the ball meets them, (p,) each. The cosine is -1 for
    surfaces that face each other, 0 without a triangle.

    Args:
        point, normal: points [m] and unit normals into the cavity there, (p, 3) each.
        max_radius: limit of the radius [m].
        overlap: the allowed depth o [m].
    """
    radius = np.full(len(point), float(max_radius))
    obstacle, cosine = np.full(len(point), -1), np.zeros(len(point))
    points = np.ascontiguousarray(point, dtype=np.float64) - mesh.middle
    normals = np.ascontiguousarray(normal, dtype=np.float64)
    tree = tree_of(mesh, None)

    def shrink(rows: slice) -> None:
        _shrink(
            tree, points[rows], normals[rows], radius[rows], obstacle[rows], cosine[rows],
            float(overlap), np.zeros(STACK, dtype=np.int32),
        )  # fmt: skip

    on_threads(shrink, len(point))
    return radius, obstacle, cosine


@jit
def _shrink(
    tree: Tree,
    point: np.ndarray,
    normal: np.ndarray,
    radius: np.ndarray,
    obstacle: np.ndarray,
    cosine: np.ndarray,
    overlap: float,
    stack: np.ndarray,
) -> None:
    """Shrink each ball until it is in no obstacle's way. ``stack``: working array for nodes."""
    for i in range(len(radius)):
        p = Vec3(point[i, 0], point[i, 1], point[i, 2])
        n = Vec3(normal[i, 0], normal[i, 1], normal[i, 2])
        size = 1
        stack[0] = 0
        while size > 0:
            size -= 1
            node = stack[size]
            for child in range(BOXES):
                centre, inside = add_scaled(p, radius[i], n), radius[i] - overlap
                if box_distance_squared(tree.bounds, node, child, centre) >= inside * inside:
                    continue
                number = tree.children[node, child]
                if number >= 0:
                    stack[size] = number
                    size += 1
                else:
                    found = _clear(tree, -1 - number, p, n, radius[i], overlap, cosine[i])
                    if found[0] < radius[i] or found[1] != cosine[i]:
                        radius[i], cosine[i] = found
                        obstacle[i] = tree.triangles[-1 - number, 0]


@jit
def _clear(
    tree: Tree, row: int, p: Vec3, n: Vec3, radius: float, overlap: float, cosine: float
) -> tuple[float, float]:
    """Return radius and cosine of a ball after it has cleared the triangle in this row."""
    for _ in range(MAX_SHRINKS):
        centre, inside = add_scaled(p, radius, n), radius - overlap
        q = point_on_triangle(tree.numbers, row, centre)
        away = sub(centre, q)
        if dot(away, away) >= inside * inside:
            break
        to = sub(q, p)
        ahead, square = dot(to, n) - overlap, dot(to, to) - overlap * overlap
        fits = square / (2.0 * ahead) if ahead > 0.0 and square > 0.0 else 0.0
        shrunk = fits < (1.0 - HARDLY) * radius
        radius = min(max(fits, overlap), radius)
        cosine = (radius - dot(to, n)) / max(radius - overlap, overlap)
        if not shrunk or fits <= overlap:
            break
    return radius, cosine
