"""Remove slivers from a surface: triangles too thin to have a direction.

A boolean operation leaves triangles 1e-12 m high where two faces nearly coincide. The rounding of
their corners is as large as their height. Their normals are therefore arbitrary, and could throw a
ball that hits them into the wall. The surface stays closed and moves by less than the height of a
sliver.
"""

from __future__ import annotations

import math

import numpy as np

from chamberopt.geometry.solids import SolidSurface
from chamberopt.geometry.triangles import heights

# m: a thousand times the rounding of a boolean at 100 mm, a millionth of the smallest ball.
MIN_HEIGHT = 1e-9
MAX_PASSES = 20  # a change can make another change possible; two or three passes are usual

Triangle = tuple[int, int, int]


def remove_slivers(surface: SolidSurface) -> SolidSurface:
    """Return the surface without triangles lower than MIN_HEIGHT, where these can be removed.

    A needle (one edge shorter than MIN_HEIGHT) is removed by merging that edge's ends. Any other
    sliver gets an edge turned: replaced by the other diagonal of its two triangles. Within one
    source triangle, the edge is turned if the thinner of the two triangles becomes thicker. Across
    two source triangles, the edge is turned only if the sliver's apex lies on it, and then both
    halves belong to the neighbour.
    """
    found = np.flatnonzero(heights(surface.vertices, surface.triangles) < MIN_HEIGHT)
    if not len(found):
        return surface
    mesh = _EditableMesh(surface, found.tolist())
    for _ in range(MAX_PASSES):
        changes = [mesh.merge(k) or mesh.turn(k) for k in mesh.slivers() if k in mesh.triangles]
        if not any(changes):
            break
    return mesh.surface()


class _Around(dict[int, set[int]]):
    """The triangles at each vertex, found when they are first asked for."""

    def __init__(self, triangles: np.ndarray) -> None:
        super().__init__()
        corners = triangles.ravel()
        self._order = np.argsort(corners, kind="stable") // 3
        self._ends = np.searchsorted(np.sort(corners), np.arange(corners.max() + 2))

    def __missing__(self, vertex: int) -> set[int]:
        own = set(self._order[self._ends[vertex] : self._ends[vertex + 1]].tolist())
        self[vertex] = own
        return own


class _EditableMesh:
    """Closed surface that keeps track of neighbours while triangles come and go.

    It reckons with plain numbers: for one triangle at a time they are far quicker than arrays.
    """

    def __init__(self, surface: SolidSurface, slivers: list[int]) -> None:
        self.vertices = surface.vertices
        self.places: list[list[float]] = surface.vertices.tolist()
        self.solid, self.source = surface.solid.copy(), surface.source.copy()
        columns = surface.triangles.T.tolist()
        self.triangles: dict[int, Triangle] = dict(enumerate(zip(*columns, strict=True)))
        self.of_edge: dict[tuple[int, int], int] = {}
        for first, second in ((0, 1), (1, 2), (2, 0)):
            self.of_edge.update(
                zip(zip(columns[first], columns[second], strict=True), self.triangles, strict=True)
            )
        self.of_vertex = _Around(surface.triangles)
        # the slivers, and the triangles that are made while slivers are removed
        self.candidates = slivers

    def slivers(self) -> list[int]:
        """Return the indices of the triangles that are now lower than MIN_HEIGHT."""
        present = (k for k in dict.fromkeys(self.candidates) if k in self.triangles)
        return [k for k in present if self._height(self.triangles[k]) < MIN_HEIGHT]

    def surface(self) -> SolidSurface:
        """Return the surface with all changes made so far."""
        kept = np.array(sorted(self.triangles))
        triangles = np.array([self.triangles[k] for k in kept.tolist()], dtype=np.int32)
        surface = SolidSurface(self.vertices, triangles, self.solid[kept], self.source[kept])
        return surface.select(np.ones(len(kept), dtype=bool))

    def merge(self, index: int) -> bool:
        """Merge the ends of a triangle's shortest edge. Return True if it was merged.

        The edge must be shorter than MIN_HEIGHT, and the surface must stay closed.
        """
        u, v = min(_edges(self.triangles[index]), key=lambda edge: self._length(*edge))
        if self._length(u, v) >= MIN_HEIGHT:
            return False
        around_u, around_v = self.of_vertex[u], self.of_vertex[v]
        if len(self._corners(around_u) & self._corners(around_v) - {u, v}) != 2:
            return False  # the surface would touch itself
        both, moved = around_u & around_v, around_v - around_u
        before = {k: self.triangles[k] for k in both | moved}
        for k in before:
            self._remove(k)
        for k in moved:
            a, b, c = (u if corner == v else corner for corner in before[k])
            self._add(k, (a, b, c))
            self.candidates.append(k)
        return True

    def turn(self, index: int) -> bool:
        """Turn the edge of a triangle that gives the thickest new pair of triangles.

        To turn an edge is to replace it by the other diagonal of its two triangles. Returns False,
        with nothing changed, if no edge gives a thicker pair than before.
        """
        options = []
        for a, b in _edges(self.triangles[index]):
            beyond = self.of_edge[b, a]
            pair = self.triangles[index], self.triangles[beyond]
            (c,), (d,) = {*pair[0]} - {a, b}, {*pair[1]} - {a, b}
            if c == d or (c, d) in self.of_edge or (d, c) in self.of_edge:
                continue
            new = (c, a, d), (d, b, c)
            same_solid = self.solid[index] == self.solid[beyond]
            one_source = same_solid and self.source[index] == self.source[beyond]
            if not (self._faces_alike(new, pair) if one_source else self._apex_on(a, b, c)):
                continue
            height = min(map(self._height, new))
            if height > min(map(self._height, pair)):
                options.append((height, beyond, new))
        if not options:
            return False
        _, beyond, new = max(options)
        for k in (index, beyond):
            self._remove(k)
        for k, triangle in zip((index, beyond), new, strict=True):
            self._add(k, triangle)
            self.candidates.append(k)
        self.solid[index], self.source[index] = self.solid[beyond], self.source[beyond]
        return True

    def _faces_alike(self, new: tuple[Triangle, Triangle], old: tuple[Triangle, Triangle]) -> bool:
        """Return True if two new triangles face the same way as the old pair.

        This holds if the pair is a convex quadrilateral.
        """
        facing = [sum(axis) for axis in zip(*map(self._area_vector, old), strict=True)]
        return all(_dot(self._area_vector(one), facing) > 0.0 for one in new)

    def _apex_on(self, a: int, b: int, c: int) -> bool:
        """Return True if vertex c is within MIN_HEIGHT of the edge a-b, between its ends."""
        along, to_apex = self._from(a, b), self._from(a, c)
        length = math.hypot(*along)
        if length == 0.0 or not 0.0 < _dot(to_apex, along) < length * length:
            return False
        return math.hypot(*_cross(along, to_apex)) < MIN_HEIGHT * length

    def _height(self, triangle: Triangle) -> float:
        """Return the smallest height of a triangle [m]; 0 if it has no area."""
        longest = max(self._length(*edge) for edge in _edges(triangle))
        if longest == 0.0:
            return 0.0
        return 2.0 * math.hypot(*self._area_vector(triangle)) / longest

    def _area_vector(self, triangle: Triangle) -> list[float]:
        a, b, c = triangle
        return [0.5 * one for one in _cross(self._from(a, b), self._from(a, c))]

    def _from(self, a: int, b: int) -> list[float]:
        """Return the vector from one vertex to another [m]."""
        return [y - x for x, y in zip(self.places[a], self.places[b], strict=True)]

    def _length(self, a: int, b: int) -> float:
        return math.dist(self.places[a], self.places[b])

    def _corners(self, indices: set[int]) -> set[int]:
        return {corner for index in indices for corner in self.triangles[index]}

    def _add(self, index: int, triangle: Triangle) -> None:
        self.triangles[index] = triangle
        for edge in _edges(triangle):
            self.of_edge[edge] = index
            self.of_vertex[edge[0]].add(index)

    def _remove(self, index: int) -> None:
        for edge in _edges(self.triangles.pop(index)):
            del self.of_edge[edge]
            self.of_vertex[edge[0]].discard(index)


def _edges(triangle: Triangle) -> tuple[tuple[int, int], ...]:
    a, b, c = triangle
    return (a, b), (b, c), (c, a)


def _dot(a: list[float], b: list[float]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: list[float], b: list[float]) -> list[float]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
