"""Tell apart the edges of a part's surface: edges between the facets of a round, and creases.

A round is a curved surface, such as a fillet, that the file divides into plane facets. A crease is
an edge of the part itself.

An angle alone cannot tell them apart: the facets of a coarse fillet turn by as much as the faces of
a chamfer. A round shows by its neighbours: several facets beside each other turn in the same
direction, with nearly the same curvature. An edge without such evidence is a crease.

Facets are triangles that lie in one plane, such as the two halves of a quadrangle.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from chamberopt.geometry.triangles import (
    area_vectors,
    connected_pieces,
    count_up,
    side_pairs,
    sides_of,
    unit_vectors,
)

# Edges that turn by more are no evidence of a round. The turn of no regular prism is near these
# values, so that rounding does not decide.
CONVEX_SURE, HOLLOW_SURE = np.radians(38.0), np.radians(55.0)
# Edges that turn by more are always creases. Edges between these limits and the sure limits belong
# to a round if other edges are evidence of it: the facets of a round turn by nearly the same angle,
# which may lie on the limit.
CONVEX_CREASE, HOLLOW_CREASE = np.radians(48.0), np.radians(66.0)
LEVEL = np.radians(0.3)  # triangles that turn by less are one facet
# Triangles are also one facet if they turn by less than this share of the largest turn of either,
# and by the least of all sides of a triangle: halves of a quadrangle that is not quite flat.
OF_LARGEST = 0.3
SMOOTH = np.radians(1.0)  # edges that turn by less need no evidence
# Factor of curvatures. Beside a plane the first facet of a round has 3/4 of the curvature of the
# other facets.
ALIKE = 1.6
# Factor of the curvatures about an edge, because a cone and its flat end are alike in the sum of
# curvatures.
ALIKE_ABOUT_AXIS = 4.0
# A round goes on beyond a facet if the facet's other edges bend about an edge by this share of that
# edge's own bend. The share holds for an edge that turns by CONVEX_SURE, and falls with the square
# of a smaller turn.
GOES_ON = 0.5
ACROSS = 0.4  # cosine between edges of a facet below which they bend about different axes
FEW_EDGES = 64


class Edges(NamedTuple):
    """Edges of a closed surface, with their turns and lengths.

    Attributes:
        sides: the two sides at each edge, 3 t + k for side k of triangle t, shape (e, 2).
        turn: angle between the normals of both sides [rad], negative in a hollow, shape (e,).
        length: length of each edge [m], shape (e,).
        along: unit vector along each edge, shape (e, 3).
    """

    sides: np.ndarray
    turn: np.ndarray
    length: np.ndarray
    along: np.ndarray

    @property
    def triangles(self) -> np.ndarray:
        """Numbers of the two triangles at each edge, shape (e, 2)."""
        return np.asarray(self.sides // 3)


def find_edges(vertices: np.ndarray, triangles: np.ndarray) -> Edges:
    """Return the edges of a closed surface with vertices (n, 3) [m] and triangles (m, 3).

    The normals of the triangles point outward.
    """
    sides = side_pairs(triangles)
    normal = unit_vectors(area_vectors(vertices, triangles))
    start, end = sides_of(triangles)[sides[:, 0]].T
    along = vertices[end] - vertices[start]
    length = np.linalg.norm(along, axis=1)
    along = unit_vectors(along)
    one, two = normal[sides.T // 3]
    across = np.einsum("ij,ij->i", np.cross(one, two), along)
    return Edges(sides, np.arctan2(across, np.einsum("ij,ij->i", one, two)), length, along)


def is_hard(edges: Edges) -> np.ndarray:
    """Return marks (e,) of edges at which the surface turns so much that they must be creases."""
    return np.asarray((edges.turn > CONVEX_CREASE) | (edges.turn < -HOLLOW_CREASE))


def find_creases(edges: Edges, area: np.ndarray) -> np.ndarray:
    """Return marks (e,) of the creases: edges without evidence that they belong to a round, which
    is a curved surface of many facets.

    Args:
        area: areas of the triangles [m²], shape (m,).
    """
    size, hard, count = np.abs(edges.turn), is_hard(edges), len(area)
    one, two = edges.triangles.T
    largest = np.zeros(count)
    for triangle in (one, two):
        np.maximum.at(largest, triangle[~hard], size[~hard])
    least = np.full(count, np.inf)
    for triangle in (one, two):
        np.minimum.at(least, triangle, size)
    flat = ~hard & (size < LEVEL)
    nearly = ~hard & (size < OF_LARGEST * np.minimum(largest[one], largest[two]))
    nearly &= (size <= least[one]) | (size <= least[two])
    smooth = size <= SMOOTH
    for level in (flat, flat | nearly):
        smooth |= level | _has_evidence(edges, level, hard, area)
    return np.asarray(hard | ~smooth)


def _has_evidence(
    edges: Edges, level: np.ndarray, hard: np.ndarray, area: np.ndarray
) -> np.ndarray:
    """Return marks (e,) of the edges that belong to a round (a curved surface), judged by the
    facets beside them.

    Args:
        level: marks the edges within facets, shape (e,).
        hard: marks the edges that belong to no round, shape (e,).
        area: areas of the triangles [m²], shape (m,).
    """
    size = np.abs(edges.turn)
    sure = (edges.turn < CONVEX_SURE) & (edges.turn > -HOLLOW_SURE)
    one, two = edges.triangles.T
    facets, facet = connected_pieces(one[level], two[level], len(area))
    border = np.flatnonzero(~level & ~hard & (facet[one] != facet[two]))
    evident = np.zeros(len(size), dtype=bool)
    for bend in (1.0, -1.0):
        same = border[bend * edges.turn[border] > LEVEL]
        evident[same] = _is_in_round(
            facet[edges.triangles[same]],
            Edges(*(values[same] for values in edges._replace(turn=size))),
            sure[same],
            np.bincount(facet, area, facets),
        )
    return evident


def _is_in_round(facet: np.ndarray, edges: Edges, sure: np.ndarray, area: np.ndarray) -> np.ndarray:
    """Return marks (k,) of the edges that belong to a round, which is a curved surface.

    The given edges are either all convex or all hollow.

    Args:
        facet: facets on both sides of each edge, shape (k, 2).
        edges: the edges with turns made positive.
        sure: marks the edges that turn so little that they are evidence of a round, shape (k,).
        area: areas of the facets, shape (f,).
    """
    bend = edges.length * edges.turn
    curvature = np.bincount(facet.T.ravel(), np.tile(bend, 2), len(area)) / np.maximum(area, 1e-30)
    pairs = np.unique(np.sort(facet[sure], axis=1), axis=0)
    is_inner = np.bincount(pairs.ravel(), minlength=len(area)) >= 2
    bends_beside = _bends_beside(facet, bend, edges.along, len(area))
    about_axis = (bends_beside + bend[:, None]) / np.maximum(area[facet], 1e-30)
    alike = is_inner[facet].all(axis=1) & _are_alike(curvature[facet], ALIKE)
    alike &= sure & _are_alike(about_axis, ALIKE_ABOUT_AXIS)
    of_round = np.zeros(len(area), dtype=bool)
    of_round[facet[alike]] = True
    beside = of_round[facet]
    needed = GOES_ON * (edges.turn / CONVEX_SURE) ** 2 * bend
    goes_on = bends_beside >= needed[:, None]
    alike = beside.all(axis=1) & _are_alike(curvature[facet], ALIKE)
    return np.asarray((goes_on & beside).any(axis=1) & (sure | alike))


def _bends_beside(facet: np.ndarray, bend: np.ndarray, along: np.ndarray, count: int) -> np.ndarray:
    """Return how much the two facets at each edge bend about it at their other edges, (k, 2).

    The bend [m rad] at an edge is its turn times its length. A bend about an axis across the given
    edge does not count: the round of a shaft shows nothing about the edge at the shaft's end. The
    round of a cone does not count either, although its lines are not quite across its end.
    """
    tensor = np.einsum("k,ki,kj->kij", bend, along, along).reshape(-1, 9)
    sums = np.stack(
        [np.bincount(facet.T.ravel(), np.tile(one, 2), count) for one in tensor.T], axis=1
    ).reshape(-1, 3, 3)
    bends = np.einsum("kfij,ki,kj->kf", sums[facet], along, along) - bend[:, None]
    # Edges that are nearly across are taken out pair by pair, in facets with few edges.
    side = facet.ravel()  # two facets of each edge
    number, order = np.bincount(side, minlength=count), np.argsort(side, kind="stable")
    few = np.flatnonzero(number[side] <= FEW_EDGES)
    times, first = number[side[few]], (np.cumsum(number) - number)[side[few]]
    pair = np.repeat(few, times)
    other = order[np.repeat(first, times) + count_up(times)] // 2
    cosine = np.einsum("ri,ri->r", along[pair // 2], along[other])
    across = np.where(np.abs(cosine) < ACROSS, bend[other] * cosine**2, 0.0)
    return np.asarray(bends - np.bincount(pair, across, 2 * len(bend)).reshape(-1, 2))


def _are_alike(curvature: np.ndarray, factor: float) -> np.ndarray:
    """Return True where two curvatures (k, 2) differ by at most a factor, shape (k,)."""
    low, high = np.sort(curvature, axis=1).T
    return np.asarray(high <= factor * low)
