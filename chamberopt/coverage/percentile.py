"""Estimate percentiles of coverage and exposure over the target, and the time to full coverage.

Notation
    window  disc of the surface round a point of the target, in which dents are counted
    x       dent density: expected sum of the shares of a window that dents take
    M       exposure, x / ln 50: the peening time over the time in which a window with as many dents
            is 98 % covered by Avrami's equation; M = 2 is "200 %"

The 5th percentile of simulated dent densities is too low, because the counts of dents scatter, and
the 95th is too high. So percentiles are those of the distribution without the scatter of counting
(true_densities.py). The result of half of the replicas shows the error that remains: it falls about
as fast as the number of dents grows, so that the step from half of the replicas to all bounds it.
The interval includes this step. The method needs about 25 dents in a window.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from chamberopt.common.estimate import Estimate, estimate, jackknife, shared_half_width
from chamberopt.coverage.coverage_from_impacts import Batch
from chamberopt.coverage.field.surface_points import CERTAIN, Reach, sampling_errors, sparse_points
from chamberopt.coverage.metrics import FULL_COVERAGE, NEVER, P05, P95
from chamberopt.coverage.true_densities import (
    CountedRoots,
    TrueDensities,
    count_roots,
    true_densities,
)

SPLITS = 6  # of the replicas into halves
SIDE = 1.645  # standard deviations from the mean beyond which 5 % of a normal quantity lie
NOT_ONE = 3.0  # expected number of dents at which no dent falls with a probability of 5 %
NEARLY_FULL = 0.9  # coverage above which times come from a shorter treatment
SHORTEST = 1e-6  # shortest treatment, over the whole treatment


class Quantile(NamedTuple):
    """A percentile over the target: a quantity of each point, such as coverage, and the share of
    the target's area where it is lower.
    """

    level: float
    of_density: Callable[[np.ndarray | float], np.ndarray | float]  # gives the figure from x
    highest: float  # largest value of the figure


def _coverage(density: np.ndarray | float) -> np.ndarray | float:
    return -np.expm1(-density)


def exposure_from_density(density: np.ndarray | float) -> np.ndarray | float:
    """Return the exposure (peening time over time to 98 % coverage) from the dent density."""
    return density / -math.log(1.0 - FULL_COVERAGE)


P05_COVERAGE = Quantile(P05, _coverage, 1.0)
P95_COVERAGE = Quantile(P95, _coverage, 1.0)
P95_EXPOSURE = Quantile(P95, exposure_from_density, math.inf)


@dataclass(frozen=True, eq=False)
class DentSums:
    """Numbers of dents in windows (discs of the target), and sums of the shares of a window that
    the dents take.

    Attributes:
        replicas: number of replicas in each batch, shape (g,).
        share: sums of the dents' shares of each window, by batch, shape (g, p).
        number: dents of all batches in each window, shape (p,).
        has_levels: whether the windows may have separate levels of density, as sides of a part have
            that are peened in different steps.
    """

    replicas: np.ndarray
    share: np.ndarray
    number: np.ndarray
    has_levels: bool = False

    @property
    def weight(self) -> float:
        """Mean share of a window (disc) that a dent takes; infinite if there are no dents."""
        count = float(self.number.sum())
        return float(self.share.sum()) / count if count else math.inf

    @cached_property
    def counted(self) -> CountedRoots:
        return count_roots(self.share, self.replicas)

    @cached_property
    def _rests(self) -> list[CountedRoots]:
        """The counted roots without each batch in turn; none if there is one batch."""
        each = ~np.eye(len(self.replicas), dtype=bool)
        if len(each) == 1:
            return []
        return [count_roots(self.share[rest], self.replicas[rest]) for rest in each]

    @cached_property
    def densities(self) -> TrueDensities:
        """Distribution of the dent density over the target, from all batches."""
        return true_densities(self.counted)

    @cached_property
    def densities_without_each(self) -> list[TrueDensities]:
        return [true_densities(rest) for rest in self._rests]

    @cached_property
    def densities_of_halves(self) -> list[TrueDensities]:
        """Distributions from random halves of the batches; none if halves do not show scatter."""
        batches, rng = len(self.replicas), np.random.default_rng(0)
        half = max(batches // 2, 2)  # a single batch does not show its variance
        if half >= batches:
            return []
        halves = [rng.permutation(batches)[:half] for _ in range(SPLITS)]
        return [true_densities(count_roots(self.share[one], self.replicas[one])) for one in halves]

    @cached_property
    def densities_of_some(self) -> list[TrueDensities]:
        """Distributions from every tenth window, whose scatter is that by the choice of windows."""
        return [
            true_densities(count_roots(some.T, self.replicas))
            for some in sparse_points(self.share.T)
        ]

    @cached_property
    def widest_densities(self) -> TrueDensities:
        """Distribution with the largest variance over the target that batches leave possible.

        If counting seems to explain all of the variance, all densities are drawn to a single value,
        which hardly moves from batch to batch, although by its own interval the variance may be
        larger.
        """
        variances = [one.true_variance for one in (self.counted, *self._rests)]
        return true_densities(self.counted, estimate(jackknife(np.array(variances))).half_width)


def sum_dents(batches: Sequence[Batch], points: int) -> DentSums:
    """Return the number of dents in each of `points` windows (discs of the target), and the sum of
    the shares of the window that the dents of each batch of replicas take.
    """
    from chamberopt.coverage.field.windows import add_powers

    sums = np.zeros((len(batches), points, 3))
    for of_batch, one in zip(sums, batches, strict=True):
        for point, weight in one.footprints.pairs():
            add_powers(point, weight, of_batch)
    return dent_sums(np.array([one.replicas for one in batches]), sums)


def dent_sums(replicas: np.ndarray, sums: np.ndarray) -> DentSums:
    """Return the numbers and shares of dents from sums of their powers, (g, p, 3), by batch of
    replicas (g,).
    """
    number, share, _ = np.ascontiguousarray(np.moveaxis(sums, 2, 0))
    return DentSums(replicas, share, number.sum(axis=0))


def quantile_estimate(
    quantile: Quantile, sums: DentSums, reach: Reach, time_ratio: float
) -> Estimate:
    """Estimate a percentile of a quantity such as coverage over the target.

    Points that no ball can touch are bare. The percentile is 0 if they make up more of the target
    than its level. If their share is not known well enough to tell, the value is the mean of both
    cases, so that it does not jump with the choice of points. The interval then holds both cases.

    Args:
        quantile: the percentile, such as P05_COVERAGE.
        sums: number and shares of the dents in each window, by batch of replicas.
        reach: share of the target that a ball can touch.
        time_ratio: treatment time over the simulated time of one replica.
    """
    from scipy.special import ndtr

    batches, beyond = len(sums.replicas), reach.beyond(1.0 - quantile.level)
    if beyond <= -CERTAIN:
        return Estimate(0.0, 0.0 if batches > 1 else math.inf, (0.0,) * batches)
    if beyond >= CERTAIN:
        return _quantile_of_reached(quantile, sums, reach, time_ratio)
    likely = float(ndtr(beyond))  # probability that the percentile is above 0
    density = math.exp(-0.5 * beyond**2) / math.sqrt(2.0 * math.pi)
    # The mean of all reaches that are enough, and the largest reach.
    mean, most = (reach.error * step for step in (density / likely, CERTAIN))
    found, furthest = (
        _quantile_of_reached(quantile, sums, Reach(min(reach.share + more, 1.0)), time_ratio)
        for more in (mean, most)
    )
    value = likely * found.value
    return replace(
        found,
        value=value,
        half_width=max(value, found.high - value, furthest.high - value),
        pseudovalues=tuple(likely * one for one in found.pseudovalues),
        shared=tuple(likely * one for one in found.shared),
    )


def _quantile_of_reached(
    quantile: Quantile, sums: DentSums, reach: Reach, time_ratio: float
) -> Estimate:
    """Estimate a percentile over the target, if the share of the target that no ball can touch is
    surely less than the percentile's level.
    """
    batches = len(sums.replicas)
    share, further = (
        max(0.0, (quantile.level - (1.0 - one)) / one)
        for one in (reach.share, reach.share + reach.error)
    )

    def value_of(densities: TrueDensities, level: float = share) -> float:
        return float(quantile.of_density(densities.at(level) * time_ratio))

    value = value_of(sums.densities)
    if batches == 1:
        return estimate([value], 0.0, quantile.highest)
    step, least = 0.0, 0.0
    if halves := sums.densities_of_halves:
        # The remaining error goes with one over the number of dents.
        of_halves = float(np.mean([value_of(one) for one in halves]))
        step = abs(value - of_halves) / (batches / max(batches // 2, 2) - 1.0)
    without = [value_of(one) for one in sums.densities_without_each]
    deviations = jackknife(np.array([value, *without])) - value
    of_some = np.array([value_of(one) for one in sums.densities_of_some])
    if np.quantile(sums.share.sum(axis=0), share) == 0.0:
        # A place without a dent may stay bare, or up to 3 dents were expected there.
        density = NOT_ONE * sums.weight * time_ratio / float(sums.replicas.sum())
        most = float(quantile.of_density(density))
        least = max(step + value, most) if math.isfinite(sums.weight) else math.inf
    by_reach = value_of(sums.densities, min(further, 1.0)) - value
    shared = [*sampling_errors(of_some), by_reach if reach.error else 0.0]
    found = estimate(value + deviations, 0.0, quantile.highest, shared=shared)
    # A larger variance over the target is an alternative to the scatter of replicas. The step is
    # added plainly: in quadrature it held the percentiles of the gear in 88 % of the groups of 8.
    furthest = value_of(sums.widest_densities) - value
    known_to = max(
        found.half_width + max(step, least), math.hypot(furthest, step, shared_half_width(shared))
    )
    if sums.has_levels:
        level = sums.counted.level(share, SIDE if quantile.level < 0.5 else -SIDE)
        of_level = float(quantile.of_density(level * time_ratio))
        known_to = max(known_to, abs(of_level - value) + found.half_width)
    bias = known_to - found.half_width if math.isfinite(known_to) else math.inf
    return replace(found, half_width=known_to, bias=bias)


def mean_exposure(sums: DentSums, reach: Reach, time_ratio: float) -> Estimate:
    """Estimate the mean exposure M over the target: peening time over the time to 98 % coverage.

    The estimate has no bias, because it is linear in the dents.

    Args:
        sums: number and shares of the dents in each window, by batch of replicas.
        reach: share of the target that a ball can touch.
        time_ratio: treatment time over the simulated time of one replica.
    """
    total, replicas = sums.share.sum(axis=0), sums.replicas
    of_one_dent = float(exposure_from_density(reach.share * time_ratio))  # a dent as its window
    whole = of_one_dent * float(total.mean()) / float(replicas.sum())
    if not whole or len(replicas) == 1:
        return Estimate(whole, math.inf, (whole,) * len(replicas))
    rests = (total.mean() - sums.share.mean(axis=1)) / (replicas.sum() - replicas)
    of_some = np.array([some.mean() for some in sparse_points(total)]) / replicas.sum()
    shared = [*sampling_errors(of_one_dent * of_some), whole * reach.error / reach.share]
    return estimate(jackknife(np.r_[whole, of_one_dent * rests]), 0.0, shared=shared)


def in_order(low: Estimate, high: Estimate, name: str) -> dict[str, Estimate]:
    """Return the 5th and 95th percentile of a quantity, by name, with the 5th not above the 95th.

    On an even surface the corrections may put the 5th above the 95th. Both then get their mean.

    Args:
        name: name of the quantity, with {} for p05 and p95.
    """
    if low.value > high.value:
        middle = 0.5 * (low.value + high.value)
        low, high = (
            replace(one, value=middle, half_width=one.half_width + abs(one.value - middle))
            for one in (low, high)
        )
    return {name.format("p05"): low, name.format("p95"): high}


def time_to_98(
    p05: Estimate, sums: DentSums, reach: Reach, time_ratio: float, seconds: float
) -> Estimate:
    """Estimate the time [s] until 95 % of the target's area is 98 % covered.

    A coverage near 1 hardly changes with twice as many dents. So the time comes from the coverage
    after a shorter part of the treatment, when more of the target is bare.

    Args:
        p05: 5th percentile of the coverage after the treatment.
        sums: number and shares of the dents in each window, by batch of replicas.
        reach: share of the target that a ball can touch.
        time_ratio: treatment time over the simulated time of one replica.
        seconds: treatment time [s].
    """
    part, may_be_bare = 1.0, abs(reach.beyond(1.0 - P05)) < CERTAIN
    while (p05.high if may_be_bare else p05.value) > NEARLY_FULL and part > SHORTEST:
        part /= 4.0
        p05 = quantile_estimate(P05_COVERAGE, sums, reach, part * time_ratio)
    return time_to_98_estimate(p05, part * seconds)


def time_to_98_estimate(p05: Estimate, seconds: float) -> Estimate:
    """Estimate the time [s] until 95 % of the target's area is 98 % covered, by Avrami's equation.

    At little coverage the time changes steeply with it, so the two sides of the time's interval
    differ. The longer side serves for both.

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
    if latest >= min(2.0 * value, NEVER):  # the time is as uncertain as it is long
        words = f"more than {soonest:,.0f} s" if is_bound else ""
        value = min(value, NEVER)
        return Estimate(value, math.inf, (value,) * count, in_words=words)
    deviations = np.array(p05.pseudovalues) - p05.value
    reach = max(latest - value, value - soonest)
    slope = reach / p05.half_width if p05.half_width else 0.0
    shared = tuple(-slope * one for one in p05.shared)
    found = estimate(value - slope * deviations, 0.0, NEVER)
    return replace(found, half_width=reach, shared=shared)
