"""Mean and standard deviation of the target's coverage, with confidence intervals.

Notation
    window   disc of the surface round a point of the target, in which dents are counted
    x        dent density of a window at the treatment time T: expected sum of the dents' shares
    C        coverage, 1 - exp(-x)
    n, t     number of replicas, and the simulated time of each replica [s]
    w_j      share of the window that simulated dent j takes
    k        T / (n t)                                                       (scale)
    r        share of the target that a ball can touch                       (reachable)
    B_1, B_2 products over the dents in a window of (1 - k w_j), (1 - 2 k w_j)
    m1, m2   means of exp(-x) and exp(-2 x) over the windows

    mean C   = r (1 - m1)
    mean C²  = r (1 - 2 m1 + m2)

Since exp is not linear, k times the sum of w_j in the place of x would make exp(-x) too large, most
of all with few dents. But the mean of B_1 is exactly exp(-x), and the mean of B_2 is exp(-2 x), for
dents of any sizes and for any t: B is the generating functional of a Poisson process (J. F. C.
Kingman, "Poisson Processes", Oxford 1993, chapter 3.2). For dents of one size B is the estimator of
I. J. Good and G. H. Toulmin, Biometrika 43 (1956) 45. It asks for about 3 dents in a window for
each unit of x. With fewer dents the products scatter more than the quantity that they estimate.

Intervals have two parts: the delete-one jackknife over replicas (B. Efron and R. J. Tibshirani, "An
Introduction to the Bootstrap", Chapman & Hall 1993, chapter 11), and the error by the choice of the
points, which results from every tenth point show.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from chamberopt.common.estimate import Estimate, estimate, jackknife
from chamberopt.coverage.coverage_from_impacts import Batch, in_batches
from chamberopt.coverage.field.surface_points import Reach, sampling_errors, sparse_points
from chamberopt.coverage.field.target_field import Gauge
from chamberopt.coverage.percentile import (
    P05_COVERAGE,
    P95_COVERAGE,
    P95_EXPOSURE,
    DentSums,
    dent_sums,
    mean_exposure,
    quantile_estimate,
)


class Products(NamedTuple):
    """Product of 1 - k w over the dents in each window, for K time ratios k.

    A window is a disc of the target, and w is the share of it that a dent takes. The ratio k is the
    treatment time over the simulated time. The mean product is the share of the target left bare.

    Attributes:
        of_all: products over the dents of all batches of replicas, shape (p, K).
        of_rest: means over the windows of the products without each batch in turn, shape (g, K).
    """

    of_all: np.ndarray
    of_rest: np.ndarray


def multiply_dents(batches: Sequence[Batch], points: int, ratios: Sequence[float]) -> Products:
    """Multiply 1 - k w over the dents in each window (disc of the target), for each time ratio k.

    Here w is the share of the window that a dent takes. The products are over the dents of all
    batches of replicas, and of all batches without each batch in turn.

    Args:
        points: number of windows.
        ratios: treatment times over the simulated time of one replica, shape (K,).
    """
    from chamberopt.coverage.field.windows import multiply_products

    size = np.array([one.replicas for one in batches])
    scales = _scales(size, ratios)
    products = np.ones((len(batches), points, len(scales)))
    for product, one in zip(products, batches, strict=True):
        for point, weight in one.footprints.pairs():
            multiply_products(product, point, weight, scales)
    return _means_of(products, size, len(ratios))


def _scales(size: np.ndarray, ratios: Sequence[float]) -> np.ndarray:
    """Return k for all batches of these sizes, then k without a batch of each size.

    Without a batch, k follows from the number of the other replicas. Batches have two sizes.
    """
    total, wanted = int(size.sum()), np.array(ratios, dtype=float)
    rests = (wanted / max(total - one, 1) for one in np.unique(size))
    return np.concatenate([wanted / total, *rests])


def _means_of(products: np.ndarray, size: np.ndarray, count: int) -> Products:
    """Return the products of all batches, and their means without each, for `count` time ratios.

    Args:
        products: products over the dents of each batch, for all k of `_scales`, (g, p, k).
        size: replicas of each batch, (g,).
    """
    of_rest = np.empty((len(size), count))
    for number, one_size in enumerate(np.unique(size), start=1):
        part = products[:, :, number * count : (number + 1) * count]
        of_this = size == one_size
        of_rest[of_this] = products_without_each(part).mean(axis=1)[of_this]
    return Products(products[:, :, :count].prod(axis=0), of_rest)


class WindowTally:
    """Sums and products over the dents in windows, to which replicas are added one by one.

    It keeps no dents, but it must know beforehand how many replicas there will be.

    Args:
        replicas: number of replicas.
        points: number of windows.
        time_ratio: treatment time over the simulated time of one replica.
    """

    def __init__(self, replicas: int, points: int, time_ratio: float) -> None:
        self._size = np.array([len(one) for one in in_batches(range(replicas))])
        self._batch = np.repeat(np.arange(len(self._size)), self._size)
        self._scales = _scales(self._size, [time_ratio, 2.0 * time_ratio])
        self._sums = np.zeros((len(self._size), points, 3))
        self._products = np.ones((len(self._size), points, len(self._scales)))
        self._added = 0

    def add(self, pairs: Sequence[tuple[np.ndarray, np.ndarray]]) -> None:
        """Add a replica's pairs of a window and the share of it that a dent takes."""
        from chamberopt.coverage.field.windows import add_powers, multiply_products

        batch, self._added = self._batch[self._added], self._added + 1
        for point, weight in pairs:
            add_powers(point, weight, self._sums[batch])
            multiply_products(self._products[batch], point, weight, self._scales)

    @property
    def sums(self) -> DentSums:
        return dent_sums(self._size, self._sums)

    def mean_and_std(self, reach: Reach) -> tuple[Estimate, Estimate]:
        """Return the estimates of mean and standard deviation of the coverage."""
        products = _means_of(self._products, self._size, 2)
        mean, variance = mean_and_variance_estimates(products, reach)
        return mean, root_of_variance(variance)


def coverage_estimates(
    batches: Sequence[Batch], sums: DentSums, reach: Reach, time_ratio: float
) -> dict[str, Estimate]:
    """Estimate mean, deviation and percentiles of coverage and exposure by Avrami's equation.

    Args:
        sums: number and shares of the dents of the batches in each window.
        reach: share of the target that a ball can touch.
        time_ratio: treatment time over the simulated time of one replica.
    """
    products = multiply_dents(batches, len(sums.number), [time_ratio, 2.0 * time_ratio])
    mean, variance = mean_and_variance_estimates(products, reach)
    return {
        "mean_coverage": mean,
        "std_coverage": root_of_variance(variance),
        "exposure": mean_exposure(sums, reach, time_ratio),
        **{
            name: quantile_estimate(quantile, sums, reach, time_ratio)
            for name, quantile in (
                ("p05_coverage", P05_COVERAGE),
                ("p95_coverage", P95_COVERAGE),
                ("p95_exposure", P95_EXPOSURE),
            )
        },
    }


def mean_and_variance_estimates(products: Products, reach: Reach) -> tuple[Estimate, Estimate]:
    """Return estimates of the mean and of the variance of coverage over the target.

    Args:
        products: products over the dents in each window, for the ratio of the treatment time to the
            simulated time, and for twice this ratio.
    """
    of_all, of_rest = products
    values = mean_and_variance(np.vstack([of_all.mean(axis=0), of_rest]), reach.share)
    of_some = np.array([some.mean(axis=0) for some in sparse_points(of_all)])
    some = mean_and_variance(of_some, reach.share)
    # Both depend on the reachable share too. Their change with one standard error of it counts.
    more = mean_and_variance(of_all.mean(axis=0), sum(reach))
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
    """Return the products over all batches but one, for each of the g batches left out, (g, p, k).

    Args:
        products: products over the dents of each single batch, in p windows, (g, p, k).
    """
    before, after = np.ones_like(products), np.ones_like(products)
    np.cumprod(products[:-1], axis=0, out=before[1:])
    after[:-1] = np.cumprod(products[:0:-1], axis=0)[::-1]
    return np.asarray(before * after)


def mean_and_variance(uncovered: np.ndarray, reachable: float) -> tuple[np.ndarray, np.ndarray]:
    """Return mean and variance of coverage over the target.

    Args:
        uncovered: means over the windows of exp(-x) and exp(-2 x), where x is the dent density of a
            window, (..., 2).
        reachable: share of the target that a ball can touch.
    """
    m1, m2 = np.moveaxis(uncovered, -1, 0)
    mean = reachable * (1.0 - m1)
    return mean, reachable * (1.0 - 2.0 * m1 + m2) - mean**2


def root_of_variance(variance: Estimate) -> Estimate:
    """Return the estimate of a standard deviation, from the estimate of its variance.

    The square root is steep at 0. So the ends of the interval come from the ends of the variance's
    interval, and the longer side serves for both.
    """
    value, reach, slope = math.sqrt(variance.value), variance.half_width, 0.0
    if 0.0 < reach < math.inf:
        low, high = (math.sqrt(max(0.0, variance.value + side * reach)) for side in (-1.0, 1.0))
        slope = max(value - low, high - value) / reach
    found = estimate(value + slope * (np.array(variance.pseudovalues) - variance.value), 0.0)
    shared = tuple(slope * one for one in variance.shared)
    return replace(found, half_width=slope * reach if slope else reach, shared=shared)


# Dents in a window for each unit of x that the mean and the standard deviation take. The share
# LEAST_RESOLVED of the windows may have fewer. Figures of single places take DENTS_FOR_PLACES dents
# in the median window.
DENTS_FOR_MEAN, DENTS_FOR_PLACES = 3.0, 25.0
LEAST_RESOLVED = 0.05
ENOUGH = 1.2  # factor on the time that the dents so far foretell, because these dents scatter


@dataclass(frozen=True)
class Resolution:
    """Number of dents in the median window (disc of the target) of a simulation, and the numbers of
    dents that its results need to be trusted.
    """

    dents: float  # in the median window
    needed_for_mean: float  # dents in the median window for mean and standard deviation
    needed_for_places: float  # dents in the median window for 5th percentile, times and intensity
    simulated_time: float  # of all replicas [s]

    @property
    def has_mean(self) -> bool:
        return self.dents >= self.needed_for_mean

    @property
    def has_places(self) -> bool:
        return self.dents >= self.needed_for_places

    def time_for(self, needed: float) -> float:
        """Return the simulated time [s] in which the median window (disc) gets `needed` dents.

        The time has a margin if the window has fewer dents so far.
        """
        if not self.dents:
            return math.inf
        margin = 1.0 if self.dents >= needed else ENOUGH
        return margin * self.simulated_time * needed / self.dents


def find_resolution(
    batches: Sequence[Batch], sums: DentSums, gauge: Gauge, time_ratio: float, time: float
) -> Resolution:
    """Return the number of dents in the median window (disc of the target), and the numbers of
    dents that the results need to be trusted.

    Args:
        sums: number and shares of the dents of the batches in each window.
        time_ratio: treatment time over the simulated time of one replica.
        time: simulated time of each replica [s].
    """
    replicas = sum(one.replicas for one in batches)
    prints, dents = [one.footprints for one in batches], float(np.median(sums.number))
    if not dents:
        return Resolution(0.0, DENTS_FOR_MEAN, DENTS_FOR_PLACES, replicas * time)
    # Area of a dent such that equal dents would scatter as the given dents do.
    area = sum(one.squares for one in prints) / sum(one.area for one in prints)
    # Dents for each unit of x. Beside a crease the dents on the crease decide.
    per_unit = gauge.area / area
    if gauge.band is not None:
        chord = 0.5 * math.sqrt(math.pi * area)  # mean width of a dent across its diameter
        np.minimum.at(per_unit, gauge.band.point, gauge.band.length / chord)
    poorest = float(np.quantile(per_unit, LEAST_RESOLVED)) * replicas / time_ratio
    needed = dents * DENTS_FOR_MEAN / poorest
    return Resolution(dents, needed, DENTS_FOR_PLACES, replicas * time)
