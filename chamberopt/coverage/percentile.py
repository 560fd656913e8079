"""The 5th percentile of coverage over the target, and the time until it is full.

The 5th percentile of k times the sum of w_j is too low, because counts scatter. sqrt(x) scatters
alike everywhere (M. S. Bartlett, J. Roy. Stat. Soc. Suppl. 3 (1936) 68), so the roots are drawn to
their mean until they vary over the target as the true ones do: the variance of counting, which
shows from replica to replica, is taken away. The result of half of the replicas shows what error
is left; the step from it to that of all is made once more, and the interval includes it. This asks
for about 25 dents in a window.

Notation: as in coverage_intervals.py.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from chamberopt.common.estimate import Estimate, estimate, jackknife
from chamberopt.coverage.coverage_from_impacts import Batch
from chamberopt.coverage.field.surface_points import sampling_errors, sparse_points
from chamberopt.coverage.metrics import FULL_COVERAGE, NEVER, P05

SPLITS = 6  # of the replicas into halves
NOT_ONE = 3.0  # expected dents of which with a probability of 5 % there is not one
NEARLY_FULL = 0.9  # coverage above which times come from a shorter treatment


class DentSums(NamedTuple):
    """Dents of all batches in windows of one size.

    Attributes:
        replicas: in each batch, shape (g,).
        share: sums of w over the dents in each window, shape (g, p).
    """

    replicas: np.ndarray
    share: np.ndarray


def sum_dents(batches: Sequence[Batch], points: int) -> DentSums:
    """Add up the dents of each batch in each of so many windows."""
    return DentSums(
        np.array([one.replicas for one in batches]),
        np.array(
            [np.bincount(one.footprints.point, one.footprints.weight, points) for one in batches]
        ),
    )


def _weight_of_dents(batches: Sequence[Batch]) -> float:
    """Mean share of a window that a dent takes; infinite if there are no dents."""
    weights = [one.footprints.weight for one in batches]
    count = sum(len(one) for one in weights)
    return float(sum(one.sum() for one in weights)) / count if count else math.inf


def p05_estimate(
    batches_of_dents: Sequence[Batch], points: int, reachable: float, time_ratio: float
) -> Estimate:
    """The 5th percentile of coverage over the target; what is out of reach is bare.

    Args:
        batches_of_dents: dents of each batch of replicas.
        points: number of windows.
        reachable: share of the target that a ball can touch.
        time_ratio: treatment time over the simulated time of one replica.
    """
    batches, share = len(batches_of_dents), (P05 - (1.0 - reachable)) / reachable
    if share <= 0.0:
        return Estimate(0.0, 0.0 if batches > 1 else math.inf, (0.0,) * batches)
    sums, weight = sum_dents(batches_of_dents, points), _weight_of_dents(batches_of_dents)

    def roots_of(some: np.ndarray | slice) -> DensityRoots:
        return _density_roots(sums.share[some], sums.replicas[some], share)

    def coverage_of(roots: DensityRoots, more: float = 0.0) -> float:
        return -math.expm1(-roots.low_density(more) * time_ratio)

    all_of_them = roots_of(slice(None))
    whole = coverage_of(all_of_them)
    if batches == 1:
        return estimate([whole], 0.0, 1.0)
    rng, value = np.random.default_rng(0), whole
    if (half := max(batches // 2, 2)) < batches:  # a single batch does not show its variance
        of_halves = [coverage_of(roots_of(rng.permutation(batches)[:half])) for _ in range(SPLITS)]
        # The error that is left goes with one over the number of dents.
        step = (whole - float(np.mean(of_halves))) / (batches / half - 1.0)
        value = min(max(whole + step, 0.0), 1.0)
    rests = [roots_of(rest) for rest in ~np.eye(batches, dtype=bool)]
    without = [coverage_of(rest) for rest in rests]
    deviations = jackknife(np.array([whole, *without])) - whole
    of_some = -np.expm1(
        [
            -_density_roots(some.T, sums.replicas, share).low_density() * time_ratio
            for some in sparse_points(sums.share.T)
        ]
    )
    bias = abs(value - whole)
    if np.quantile(sums.share.sum(axis=0), share) == 0.0:
        # Where no dent has fallen it may be bare, or up to 3 dents were to be expected.
        density = NOT_ONE * weight * time_ratio / float(sums.replicas.sum())
        bias = max(bias + value, -math.expm1(-density)) if math.isfinite(weight) else math.inf
    found = estimate(value + deviations, 0.0, 1.0, bias=bias, shared=sampling_errors(of_some))
    # Where counting seems to explain all of the variance, the roots are drawn to one value, which
    # hardly moves from replica to replica. There may be more variance, by its own interval.
    variances = np.array([one.over_target - one.counting for one in (all_of_them, *rests)])
    reach = estimate(jackknife(variances)).half_width
    lowest = coverage_of(all_of_them, reach)
    return replace(found, half_width=max(found.half_width, bias + whole - lowest))


class DensityRoots(NamedTuple):
    """Roots of the dent density in windows, per replica.

    Attributes:
        low: that a share of the windows do not exceed.
        middle: mean.
        over_target: variance over the windows.
        counting: the part of it that comes from counting.
    """

    low: float
    middle: float
    over_target: float
    counting: float

    def low_density(self, more: float = 0.0) -> float:
        """The density that the share of the windows do not exceed, counting taken away.

        Args:
            more: added to the variance that is left.
        """
        if not self.over_target:
            return self.low**2
        left = max(0.0, self.over_target - self.counting) + more
        shrink = math.sqrt(left / self.over_target)
        return max(0.0, self.middle + shrink * (self.low - self.middle)) ** 2


def _density_roots(shares: np.ndarray, replicas: np.ndarray, share: float) -> DensityRoots:
    """Roots of the dent density and their variances.

    Args:
        shares: sums of w of each batch in each window, (g, p).
        replicas: in each batch, (g,).
    """
    batches, total = len(shares), shares.sum(axis=0)
    root = np.sqrt(total / replicas.sum())
    low, middle = float(np.quantile(root, share)), float(root.mean())
    if batches == 1:
        return DensityRoots(low, middle, 0.0, 0.0)
    rest = (replicas.sum() - replicas)[:, None]
    without_each = np.sqrt(np.maximum(total - shares, 0.0) / rest)
    counting = (batches - 1) * float(without_each.var(axis=0).mean())  # jackknife in each window
    return DensityRoots(low, middle, float(root.var()), counting)


def time_to_98(
    p05: Estimate,
    batches: Sequence[Batch],
    points: int,
    reachable: float,
    time_ratio: float,
    seconds: float,
) -> Estimate:
    """Time [s] until the 5th percentile of coverage is FULL_COVERAGE.

    A coverage near 1 hardly tells dents from twice as many. So the time comes from the coverage
    after a part of the treatment that leaves more bare.

    Args:
        p05: 5th percentile of the coverage after the treatment.
        batches, points, reachable, time_ratio: as for `p05_estimate`.
        seconds: of the treatment.
    """
    part = 1.0
    while p05.value > NEARLY_FULL:
        part /= 4.0
        p05 = p05_estimate(batches, points, reachable, part * time_ratio)
    return time_to_98_estimate(p05, part * seconds)


def time_to_98_estimate(p05: Estimate, seconds: float) -> Estimate:
    """Time [s] until the 5th percentile of coverage is FULL_COVERAGE, by Avrami's equation.

    The time is steep where little is covered, so the longer side of its interval serves for both.

    Args:
        p05: 5th percentile of the coverage after `seconds` of peening.
    """

    def time_from(coverage: float) -> float:
        density = -math.log1p(-min(coverage, 1.0 - 1e-12))
        return seconds * -math.log(1.0 - FULL_COVERAGE) / density if density > 0.0 else math.inf

    value, soonest, latest = (time_from(one) for one in (p05.value, p05.high, p05.low))
    count, is_bound = len(p05.pseudovalues), 0.0 < p05.half_width < math.inf
    if value >= NEVER and not is_bound:
        return Estimate(NEVER, p05.half_width, (NEVER,) * count, in_words="never")
    if latest >= min(2.0 * value, NEVER):  # as uncertain as it is long
        words = f"more than {soonest:,.0f} s" if is_bound else ""
        value = min(value, NEVER)
        return Estimate(value, math.inf, (value,) * count, in_words=words)
    deviations = np.array(p05.pseudovalues) - p05.value
    reach = max(latest - value, value - soonest)
    slope = reach / p05.half_width if p05.half_width else 0.0
    shared = tuple(-slope * one for one in p05.shared)
    found = estimate(value - slope * deviations, 0.0, NEVER)
    return replace(found, half_width=reach, shared=shared)
