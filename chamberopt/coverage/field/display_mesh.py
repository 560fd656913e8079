r"""Build a mesh to draw coverage on: fine where coverage changes, coarse where it does not.

The part's triangles are divided again and again, in rounds. An edge is split at its middle where
coverage changes along it, and always where it is longer than MAX_EDGE. A triangle is divided by the
number of its split edges, so that neighbours always meet at whole edges:

      /|\            /\            /\
     / | \          /__\          /__\
    /  |  \        / .-'\        /\  /\
    ---+---        -------        -------

A triangle with a split edge splits its longest edge too, which keeps triangles from becoming ever
thinner (M. C. Rivara, Int. J. Numer. Methods Eng. 20 (1984) 745).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from chamberopt.coverage.field.smooth_faces import Places
from chamberopt.geometry.triangles import areas, sides_of, unit_vectors

MIN_EDGE, MAX_EDGE = 0.5, 4.0  # diameters of the gauge
FINEST = 0.2  # diameters of the gauge, at the border of the touchable surface (narrow stripes)
# An edge is split if coverage at its middle is off the mean of its ends by more than BEND, or if
# its ends differ by more than STEP.
BEND, STEP = 0.02, 0.05
MAX_TRIANGLES = 400_000  # a part with more triangles keeps them undivided
# Angle between the normals of two corners of one face at one vertex, from which on a sharp edge is
# between them, and how many sides of such edges at one vertex are told apart.
SHARP_DEG, SIDES = 15.0, 4

Values = Callable[[Places], np.ndarray]
"""Coverage at some places, (p,); NaN where there is none."""


@dataclass(frozen=True)
class DisplayMesh:
    """A mesh whose vertices belong to one smooth face each. At creases vertices are repeated.

    Attributes:
        vertices: positions of the vertices [m], shape (v, 3).
        triangles: normals out of the part, shape (c, 3).
        normal: unit vectors out of the part, shape (v, 3).
        face: smooth face of each vertex, shape (v,).
        part_triangle: part triangle around each triangle, shape (c,).
    """

    vertices: np.ndarray
    triangles: np.ndarray
    normal: np.ndarray
    face: np.ndarray
    part_triangle: np.ndarray

    @property
    def places(self) -> Places:
        """The vertices, with normals and smooth faces, as points at which coverage is computed.

        Dents on creases (sharp edges) make a band as narrow as a dent. Values at vertices should
        leave this band out, because the drawing would smear it over whole triangles.
        """
        return Places(self.vertices, self.normal, self.face)


@dataclass(frozen=True)
class DisplayField:
    """A mesh to draw, and values of coverage and the like at its vertices."""

    mesh: DisplayMesh
    fields: dict[str, np.ndarray]  # by name, (v,) each


def display_mesh(
    vertices: np.ndarray,
    triangles: np.ndarray,
    normals: np.ndarray,
    shown: np.ndarray,
    face: np.ndarray,
    gauge: float,
    coverage: Values,
) -> tuple[DisplayMesh, np.ndarray]:
    """Divide a part's triangles until coverage can be drawn by interpolation between vertices.

    Args:
        vertices: vertices of the part [m], shape (n, 3).
        triangles: triangles of the part, shape (m, 3).
        normals: unit vectors of the surface at the triangles' corners, outward, shape (m, 3, 3).
        shown: marks the triangles on which coverage is drawn, shape (m,). Other triangles are
            divided only where they meet a shown triangle.
        face: smooth face of each triangle, shape (m,).
        gauge: area of a window, a disc in which coverage is measured [m²].
        coverage: function that returns the coverage at points, called once in each round of
            divisions.
    Returns:
        The mesh, and the number of each vertex among all points at which coverage was asked, (v,).
    """
    diameter = 2.0 * float(np.sqrt(gauge / np.pi))
    # point: number of each vertex's place, equal for all vertices at one place of a crease.
    mesh, point = _with_vertices_of_faces(vertices, triangles, normals, face)
    asked_at = np.full(len(mesh.vertices), -1)  # number of each vertex among the points asked
    value = np.zeros(0)  # coverage at these points
    settled = np.zeros(0, dtype=np.int64)  # edges that need not be split
    while True:
        edges, of_side = _edges_of(mesh.triangles)
        a, b = edges.T
        key = (a << 32) + b
        length = np.linalg.norm(mesh.vertices[a] - mesh.vertices[b], axis=1)
        drawn = np.zeros(len(edges), dtype=bool)
        drawn[of_side[shown[mesh.part_triangle]]] = True
        asked = np.flatnonzero(
            drawn & (length > FINEST * diameter) & ~np.isin(key, settled, assume_unique=True)
        )
        new, middle = np.flatnonzero(asked_at < 0), _middles(mesh, edges[asked])
        read = coverage(_joined(mesh.places.select(new), middle.places))
        read = np.where(np.isfinite(read), read, -1.0)  # -1, no value, differs from all values
        asked_at[new] = len(value) + np.arange(len(new))
        middle_at = np.full(len(edges), -1)
        middle_at[asked] = len(value) + len(new) + np.arange(len(asked))
        value = np.concatenate([value, read])
        one, two = value[asked_at[a[asked]]], value[asked_at[b[asked]]]
        mid = read[len(new) :]
        wanted = (np.abs(mid - 0.5 * (one + two)) > BEND) | (np.abs(one - two) > STEP)
        wanted &= length[asked] > MIN_EDGE * diameter
        wanted |= ((one < 0.0) != (two < 0.0)) | ((one < 0.0) != (mid < 0.0))
        wanted |= length[asked] > MAX_EDGE * diameter
        settled = np.concatenate([settled, key[asked[~wanted]]])
        split = np.zeros(len(edges), dtype=bool)
        split[asked[wanted]] = True
        split = _spread_split(split, point[edges], of_side, length)
        count = len(mesh.triangles) + int(split[of_side].sum())
        if not split.any() or count > max(MAX_TRIANGLES, len(triangles)):
            order = np.argsort(mesh.part_triangle, kind="stable")
            in_order = replace(
                mesh, triangles=mesh.triangles[order], part_triangle=mesh.part_triangle[order]
            )
            return in_order, asked_at
        point = np.concatenate([point, len(point) + _same_edge(point[edges[split]])])
        mesh = _divide(mesh, edges, of_side, split)
        asked_at = np.concatenate([asked_at, middle_at[split]])


def _with_vertices_of_faces(
    vertices: np.ndarray, triangles: np.ndarray, normals: np.ndarray, face: np.ndarray
) -> tuple[DisplayMesh, np.ndarray]:
    """Return the part as a mesh with separate vertices for each smooth face, and the index of the
    part's vertex behind each vertex.

    A face that is smooth at one place may meet itself at a sharp edge elsewhere. There too it has
    separate vertices: at a mean normal no ball would fit.
    """
    faces, corners = int(face.max()) + 1, normals.reshape(-1, 3)
    places = (triangles * np.int64(faces) + face[:, None]).ravel()
    own, corner = np.unique(places * SIDES + _side(places, corners), return_inverse=True)
    vertex, face_of = np.divmod(own // SIDES, faces)
    area = np.repeat(areas(vertices, triangles), 3)
    normal = np.zeros((len(own), 3))
    # weighted by area, so a plane beside a rounded edge stays flat
    np.add.at(normal, corner, area[:, None] * corners)
    part_triangle = np.arange(len(triangles))
    return DisplayMesh(
        vertices[vertex], corner.reshape(-1, 3), unit_vectors(normal), face_of, part_triangle
    ), vertex


def _side(places: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return on which side of a sharp edge corners of triangles lie, (k,), 0 where there is none.

    Args:
        places: number of each corner's vertex and face, (k,).
        normals: of the surface at each corner, (k, 3).
    """
    side, left = np.zeros(len(places), dtype=np.int64), np.arange(len(places))
    for number in range(SIDES):
        side[left] = number
        _, first, of_left = np.unique(places[left], return_index=True, return_inverse=True)
        alike = np.einsum("ij,ij->i", normals[left], normals[left[first]][of_left])
        left = left[alike < np.cos(np.radians(SHARP_DEG))]
        if not len(left):
            break
    return side


def _edges_of(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the edges of triangles (e, 2), the lower vertex first, and the index of the edge on
    each side of each triangle, (c, 3).
    """
    sides = np.sort(sides_of(triangles), axis=1).astype(np.int64)
    key, of_side = np.unique((sides[:, 0] << 32) + sides[:, 1], return_inverse=True)
    return np.column_stack([key >> 32, key & 0xFFFFFFFF]), of_side.reshape(-1, 3)


def _same_edge(ends: np.ndarray) -> np.ndarray:
    """Return a number for each edge, (e,). Edges between the same two points `ends` (e, 2) have
    equal numbers.
    """
    low, high = np.sort(ends, axis=1).astype(np.int64).T
    return np.unique((low << 32) + high, return_inverse=True)[1].reshape(-1)


def _spread_split(
    split: np.ndarray, ends: np.ndarray, of_side: np.ndarray, length: np.ndarray
) -> np.ndarray:
    """Return the marks of edges to split, with further edges marked.

    Further edges are the edges at the same position in a neighbouring face, and the longest edge of
    each triangle that has a split edge.

    Args:
        split: marks the edges to split, shape (e,).
        ends: points at the ends of the edges, shape (e, 2).
        of_side: edges of the triangles, shape (c, 3).
        length: length of each edge [m], shape (e,).
    """
    same = _same_edge(ends)
    longest = of_side[np.arange(len(of_side)), length[of_side].argmax(axis=1)]
    while True:
        split = np.isin(same, same[split])
        more = longest[split[of_side].any(axis=1)]
        if split[more].all():
            return split
        split[more] = True


def _middles(mesh: DisplayMesh, edges: np.ndarray) -> DisplayMesh:
    """Return new vertices in the middles of edges (e, 2), as a mesh without triangles."""
    a, b = edges.T
    return DisplayMesh(
        vertices=0.5 * (mesh.vertices[a] + mesh.vertices[b]),
        triangles=mesh.triangles[:0],
        normal=unit_vectors(mesh.normal[a] + mesh.normal[b]),
        face=mesh.face[a],
        part_triangle=mesh.part_triangle[:0],
    )


def _joined(one: Places, other: Places) -> Places:
    return Places(*(np.concatenate(pair) for pair in zip(one, other, strict=True)))


def _divide(
    mesh: DisplayMesh, edges: np.ndarray, of_side: np.ndarray, split: np.ndarray
) -> DisplayMesh:
    """Return the mesh with each triangle divided at its split edges, into two to four triangles."""
    added = _middles(mesh, edges[split])
    middle = np.full(len(edges), -1)
    middle[split] = len(mesh.vertices) + np.arange(len(added.vertices))
    new = middle[of_side]
    count = (new >= 0).sum(axis=1)
    vertices = np.concatenate([mesh.vertices, added.vertices])
    # Triangles are turned so that their split sides come first.
    first = np.where(count == 2, (new < 0).argmax(axis=1) + 1, (new >= 0).argmax(axis=1))
    turned = (first[:, None] + np.arange(3)) % 3
    corners, new = (np.take_along_axis(one, turned, axis=1) for one in (mesh.triangles, new))
    pieces, origin = [mesh.triangles[count == 0]], [mesh.part_triangle[count == 0]]

    def add(rows: np.ndarray, *triangles: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
        for columns in triangles:
            pieces.append(np.column_stack(columns)[rows])
            origin.append(mesh.part_triangle[rows])

    (a, b, c), (ab, bc, ca) = corners.T, new.T
    add(count == 1, (a, ab, c), (ab, b, c))
    add(count == 2, (ab, b, bc))
    shorter = np.linalg.norm(vertices[a] - vertices[bc], axis=1) < np.linalg.norm(
        vertices[ab] - vertices[c], axis=1
    )
    add((count == 2) & shorter, (a, ab, bc), (a, bc, c))
    add((count == 2) & ~shorter, (a, ab, c), (ab, bc, c))
    add(count == 3, (a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    return DisplayMesh(
        vertices=vertices,
        triangles=np.concatenate(pieces),
        normal=np.concatenate([mesh.normal, added.normal]),
        face=np.concatenate([mesh.face, added.face]),
        part_triangle=np.concatenate(origin),
    )
