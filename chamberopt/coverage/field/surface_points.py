"""Points spread evenly over a surface, and a test if a ball fits at a point."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.chamber.reach import TOLERATED_OVERLAP
from chamberopt.common.estimate import CONFIDENCE, normal_quantile
from chamberopt.geometry.triangles import count_up, on_triangles, unit_normals

if TYPE_CHECKING:
    from sim_core import TriangleMesh

    Rooms = TriangleMesh | tuple["StepRoom", ...]
    """The surface of the room of the balls; for a design with steps, the rooms of all of them."""

PLASTIC_NUMBER = 1.32471795724474602596  # real root of x³ = x + 1
SPARSE = 10
ON_SURFACE = 1e-3  # ball radii from the surface within which a place counts as on it


class SurfacePoints(NamedTuple):
    """Points spread evenly over triangles.

    Attributes:
        place: positions of the points [m], shape (p, 3).
        normal: unit vectors out of the part, shape (p, 3).
        triangle: triangle under each point, shape (p,).
    """

    place: np.ndarray
    normal: np.ndarray
    triangle: np.ndarray


def spread_points(
    vertices: np.ndarray, triangles: np.ndarray, area: np.ndarray, count: int
) -> SurfacePoints:
    """Spread points evenly over all triangles with an area. Equal arguments give equal points.

    The triangles are taken along a Morton curve through space, and every 1/count of their area gets
    a point. Within a triangle the points follow the additive recurrence of the plastic number.

    Args:
        area: areas of the triangles [m²], shape (m,); 0 where no points are wanted.
        count: number of points.

    Sources: G. M. Morton, "A computer oriented geodetic data base", IBM 1966. M. Roberts, "The
    unreasonable effectiveness of quasirandom sequences", 2018.
    """
    chosen = np.flatnonzero(area > 0.0)
    chosen = chosen[np.argsort(morton(vertices[triangles[chosen]].mean(axis=1)), kind="stable")]
    upto = np.cumsum(area[chosen])
    owner = np.searchsorted(upto, (np.arange(count) + 0.5) / count * upto[-1])
    triangle = chosen[np.minimum(owner, len(chosen) - 1)]
    return _within(vertices, triangles, triangle, np.arange(count))


def spread_within(
    vertices: np.ndarray, triangles: np.ndarray, area: np.ndarray, share: float, most: int
) -> SurfacePoints:
    """Spread points over each triangle with an area, at least one point on each.

    Args:
        area: areas of the triangles [m²], shape (m,); 0 where no points are wanted.
        share: area of a triangle for each point after its first [m²].
        most: largest number of such further points.
    """
    share = max(share, float(area.sum()) / most)
    count = np.where(area > 0.0, 1 + (area / share).astype(int), 0)
    triangle = np.repeat(np.arange(len(area)), count)
    number = count_up(count)
    return _within(vertices, triangles, triangle, number)


def _within(
    vertices: np.ndarray, triangles: np.ndarray, triangle: np.ndarray, number: np.ndarray
) -> SurfacePoints:
    """Return points on triangles, each at the position of its number in an evenly spread sequence,
    the additive recurrence of the plastic number.

    Args:
        triangle: triangle of each point, (p,).
        number: number of each point in the sequence, (p,).
    """
    corners = vertices[triangles[triangle]]
    place = on_triangles(corners, *_in_square(number))
    return SurfacePoints(place, unit_normals(corners), triangle)


def within_each(corners: np.ndarray, count: int) -> np.ndarray:
    """Return the positions [m] of `count` points on each triangle (n, 3, c), shape (count, n, c).

    Each triangle takes the next numbers of an evenly spread sequence. So the points of congruent
    triangles differ, and do not all miss the same spot.
    """
    return on_triangles(corners, *_in_square(np.arange(count * len(corners)).reshape(-1, count).T))


def _in_square(number: np.ndarray) -> Iterator[np.ndarray]:
    """Return the coordinates u and v, from 0 to 1, of points with these numbers in an evenly spread
    sequence, the additive recurrence of the plastic number.

    The first point comes to the middle of a triangle.
    """
    return ((number / PLASTIC_NUMBER**power + 1.0 / 3.0) % 1.0 for power in (1, 2))


def morton(places: np.ndarray) -> np.ndarray:
    """Return a number for each point (n, 3): its position along a Morton curve, on which points
    near each other mostly follow one another.

    The number interleaves the bits of the coordinates.
    """
    low = places.min(axis=0)
    cells = ((places - low) / max(float(np.ptp(places, axis=0).max()), 1e-12) * 1023).astype(int)
    code = np.zeros(len(places), dtype=np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return code


class StepRoom(NamedTuple):
    """The cavity round a part in one of several steps, and the way there from the first step.

    Attributes:
        mesh: the surface of the cavity.
        ball: radius of the smallest ball [m].
        turn, shift: rotation (3, 3), then shift (3,) [m], of the part from its pose in the first.
    """

    mesh: TriangleMesh
    ball: float
    turn: np.ndarray
    shift: np.ndarray


def ball_fits(mesh: Rooms, place: np.ndarray, normal: np.ndarray, radius: float) -> np.ndarray:
    """Return for each point on the surface of the cavity whether a ball can touch it, (p,) bool.

    A ball touches the point along the surface's normal, or upright on the facet under it. Along a
    normal that leans far from a coarse convex facet, a ball would dip into that facet.

    Args:
        mesh: the surface of the cavity; or the cavities of several steps, each with its balls, of
            which a ball must touch the point in one.
        place: the points [m], shape (p, 3). No ball fits at a point off the surface.
        normal: unit vectors into the cavity at the points, shape (p, 3).
        radius: radius of the ball [m]. Each of several steps has its own.
    """
    from sim_core import closest_points

    if isinstance(mesh, tuple):
        fits = np.zeros(len(place), dtype=bool)
        for room in mesh:
            at, out = place[~fits] @ room.turn.T + room.shift, normal[~fits] @ room.turn.T
            fits[~fits] = ball_fits(room.mesh, at, out, room.ball)
        return fits
    fits = _is_clear(mesh, place, normal, radius)
    rows = np.flatnonzero(~fits)
    own = closest_points(mesh, place[rows], ON_SURFACE * radius).triangle
    rows, own = rows[own >= 0], own[own >= 0]
    fits[rows] = _is_clear(mesh, place[rows], -unit_normals(mesh.corners[own]), radius)
    return fits


def _is_clear(
    mesh: TriangleMesh, place: np.ndarray, normal: np.ndarray, radius: float
) -> np.ndarray:
    """Return for each point whether a ball fits that touches it along the normal, (p,) bool."""
    from sim_core import closest_points

    found = closest_points(mesh, place + radius * normal, radius * (1.0 + 1e-6))
    fits = (found.triangle >= 0) & (found.distance >= radius * (1.0 - TOLERATED_OVERLAP))
    # Another spot of the surface may be nearer, also to a place outside the cavity.
    rows = np.flatnonzero(fits)
    rows = rows[np.linalg.norm(found.point[rows] - place[rows], axis=1) > ON_SURFACE * radius]
    fits[rows] = closest_points(mesh, place[rows], ON_SURFACE * radius).triangle >= 0
    return fits


def sparse_points(values: np.ndarray) -> list[np.ndarray]:
    """Return ten subsets of the values at points (p, ...): each has every tenth point, spread as
    evenly over the target as all points.
    """
    return [values[start::SPARSE] for start in range(SPARSE)]


def sampling_errors(of_some: np.ndarray) -> list[float]:
    """Return the parts, with signs, of a result's standard error from the choice of its points.

    The standard error is the root of the sum of their squares. Two results from the same points
    have similar parts, which drop out of the difference of the results.

    Args:
        of_some: the result, such as a mean coverage, from each subset of `sparse_points`.
    """
    count = len(of_some)
    errors: list[float] = ((of_some - of_some.mean()) / math.sqrt(count * (count - 1))).tolist()
    return errors


RULE_OF_THREE = 3.0  # expected number of events at which none is seen with a probability of 5 %
CERTAIN = 3.0  # standard errors from which the reach surely is more or less than a share


class Reach(NamedTuple):
    """The share of the target that a ball can touch, and its error.

    Attributes:
        share: share of the target's area.
        error: standard error of the share, by the choice of the points at which it was tested.
    """

    share: float
    error: float = 0.0

    @property
    def largest(self) -> float:
        """The largest share of the target that a ball may be able to touch, within the error."""
        return min(1.0, self.share + CERTAIN * self.error)

    def beyond(self, share: float) -> float:
        """Return by how many standard errors the touchable share of the target is above a given
        share; negative if it is below.
        """
        more = self.share - share
        return more / self.error if self.error else math.copysign(math.inf, more or -1.0)


def reach_from(fits: np.ndarray) -> Reach:
    """Return the share of the target that a ball can touch, from marks (p,) of points where a ball
    fits.

    With a probability of 5 %, a ball fits at all points although a share of 3 / p is out of reach:
    the rule of three (J. A. Hanley and A. Lippman-Hand, J. Am. Med. Assoc. 249 (1983) 1743).
    """
    scatter = sampling_errors(np.array([some.mean() for some in sparse_points(fits)]))
    least = RULE_OF_THREE / len(fits) / normal_quantile(CONFIDENCE)
    return Reach(float(fits.mean()), max(math.hypot(*scatter), least))
