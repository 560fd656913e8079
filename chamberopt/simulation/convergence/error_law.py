"""How an error falls with its price: errors of sub-pools of replicas, a power law through them, the Pareto front."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from chamberopt.coverage.statistics.confidence_interval import CONFIDENCE

NORMAL = 1.96  # half-width of a 95 % interval over the standard error
DRAWS = 200  # resampled pools behind the law's interval


@dataclass(frozen=True)
class Level:
    """Sub-pools of so many replicas.

    blocks: how many such sub-pools, none sharing a replica · rms, low, high: root mean square error of the objective
    against the infinite pool, and its 95 % interval · said: mean half-width of the intervals that sub-pools give
    themselves · cpu_s: CPU seconds of one, simulated and estimated · joined: whether some had so few dents that
    triangles were taken together, which has errors of its own.
    """

    replicas: int
    blocks: int
    rms: float
    low: float
    high: float
    said: float
    cpu_s: float
    joined: bool = False

    @property
    def error(self) -> float:
        """Half-width of a 95 % interval that is as wide as the errors are."""
        return NORMAL * self.rms


@dataclass(frozen=True)
class Law:
    """error = scale · cost^(-power); half_width: 95 % interval of the power."""

    scale: float
    power: float
    half_width: float = math.inf

    @property
    def halving(self) -> tuple[float, float, float]:
        """Cost of halving the error, times, and the ends of its 95 % interval: 4 where it falls as 1/sqrt(cost)."""
        steep, flat = self.power + self.half_width, self.power - self.half_width
        return _factor(self.power), _factor(steep), _factor(flat)


def _factor(power: float) -> float:
    return float(2.0 ** (1.0 / power)) if power > 1e-3 else math.inf


def rms_error(values: np.ndarray, whole: float, share: float) -> float:
    """Root mean square error of sub-pools (m,) against the infinite pool, from that against the whole pool.

    A sub-pool that is a share of the pool is part of what it is compared with: independent replicas of variance s²
    give mean square s²/k - s²/R = s²/k (1 - share).
    """
    return math.sqrt(float(np.mean((np.asarray(values) - whole) ** 2)) / (1.0 - share))


def rms_interval(rms: float, blocks: int) -> tuple[float, float]:
    """95 % interval of the RMS error of `blocks` sub-pools that make up a pool: chi-square, blocks - 1 degrees."""
    from scipy.special import chdtri  # upper tail of chi-square, inverted

    freedom, tail = blocks - 1, 0.5 - CONFIDENCE / 2.0
    return rms * math.sqrt(freedom / chdtri(freedom, tail)), rms * math.sqrt(
        freedom / chdtri(freedom, 1.0 - tail)
    )


def fitted(costs: Sequence[float], errors: Sequence[float], blocks: Sequence[int]) -> Law:
    """Weighted least squares in logarithms: the log of an RMS over m sub-pools scatters by 1/sqrt(2 (m - 1))."""
    x, y, weight = np.log(costs), np.log(errors), np.asarray(blocks, dtype=float) - 1.0
    mean_x, mean_y = np.average(x, weights=weight), np.average(y, weights=weight)
    slope = np.sum(weight * (x - mean_x) * (y - mean_y)) / np.sum(weight * (x - mean_x) ** 2)
    return Law(float(np.exp(mean_y - slope * mean_x)), float(-slope))


def law_of(levels: Sequence[Level], pseudovalues: Sequence[float]) -> Law:
    """The law of the levels' errors, its interval from resampled pools: levels share replicas, so scatter together.

    Of levels where no triangles were taken together, if there are two.
    """
    plain = [level for level in levels if not level.joined]
    levels = plain if len(plain) > 1 else levels
    costs, blocks = [level.cpu_s for level in levels], [level.blocks for level in levels]
    law = fitted(costs, [level.error for level in levels], blocks)
    rng = np.random.default_rng(0)
    powers = []
    for _ in range(DRAWS):
        pool = rng.choice(np.asarray(pseudovalues), len(pseudovalues))
        errors = []
        for level in levels:
            means = (
                pool[: level.replicas * level.blocks]
                .reshape(level.blocks, level.replicas)
                .mean(axis=1)
            )
            errors.append(rms_error(means, float(pool.mean()), level.replicas / len(pool)))
        powers.append(fitted(costs, errors, blocks).power)
    return Law(law.scale, law.power, NORMAL * float(np.std(powers)))


def front(costs: Sequence[float], errors: Sequence[float]) -> list[int]:
    """Indices of the points that none beats in both cost and error, cheapest first."""
    best, kept = math.inf, []
    for i in sorted(range(len(costs)), key=lambda i: (costs[i], errors[i])):
        if errors[i] < best:
            best = errors[i]
            kept.append(i)
    return kept
