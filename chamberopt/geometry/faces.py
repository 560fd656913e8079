"""Divide a surface into faces: up to where it turns by an angle, or as a CAD file has them."""

from __future__ import annotations

from functools import cached_property
from typing import Literal

import numpy as np

from chamberopt.geometry.triangles import (
    area_vectors,
    areas,
    connected_pieces,
    side_pairs,
    unit_vectors,
)

Border = float | Literal["cad_face", "fillet"]
"""What parts a surface into faces: a crease angle [degrees], its CAD file, or its fillets."""

SAME = 0.02  # relative difference of size and extent below which faces count as alike
# A face of less than TINY of the whole area is a facet rather than a face. Where facets are more
# than FACETED of the area, the surface is too coarse to be parted at such edges.
TINY, FACETED = 1e-3, 0.2


class Faces:
    """Faces of a closed surface, each a number from 0 on.

    Args:
        vertices: vertex positions [m], shape (n, 3).
        triangles: vertex indices, shape (m, 3).
        border: largest angle between the normals of neighbours in one face [degrees], or the number
            of each triangle's face in a CAD file, (m,).
        uncut: number of each triangle's face in a CAD file, (m,), -1 for none. An angle cuts none
            of these faces. None: there are none.
    """

    def __init__(
        self,
        vertices: np.ndarray,
        triangles: np.ndarray,
        border: float | np.ndarray,
        uncut: np.ndarray | None = None,
    ) -> None:
        normal = unit_vectors(area_vectors(vertices, triangles))
        self._neighbours = side_pairs(triangles) // 3  # (e, 2)
        one, two = self._neighbours.T
        if isinstance(border, np.ndarray):
            smooth = border[one] == border[two]
        else:
            smooth = np.einsum("ij,ij->i", normal[one], normal[two]) > np.cos(np.radians(border))
            # A triangle without area has no normal. It belongs to the faces of its neighbours.
            smooth |= ~normal[one].any(axis=1) | ~normal[two].any(axis=1)
            if uncut is not None:
                smooth |= (uncut[one] == uncut[two]) & (uncut[one] >= 0)
        self.of_triangle = connected_pieces(one[smooth], two[smooth], len(triangles))[1]  # (m,)
        self.count = int(self.of_triangle.max()) + 1
        self._corners, self._normal = vertices[triangles], normal
        self._weight = areas(vertices, triangles)
        self.area = np.bincount(self.of_triangle, self._weight)  # [m²], (count,)

    @property
    def are_facets(self) -> np.ndarray:
        """Marks the faces too small to be faces, (count,); none where they are little in all."""
        tiny = self.area < TINY * self.area.sum()
        return np.asarray(tiny & (self.area[tiny].sum() > FACETED * self.area.sum()))

    def at(self, place: np.ndarray) -> tuple[int, float]:
        """Return the number of the face closest to a point (3,) [m], and its distance [m]."""
        from sim_core import closest_on_each

        points = closest_on_each(self._corners, np.broadcast_to(place, (len(self._corners), 3)))
        away = np.linalg.norm(points - place, axis=1)
        return int(self.of_triangle[away.argmin()]), float(away.min())

    def normal(self, face: int) -> np.ndarray:
        """Return the mean unit normal (3,) of a face; zero if it goes all round, as a cylinder."""
        own = self.of_triangle == face
        mean = self._weight[own] @ self._normal[own] / max(float(self._weight[own].sum()), 1e-30)
        length = float(np.linalg.norm(mean))
        return np.asarray(mean / length if length > SAME else 0.0 * mean)

    def place(self, face: int) -> np.ndarray:
        """Return a point (3,) [m] on a face: the middle of its triangle closest to its centre."""
        own = np.flatnonzero(self.of_triangle == face)
        middles = self._corners[own].mean(axis=1)
        middle = np.average(middles, axis=0, weights=self._weight[own] + 1e-30)
        return np.asarray(middles[np.linalg.norm(middles - middle, axis=1).argmin()])

    def place_mm(self, face: int) -> list[float]:
        """Return the point of `place` in mm, to the micrometre, as design files have it."""
        return [round(1e3 * float(x), 3) + 0.0 for x in self.place(face)]

    def free_of(self, marked: np.ndarray) -> np.ndarray:
        """Return which faces (count,) have none of the marked triangles (m,)."""
        return np.asarray(np.bincount(self.of_triangle, marked) == 0.0)

    @cached_property
    def area_vectors(self) -> np.ndarray:
        """Sum of the outward area vectors of each face [m²], (count, 3)."""
        vectors = self._normal * self._weight[:, None]
        sums = [np.bincount(self.of_triangle, one, self.count) for one in vectors.T]
        return np.stack(sums, axis=1)

    def are_flat(self, angle: float) -> np.ndarray:
        """Return which faces (count,) are flat: those that bend have a shorter sum of area vectors.

        Args:
            angle: largest angle in a flat face [degrees].
        """
        length = np.linalg.norm(self.area_vectors, axis=1)
        return np.asarray(length > np.cos(np.radians(angle)) * self.area)

    def is_facet(self, face: int, angle: float) -> bool:
        """Return whether a flat face is a facet of a round surface, as of a scan.

        Round it the surface then goes on for more than the face's own area before it turns away.
        Beside a flat face with rounded edges there is less.

        Args:
            angle: between the normals of the face and of what belongs to the same round [degrees].
        """
        near = self._normal @ self.normal(face) > np.cos(np.radians(angle))
        one, two = self._neighbours[near[self._neighbours].all(axis=1)].T
        piece = connected_pieces(one, two, len(near))[1]
        own = piece[self.of_triangle == face][0]
        return bool(self._weight[piece == own].sum() > 2.0 * self.area[face])

    def alike(self, face: int) -> np.ndarray:
        """Return marks (count,) of the faces that are congruent with the face of number `face`.

        Mirror images count as congruent.
        """
        figures = self._figures
        scale = np.maximum(np.abs(figures[face]), 1e-12 * np.abs(figures).max())
        return np.asarray((np.abs(figures - figures[face]) <= SAME * scale).all(axis=1))

    @cached_property
    def _figures(self) -> np.ndarray:
        """Five lengths [m] of each face by which congruent faces are recognised, (count, 5).

        They are the root of the area, the extents along the three principal axes, and the root of
        the area times the length of the mean unit normal.
        """
        face, corners = self.of_triangle, self._corners
        weight = self._weight / np.maximum(self.area, 1e-30)[face]

        def per_face(values: np.ndarray) -> np.ndarray:
            """Return the sums (count, ...) of values (m, ...) over the triangles of each face."""
            flat = values.reshape(len(values), -1)
            sums = [np.bincount(face, column, self.count) for column in flat.T]
            return np.stack(sums, axis=1).reshape(self.count, *values.shape[1:])

        middle = per_face(weight[:, None] * corners.mean(axis=1))
        offset = corners - middle[face][:, None]
        # The second moment of a triangle's area is the sum over its corners and its middle.
        total = np.concatenate([offset, offset.mean(axis=1, keepdims=True) * 3.0], axis=1)
        moments = per_face(weight[:, None, None] * np.einsum("tki,tkj->tij", total, total) / 12.0)
        extent = np.sqrt(np.maximum(np.linalg.eigvalsh(moments), 0.0))
        size = np.sqrt(self.area)
        # The thinnest extent of a flat face is rounding. Differences count against the face's size.
        extent[extent < SAME * size[:, None]] = 0.0
        bend = np.linalg.norm(per_face(weight[:, None] * self._normal), axis=1)
        return np.column_stack([size, extent, size * bend])
