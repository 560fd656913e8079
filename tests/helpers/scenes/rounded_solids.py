"""Solids of lines and arcs, drawn out or turned, with meshes of them and their exact surface.

An outline is a polygon of which corners are rounded: an arc for each, convex or hollow. A solid is
the outline drawn out along z, or turned about z, x then being the distance from the axis. Meshes
have their vertices on the exact surface: strips as CAD programs write them, or irregular triangles
by Gmsh.
"""

from __future__ import annotations

import functools
import multiprocessing
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from typing import NamedTuple

import manifold3d
import numpy as np

from chamberopt.geometry.triangles import unit_normals, unit_vectors

Mesh = tuple[np.ndarray, np.ndarray]  # vertices (n, 3) and triangles (m, 3), normals outward


class Piece(NamedTuple):
    """A line, or an arc that turns by no more than 180 degrees; the material is on its left."""

    start: np.ndarray  # (2,)
    end: np.ndarray  # (2,)
    centre: np.ndarray  # (2,), of an arc
    turn: float  # to the left [rad], 0 of a line

    @property
    def radius(self) -> float:
        return float(np.linalg.norm(self.start - self.centre))

    def points(self, step: float, rng: np.random.Generator | None = None) -> np.ndarray:
        """Points from the start on, without the end, no more than a step [rad] apart, (k, 2)."""
        count = max(1, int(np.ceil(abs(self.turn) / step - 1e-9)))
        part = np.arange(count) / count
        if rng is not None and self.turn:
            part[1:] += rng.uniform(-0.25, 0.25, count - 1) / count
        if not self.turn:
            return self.start[None]
        angle = self.turn * part
        along, across = self.start - self.centre, _left(self.start - self.centre)
        return self.centre + np.cos(angle)[:, None] * along + np.sin(angle)[:, None] * across

    def nearest(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distances (p,) of places (p, 2), and the piece's normals (p, 2) out of the material."""
        if not self.turn:
            along = self.end - self.start
            part = np.clip((places - self.start) @ along / (along @ along), 0.0, 1.0)
            distance = np.linalg.norm(places - self.start - part[:, None] * along, axis=1)
            normal = -_left(along) / np.linalg.norm(along)
            return distance, np.tile(normal, (len(places), 1))
        away = places - self.centre
        middle = self.points(0.5 * abs(self.turn))[1] - self.centre
        angle = np.arctan2(_left(middle) @ away.T, middle @ away.T)
        distance = np.abs(np.linalg.norm(away, axis=1) - self.radius)
        distance[np.abs(angle) > 0.5 * abs(self.turn) + 1e-9] = np.inf
        return distance, np.sign(self.turn) * unit_vectors(away)


Outline = list[Piece]


def outline(corners: Sequence[Sequence[float]] | np.ndarray) -> Outline:
    """The outline of a polygon, counter-clockwise, of corners (x, y) or (x, y, radius)."""
    at = np.array([corner[:2] for corner in corners], dtype=float)
    radius = np.array([corner[2] if len(corner) > 2 else 0.0 for corner in corners])
    into = unit_vectors(at - np.roll(at, 1, axis=0))
    onward = np.roll(into, -1, axis=0)
    turn = np.arctan2(into[:, 0] * onward[:, 1] - into[:, 1] * onward[:, 0],
                      (into * onward).sum(axis=1))  # fmt: skip
    cut = (radius * np.tan(0.5 * np.abs(turn)))[:, None]
    first, last = at - cut * into, at + cut * onward
    pieces = []
    for k in range(len(at)):
        if radius[k]:
            centre = first[k] + np.sign(turn[k]) * radius[k] * _left(into[k])
            pieces.append(Piece(first[k], last[k], centre, float(turn[k])))
        start = first[(k + 1) % len(at)]
        if np.linalg.norm(start - last[k]) > 1e-9 * np.abs(at).max():
            pieces.append(Piece(last[k], start, last[k], 0.0))
    return pieces


def regular_polygon(count: int, radius: float) -> Outline:
    angle = 2.0 * np.pi * np.arange(count) / count
    return outline([(radius * np.cos(a), radius * np.sin(a)) for a in angle])


def circle(radius: float, x: float = 0.0) -> Outline:
    r = radius
    return outline([(x - r, -r, r), (x + r, -r, r), (x + r, r, r), (x - r, r, r)])


@dataclass(frozen=True)
class Solid:
    """An outline drawn out along z from 0 to a height, or turned about z where that is None."""

    outline: Outline
    height: float | None = None

    def strips(
        self, step: float, around: float | None = None, rng: np.random.Generator | None = None
    ) -> Mesh:
        """A mesh of quadrangles between rows of vertices.

        Args:
            step: turn of the facets of arcs [rad].
            around: the same about the axis of a solid that is turned.
            rng: for facets of unequal width and diagonals either way.
        """
        pieces = [one for one in self.outline if not self._is_axis(one)]
        points = np.concatenate([one.points(step, rng) for one in pieces])
        closed = len(pieces) == len(self.outline)
        if not closed:
            # From the end of the axis on round to its start.
            gap = next(k for k, one in enumerate(self.outline) if self._is_axis(one))
            pieces = [*self.outline[gap + 1 :], *self.outline[:gap]]
            points = np.concatenate(
                [*[one.points(step, rng) for one in pieces], pieces[-1].end[None]]
            )
        if self.height is None:
            count = int(np.ceil(2.0 * np.pi / (around or step) - 1e-9))
            angle = 2.0 * np.pi * np.arange(count) / count
            if rng is not None:
                angle += rng.uniform(-0.2, 0.2, count) * 2.0 * np.pi / count
            grid = np.stack(
                [
                    points[:, None, 0] * np.cos(angle),
                    points[:, None, 0] * np.sin(angle),
                    np.tile(points[:, None, 1], (1, count)),
                ],
                axis=2,
            )
            return _welded(
                grid.reshape(-1, 3), _grid(grid.shape[0], grid.shape[1], closed, True, rng)
            )
        levels = [np.c_[points, np.full(len(points), z)] for z in (0.0, self.height)]
        return stacked(np.stack(levels, axis=1), rng)

    def irregular(self, step: float, size: float) -> Mesh:
        """A mesh by Gmsh, of facets that turn by a step [rad] on rounds and of a size elsewhere."""
        vertices, triangles = _gmsh_process().submit(_mesh_with_gmsh, self, step, size).result()
        outward = self.nearest(vertices[triangles].mean(axis=1))[1]
        if self.height is not None:
            z = vertices[triangles][:, :, 2]
            outward[(z < 1e-9 * self.height).all(axis=1)] = [0.0, 0.0, -1.0]
            outward[(z > (1.0 - 1e-9) * self.height).all(axis=1)] = [0.0, 0.0, 1.0]
        inside_out = (unit_normals(vertices[triangles]) * outward).sum(axis=1) < 0.0
        triangles[inside_out] = triangles[inside_out][:, ::-1]
        return vertices, triangles

    def nearest(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distances (p,) of places (p, 3) from the sides, and their normals (p, 3) there."""
        if self.height is None:
            radius = np.hypot(places[:, 0], places[:, 1])
            flat = np.c_[radius, places[:, 2]]
            out = unit_vectors(places[:, :2])
        else:
            flat = places[:, :2]
        found = [one.nearest(flat) for one in self.outline if not self._is_axis(one)]
        which = np.argmin([distance for distance, _ in found], axis=0)
        rows = np.arange(len(places))
        distance = np.array([distance for distance, _ in found])[which, rows]
        normal = np.array([normal for _, normal in found])[which, rows]
        if self.height is None:
            return distance, np.c_[normal[:, :1] * out, normal[:, 1]]
        return distance, np.c_[normal, np.zeros(len(places))]

    def _is_axis(self, piece: Piece) -> bool:
        ends = abs(piece.start[0]) + abs(piece.end[0])
        return self.height is None and not piece.turn and ends < 1e-12


@functools.cache
def _gmsh_process() -> ProcessPoolExecutor:
    """A process for Gmsh, whose faults would end that of the tests without a word."""
    return ProcessPoolExecutor(1, multiprocessing.get_context("spawn"))


def _mesh_with_gmsh(solid: Solid, step: float, size: float) -> Mesh:
    import gmsh

    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 2.0 * np.pi / step)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        gmsh.option.setNumber("Mesh.RandomSeed", 1)
        occ = gmsh.model.occ

        def point(at: np.ndarray) -> int:
            place = (at[0], at[1], 0.0) if solid.height is not None else (at[0], 0.0, at[1])
            return int(occ.addPoint(*place))

        starts = [point(one.start) for one in solid.outline]
        curves = [
            occ.addCircleArc(one, point(piece.centre), two) if piece.turn else occ.addLine(one, two)
            for piece, one, two in zip(solid.outline, starts, [*starts[1:], starts[0]], strict=True)
        ]
        face = (2, occ.addPlaneSurface([occ.addCurveLoop(curves)]))
        if solid.height is None:
            occ.revolve([face], 0, 0, 0, 0, 0, 1, 2.0 * np.pi)
            occ.remove([face])
        else:
            occ.extrude([face], 0, 0, solid.height)
        occ.synchronize()
        gmsh.model.mesh.generate(2)
        tags, places, _ = gmsh.model.mesh.getNodes()
        _, corners = gmsh.model.mesh.getElementsByType(2)
    finally:
        gmsh.finalize()
    row = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    row[tags] = np.arange(len(tags))
    return _welded(places.reshape(-1, 3), row[corners].reshape(-1, 3))


def stacked(rows: np.ndarray, rng: np.random.Generator | None = None) -> Mesh:
    """The solid between closed outlines above one another.

    Args:
        rows: points of each outline, counter-clockwise from above, shape (points, outlines, 3).
        rng: for diagonals either way.
    """
    triangles = _grid(rows.shape[0], rows.shape[1], True, False, rng)[:, ::-1]
    last = rows.shape[1] - 1
    low, high = (
        rows.shape[1] * np.asarray(manifold3d.triangulate([rows[:, k, :2]]), dtype=np.int64) + k
        for k in (0, last)
    )
    return _welded(rows.reshape(-1, 3), np.concatenate([triangles, low[:, ::-1], high]))


def staggered(
    low: float, high: float, height: float, count: int, rng: np.random.Generator | None = None
) -> Mesh:
    """A frustum of rings of vertices, each half a step ahead of the one below, with nearly even
    triangles. The edges along a ring are valleys.

    Args:
        low, high: radii of the ends.
        count: vertices in a ring.
        rng: for vertices that are off by up to a fifth of a step.
    """
    rows = max(2, round(height / (np.sqrt(3.0) / 2.0 * np.pi * (low + high) / count)))
    ring, k = np.divmod(np.arange((rows + 1) * count), count)
    off = np.zeros((2, len(k))) if rng is None else rng.uniform(-0.2, 0.2, (2, len(k)))
    off[1, (ring == 0) | (ring == rows)] = 0.0
    z = height * (ring + off[1]) / rows
    radius, angle = low + (high - low) * z / height, 2.0 * np.pi * (k + 0.5 * ring + off[0]) / count
    vertices = np.c_[radius * np.cos(angle), radius * np.sin(angle), z]
    below, step = np.arange(rows * count), np.where(k[: rows * count] == count - 1, 1 - count, 1)
    right, above = below + step, below + count
    sides = np.r_[np.c_[below, right, above], np.c_[right, above + step, above]]
    ends = [
        np.asarray(manifold3d.triangulate([vertices[at : at + count, :2]]), dtype=np.int64) + at
        for at in (0, count * rows)
    ]
    return _welded(vertices, np.concatenate([sides, ends[0][:, ::-1], ends[1]]))


def _left(vector: np.ndarray) -> np.ndarray:
    return np.stack([-vector[..., 1], vector[..., 0]], axis=-1)


def _grid(
    rows: int, columns: int, closed: bool, around: bool, rng: np.random.Generator | None
) -> np.ndarray:
    """Two triangles in each quadrangle of a grid, which may close both ways, (m, 3).

    Their normals are along the rows' direction x the columns', reversed.
    """
    i = np.arange(rows if closed else rows - 1).repeat(columns if around else columns - 1)
    j = np.arange(len(i)) % (columns if around else columns - 1)
    k, m = (i + 1) % rows, (j + 1) % columns
    a, b, c, d = i * columns + j, i * columns + m, k * columns + m, k * columns + j
    other = np.zeros(len(i), dtype=bool) if rng is None else rng.random(len(i)) < 0.5
    first = np.where(other[:, None], np.c_[a, b, d], np.c_[a, b, c])
    second = np.where(other[:, None], np.c_[b, c, d], np.c_[a, c, d])
    return np.stack([first, second], axis=1).reshape(-1, 3)


def _welded(vertices: np.ndarray, triangles: np.ndarray) -> Mesh:
    """The mesh with equal vertices made one, outside out, and without triangles of no area."""
    size = np.abs(vertices).max()
    _, first, numbers = np.unique(
        np.round(vertices / (1e-9 * size)).astype(np.int64),
        axis=0,
        return_index=True,
        return_inverse=True,
    )
    triangles = np.asarray(numbers).reshape(-1)[triangles]
    kept = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    return vertices[first], triangles[kept]


def on_sides(mesh: Mesh, solid: Solid) -> np.ndarray:
    """Marks (m,) the triangles that are not on an end of a solid that is drawn out."""
    if solid.height is None:
        return np.ones(len(mesh[1]), dtype=bool)
    return np.asarray(np.abs(unit_normals(mesh[0][mesh[1]])[:, 2]) < 0.5)
