"""Divide triangles where the sides of a box cross them, so that what the box holds ends straight.

An edge is divided for both of its triangles or for neither, so that a closed surface stays closed.
"""

from __future__ import annotations

import numpy as np

from chamberopt.geometry.smoothing.divide import Surface, divided
from chamberopt.geometry.triangles import edge_keys, sides_of, unit_vectors

# Share of an edge: a side of the box that is nearer to its end leaves the edge whole, as the
# triangles between them would be slivers.
NEAR_END = 0.02


def cut_at_box(surface: Surface, box: np.ndarray, wanted: np.ndarray) -> Surface:
    """Return a surface whose wanted triangles are divided at the sides of a box.

    Args:
        box: its low and high corners [m], shape (2, 3).
        wanted: marks of triangles, shape (k,). Others are divided only at edges of wanted ones.
    """
    for axis in range(3):
        for value in box[:, axis]:
            before = surface
            surface, row = _cut_at_plane(before, axis, float(value), box, wanted)
            wanted = wanted[row]
    return surface


def _cut_at_plane(
    surface: Surface, axis: int, value: float, box: np.ndarray, wanted: np.ndarray
) -> tuple[Surface, np.ndarray]:
    """Return a surface divided at a plane, and the triangle from which each of its triangles comes.

    Args:
        axis, value: the plane across this axis, at this coordinate [m].
        box: corners of a box (2, 3) [m]; wanted triangles that it does not meet stay whole.
    """
    vertices, triangles = surface.vertices, surface.triangles
    corners = vertices[triangles]
    meets = ((corners.max(axis=1) >= box[0]) & (corners.min(axis=1) <= box[1])).all(axis=1)
    _, first, edge = np.unique(edge_keys(triangles), return_index=True, return_inverse=True)
    ends = np.sort(sides_of(triangles)[first], axis=1)
    one, two = (vertices[ends, axis] - value).T
    share = np.divide(one, one - two, out=np.zeros_like(one), where=one * two < 0.0)
    is_cut = (share > NEAR_END) & (share < 1.0 - NEAR_END)
    is_cut &= np.bincount(edge, np.repeat(wanted & meets, 3), len(first)) > 0.0
    place = vertices[ends[:, 0]] + share[:, None] * (vertices[ends[:, 1]] - vertices[ends[:, 0]])
    place[:, axis] = value
    number = np.where(is_cut, len(vertices) + np.cumsum(is_cut) - 1, -1)
    # The normals of both surfaces at an edge are interpolated along the side of each.
    starts, following = surface.normals, np.roll(surface.normals, -1, axis=1)
    runs_on = sides_of(triangles)[:, 0] == ends[edge, 0]
    of_side = np.where(runs_on, share[edge], 1.0 - share[edge]).reshape(-1, 3, 1)
    normal = unit_vectors((1.0 - of_side) * starts + of_side * following)
    new = np.concatenate([vertices, place[is_cut]])
    finer, row, _ = divided(surface, new, number[edge].reshape(-1, 3), normal)
    return finer, row
