"""Divide triangles where the sides of a box, or a level of a distance, cross them.

What the box holds, or lies beyond the level, then ends there and not at the triangles' own edges.

An edge is divided for both of its triangles or for neither, so that a closed surface stays closed.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from chamberopt.geometry.face_shapes import beside as faces_beside
from chamberopt.geometry.smoothing.divide import Surface, divided
from chamberopt.geometry.triangles import area_vectors, edge_keys, sides_of, unit_vectors

# Share of an edge: a side of the box that is nearer to its end leaves the edge whole, as the
# triangles between them would be slivers.
NEAR_END = 0.02
# Edges that a level meets are halved until the distance in their middle is the mean of those at
# their ends, to this share of the level, or they are this short beside it. Of slivers, whose new
# edges are as long, a few would be halved for ever.
STRAIGHT, FINE, MOST_HALVINGS = 0.01, 0.1, 8


def facets(vertices: np.ndarray, triangles: np.ndarray) -> Surface:
    """Return a mesh as a surface whose normals are those of its facets.

    Args:
        vertices, triangles: the mesh, (n, 3) [m] and (m, 3).
    """
    count = len(triangles)
    normal = np.repeat(unit_vectors(area_vectors(vertices, triangles))[:, None], 3, axis=1)
    marks = np.zeros((count, 3), dtype=bool)
    return Surface(vertices, triangles, np.arange(count), normal, marks, np.ones(count))


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
    ends, edge = _edges(triangles)
    share = _crossing(*(vertices[ends, axis] - value).T)
    share[np.bincount(edge, np.repeat(wanted & meets, 3), len(ends)) == 0.0] = 0.0
    place = _between(vertices, ends, share)
    place[:, axis] = value
    return _divided_at(surface, ends, edge, share, place)


def piece_beyond(
    vertices: np.ndarray,
    triangles: np.ndarray,
    distance: Callable[[np.ndarray], np.ndarray],
    least: float,
    values: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the piece of a surface that is farther than a distance from something.

    Args:
        vertices, triangles: the surface, which may have a border [m].
        distance: returns the distance of each of some places (n, 3) from that thing [m], (n,).
        least: the distance [m].
        values: of each vertex, shape (n, k).

    Returns:
        Vertices [m] and triangles of the piece, and the values, linear in between, of its vertices.
        There are none if all of the surface is nearer.
    """
    surface, beyond, values = _cut_at_level(facets(vertices, triangles), distance, least, values)
    kept = surface.triangles[beyond[surface.triangles].mean(axis=1) > 0.0]
    used, numbers = np.unique(kept, return_inverse=True)
    return surface.vertices[used], numbers.reshape(-1, 3), values[used]


def with_beside(surface: Surface, own: np.ndarray, beside: float) -> tuple[Surface, np.ndarray]:
    """Return a surface divided beside a piece of it, and marks of the piece with that, (k,).

    Args:
        own: marks the triangles of the piece, (m,).
        beside: how near to the piece the faces that go on from it are taken too [m].
    """
    from sim_core import TriangleMesh, closest_points

    near = faces_beside(surface.vertices, surface.triangles, own)
    piece = TriangleMesh(surface.vertices, surface.triangles, own.astype(np.uint8))
    far = float(np.linalg.norm(np.ptp(surface.vertices, axis=0)))

    def distance(places: np.ndarray) -> np.ndarray:
        return closest_points(piece, places, far, tag=1).distance

    none = np.empty((len(surface.vertices), 0))
    cut, beyond, _ = _cut_at_level(surface, distance, beside, none)
    is_near = beyond[cut.triangles].mean(axis=1) < 0.0
    return cut, own[cut.parent] | (near[cut.parent] & is_near)


def _cut_at_level(
    surface: Surface, distance: Callable[[np.ndarray], np.ndarray], level: float, values: np.ndarray
) -> tuple[Surface, np.ndarray, np.ndarray]:
    """Return a surface divided at a distance from something.

    Args:
        distance: returns the distance of each of some places (n, 3) from that thing [m], (n,).
        level: the distance [m].
        values: of each vertex, shape (n, k).

    Returns:
        The surface, how far each of its vertices is beyond the level [m], (m,), and the values,
        linear in between, of its vertices.
    """
    for halvings in range(MOST_HALVINGS + 1):
        ends, edge = _edges(surface.triangles)
        beyond = distance(surface.vertices) - level
        length = np.linalg.norm(np.diff(surface.vertices[ends], axis=1)[:, 0], axis=1)
        # A distance changes by no more than the way: elsewhere the level does not meet the edge.
        meets = np.abs(beyond[ends]).min(axis=1) < length
        middle = distance(surface.vertices[ends].mean(axis=1)) - level
        is_bent = np.abs(middle - beyond[ends].mean(axis=1)) > STRAIGHT * level
        share = np.where(meets & is_bent & (length > FINE * level), 0.5, 0.0)
        if halvings == MOST_HALVINGS or not share.any():
            break
        values = np.concatenate([values, _between(values, ends, share)[share > 0.0]])
        place = _between(surface.vertices, ends, share)
        surface, _ = _divided_at(surface, ends, edge, share, place)
    share = _crossing(*beyond[ends].T)
    values = np.concatenate([values, _between(values, ends, share)[share > 0.0]])
    place = _between(surface.vertices, ends, share)
    beyond = np.concatenate([beyond, np.zeros(np.count_nonzero(share))])
    surface, _ = _divided_at(surface, ends, edge, share, place)
    return surface, beyond, values


def _edges(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return both ends of each edge, shape (e, 2), and the edge of each side, shape (3 k,)."""
    _, first, edge = np.unique(edge_keys(triangles), return_index=True, return_inverse=True)
    return np.sort(sides_of(triangles)[first], axis=1), edge


def _crossing(one: np.ndarray, two: np.ndarray) -> np.ndarray:
    """Return the share of each edge (e,) at which values at its ends pass through 0.

    It is 0 for edges that stay whole: where they do not, or too near to an end.
    """
    share = np.divide(one, one - two, out=np.zeros_like(one), where=one * two < 0.0)
    return np.where((share > NEAR_END) & (share < 1.0 - NEAR_END), share, 0.0)


def _between(values: np.ndarray, ends: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Return values of vertices (n, k) at a share of the way along each edge, (e, k)."""
    start, end = values[ends[:, 0]], values[ends[:, 1]]
    return np.asarray(start + share[:, None] * (end - start))


def _divided_at(
    surface: Surface, ends: np.ndarray, edge: np.ndarray, share: np.ndarray, place: np.ndarray
) -> tuple[Surface, np.ndarray]:
    """Return a surface divided at places on its edges, and the former triangle of each triangle.

    Args:
        ends, edge: as of `_edges`.
        share: share of each edge at which it is divided, (e,); 0 where it stays whole.
        place: place there [m], (e, 3). Those of divided edges follow the vertices, in their order.
    """
    is_cut = share > 0.0
    number = np.where(is_cut, len(surface.vertices) + np.cumsum(is_cut) - 1, -1)
    # The normals of both surfaces at an edge are interpolated along the side of each.
    starts, following = surface.normals, np.roll(surface.normals, -1, axis=1)
    runs_on = sides_of(surface.triangles)[:, 0] == ends[edge, 0]
    of_side = np.where(runs_on, share[edge], 1.0 - share[edge]).reshape(-1, 3, 1)
    normal = unit_vectors((1.0 - of_side) * starts + of_side * following)
    new = np.concatenate([surface.vertices, place[is_cut]])
    finer, row, _ = divided(surface, new, number[edge].reshape(-1, 3), normal)
    return finer, row
