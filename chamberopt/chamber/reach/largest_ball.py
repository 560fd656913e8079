"""How large a ball can touch the cavity's surface, place by place.

From each place a ball grows along the normal until something else stops it: the largest that touches there without
reaching into the surface anywhere. Found from above, shrinking it past the nearest obstacle until none is left (J. Ma,
S. W. Bae, S. Choi, The Visual Computer 28 (2012) 7).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.geometry.triangles import area_vectors

if TYPE_CHECKING:
    from sim_core import TriangleMesh

ROUNDS = 50  # of shrinking; 5 are usual
# The sequence that fills a square evenly from the first point on: M. Roberts, "The unreasonable effectiveness of
# quasirandom sequences" (2018), with the powers of the plastic number.
EVEN = np.array([0.7548776662466927, 0.5698402909980532])


class Touches(NamedTuple):
    """Places on the surface, and the largest ball that touches there.

    ``triangle`` (p,) int · ``point`` (p, 3) m · ``normal`` (p, 3) into the cavity · ``area`` (p,) m² that each stands
    for · ``radius`` (p,) m, up to the largest asked for · ``against`` (p,): the triangle that stops it there, else -1 ·
    ``opposite`` (p,): cosine between the normal and the direction it is stopped in, -1 from straight across, else 0.
    """

    triangle: np.ndarray
    point: np.ndarray
    normal: np.ndarray
    area: np.ndarray
    radius: np.ndarray
    against: np.ndarray
    opposite: np.ndarray

    @property
    def centre(self) -> np.ndarray:
        """Of the largest balls (p, 3) [m]."""
        return np.asarray(self.point + self.radius[:, None] * self.normal)

    def only(self, chosen: np.ndarray) -> Touches:
        """Some of them."""
        return Touches(*(column[chosen] for column in self))


def touches(mesh: TriangleMesh, spacing: np.ndarray, most: float, forgiven: float) -> Touches:
    """Places about ``spacing`` (m,) [m] apart on each triangle, at least one, and the largest balls there.

    ``most`` [m]: radius beyond which it does not matter; ``forgiven`` [m]: so far a ball may reach into a surface.
    """
    triangle, point, area = spread(mesh.vertices, mesh.triangles, spacing)
    outward = area_vectors(mesh.vertices, mesh.triangles)
    size = np.linalg.norm(outward, axis=1)
    normal = -np.divide(
        outward, size[:, None], out=np.zeros_like(outward), where=size[:, None] > 0.0
    )[triangle]
    return Touches(
        triangle, point, normal, area, *largest_balls(mesh, point, normal, most, forgiven)
    )


def spread(
    vertices: np.ndarray, triangles: np.ndarray, spacing: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places spread evenly over triangles: triangle (p,), point (p, 3) [m], and the area (p,) [m²] of each."""
    size = np.linalg.norm(area_vectors(vertices, triangles), axis=1)
    count = np.where(size > 0.0, np.maximum(np.ceil(size / spacing**2), 1.0), 0.0).astype(np.int64)
    triangle = np.repeat(np.arange(len(triangles)), count)
    # one sequence through all: were it begun anew on each, a row of like triangles would be looked at in a few lines
    u, v = ((1.0 / 3.0 + np.arange(len(triangle))[:, None] * EVEN) % 1.0).T
    fold = u + v > 1.0  # the square's other half falls onto the triangle
    u, v = np.where(fold, 1.0 - u, u), np.where(fold, 1.0 - v, v)
    a, b, c = (vertices[triangles[triangle, k]] for k in range(3))
    return (
        triangle,
        a + u[:, None] * (b - a) + v[:, None] * (c - a),
        (size / np.maximum(count, 1))[triangle],
    )


def largest_balls(
    mesh: TriangleMesh, point: np.ndarray, normal: np.ndarray, most: float, forgiven: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Radius, against and opposite (p,) of the largest ball that touches at each point, as in Touches.

    A ball of radius R that touches at p reaches ``forgiven`` > 0 deep at q where |q - p - R n| = R - forgiven.
    """
    from sim_core import closest_points

    radius = np.full(len(point), most)
    against, opposite = np.full(len(point), -1), np.zeros(len(point))
    asked = np.arange(len(point))
    for _ in range(ROUNDS):
        centre = point[asked] + radius[asked, None] * normal[asked]
        found = closest_points(mesh, centre, radius[asked] - forgiven)
        hit = found.triangle >= 0
        asked = asked[hit]
        if not len(asked):
            break
        to = found.point[hit] - point[asked]
        ahead = np.einsum("ij,ij->i", to, normal[asked]) - forgiven
        square = np.einsum("ij,ij->i", to, to) - forgiven**2
        fits = np.divide(
            square, 2.0 * ahead, out=np.zeros_like(ahead), where=(ahead > 0.0) & (square > 0.0)
        )
        against[asked] = found.triangle[hit]
        shrunk = fits < (1.0 - 1e-9) * radius[asked]
        radius[asked] = np.minimum(np.maximum(fits, forgiven), radius[asked])
        across = (
            np.einsum("ij,ij->i", point[asked] - found.point[hit], normal[asked]) + radius[asked]
        )
        opposite[asked] = across / np.maximum(radius[asked] - forgiven, forgiven)
        asked = asked[shrunk & (fits > forgiven)]
    return radius, against, opposite
