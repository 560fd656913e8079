"""Mean, standard deviation and 5th percentile of the target's coverage, with confidence intervals.

Notation
    x        dent density of a window at the treatment time T: expected dents, by their share of it
    C        coverage, 1 - exp(-x)
    n, t     number of replicas, and the time that each simulates [s]
    w_j      share of the window that simulated dent j takes
    k        T / (n t)                                                       (scale)
    r        share of the target that a ball can touch                       (reachable)
    B_1, B_2 products over the dents in a window of (1 - k w_j), (1 - 2 k w_j)
    m1, m2   means of exp(-x) and exp(-2 x) over the windows

    mean C   = r (1 - m1)
    mean C²  = r (1 - 2 m1 + m2)

k times the sum of w_j in the place of x would make exp(-x) too large, because exp is not linear,
and the fewer dents, the worse. But B_1 has exactly exp(-x) for its mean, and B_2 exp(-2 x), for
dents of any sizes and however short t is: B is the generating functional of a Poisson process
(J. F. C. Kingman, "Poisson Processes", Oxford 1993, chapter 3.2). For dents of one size it is the
estimator of I. J. Good and G. H. Toulmin, Biometrika 43 (1956) 45. It asks for about 3 dents in a
window for each unit of x; with fewer the products scatter more than what they estimate.

The 5th percentile of k times the sum of w_j is too low, because counts scatter. sqrt(x) scatters
alike everywhere (M. S. Bartlett, J. Roy. Stat. Soc. Suppl. 3 (1936) 68), so the roots are drawn to
their mean until they vary over the target as the true ones do: the variance of counting, which
shows from replica to replica, is taken away. The result of half of the replicas shows what error
is left; the step from it to that of all is made once more, and the interval includes it. This asks
for about 25 dents in a window.

Intervals are those of the delete-one jackknife over replicas (B. Efron and R. J. Tibshirani, "An
Introduction to the Bootstrap", Chapman & Hall 1993, chapter 11), and of the choice of the points,
from figures of every tenth of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from chamberopt.common.estimate import Estimate, estimate
from chamberopt.coverage.coverage_from_impacts import Batch
from chamberopt.coverage.field.surface_points import sampling_errors, sparse_points
from chamberopt.coverage.field.target_field import Gauge
from chamberopt.coverage.metrics import FULL_COVERAGE, NEVER, P05

# Dents in a window for each unit of x that the mean and the standard deviation take, in all windows
# but LEAST_RESOLVED of them, and dents in the median window for the figures of single places.
DENTS_FOR_MEAN, DENTS_FOR_PLACES = 3.0, 25.0
LEAST_RESOLVED = 0.05
ENOUGH = 1.2  # times what the dents so far foretell, which scatter themselves
SPLITS = 6  # of the replicas into halves
NOT_ONE = 3.0  # expected dents of which with a probability of 5 % there is not one
NOT_RESOLVED = "not resolved"
NEARLY_FULL = 0.9  # coverage above which times come from a shorter treatment


@dataclass(frozen=True)
class Resolution:
    """How many dents the windows of a simulation have, and how many its figures take."""

    dents: float  # in the median window
    needed_for_mean: float  # dents in the median window for mean and standard deviation
    needed_for_places: float  # for 5th percentile, times and intensity
    simulated_time: float  # of all replicas [s]

    @property
    def has_mean(self) -> bool:
        return self.dents >= self.needed_for_mean

    @property
    def has_places(self) -> bool:
        return self.dents >= self.needed_for_places

    def time_for(self, needed: float) -> float:
        """Simulated time [s] in which the median window gets so many dents.

        With a margin where it has fewer now.
        """
        if not self.dents:
            return math.inf
        margin = 1.0 if self.dents >= needed else ENOUGH
        return margin * self.simulated_time * needed / self.dents


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


class Products(NamedTuple):
    """Products over the dents in each window of 1 - k w, for K time ratios.

    Attributes:
        of_all: of all batches, shape (p, K).
        of_rest: means over the windows of all batches but each, shape (g, K).
    """

    of_all: np.ndarray
    of_rest: np.ndarray


def multiply_dents(batches: Sequence[Batch], points: int, ratios: Sequence[float]) -> Products:
    """Multiply over the dents of all batches, and of all but each.

    Args:
        points: number of windows.
        ratios: times over the simulated time of one replica, shape (K,).
    """
    from chamberopt.coverage.field.windows import multiply_products

    size = np.array([one.replicas for one in batches])
    total, count, wanted = int(size.sum()), len(ratios), np.array(ratios, dtype=float)
    # Without a batch, k belongs to the number of the other replicas; batches have two sizes.
    sizes = np.unique(size)
    scales = np.concatenate([wanted / total, *(wanted / max(total - one, 1) for one in sizes)])
    products = np.ones((len(batches), points, len(scales)))
    for product, one in zip(products, batches, strict=True):
        multiply_products(product, one.footprints.point, one.footprints.weight, scales)
    of_rest = np.empty((len(batches), count))
    for number, one_size in enumerate(sizes, start=1):
        part = products[:, :, number * count : (number + 1) * count]
        of_this = size == one_size
        of_rest[of_this] = products_without_each(part).mean(axis=1)[of_this]
    return Products(products[:, :, :count].prod(axis=0), of_rest)


def find_resolution(
    batches: Sequence[Batch], gauge: Gauge, time_ratio: float, time: float
) -> Resolution:
    """Compare the dents in the windows with what the figures take.

    Args:
        time_ratio: treatment time over the simulated time of one replica.
        time: simulated by each replica [s].
    """
    replicas = sum(one.replicas for one in batches)
    points, prints = len(gauge.area), [one.footprints for one in batches]
    dents = float(np.median(sum(np.bincount(one.point, minlength=points) for one in prints)))
    if not dents:
        return Resolution(0.0, DENTS_FOR_MEAN, DENTS_FOR_PLACES, replicas * time)
    # Area of dents that, all alike, would scatter as these do.
    area = sum(one.squares for one in prints) / sum(one.area for one in prints)
    # Dents for each unit of x; beside a crease those on the crease decide.
    per_unit = gauge.area / area
    if gauge.band is not None:
        chord = 0.5 * math.sqrt(math.pi * area)  # mean width of a dent across its diameter
        np.minimum.at(per_unit, gauge.band.point, gauge.band.length / chord)
    poorest = float(np.quantile(per_unit, LEAST_RESOLVED)) * replicas / time_ratio
    needed = dents * DENTS_FOR_MEAN / poorest
    return Resolution(dents, needed, DENTS_FOR_PLACES, replicas * time)


def coverage_estimates(
    batches: Sequence[Batch],
    points: int,
    reachable: float,
    time_ratio: float,
    reachable_error: float = 0.0,
) -> dict[str, Estimate]:
    """Estimate mean_coverage, std_coverage and p05_coverage by Avrami's equation.

    Args:
        points: number of windows.
        reachable: share of the target that a ball can touch.
        time_ratio: treatment time over the simulated time of one replica.
        reachable_error: standard error of `reachable`, by the choice of points.
    """
    products = multiply_dents(batches, points, [time_ratio, 2.0 * time_ratio])
    mean, variance = mean_and_variance_estimates(products, reachable, reachable_error)
    return {
        "mean_coverage": mean,
        "std_coverage": root_of_variance(variance),
        "p05_coverage": p05_estimate(batches, points, reachable, time_ratio),
    }


def mean_and_variance_estimates(
    products: Products, reachable: float, reachable_error: float
) -> tuple[Estimate, Estimate]:
    """Mean and variance of coverage over the target.

    Args:
        products: of the time ratio and of twice that.
        reachable, reachable_error: as for `coverage_estimates`.
    """
    of_all, of_rest = products
    values = mean_and_variance(np.vstack([of_all.mean(axis=0), of_rest]), reachable)
    of_some = np.array([some.mean(axis=0) for some in sparse_points(of_all)])
    some = mean_and_variance(of_some, reachable)
    # Both move with the reachable share too: by their differences from one standard error more.
    more = mean_and_variance(of_all.mean(axis=0), reachable + reachable_error)
    mean, variance = (
        estimate(
            jackknife(values[k]),
            0.0,
            highest,
            shared=[*sampling_errors(some[k]), float(more[k] - values[k][0])],
        )
        for k, highest in enumerate((1.0, 0.25))
    )
    return mean, variance


def products_without_each(products: np.ndarray) -> np.ndarray:
    """Products over all batches but one, for each one, (g, p, k) from (g, p, k)."""
    before, after = np.ones_like(products), np.ones_like(products)
    np.cumprod(products[:-1], axis=0, out=before[1:])
    after[:-1] = np.cumprod(products[:0:-1], axis=0)[::-1]
    return before * after


def mean_and_variance(uncovered: np.ndarray, reachable: float) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variance of coverage over the target from (m1, m2), rows (..., 2)."""
    m1, m2 = np.moveaxis(uncovered, -1, 0)
    mean = reachable * (1.0 - m1)
    return mean, reachable * (1.0 - 2.0 * m1 + m2) - mean**2


def jackknife(values: np.ndarray) -> np.ndarray:
    """Pseudo-values about a value that needs no correction of its bias.

    Args:
        values: of all batches, and of all but each, (g + 1,).
    """
    batches = len(values) - 1
    if batches == 1:
        return values[:1]
    raw = batches * values[0] - (batches - 1) * values[1:]
    return np.asarray(raw + (values[0] - raw.mean()))


def root_of_variance(variance: Estimate) -> Estimate:
    """Standard deviation from a variance.

    The square root is steep at 0: the ends of the interval of the variance give those of the
    standard deviation, and its longer side serves for both.
    """
    value, reach, slope = math.sqrt(variance.value), variance.half_width, 0.0
    if 0.0 < reach < math.inf:
        low, high = (math.sqrt(max(0.0, variance.value + side * reach)) for side in (-1.0, 1.0))
        slope = max(value - low, high - value) / reach
    found = estimate(value + slope * (np.array(variance.pseudovalues) - variance.value), 0.0)
    shared = tuple(slope * one for one in variance.shared)
    return replace(found, half_width=slope * reach if slope else reach, shared=shared)


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
