"""Averages of triangle values over discs on the surface, for maps of parts that received few dents.

The radius is the same for all triangles of a part: just wide enough for a disc to hold
DENTS_PER_DISC dents on average. Only triangles that face the same way are averaged, so values of
one flank of a tooth do not mix with those of the next.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

# Below about this many dents a map of single triangles shows mostly noise.
DENTS_PER_DISC = 15
# Upper limit of the radius, as a share of the target's size: a wider disc could hide a pattern.
MAX_RADIUS_SHARE = 0.06
MIN_COSINE = 0.7  # between the normals of triangles that are averaged


def average_over_discs(
    centre: np.ndarray, normal: np.ndarray, density: np.ndarray, area: np.ndarray, dents: np.ndarray
) -> tuple[np.ndarray, float]:
    """Average a density over the disc round each triangle.

    Args:
        centre: of the triangles [mm], shape (m, 3).
        normal: unit vectors, shape (m, 3).
        density: value per area, shape (m,).
        area: of the triangles [mm²], shape (m,).
        dents: simulated dents of each triangle, shape (m,).

    Returns:
        The averaged density (m,), and the radius of the discs [mm]: 0.0 where nothing is averaged.
    """
    radius = averaging_radius(centre, area, dents)
    if radius == 0.0:
        return density, 0.0
    sums = disc_sums(centre, normal, radius)
    return sums(density * area) / sums(area), radius


def averaging_radius(
    centre: np.ndarray, area: np.ndarray, dents: np.ndarray, wanted: float = DENTS_PER_DISC
) -> float:
    """Radius [mm] of discs that hold `wanted` dents on average; 0.0 if the triangles do already."""
    if not len(centre) or np.mean(dents) >= wanted:
        return 0.0
    per_mm2 = max(float(dents.sum() / area.sum()), 1e-12)
    size = float(np.linalg.norm(np.ptp(centre, axis=0)))
    return float(min(np.sqrt(wanted / (np.pi * per_mm2)), MAX_RADIUS_SHARE * size))


def disc_sums(
    centre: np.ndarray, normal: np.ndarray, radius: float
) -> Callable[[np.ndarray], np.ndarray]:
    """Return a function that sums triangle values (m,) over the disc round each triangle."""
    if radius == 0.0:
        return np.asarray
    from scipy.spatial import cKDTree

    pairs = cKDTree(centre).query_pairs(radius, output_type="ndarray")
    cosine = np.einsum("ij,ij->i", normal[pairs[:, 0]], normal[pairs[:, 1]])
    i, j = pairs[cosine > MIN_COSINE].T

    def sums(own: np.ndarray) -> np.ndarray:
        return np.asarray(own + np.bincount(i, own[j], len(own)) + np.bincount(j, own[i], len(own)))

    return sums
