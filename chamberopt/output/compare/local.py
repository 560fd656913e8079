"""Where one candidate covers more than another, and where that is no more than noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from chamberopt.coverage.coverage_from_impacts import coverage_from_dent_density
from chamberopt.output.compare.covered import Covered
from chamberopt.output.disc_averages import DENTS_PER_DISC, averaging_radius, disc_sums
from chamberopt.simulation.triangle_fields import coverage_bounds

DENT = np.pi / 4.0  # area of a dent of diameter 1
DENTS = (
    4.0 * DENTS_PER_DISC
)  # on a disc: a difference of two has more noise than either, and is smaller


@dataclass(frozen=True)
class LocalDifference:
    """Coverage of a later candidate less that of the first, of each part triangle, (m,), -1..1, NaN off the target.

    real (m,) bool: beyond its 95 % interval, each triangle for itself: one in twenty is so by chance · reach [mm]: both
    are averaged over discs of that radius, 0 where they are not · more, less: shares of the target's area where the
    later one really covers more, or less.
    """

    value: np.ndarray
    real: np.ndarray
    reach: float
    more: float
    less: float

    def as_json(self) -> dict[str, float]:
        """What there is to say of the whole."""
        return {"share_more": self.more, "share_less": self.less, "averaged_over_mm": self.reach}


def local_difference(first: Covered, other: Covered) -> LocalDifference:
    """other - first: of one part and target, and both with single impacts.

    The interval is made of those of the two coverages as G. Y. Zou and A. Donner have it, "Construction of confidence
    limits about effect measures", Statistics in Medicine 27 (2008) 1693; theirs are quantities.coverage_bounds, which
    know no dents that come in series. Both are averaged over the same discs. What is hidden from the shot in one is not
    covered there.
    """
    target = first.target
    centre, normal = first.centre[target], first.normal[target]
    reach = max(
        averaging_radius(centre, one.exposed[target], one.dents[target], DENTS)
        for one in (first, other)
    )
    over = disc_sums(centre, normal, reach)
    a, a_low, a_high = _with_interval(first, target, over)
    b, b_low, b_high = _with_interval(other, target, over)
    value = b - a
    less = value + np.hypot(b_high - b, a - a_low) < 0.0
    more = value - np.hypot(b - b_low, a_high - a) > 0.0
    share = first.area[target] / first.area[target].sum()
    shown, real = np.full(len(target), np.nan), np.zeros(len(target), dtype=bool)
    shown[target], real[target] = value, more | less
    return LocalDifference(shown, real, reach, float(share[more].sum()), float(share[less].sum()))


def _with_interval(
    one: Covered, target: np.ndarray, over: Callable[[np.ndarray], np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Coverage of the target's triangles, each averaged over its disc, and the ends of its interval."""
    assert one.hits is not None
    exposed = one.exposed[target]
    there = exposed > 0.0
    area = np.where(there, over(exposed), np.nan) * 1e-6
    low, high = coverage_bounds(one.hits, area, one.times, lambda own: over(own[target]))
    dented = over(
        np.bincount(
            one.hits.hits.triangle, DENT * one.hits.hits.dent.astype(float) ** 2, len(target)
        )[target]
    )
    found = (coverage_from_dent_density(dented * one.times / area), low, high)
    value, low, high = (np.where(there, column, 0.0) for column in found)
    return value, low, high
