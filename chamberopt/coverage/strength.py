"""Peening strength of a place, and how evenly it is spread over the target.

Notation
    d, D    diameters of a dent and of its ball [m]
    s       strength of one impact, d² / D: eight times dent volume over dent area [m]
    L(s)    dents of more than s in a window, as a rate: sum of their areas over the window's and
            over the time [1/s]
    h(t)    strength that a place has after a time t, each spot keeping its strongest dent [m]
    T       saturation time: the largest for which h(2 T) = 1.1 h(T) [s]
    S       peening strength, h(T) [m]

    h(t) = integral over s of 1 - exp(-L(s) t)

An Almen strip's arc height saturates like h, and 10 % more in twice the time is what SAE J443
calls saturated. The arc height goes with d²/D as long as the strip's in-plane stretch, and not its
yielding, limits it. For equal impacts h is the curve a (1 - exp(-b t)) of D. Kirk, "Almen
saturation curve solver program", The Shot Peener, 2005. Intensity is S times a constant that a set
of strips calibrates, here 1. The strip's hardness is part of it: all dents grow alike with it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.estimate import Estimate, estimate, jackknife
from chamberopt.coverage.coverage_intervals import root_of_variance
from chamberopt.coverage.field.surface_points import sampling_errors, sparse_points

if TYPE_CHECKING:
    from chamberopt.coverage.field.target_field import TargetField
    from chamberopt.coverage.field.windows import Places, Windows
    from chamberopt.coverage.part_impacts import Hits

LEVELS = 32  # of s; twice as many change S by less than 0.3 %
WINDOWS = 2_000  # of the target's; S varies little from one to the next
SATURATED = 1.1  # SAE J443
NEWTON_STEPS = 3  # S moves by a quarter of what the saturation time is wrong by
HALVINGS = 12
MIN_BATCHES = 4  # for two quarters
SPLITS = 3  # into halves, and into quarters


def impact_strength(hits: Hits, density: float) -> np.ndarray:
    """Strength s of each impact [m], (k,); 0 where it leaves no dent.

    Args:
        density: of the balls [kg/m³].
    """
    strength, dents = np.zeros(len(hits)), np.flatnonzero(hits.dent > 0.0)
    speed, dent = hits.speed[dents].astype(float), hits.dent[dents].astype(float)
    ball = (6.0 / np.pi * 2.0 * hits.energy[dents] / speed**2 / density) ** (1.0 / 3.0)
    strength[dents] = dent**2 / ball
    return strength


def levels(values: np.ndarray, highest: float) -> np.ndarray:
    """The level of each value, 0 to LEVELS - 1."""
    return np.minimum(LEVELS * values / max(highest, 1e-300), LEVELS - 1).astype(np.int64)


def strength_histogram(
    windows: Windows, area: np.ndarray, contacts: Places, dent: np.ndarray, level: np.ndarray
) -> np.ndarray:
    """Dented area over area of each window, by level of strength, (p, LEVELS).

    Args:
        area: of the windows [m²], (p,).
        contacts: where the dents are.
        dent: their diameters [m], (k,).
        level: their levels, (k,).
    """
    points = len(area)
    sums = np.zeros(points * LEVELS)
    size = np.pi / 4.0 * dent**2
    for point, contact in windows.pairs(contacts):
        at = point.astype(np.int64) * LEVELS + level[contact]
        sums += np.bincount(at, size[contact], len(sums))
    return sums.reshape(points, LEVELS) / area[:, None]


def saturated_strength(histogram: np.ndarray, highest: float) -> tuple[np.ndarray, np.ndarray]:
    """S [m] and T, in units of the time of the dents, of each window, (p,); 0 where there are none.

    Args:
        histogram: dented area over area of each window by level, (p, LEVELS).
        highest: strength at the upper end of the levels [m].
    """
    rate = _rates(histogram)
    # Between these times lies T: where all dents are alike, ln 10 over their rate.
    top = rate.max(axis=1)
    some = top > 0.0
    low = np.divide(0.1, top, out=np.zeros_like(top), where=some)
    weakest = np.where(rate > 0.0, rate, np.inf).min(axis=1)
    high = np.where(some, 5.0 / weakest, 0.0)
    for _ in range(HALVINGS):
        middle = np.sqrt(low * high)
        grows = _gain(rate, middle)[0] > 0.0
        low, high = np.where(grows, middle, low), np.where(grows, high, middle)
    return _strength(rate, low, highest), low


def strength_near(histogram: np.ndarray, highest: float, time: np.ndarray) -> np.ndarray:
    """S [m] of each window (p,) where the saturation time is known to be near `time` (p,)."""
    rate = _rates(histogram)
    for _ in range(NEWTON_STEPS):
        gain, slope = _gain(rate, time)
        step = np.divide(gain, slope, out=np.zeros_like(gain), where=slope < 0.0)
        time = np.clip(time - step, 0.5 * time, 2.0 * time)
    return _strength(rate, time, highest)


def _rates(histogram: np.ndarray) -> np.ndarray:
    """Rate of dents stronger than the middle of each level, (p, LEVELS)."""
    down = np.cumsum(histogram[:, ::-1], axis=1)[:, ::-1]
    return np.asarray(down - 0.5 * histogram)


def _gain(rate: np.ndarray, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """h(2 T) - 1.1 h(T), in levels, and its slope over T."""
    left = np.exp(-rate * time[:, None])
    gain = (1.0 - left**2).sum(axis=1) - SATURATED * (1.0 - left).sum(axis=1)
    slope = (rate * (2.0 * left**2 - SATURATED * left)).sum(axis=1)
    return gain, slope


def _strength(rate: np.ndarray, time: np.ndarray, highest: float) -> np.ndarray:
    return np.asarray(-np.expm1(-rate * time[:, None]).sum(axis=1) * highest / LEVELS)


def intensity_uniformity(
    field: TargetField, replicas: Sequence[Sequence[Hits]], density: float
) -> Estimate:
    """Estimate 1 - (standard deviation of S) / (mean of S) over the target: 1 is even.

    A place out of reach has S = 0. S scatters as counts do, which would add to its variance. So the
    mean square comes from products of S in two disjoint halves of the replicas, whose scatter is
    independent. S is also too small where there are few dents, because the strongest are missing.
    Quarters of the replicas show by how much that changes the result; the step from them to the
    halves is made once more, and the interval includes it.

    Args:
        replicas: impacts of the replicas of each batch.
        density: of the balls [kg/m³].
    """
    from chamberopt.coverage.field.windows import Windows

    gauge = field.gauge
    rows = np.linspace(0, len(gauge.area) - 1, min(WINDOWS, len(gauge.area))).astype(int)
    windows = Windows(gauge.windows.points.select(rows), gauge.windows.radius)
    area = gauge.area[rows]
    replicas = [[field.in_sector(hits) for hits in batch] for batch in replicas]
    of_hits = [[impact_strength(hits, density) for hits in batch] for batch in replicas]
    highest = max(float(s.max(initial=0.0)) for batch in of_hits for s in batch)
    if highest == 0.0:
        return Estimate(0.0, math.inf, (0.0,) * len(replicas))
    parts = np.zeros((len(replicas), len(rows), LEVELS))
    for number, (batch, strengths) in enumerate(zip(replicas, of_hits, strict=True)):
        for hits, s in zip(batch, strengths, strict=True):
            dents = np.flatnonzero(s > 0.0)
            level = levels(s[dents], highest)
            contacts = field.places_of(hits, dents)
            parts[number] += strength_histogram(
                windows, area, contacts, hits.dent[dents].astype(float), level
            )
    return uniformity_of(parts, highest, field.reachable)


def uniformity_of(parts: np.ndarray, highest: float, reachable: float) -> Estimate:
    """The uniformity from histograms of batches, (g, p, LEVELS)."""
    batches, whole = len(parts), parts.sum(axis=0)
    strength, time = saturated_strength(whole, highest)
    if batches < MIN_BATCHES:
        value = _uniformity(_spread(strength, strength), reachable)
        return Estimate(value, math.inf, (value,) * batches)
    rng = np.random.default_rng(0)
    by_halves = _spreads_of_pairs(parts, highest, batches // 2, rng)
    by_quarters = _spreads_of_pairs(parts, highest, batches // 4, rng)
    # With half the dents, the error of S is about twice as large.
    value = _uniformity(float((2.0 * by_halves - by_quarters).mean()), reachable)
    # The bias falls more slowly than that; twice the step held where once held in 3 of 4 runs.
    # Steps of single pairs do not cancel where their mean is near 0 by chance.
    steps = [
        _uniformity(2.0 * half - quarter, reachable) - _uniformity(half, reachable)
        for half, quarter in zip(by_halves, by_quarters, strict=True)
    ]
    bias = 2.0 * math.sqrt(float(np.mean(np.square(steps))))
    of_some = [_uniformity(_spread(some, some), reachable) for some in sparse_points(strength)]
    values = np.array(
        [
            batches * strength - (batches - 1) * strength_near(whole - part, highest, time)
            for part in parts
        ]
    )
    squares, means = values @ values.T / values.shape[1], values.mean(axis=1)
    without = [
        _relative_variance(squares[np.ix_(rest, rest)], means[rest], reachable)
        for rest in ~np.eye(batches, dtype=bool)
    ]
    everything = _relative_variance(squares, means, reachable)
    spread = root_of_variance(estimate(jackknife(np.array([everything, *without])), 0.0))
    deviations = np.array(spread.pseudovalues) - spread.value
    return estimate(
        value - deviations, highest=1.0, bias=bias, shared=sampling_errors(np.array(of_some))
    )


def _spreads_of_pairs(
    parts: np.ndarray, highest: float, size: int, rng: np.random.Generator
) -> np.ndarray:
    """Mean square of S over the square of its mean, from each of SPLITS pairs of sets of batches.

    Args:
        size: number of batches in each set.
    """
    spreads = []
    for _ in range(SPLITS):
        order = rng.permutation(len(parts))
        one, two = (
            saturated_strength(parts[order[k * size : (k + 1) * size]].sum(axis=0), highest)[0]
            for k in (0, 1)
        )
        spreads.append(_spread(one, two))
    return np.array(spreads)


def _spread(one: np.ndarray, two: np.ndarray) -> float:
    """Mean product of two estimates of S, (p,) each, over the product of their means."""
    means = float(one.mean() * two.mean())
    return float((one * two).mean()) / means if means > 0.0 else 2.0


def _uniformity(spread: float, reachable: float) -> float:
    """The uniformity over the whole target; places out of reach have S = 0."""
    return 1.0 - math.sqrt(max(0.0, spread / reachable - 1.0))


def _relative_variance(squares: np.ndarray, means: np.ndarray, reachable: float) -> float:
    """Variance of S over the target over the square of its mean.

    Args:
        squares: means over the windows of products of two batches, (g, g).
        means: of the batches, (g,).
    """
    batches, mean = len(means), float(means.mean())
    if mean <= 0.0:
        return 1.0
    pairs = batches * (batches - 1)
    square = float(squares.sum() - np.trace(squares)) / pairs
    square_of_mean = float(means.sum() ** 2 - (means**2).sum()) / pairs
    return (reachable * square - reachable**2 * square_of_mean) / (reachable * mean) ** 2
