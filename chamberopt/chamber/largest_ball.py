"""Spread points over a cavity's surface, and find the largest ball that touches at each point."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.geometry.triangles import (
    EVEN_STEP,
    area_vectors,
    areas,
    interpolate,
    on_triangles,
    unit_vectors,
)

if TYPE_CHECKING:
    from sim_core import TriangleMesh


class TouchPoints(NamedTuple):
    """Points of a cavity's surface, and the largest ball that touches it at each point."""

    triangle: np.ndarray  # (p,), triangle under the point
    point: np.ndarray  # [m], (p, 3)
    normal: np.ndarray  # unit vector into the cavity, (p, 3)
    area: np.ndarray  # surface that the point stands for [m²], (p,)
    radius: np.ndarray  # of the largest ball, up to a limit [m], (p,)
    obstacle: np.ndarray  # triangle that limits the ball, else -1; (p,)
    # Cosine between the normals of point and obstacle where the ball meets them, (p,). It is -1
    # for surfaces that face each other, 0 without an obstacle.
    cosine: np.ndarray

    @property
    def centre(self) -> np.ndarray:
        """Centres of the largest balls (p, 3) [m]."""
        return np.asarray(self.point + self.radius[:, None] * self.normal)

    def select(self, rows: np.ndarray) -> TouchPoints:
        return TouchPoints(*(column[rows] for column in self))


def find_touch_points(
    mesh: TriangleMesh,
    normals: np.ndarray,
    spacing: np.ndarray,
    max_radius: float,
    overlap: float,
    chosen: np.ndarray | None = None,
) -> TouchPoints:
    """Return points on the triangles of a mesh, and the largest ball that touches at each point.

    Each triangle has at least one point.

    Args:
        normals: unit vectors of the surface at the triangles' corners, into the cavity, (m, 3, 3).
        spacing: distance between the points on each triangle [m], shape (m,).
        max_radius: limit of the balls' radius [m].
        overlap: depth to which a ball may reach into a surface [m].
        chosen: marks the triangles whose points are wanted, (m,) bool; None for all. Their points
            do not depend on the choice.
    """
    from sim_core import largest_balls

    triangle, point, area = spread_points(mesh.vertices, mesh.triangles, spacing, chosen)
    # Where the normals of all corners are equal there is nothing to interpolate.
    normal = np.ascontiguousarray(normals[triangle, 0])
    bent = np.flatnonzero((normals != normals[:, :1]).any(axis=(1, 2))[triangle])
    own = triangle[bent]
    normal[bent] = unit_vectors(interpolate(normals[own], mesh.corners[own], point[bent]))
    balls = largest_balls(mesh, point, normal, max_radius, overlap)
    # The surface of a convex round lies above its facets. Where the normal leans so far from a
    # coarse facet that a ball on it would dip into the facet itself, the ball may also stand
    # upright on the facet, as it does in the simulation. In a hollow, that ball is the smaller one.
    flat = unit_vectors(-area_vectors(mesh.vertices, mesh.triangles[own]))
    dip = max_radius * (1.0 - np.einsum("ij,ij->i", normal[bent], flat))
    leans = (dip > overlap) & (balls[0][bent] < max_radius)
    upright, flat = bent[leans], flat[leans]
    of_flat = largest_balls(mesh, point[upright], flat, max_radius, overlap)
    wider = of_flat[0] > balls[0][upright]
    normal[upright[wider]] = flat[wider]
    for old, new in zip(balls, of_flat, strict=True):
        old[upright[wider]] = new[wider]
    return TouchPoints(triangle, point, normal, area, *balls)


def spread_points(
    vertices: np.ndarray,
    triangles: np.ndarray,
    spacing: np.ndarray,
    chosen: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return points spread evenly over triangles.

    Args:
        spacing: distance between the points on each triangle [m], (m,).
        chosen: as in `find_touch_points`.
    Returns:
        For each point its triangle (p,), its position [m] (p, 3), and the area [m²] for which it
        stands (p,).
    """
    size = areas(vertices, triangles)
    count = np.where(size > 0.0, np.maximum(np.ceil(size / spacing**2), 1.0), 0.0).astype(np.int64)
    triangle = np.repeat(np.arange(len(triangles)), count)
    number = np.arange(len(triangle))
    if chosen is not None:
        number = np.flatnonzero(chosen[triangle])
        triangle = triangle[number]
    # One sequence runs over all triangles. If it began again on each triangle, the points of a row
    # of similar triangles would lie on a few lines.
    u, v = ((1.0 / 3.0 + number[:, None] * EVEN_STEP) % 1.0).T
    point = on_triangles(vertices[triangles[triangle]], u, v)
    return triangle, point, (size / np.maximum(count, 1))[triangle]
