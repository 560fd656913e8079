"""Find where to look at a peened target: where the fewest dents are expected, in several places."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.coverage.coverage_from_impacts import coverage_from_dent_density
from chamberopt.geometry.triangles import areas

if TYPE_CHECKING:
    from chamberopt.results.arrays_file import ResultArrays

MOST_PLACES = 3
# Patches are what cubes of the target's diagonal over this hold of one face, such as a root between
# teeth. Their dents are told as a mean over windows, so many at least: single windows scatter, and
# the least of many would tell of luck. Places are two cubes apart.
PATCHES = 8.0
LEAST_WINDOWS = 3.0
SHORT = 0.25  # side of the target over its longest, below which it has no ends along that side
ACROSS = 0.7  # share of a normal along an axis from which on the axis is not along the surface


class LookedPlace(NamedTuple):
    """A patch of the target to look at.

    Attributes:
        at: its middle on the surface, in the chamber's frame [m], (3,).
        normal: out of the part, (3,).
        along: axis of the chamber, 0 to 2, and where the place is along it, from -1 at the target's
            lower end to 1 at its upper end. It is the axis, of those along the surface there, on
            which the place is nearest to an end.
        density: of the dents expected in it after the treatment time, such that its coverage is
            1 - exp(-density).
    """

    at: np.ndarray
    normal: np.ndarray
    along: tuple[int, float]
    density: float

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
    corners = mesh.triangles[part.target[mesh.part_triangle]]
    shares = np.repeat(areas(mesh.vertices, corners) / 3.0, 3)
    weight = np.bincount(corners.ravel(), shares, len(mesh.vertices))
    known = (weight > 0.0) & (fields["reachable"] > 0.5) & (fields["resolved"] > 0.5)
    if not known.any():
        return []
    place, weight = mesh.vertices[known].astype(float), weight[known]
    covered = coverage_from_dent_density(fields["dent_density"][known].astype(float))
    side = float(np.linalg.norm(np.ptp(place, axis=0))) / PATCHES
    low, high = place.min(axis=0), place.max(axis=0)
    is_short = high - low < SHORT * (high - low).max()
    cell = np.column_stack([np.floor(place / side), mesh.face[known]])
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
        normal = mesh.normal[known][nearest]
        share = np.where(is_short, 0.0, (2.0 * at - low - high) / np.maximum(high - low, 1e-12))
        axis = int(np.where(np.abs(normal) > ACROSS, 0.0, np.abs(share)).argmax())
        density = -float(np.log1p(-min(mean[one], 1.0 - 1e-9)))
        found.append(LookedPlace(at, normal, (axis, float(share[axis])), density))
        if len(found) == MOST_PLACES:
            break
    return found
