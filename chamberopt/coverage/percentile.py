"""Estimate percentiles of coverage and exposure over the target, and the time to full coverage.

Notation
    window  disc of the surface round a point of the target, in which dents are counted
    x       dent density: expected sum of the shares of a window that dents take
    M       exposure, x / ln 50: the peening time over the time in which a window with as many dents
            is 98 % covered by Avrami's equation; M = 2 is "200 %"

The 5th percentile of simulated dent densities is too low, because the counts of dents scatter. The
scatter of sqrt(x) is the same at any x (M. S. Bartlett, J. Roy. Stat. Soc. Suppl. 3 (1936) 68). So
the roots of all windows are moved towards their mean until they vary over the target as the true
roots do. This takes away the variance of counting, which is known from the differences between
replicas (independent simulations). The result of half of the replicas shows the remaining error:
the step from it to the result of all replicas is made once more, and the interval includes this
step. The method needs about 25 dents in a window. The 95th percentile, which is too high, is
corrected in the same way.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from chamberopt.common.estimate import Estimate, estimate, jackknife, shared_half_width
from chamberopt.coverage.coverage_from_impacts import Batch
from chamberopt.coverage.field.surface_points import CERTAIN, Reach, sampling_errors, sparse_points
from chamberopt.coverage.metrics import FULL_COVERAGE, NEVER, P05, P95

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


class DentSums(NamedTuple):
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

    def roots_of(some: np.ndarray | slice) -> DensityRoots:
        return _density_roots(sums.share[some], sums.replicas[some], share)

    def value_of(roots: DensityRoots, more: float = 0.0) -> float:
        return float(quantile.of_density(roots.density(more) * time_ratio))

    all_of_them = roots_of(slice(None))
    whole = value_of(all_of_them)
    if batches == 1:
        return estimate([whole], 0.0, quantile.highest)
    rng, value = np.random.default_rng(0), whole
    if (half := max(batches // 2, 2)) < batches:  # a single batch does not show its variance
        of_halves = [value_of(roots_of(rng.permutation(batches)[:half])) for _ in range(SPLITS)]
        # The remaining error goes with one over the number of dents.
        correction = (whole - float(np.mean(of_halves))) / (batches / half - 1.0)
        value = min(max(whole + correction, 0.0), quantile.highest)
    rests = [roots_of(rest) for rest in ~np.eye(batches, dtype=bool)]
    without = [value_of(rest) for rest in rests]
    deviations = jackknife(np.array([whole, *without])) - whole
    of_some = np.array(
        [
            value_of(_density_roots(some.T, sums.replicas, share))
            for some in sparse_points(sums.share.T)
        ]
    )
    step, least = value - whole, 0.0
    if np.quantile(sums.share.sum(axis=0), share) == 0.0:
        # A place without a dent may stay bare, or up to 3 dents were expected there.
        density = NOT_ONE * sums.weight * time_ratio / float(sums.replicas.sum())
        most = float(quantile.of_density(density))
        least = max(abs(step) + value, most) if math.isfinite(sums.weight) else math.inf
    by_reach = value_of(_density_roots(sums.share, sums.replicas, min(further, 1.0))) - whole
    shared = [*sampling_errors(of_some), by_reach if reach.error else 0.0]
    found = estimate(value + deviations, 0.0, quantile.highest, shared=shared)
    # If counting seems to explain all of the variance, the roots are drawn to a single value, which
    # hardly moves from replica to replica. By its own interval the variance may be larger.
    variances = np.array([one.over_target - one.counting for one in (all_of_them, *rests)])
    more = estimate(jackknife(variances)).half_width
    furthest = value_of(all_of_them, more) - whole
    # This larger variance is an alternative to the scatter, so it is added in quadrature. Added
    # plainly, the interval always held. The step in quadrature held in 88 % of the cases beside
    # creases (benchmarks/interval_calibration.py).
    known_to = max(
        found.half_width + max(abs(step), least),
        math.hypot(furthest, step, shared_half_width(shared)),
    )
    if sums.has_levels:
        level = all_of_them.level(SIDE if quantile.level < 0.5 else -SIDE)
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


class DensityRoots(NamedTuple):
    """Quantile, mean and variances of the square roots of dent densities in windows, per replica.

    A dent density is the sum of the shares of a window (disc of the target) that dents take.

    Attributes:
        at_share: quantile: the root that a given share of the windows do not exceed.
        middle: mean root.
        over_target: variance of the roots over the windows.
        counting: part of the variance that comes from counting.
    """

    at_share: float
    middle: float
    over_target: float
    counting: float

    def level(self, deviations: float) -> float:
        """Return the density that lies so many standard deviations of counting from the quantile.

        Windows of one level of density scatter round it by counting alone. So SIDE deviations bring
        the 5th or 95th percentile of such windows back to their level.
        """
        return max(0.0, self.at_share + deviations * math.sqrt(self.counting)) ** 2

    def density(self, more: float = 0.0) -> float:
        """Return the dent density that the given share of the windows do not exceed, corrected for
        the scatter of counting.

        Args:
            more: variance to add to the variance without counting.
        """
        if not self.over_target:
            return self.at_share**2
        left = max(0.0, self.over_target - self.counting) + more
        shrink = math.sqrt(left / self.over_target)
        return max(0.0, self.middle + shrink * (self.at_share - self.middle)) ** 2


def _density_roots(shares: np.ndarray, replicas: np.ndarray, share: float) -> DensityRoots:
    """Return a quantile, the mean and the variances of the square roots of dent densities in
    windows.

    Args:
        shares: sums of the dents' shares of each window, by batch, (g, p).
        replicas: number of replicas in each batch, (g,).
        share: share of the windows that do not exceed the quantile.
    """
    batches, total = len(shares), shares.sum(axis=0)
    root = np.sqrt(total / replicas.sum())
    at_share, middle = float(np.quantile(root, share)), float(root.mean())
    if batches == 1:
        return DensityRoots(at_share, middle, 0.0, 0.0)
    rest = (replicas.sum() - replicas)[:, None]
    without_each = np.sqrt(np.maximum(total - shares, 0.0) / rest)
    counting = (batches - 1) * float(without_each.var(axis=0).mean())  # jackknife in each window
    return DensityRoots(at_share, middle, float(root.var()), counting)


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
