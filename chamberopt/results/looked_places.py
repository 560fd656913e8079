"""Find where to look at a peened target: where the fewest dents are expected, in several places."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.chamber.largest_ball import spread_points
from chamberopt.coverage.coverage_from_impacts import coverage_from_dent_density
from chamberopt.geometry.triangles import interpolate, unit_vectors

if TYPE_CHECKING:
    from chamberopt.results.arrays_file import ResultArrays

MOST_PLACES = 3
# Patches are what cubes of the target's diagonal over this hold of one face, such as a root between
# teeth. Their dents are told as a mean over windows, so many at least: single windows scatter, and
# the least of many would tell of luck. Places are two cubes apart.
PATCHES = 8.0
POINTS = 8.0  # on the side of a cube, of which a patch is made
LEAST_WINDOWS = 3.0
SHORT = 0.25  # side of the target over its longest, below which it has no ends along that side
OFF = 1e-5  # of the part's size, by which a ray begins off the surface
ACROSS = 0.7  # share of a normal along an axis from which on the axis is not along the surface


class LookedPlace(NamedTuple):
    """A patch of the target to look at.

    Attributes:
        at: its middle on the surface, off the target's edges, in the chamber's frame [m], (3,).
        normal: out of the part, (3,).
        along: axis of the chamber, 0 to 2, and where the place is along it, from -1 at the target's
            lower end to 1 at its upper end. It is the axis, of those along the surface there, on
            which the place is nearest to an end.
        density: of the dents expected in it after the treatment time, such that its coverage is
            1 - exp(-density).
        to_part: from it along its normal to another place of the part [m]; inf if there is none.
    """

    at: np.ndarray
    normal: np.ndarray
    along: tuple[int, float]
    density: float
    to_part: float = math.inf

    def coverage(self, times: float) -> float:
        """Return the expected coverage after a multiple of the treatment time."""
        return float(coverage_from_dent_density(np.array(times * self.density)))


def looked_places(arrays: ResultArrays, gauge: float) -> list[LookedPlace]:
    """Return the least covered patches of a target, apart from each other, the least first.

    There are none where too few dents were simulated to tell places apart.

    Args:
        gauge: area of a window [m²].
    """
    display, part = arrays.display, arrays.chamber.part
    mesh, fields = display.mesh, display.fields
    vertices = mesh.vertices.astype(float)
    known = (fields["reachable"] > 0.5) & (fields["resolved"] > 0.5)
    corners = mesh.triangles[part.target[mesh.part_triangle]]
    corners = corners[known[corners].all(axis=1)]
    if not len(corners):
        return []
    low, high = (pick(vertices[corners], axis=(0, 1)) for pick in (np.min, np.max))
    side = float(np.linalg.norm(high - low)) / PATCHES
    # Vertices would not do: those of a flat or straight face lie on its edges.
    spacing = np.full(len(corners), side / POINTS)
    triangle, place, weight = spread_points(vertices, corners, spacing)
    own_corners = corners[triangle]
    coverage = coverage_from_dent_density(fields["dent_density"].astype(float))
    at_vertices = np.column_stack([coverage, mesh.normal])
    at_points = interpolate(at_vertices[own_corners], vertices[own_corners], place)
    covered, normal_at = at_points[:, 0], unit_vectors(at_points[:, 1:])
    is_short = high - low < SHORT * (high - low).max()
    cells = np.maximum(np.ceil((high - low) / side), 1.0)  # equal ones, none narrow at an end
    cell = np.floor((place - low) / np.maximum(high - low, 1e-12) * cells * (1.0 - 1e-9))
    cell = np.column_stack([cell, mesh.face[own_corners[:, 0]]])
    _, patch = np.unique(cell, axis=0, return_inverse=True)
    patch = patch.reshape(-1)
    area = np.bincount(patch, weight)
    mean = np.bincount(patch, weight * covered) / area
    middle = np.stack([np.bincount(patch, weight * x) / area for x in place.T], axis=1)
    found: list[LookedPlace] = []
    for one in np.argsort(mean, kind="stable"):
        own = np.flatnonzero(patch == one)
        nearest = own[np.linalg.norm(place[own] - middle[one], axis=1).argmin()]
        at = place[nearest]
        is_apart = all(np.linalg.norm(at - other.at) > 2.0 * side for other in found)
        if area[one] < LEAST_WINDOWS * gauge or not is_apart:
            continue
        normal = normal_at[nearest]
        share = np.where(is_short, 0.0, (2.0 * at - low - high) / np.maximum(high - low, 1e-12))
        axis = int(np.where(np.abs(normal) > ACROSS, 0.0, np.abs(share)).argmax())
        density = -float(np.log1p(-min(mean[one], 1.0 - 1e-9)))
        before = _to_part(part.vertices[part.triangles], at, normal)
        found.append(LookedPlace(at, normal, (axis, float(share[axis])), density, before))
        if len(found) == MOST_PLACES:
            break
    return found


def _to_part(corners: np.ndarray, at: np.ndarray, normal: np.ndarray) -> float:
    """Return how far the part is before a place on it, along the normal [m]; inf if it is not.

    Args:
        corners: of the part's triangles [m], (m, 3, 3).
        at, normal: the place [m] and its normal, (3,).
    """
    from sim_core import ray_lengths

    # A ray that leaves the part's inside out crosses its triangles from the other side.
    inside_out = corners[:, ::-1]
    reach = float(np.linalg.norm(np.ptp(corners.reshape(-1, 3), axis=0)))
    start = at + OFF * reach * normal
    return float(ray_lengths(inside_out, start[None], normal[None], reach)[0])
