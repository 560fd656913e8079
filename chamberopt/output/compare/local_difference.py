"""Where one candidate covers more than another, and where the difference is not noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from chamberopt.coverage.coverage_from_impacts import coverage_from_dent_density
from chamberopt.output.compare.target_surface import TargetSurface
from chamberopt.output.disc_averages import DENTS_PER_DISC, averaging_radius, disc_sums
from chamberopt.simulation.triangle_fields import coverage_bounds

UNIT_DENT = np.pi / 4.0  # area of a dent of diameter 1
# A difference is smaller than either coverage and has more noise, so discs hold more dents.
DENTS_FOR_DIFFERENCE = 4.0 * DENTS_PER_DISC


@dataclass(frozen=True)
class LocalDifference:
    """Coverage of a later candidate minus that of the first, for each triangle of the part.

    Args:
        value: the difference, -1 to 1, NaN off the target, shape (m,).
        real: whether it exceeds its 95 % interval, shape (m,) bool. The intervals hold for each
            triangle alone, so one triangle in twenty exceeds its own by chance.
        radius: both are averaged over discs of this radius [mm]; 0 if they are not averaged.
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
    """Compute other - first for two results of one part and target with single impacts.

    Both are averaged over the same discs. The interval of the difference follows from those of the
    two coverages (triangle_fields.coverage_bounds), which assume independent dents. A triangle
    outside the cavity of one result has coverage 0 there.

    Source: G. Y. Zou and A. Donner, "Construction of confidence limits about effect measures",
    Statistics in Medicine 27 (2008) 1693.
    """
    target = first.target
    centre, normal = first.centre[target], first.normal[target]
    radius = max(
        averaging_radius(centre, one.exposed[target], one.dents[target], DENTS_FOR_DIFFERENCE)
        for one in (first, other)
    )
    over = disc_sums(centre, normal, radius)
    a, a_low, a_high = _with_interval(first, target, over)
    b, b_low, b_high = _with_interval(other, target, over)
    value = b - a
    less = value + np.hypot(b_high - b, a - a_low) < 0.0
    more = value - np.hypot(b - b_low, a_high - a) > 0.0
    share = first.area[target] / first.area[target].sum()
    shown, real = np.full(len(target), np.nan), np.zeros(len(target), dtype=bool)
    shown[target], real[target] = value, more | less
    return LocalDifference(shown, real, radius, float(share[more].sum()), float(share[less].sum()))


def _with_interval(
    one: TargetSurface, target: np.ndarray, over: Callable[[np.ndarray], np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Coverage of the target's triangles, averaged over discs, and the ends of its interval."""
    assert one.hits is not None
    exposed = one.exposed[target]
    there = exposed > 0.0
    area = np.where(there, over(exposed), np.nan) * 1e-6
    low, high = coverage_bounds(one.hits, area, one.time_ratio, lambda own: over(own[target]))
    dented = over(
        np.bincount(
            one.hits.hits.triangle, UNIT_DENT * one.hits.hits.dent.astype(float) ** 2, len(target)
        )[target]
    )
    found = (coverage_from_dent_density(dented * one.time_ratio / area), low, high)
    value, low, high = (np.where(there, column, 0.0) for column in found)
    return value, low, high
