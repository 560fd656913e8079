"""Removes triangles too thin to have a direction; the surface stays closed and moves by less than that.

Where two faces nearly coincide, a boolean leaves triangles 1e-12 m high: the rounding of their corners is
as large as they are, so their normals point anywhere and a ball could be thrown back into the wall.
"""

from __future__ import annotations

import numpy as np

from chamberopt.geometry.solids import SolidSurface
from chamberopt.geometry.triangles import heights

MIN_HEIGHT = 1e-9  # m: a thousand times the rounding of a boolean at 100 mm, a millionth of the smallest ball
PASSES = 20  # a change can free the next one; two or three passes are usual

Triangle = tuple[int, int, int]


def remove_slivers(surface: SolidSurface) -> tuple[SolidSurface, int, int]:
    """The surface with triangles lower than THINNEST taken out, how many there were and how many had to stay.

    A needle (one edge shorter than THINNEST) is closed by merging that edge's ends. Any other gets one edge
    turned: within one source triangle where that makes the thinner of the two triangles thicker; across
    two, only where the sliver's apex lies on the edge, and then both halves belong to the neighbour.
    """
    found = int((heights(surface.vertices, surface.triangles) < MIN_HEIGHT).sum())
    if not found:
        return surface, 0, 0
    web = _Web(surface)
    for _ in range(PASSES):
        thin = [index for index in web.alive() if web.height(web.triangles[index]) < MIN_HEIGHT]
        changes = [web.merge(index) or web.turn(index) for index in thin if index in web.triangles]
        if not any(changes):
            break
    cleaned = web.surface()
    return cleaned, found, int((heights(cleaned.vertices, cleaned.triangles) < MIN_HEIGHT).sum())


class _Web:
    """A closed surface that knows who its neighbours are while triangles come and go."""

    def __init__(self, surface: SolidSurface) -> None:
        self.vertices = surface.vertices
        self.solid, self.source = surface.solid.copy(), surface.source.copy()
        self.triangles: dict[int, Triangle] = {}
        self.of_edge: dict[tuple[int, int], int] = {}
        self.of_vertex: dict[int, set[int]] = {}
        self.suspects = np.flatnonzero(
            heights(surface.vertices, surface.triangles) < MIN_HEIGHT
        ).tolist()
        for index, (a, b, c) in enumerate(surface.triangles.tolist()):
            self._put(index, (a, b, c))

    def alive(self) -> list[int]:
        """Triangles that may be thin: those that were, and those made since."""
        return [index for index in dict.fromkeys(self.suspects) if index in self.triangles]

    def height(self, triangle: Triangle) -> float:
        return float(heights(self.vertices, np.array([triangle]))[0])

    def surface(self) -> SolidSurface:
        kept = np.array(sorted(self.triangles))
        triangles = np.array([self.triangles[index] for index in kept.tolist()], dtype=np.int32)
        everything = np.ones(len(kept), dtype=bool)
        return SolidSurface(self.vertices, triangles, self.solid[kept], self.source[kept]).select(
            everything
        )

    def merge(self, index: int) -> bool:
        """Closes the triangle's shortest edge if it is shorter than THINNEST and the surface stays closed."""
        u, v = min(_edges(self.triangles[index]), key=lambda edge: self._length(*edge))
        if self._length(u, v) >= MIN_HEIGHT:
            return False
        around_u, around_v = self.of_vertex[u], self.of_vertex[v]
        if len(self._corners(around_u) & self._corners(around_v) - {u, v}) != 2:
            return False  # the surface would touch itself
        both, moved = around_u & around_v, around_v - around_u
        before = {k: self.triangles[k] for k in both | moved}
        for k in before:
            self._take(k)
        for k in moved:
            a, b, c = (u if corner == v else corner for corner in before[k])
            self._put(k, (a, b, c))
            self.suspects.append(k)
        return True

    def turn(self, index: int) -> bool:
        """Turns the edge that leaves the thickest pair of triangles, if that is thicker than the pair now."""
        options = []
        for a, b in _edges(self.triangles[index]):
            beyond = self.of_edge[b, a]
            (c,), (d,) = {*self.triangles[index]} - {a, b}, {*self.triangles[beyond]} - {a, b}
            if c == d or (c, d) in self.of_edge or (d, c) in self.of_edge:
                continue
            new = (c, a, d), (d, b, c)
            same = (
                self.solid[index] == self.solid[beyond]
                and self.source[index] == self.source[beyond]
            )
            if not (self._faces_as(new, index, beyond) if same else self._apex_on(a, b, c)):
                continue
            now = min(self.height(self.triangles[index]), self.height(self.triangles[beyond]))
            then = min(self.height(new[0]), self.height(new[1]))
            if then > now:
                options.append((then, beyond, new))
        if not options:
            return False
        _, beyond, new = max(options)
        for k in (index, beyond):
            self._take(k)
        for k, triangle in zip((index, beyond), new, strict=True):
            self._put(k, triangle)
            self.suspects.append(k)
        self.solid[index], self.source[index] = self.solid[beyond], self.source[beyond]
        return True

    def _faces_as(self, new: tuple[Triangle, Triangle], index: int, beyond: int) -> bool:
        """Do both new triangles face as the pair does (that is: is the pair a convex quadrilateral)?"""
        facing = self._area_vector(self.triangles[index]) + self._area_vector(
            self.triangles[beyond]
        )
        return all(float(self._area_vector(triangle) @ facing) > 0.0 for triangle in new)

    def _apex_on(self, a: int, b: int, c: int) -> bool:
        """Is c within THINNEST of the inside of the edge a-b?"""
        along, to_apex = self.vertices[b] - self.vertices[a], self.vertices[c] - self.vertices[a]
        length = float(np.linalg.norm(along))
        if length == 0.0 or not 0.0 < float(to_apex @ along) < length * length:
            return False
        return float(np.linalg.norm(np.cross(along, to_apex))) < MIN_HEIGHT * length

    def _area_vector(self, triangle: Triangle) -> np.ndarray:
        a, b, c = (self.vertices[corner] for corner in triangle)
        return np.cross(b - a, c - a)

    def _length(self, a: int, b: int) -> float:
        return float(np.linalg.norm(self.vertices[a] - self.vertices[b]))

    def _corners(self, indices: set[int]) -> set[int]:
        return {corner for index in indices for corner in self.triangles[index]}

    def _put(self, index: int, triangle: Triangle) -> None:
        self.triangles[index] = triangle
        for edge in _edges(triangle):
            self.of_edge[edge] = index
            self.of_vertex.setdefault(edge[0], set()).add(index)

    def _take(self, index: int) -> None:
        for edge in _edges(self.triangles.pop(index)):
            del self.of_edge[edge]
            self.of_vertex[edge[0]].discard(index)


def _edges(triangle: Triangle) -> tuple[tuple[int, int], ...]:
    a, b, c = triangle
    return (a, b), (b, c), (c, a)
