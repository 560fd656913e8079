"""Lengths of many straight rays through a closed body, from its surface to where they leave it.

A ray starts on the surface and points inwards. It ends at the first triangle that it crosses from
inside, so that the triangle on which it starts does not count.

Source: T. Möller & B. Trumbore, J. Graphics Tools 2 (1997) 21, for the crossing of a triangle.
"""

import numpy as np

from sim_core.geometry.bvh import STACK, Tree, build_tree
from sim_core.geometry.obstacles import FACE, ObstacleTable
from sim_core.numerics.jit import jit
from sim_core.numerics.simd import BOXES
from sim_core.numerics.vec3 import Vec3, cross, dot, sub

# Share of a triangle by which a ray may pass beside it and still cross it, so that no ray slips
# through between two triangles.
BESIDE = 1e-9
TINY = 1e-30  # replaces a component of zero, whose inverse would be infinite


def ray_lengths(
    corners: np.ndarray, starts: np.ndarray, directions: np.ndarray, reach: float
) -> np.ndarray:
    """Return how far each ray goes through the body [m], shape (n,); inf beyond the reach.

    Args:
        corners: corners of the triangles of a closed surface, normals outwards [m], (m, 3, 3).
        starts: points of the surface [m], shape (n, 3).
        directions: unit vectors into the body, shape (n, 3).
        reach: largest length that is searched [m].
    """
    middle = 0.5 * (corners.min(axis=(0, 1)) + corners.max(axis=(0, 1)))
    rows = np.repeat(np.arange(len(corners), dtype=np.int32)[:, None], 2, axis=1)
    near = corners - middle
    numbers = np.ascontiguousarray(near.reshape(len(corners), 9), dtype=np.float64)
    kinds = np.full(len(corners), FACE, dtype=np.uint8)
    table = ObstacleTable(numbers, kinds, rows, near.min(axis=1), near.max(axis=1))
    starts = np.ascontiguousarray(starts - middle, dtype=np.float64)
    directions = np.ascontiguousarray(directions, dtype=np.float64)
    lengths = np.full(len(starts), float(reach))
    _find(build_tree(table, 0.0), starts, directions, lengths, np.zeros(STACK, dtype=np.int32))
    lengths[lengths >= reach] = np.inf
    return lengths


@jit
def _find(
    tree: Tree, starts: np.ndarray, directions: np.ndarray, lengths: np.ndarray, stack: np.ndarray
) -> None:
    """Write the lengths of rays into ``lengths``, which hold the reach before."""
    for i in range(len(lengths)):
        start = Vec3(starts[i, 0], starts[i, 1], starts[i, 2])
        along = Vec3(directions[i, 0], directions[i, 1], directions[i, 2])
        inverse = Vec3(_inverse(along.x), _inverse(along.y), _inverse(along.z))
        size = 1
        stack[0] = 0
        while size > 0:
            size -= 1
            node = stack[size]
            for child in range(BOXES):
                if not _enters(tree.bounds, node, child, start, inverse, lengths[i]):
                    continue
                number = tree.children[node, child]
                if number >= 0:
                    stack[size] = number
                    size += 1
                    continue
                length = _exit(tree.numbers, -1 - number, start, along)
                if length < lengths[i]:
                    lengths[i] = length


@jit
def _inverse(component: float) -> float:
    return 1.0 / (component if abs(component) > TINY else TINY)


@jit
def _enters(
    bounds: np.ndarray, node: int, child: int, start: Vec3, inverse: Vec3, longest: float
) -> bool:
    """Return True if a ray enters the box of a node's child before it is ``longest`` [m] long."""
    first, last = 0.0, longest
    for axis in range(3):
        one = (bounds[node, axis, child] - start[axis]) * inverse[axis]
        two = (bounds[node, 3 + axis, child] - start[axis]) * inverse[axis]
        first = max(first, min(one, two))
        last = min(last, max(one, two))
    return first <= last


@jit
def _exit(numbers: np.ndarray, row: int, start: Vec3, along: Vec3) -> float:
    """Return the length [m] at which a ray crosses triangle ``row`` from inside; inf if nowhere."""
    a = Vec3(numbers[row, 0], numbers[row, 1], numbers[row, 2])
    ab = sub(Vec3(numbers[row, 3], numbers[row, 4], numbers[row, 5]), a)
    ac = sub(Vec3(numbers[row, 6], numbers[row, 7], numbers[row, 8]), a)
    across = cross(along, ac)
    # positive where the ray comes from the back, minus the volume that Möller and Trumbore have
    facing = -dot(ab, across)
    if facing <= 0.0:
        return np.inf
    offset = sub(start, a)
    u = -dot(offset, across) / facing
    if u < -BESIDE or u > 1.0 + BESIDE:
        return np.inf
    turned = cross(offset, ab)
    v = -dot(along, turned) / facing
    if v < -BESIDE or u + v > 1.0 + BESIDE:
        return np.inf
    length = -dot(ac, turned) / facing
    return float(length) if length > 0.0 else np.inf
