"""Smooth faces of a part and the sharp edges between them, called creases.

All edges between a face's triangles turn by less than a crease does. So the division of a flat
surface into triangles makes no difference to its faces and creases.

No single angle makes an edge sharp, because a rounding error would decide for a part with just this
angle. The part is divided into faces by each of DIVISIONS angles spread over a range. Each division
serves the same share of the windows (discs of the surface in which dents are counted). A convex
edge that turns by 45 degrees is sharp to three quarters of the windows beside it. So results pass
continuously from a surface that goes on across an edge to a surface that ends there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from chamberopt.geometry.triangles import (
    area_vectors,
    connected_pieces,
    edge_keys,
    sides_of,
    unit_vectors,
)

# Turn of the surface [degrees] at edges that are sharp to half of the windows. Facets of round
# surfaces turn by less.
CONVEX_CREASE, HOLLOW_CREASE = 40.0, 60.0
STRAIGHT_ON = 45.0  # degrees: a line of creases that turns by more ends for half of the windows
RANGE = 10.0  # degrees above and below both angles, over which the divisions spread
DIVISIONS = 32  # angles in the middles of equal parts of the range, never a whole number
OFFSETS = RANGE * (2.0 * (np.arange(DIVISIONS) + 0.5) / DIVISIONS - 1.0)  # degrees, from the middle
GOLDEN = 0.5 * (5.0**0.5 - 1.0)  # steps of this share of a range spread evenly over it


class Places(NamedTuple):
    """Points on a surface, with the normal and the smooth face there.

    Attributes:
        place: [m], shape (p, 3).
        normal: unit vectors out of the part, shape (p, 3); zero on lines.
        face: smooth face, or line, under each place, shape (p,).
    """

    place: np.ndarray
    normal: np.ndarray
    face: np.ndarray

    def select(self, rows: np.ndarray | slice) -> Places:
        return Places(*(column[rows] for column in self))


class Faces(NamedTuple):
    """Smooth faces of a part, by each of several divisions of the part into faces.

    Divisions differ in the angle from which on an edge is sharp. The division into most faces, the
    finest, comes first.

    Attributes:
        of_triangle: the face of each triangle by the finest division, shape (m,).
        joined: for each division and each face of the finest division, the face that stands for all
            faces joined to it, shape (d, f).
        of_angle: number of the division by each angle, shape (DIVISIONS,).
    """

    of_triangle: np.ndarray
    joined: np.ndarray
    of_angle: np.ndarray

    def divisions(self, count: int) -> np.ndarray:
        """Return the index of the division that each of `count` windows uses, (count,).

        Each of the angles from which on an edge is sharp serves as many windows as any other.
        """
        angle = (DIVISIONS * ((np.arange(count) + 0.5) * GOLDEN % 1.0)).astype(int)
        return np.asarray(self.of_angle[angle])

    @property
    def middle(self) -> int:
        """Index of the division into faces for pictures: an edge is sharp from a mean angle on."""
        return int(self.of_angle[DIVISIONS // 2])

    @property
    def shares(self) -> np.ndarray:
        """Share of the measuring windows that use each division into faces, shape (d,)."""
        return np.bincount(self.of_angle, minlength=len(self.joined)) / DIVISIONS


class Creases(NamedTuple):
    """Creases: convex edges at which the surface of the target turns sharply.

    Attributes:
        ends: both ends of each edge [m], shape (e, 2, 3).
        outward: unit vectors midway between the normals of the two sides, shape (e, 3).
        line: number of each edge's line (a chain of edges without corners) in each division of the
            part into faces, -1 where the edge is not sharp, shape (d, e). Different divisions have
            different numbers.
        faces: the faces of the finest division on both sides, shape (e, 2).
        of_triangle: crease at each side of each part triangle, -1 without a crease, shape (m, 3).
        at_corner: the sharpest crease that begins or ends at each corner, else -1, shape (m, 3).
    """

    ends: np.ndarray
    outward: np.ndarray
    line: np.ndarray
    faces: np.ndarray
    of_triangle: np.ndarray
    at_corner: np.ndarray


def find_faces(
    vertices: np.ndarray, triangles: np.ndarray, target: np.ndarray
) -> tuple[Faces, Creases]:
    """Divide a part into smooth faces. The border of the target divides faces as creases do.

    Args:
        vertices: vertices of the part [m], shape (n, 3).
        triangles: triangles of the part, normals outward, shape (m, 3).
        target: marks the triangles of the target, shape (m,).

    Returns:
        The faces, and the creases of the finest division that border on the target.
    """
    keys = edge_keys(triangles)
    order = np.argsort(keys, kind="stable")
    paired = np.flatnonzero(keys[order[1:]] == keys[order[:-1]])
    one, two = order[paired], order[paired + 1]  # the two triangle sides of each edge
    normal = unit_vectors(area_vectors(vertices, triangles))
    start, end = sides_of(triangles)[one].T
    apex = vertices[triangles[two // 3, (two % 3 + 2) % 3]]
    turn = np.degrees(
        np.arccos(np.clip(np.einsum("ij,ij->i", normal[one // 3], normal[two // 3]), -1.0, 1.0))
    )
    convex = np.einsum("ij,ij->i", apex - vertices[start], normal[one // 3]) < 0.0
    over = turn - np.where(convex, CONVEX_CREASE, HOLLOW_CREASE)
    inside = target[one // 3] == target[two // 3]
    joined = inside & (over <= OFFSETS[0])
    face = connected_pieces(one[joined] // 3, two[joined] // 3, len(triangles))[1]
    beside = np.column_stack([face[one // 3], face[two // 3]])

    is_crease = (over > OFFSETS[0]) & convex & (target[one // 3] | target[two // 3])
    edge = np.flatnonzero(is_crease)
    edge = edge[np.lexsort([*np.abs(vertices[end] - vertices[start])[edge].T, over[edge].round(4)])]
    one, two, start, end = one[edge], two[edge], start[edge], end[edge]
    of_triangle = np.full(3 * len(triangles), -1)
    of_triangle[one] = of_triangle[two] = np.arange(len(edge))
    of_vertex = np.full(len(vertices), -1)
    of_vertex[start] = of_vertex[end] = np.arange(len(edge))  # the last edge is the sharpest

    near = inside & (over > OFFSETS[0]) & (over <= OFFSETS[-1])
    links, corner = _links(vertices, start, end)
    faces_by: list[np.ndarray] = []
    lines_by: list[np.ndarray] = []
    of_angle, before = [], (-1, -1, -1)
    for offset in OFFSETS:
        soft, sharp = near & (over <= offset), over[edge] > offset
        goes_on = sharp[links].all(axis=1) & (corner < STRAIGHT_ON + offset)
        now = (
            int(soft.sum()),
            int(sharp.sum()),
            int(goes_on.sum()),
        )  # nested: equal sizes, equal sets
        if now != before:
            faces_by.append(_joined_faces(beside[soft], int(face.max(initial=-1)) + 1))
            line = connected_pieces(links[goes_on, 0], links[goes_on, 1], len(edge))[1] + len(
                lines_by
            ) * len(edge)
            lines_by.append(np.where(sharp, line, -1))
        before = now
        of_angle.append(len(faces_by) - 1)
    return Faces(face, np.array(faces_by), np.array(of_angle)), Creases(
        ends=np.stack([vertices[start], vertices[end]], axis=1),
        outward=unit_vectors(normal[one // 3] + normal[two // 3]),
        line=np.array(lines_by),
        faces=beside[edge],
        of_triangle=of_triangle.reshape(-1, 3),
        at_corner=of_vertex[triangles],
    )


def _joined_faces(pairs: np.ndarray, count: int) -> np.ndarray:
    """Return for each face the lowest number of all faces joined to it, shape (count,).

    Args:
        pairs: pairs of faces to join, (k, 2).
    """
    piece = connected_pieces(pairs[:, 0], pairs[:, 1], count)[1]
    _, first = np.unique(piece, return_index=True)
    return np.asarray(first[piece])


def _links(
    vertices: np.ndarray, start: np.ndarray, end: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the pairs of edges that meet at a vertex, (k, 2), and the angles [degrees] by which a
    line along both edges turns there, (k,).
    """
    edges = len(start)
    edge, vertex = np.tile(np.arange(edges), 2), np.concatenate([start, end])
    along = unit_vectors(vertices[end] - vertices[start])
    away = np.concatenate([along, -along])  # direction of each edge away from the vertex
    order = np.argsort(vertex, kind="stable")
    pairs, turns = [np.zeros((0, 2), dtype=int)], [np.zeros(0)]
    for step in range(1, int(np.bincount(vertex).max()) if edges else 0):
        a, b = order[:-step], order[step:]
        a, b = a[vertex[a] == vertex[b]], b[vertex[a] == vertex[b]]
        pairs.append(np.column_stack([edge[a], edge[b]]))
        cosine = -np.einsum("ij,ij->i", away[a], away[b])
        turns.append(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
    return np.concatenate(pairs), np.concatenate(turns)
