"""Smooth faces of a part and the sharp edges, called creases, between them.

A face turns smoothly: all edges between its triangles turn by less than a crease does. So how a
flat surface is divided into triangles makes no difference to its faces and creases.
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

# Degrees by which a surface turns at a crease. Facets of round surfaces turn by less.
CONVEX_CREASE, HOLLOW_CREASE = 40.0, 60.0
STRAIGHT_ON = 45.0  # degrees: where creases turn by more, a line of them ends


class Creases(NamedTuple):
    """Convex edges of the target at which the surface turns sharply.

    Attributes:
        ends: of each edge [m], shape (e, 2, 3).
        outward: unit vectors midway between the normals of the two sides, shape (e, 3).
        line: number of the line, a chain of edges without corners, shape (e,).
        faces: the smooth faces on both sides, shape (e, 2).
        of_triangle: crease at each side of each part triangle, -1 if there is none, shape (m, 3).
        at_corner: some crease that begins or ends at each corner, else -1, shape (m, 3).
    """

    ends: np.ndarray
    outward: np.ndarray
    line: np.ndarray
    faces: np.ndarray
    of_triangle: np.ndarray
    at_corner: np.ndarray


def find_faces(
    vertices: np.ndarray, triangles: np.ndarray, target: np.ndarray
) -> tuple[np.ndarray, Creases]:
    """Divide a part into smooth faces; the border of the target divides faces as creases do.

    Args:
        vertices: [m], shape (n, 3).
        triangles: normals out of the part, shape (m, 3).
        target: marks the triangles of the target, shape (m,).

    Returns:
        The face of each triangle, shape (m,), and the creases that border on the target.
    """
    keys = edge_keys(triangles)
    order = np.argsort(keys, kind="stable")
    paired = np.flatnonzero(keys[order[1:]] == keys[order[:-1]])
    one, two = order[paired], order[paired + 1]  # the two sides at each edge
    normal = unit_vectors(area_vectors(vertices, triangles))
    start, end = sides_of(triangles)[one].T
    apex = vertices[triangles[two // 3, (two % 3 + 2) % 3]]
    turn = np.degrees(
        np.arccos(np.clip(np.einsum("ij,ij->i", normal[one // 3], normal[two // 3]), -1.0, 1.0))
    )
    convex = np.einsum("ij,ij->i", apex - vertices[start], normal[one // 3]) < 0.0
    sharp = turn > np.where(convex, CONVEX_CREASE, HOLLOW_CREASE)
    joined = ~sharp & (target[one // 3] == target[two // 3])
    face = connected_pieces(one[joined] // 3, two[joined] // 3, len(triangles))[1]

    edge = np.flatnonzero(sharp & convex & (target[one // 3] | target[two // 3]))
    one, two, start, end = one[edge], two[edge], start[edge], end[edge]
    of_triangle = np.full(3 * len(triangles), -1)
    of_triangle[one] = of_triangle[two] = np.arange(len(edge))
    of_vertex = np.full(len(vertices), -1)
    of_vertex[start] = of_vertex[end] = np.arange(len(edge))
    return face, Creases(
        ends=np.stack([vertices[start], vertices[end]], axis=1),
        outward=unit_vectors(normal[one // 3] + normal[two // 3]),
        line=_lines(vertices, start, end),
        faces=np.column_stack([face[one // 3], face[two // 3]]),
        of_triangle=of_triangle.reshape(-1, 3),
        at_corner=of_vertex[triangles],
    )


def _lines(vertices: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """The line of each edge from start to end (e,): edges that go on without a corner are one."""
    edges = len(start)
    edge, vertex = np.tile(np.arange(edges), 2), np.concatenate([start, end])
    along = unit_vectors(vertices[end] - vertices[start])
    away = np.concatenate([along, -along])  # direction in which the edge leaves the vertex
    order = np.argsort(vertex, kind="stable")
    links = []
    for step in range(1, int(np.bincount(vertex).max()) if edges else 0):
        a, b = order[:-step], order[step:]
        opposite = np.einsum("ij,ij->i", away[a], away[b]) < -np.cos(np.radians(STRAIGHT_ON))
        same = (vertex[a] == vertex[b]) & opposite
        links.append(np.column_stack([edge[a[same]], edge[b[same]]]))
    a, b = np.concatenate(links).T if links else np.zeros((2, 0), dtype=int)
    return connected_pieces(a, b, edges)[1]
