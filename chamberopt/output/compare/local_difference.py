"""Where one candidate covers more than another, and where the difference is not noise."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from chamberopt.output.compare.target_surface import MIN_COSINE, TargetSurface

# A difference is smaller than either coverage and has more noise: discs hold as many dents.
DENTS = 60.0
# Upper limit of their radius, as a share of the target's size: a wider disc could hide a pattern.
MAX_RADIUS_SHARE = 0.06


@dataclass(frozen=True)
class LocalDifference:
    """Coverage of a later candidate minus that of the first, at places of the target.

    Args:
        value: the difference, -1 to 1, at the vertices of the first candidate's field, shape (v,).
        radius: both are averaged over discs of this radius [mm]; 0 if they are not averaged.
        real: whether it exceeds its 95 % interval, shape (v,) bool. The intervals hold for each
            place alone, so one place in twenty exceeds its own by chance.
        more: share of the target's area where the later candidate really covers more.
        less: share of the target's area where it really covers less.
    """

    value: np.ndarray
    real: np.ndarray
    radius: float
    more: float
    less: float

    def as_json(self) -> dict[str, float]:
        """Return the figures of the whole target as plain JSON values."""
        return {"share_more": self.more, "share_less": self.less, "averaged_over_mm": self.radius}


def local_difference(first: TargetSurface, other: TargetSurface) -> LocalDifference:
    """Compute other - first for two results of one part and target.

    Both are averaged over the same discs, wide enough for DENTS dents. The interval of the
    difference follows from those of the two coverages, which assume independent dents: averages of
    windows of radius l over discs of radius R scatter as in windows of radius sqrt(l² + R²). Where
    either has too few dents, no difference is real.

    Source: G. Y. Zou and A. Donner, "Construction of confidence limits about effect measures",
    Statistics in Medicine 27 (2008) 1693.
    """
    coverage, interval, resolved = other.at(first)
    window, dents = first.window_radius, max(min(first.dents, other.dents), 1.0)
    size = float(np.linalg.norm(np.ptp(first.place, axis=0)))
    radius = min(window * math.sqrt(max(0.0, DENTS / dents - 1.0)), MAX_RADIUS_SHARE * size)
    average = _averages(first, radius)
    value = average(coverage - first.coverage)
    width = average(np.hypot(interval, first.interval)) * window / math.hypot(window, radius)
    real = np.abs(value) > 0.5 * width
    real &= resolved & first.resolved
    more, less = (float(first.area[real & sign].sum()) for sign in (value > 0.0, value < 0.0))
    return LocalDifference(value, real, radius, more, less)


def _averages(surface: TargetSurface, radius: float) -> Callable[[np.ndarray], np.ndarray]:
    """A function that averages values (v,) over the disc round each place that faces its way."""
    if radius == 0.0:
        return np.asarray
    from scipy.spatial import cKDTree

    pairs = cKDTree(surface.place).query_pairs(radius, output_type="ndarray")
    cosine = np.einsum("ij,ij->i", surface.normal[pairs[:, 0]], surface.normal[pairs[:, 1]])
    i, j = pairs[cosine > MIN_COSINE].T

    def sums(own: np.ndarray) -> np.ndarray:
        return np.asarray(own + np.bincount(i, own[j], len(own)) + np.bincount(j, own[i], len(own)))

    total = sums(surface.area)
    return lambda values: sums(values * surface.area) / total
