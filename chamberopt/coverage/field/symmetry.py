"""Find turns about the chamber's axis that change nothing, and count equivalent points together.

Notation
    n       number of turns, by multiples of 2 pi / n, that leave cavity, target and sonotrode as
            they are (``copies``)
    window  disc of the surface round a point of the target, in which dents are counted

A turn takes each point of the target to a point that is hit equally often and equally hard. So the
n windows of such points count as one window of n times the area, which gets n times the dents from
one simulation. All impacts and all windows are turned into one sector of the chamber. Impacts near
the sector's borders count again beyond the borders. The mean over the target does not change, and
the scatter from point to point is smaller. Nothing is lost: which of the n windows a dent lies in
tells nothing about their common rate (Rao and Blackwell; E. L. Lehmann and G. Casella, "Theory of
Point Estimation", Springer 1998, section 1.7).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.design.shape_surface import TAG_PART
from chamberopt.geometry.triangles import areas

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from sim_core import TriangleMesh

MAX_COPIES = 360
TOLERANCE = 2e-7  # m, largest difference between alike surfaces, from a file's rounding
INSIDE = 0.01  # of the way from a corner to the middle
FEW = 40  # triangles that are tried before all triangles


@dataclass(frozen=True)
class Symmetry:
    """A cavity that looks the same after a turn about its axis by 1 / `copies` of a full turn."""

    copies: int
    mesh: TriangleMesh  # of the chamber
    source: np.ndarray  # part triangle under each triangle of the mesh, -1 for walls, (t,)

    @property
    def step(self) -> float:
        """The angle of the smallest turn [rad]."""
        return 2.0 * np.pi / self.copies

    def into_sector(self, place: np.ndarray, margin: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Return the turns that bring points into the sector of the cavity round the x axis.

        Args:
            place: the points [m], (k, 3).
            margin: distance from the sector [m] up to which a turned point is returned too.
        Returns:
            Row numbers of `place`, and the number of steps (smallest turns) by which the point in
            each of these rows is turned. Each row comes once, with the turn into the sector. Rows
            that another turn brings closer to the sector than `margin` come again after these.
        """
        angle = np.arctan2(place[:, 1], place[:, 0])
        sector = np.round(angle / self.step)
        beside, radius = angle - self.step * sector, np.hypot(place[:, 0], place[:, 1])
        rows, turns = [np.arange(len(place))], [-sector]
        # Only a place near a border of its own sector can be near another sector.
        close = np.flatnonzero(_off(0.5 * self.step - np.abs(beside), radius) < margin)
        for other in range(1, self.copies):
            around = np.abs((beside[close] + other * self.step + np.pi) % (2.0 * np.pi) - np.pi)
            near = close[_off(around - 0.5 * self.step, radius[close]) < margin]
            rows.append(near)
            turns.append(other - sector[near])
        return np.concatenate(rows), (np.concatenate(turns) % self.copies).astype(int)

    def reaches_sector(self, corners: np.ndarray, margin: float) -> np.ndarray:
        """Return whether triangles (k, 3, 3) [m] may come closer to the sector than `margin` [m],
        (k,) bool.
        """
        middle = corners.mean(axis=1)
        size = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
        beyond = np.abs(np.arctan2(middle[:, 1], middle[:, 0])) - 0.5 * self.step
        return np.asarray(_off(beyond, np.hypot(middle[:, 0], middle[:, 1])) < margin + size)

    def on_each(self, face: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return a point on each smooth face: the middle of its largest triangle that bounds the
        cavity.

        Args:
            face: number of the smooth face of each triangle of the part, (m,).

        Returns:
            Points (f, 3) [m], and the triangle of the part under each, (f,).
        """
        own = np.flatnonzero(self.source >= 0)
        size = areas(self.mesh.vertices, self.mesh.triangles[own])
        order = np.argsort(-size, kind="stable")
        _, first = np.unique(face[self.source[own[order]]], return_index=True)
        chosen = own[order[first]]
        return self.mesh.corners[chosen].mean(axis=1), self.source[chosen]

    def turned(self, place: np.ndarray, turn: np.ndarray) -> np.ndarray:
        """Return points or directions (k, 3) turned about the axis by `turn` (k,) times the
        smallest turn.
        """
        return turn_about_axis(place, turn * self.step)

    def triangles_at(self, place: np.ndarray, reach: float = 10.0 * TOLERANCE) -> np.ndarray:
        """Return the index of the part triangle at each point (k, 3), or -1 if the point is off the
        part's surface in the cavity, (k,).

        Args:
            reach: largest distance of the triangle from the point [m].
        """
        from sim_core import closest_points

        found = closest_points(self.mesh, place, reach, TAG_PART).triangle
        return np.where(found < 0, -1, self.source[found])


def _off(angle: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Return the distance [m] of points from a half plane through the axis, (k,).

    The points are at this angle to the half plane [rad] and at this radius from the axis [m].
    """
    return np.asarray(radius * np.sin(np.clip(angle, 0.0, 0.5 * np.pi)))


def find_symmetry(chamber: Chamber, mesh: TriangleMesh) -> Symmetry | None:
    """Return the symmetry by the smallest turn about the axis that leaves a chamber as it is, or
    None if there is no such turn.

    Turned corners of triangles must lie on the surface again. Turned points just inside the corners
    must lie on a triangle of the same kind (part, wall or sonotrode), in the target or outside it
    as before.

    Args:
        mesh: surface of the chamber.
    """
    from sim_core import closest_points

    vertices, corners = chamber.vertices, chamber.vertices[chamber.triangles]
    inside = corners + INSIDE * (corners.mean(axis=1, keepdims=True) - corners)
    looks = chamber.tags + 256 * chamber.on_target.astype(int)

    def on_surface(places: np.ndarray, angle: float | np.ndarray) -> np.ndarray:
        turned = turn_about_axis(places, angle)
        return np.asarray(closest_points(mesh, turned, TOLERANCE).triangle)

    def is_kept(angle: float, triangles: np.ndarray) -> bool:
        ends = np.unique(chamber.triangles[triangles])
        if (on_surface(vertices[ends], angle) < 0).any():
            return False
        found = on_surface(inside[triangles].reshape(-1, 3), angle)
        same = looks[found] == np.repeat(looks[triangles], 3)
        return bool(((found >= 0) & same).all())

    count = len(corners)
    few = np.linspace(0, count - 1, min(FEW, count)).astype(int)
    tried = np.arange(MAX_COPIES, 1, -1)
    # Corners of few triangles, turned by all angles at once, leave few angles to try.
    ends = np.unique(chamber.triangles[few])
    place = np.tile(vertices[ends], (len(tried), 1))
    angles = np.repeat(2.0 * np.pi / tried, len(ends))
    kept = (on_surface(place, angles) >= 0).reshape(len(tried), -1).all(axis=1)
    for copies in tried[kept].tolist():
        angle = 2.0 * np.pi / copies
        if is_kept(angle, few) and is_kept(angle, np.arange(count)):
            return Symmetry(copies, mesh, chamber.source)
    return None


def turn_about_axis(place: np.ndarray, angle: float | np.ndarray) -> np.ndarray:
    """Return points (k, 3) turned about the z axis by angles [rad], one for each point (k,) or one
    for all.
    """
    cosine, sine = np.cos(angle), np.sin(angle)
    x, y, z = place.T.astype(float)
    return np.stack([cosine * x - sine * y, sine * x + cosine * y, z], axis=1)
