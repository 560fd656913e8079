"""A figure of two candidates: how far apart, whether that is real, and if not, how long to simulate to know."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from chamberopt.coverage.statistics.confidence_interval import (
    CONFIDENCE,
    ZERO_TOLERANCE,
    Estimate,
    independent_difference,
    paired_difference,
    student_quantile,
    welch_half_width,
)

LONGEST = 1000  # times as long as was simulated: what takes more is not foretold


@dataclass(frozen=True)
class Difference:
    """A later candidate's figure minus the first's.

    value, half_width: with its interval · paired: replica by replica, on the same seeds; else independent (Welch) ·
    replicas: how many of the later candidate would tell the difference from nothing if it is as large as it looks,
    times: so many times those there are; None where it is real, where there is none, or beyond LONGEST times.
    """

    value: float
    half_width: float
    paired: bool
    times: float | None = None
    replicas: int | None = None

    @property
    def real(self) -> bool:
        """Whether it is larger than its interval."""
        return abs(self.value) > self.half_width

    def as_json(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            "value": self.value,
            "half_width": self.half_width,
            "paired": self.paired,
            "real": self.real,
            "times_as_long": self.times,
            "replicas": self.replicas,
        }


def confidence_of_each(comparisons: int) -> float:
    """Confidence of each of so many intervals for all of them together to hold with 95 %.

    Bonferroni's inequality: O. J. Dunn, "Multiple comparisons among means", J. Am. Stat. Assoc. 56 (1961) 52.
    """
    return 1.0 - (1.0 - CONFIDENCE) / comparisons


def difference(
    after: Estimate, before: Estimate, same_seeds: bool, confidence: float = CONFIDENCE
) -> Difference:
    """after - before, with its interval; as pairs where both have as many replicas, on the same seeds."""
    count = len(after.pseudovalues)
    paired = same_seeds and count == len(before.pseudovalues) > 0
    gap = (paired_difference if paired else independent_difference)(after, before, confidence)
    found = Difference(
        0.0 if abs(gap.value) < ZERO_TOLERANCE else gap.value, gap.half_width, paired
    )
    if found.real or found.value == 0.0 or min(count, len(before.pseudovalues)) < 2:
        return found
    scatter = _of_pairs(gap, confidence) if paired else _of_two(after, before, confidence)
    # The bias in an interval is of what so few dents do not say: it is taken to shrink like the scatter.
    needed = _smallest(
        lambda n: scatter(n / count) + gap.bias * math.sqrt(count / n), count, abs(gap.value)
    )
    return found if needed is None else replace(found, times=needed / count, replicas=needed)


def _of_pairs(gap: Estimate, confidence: float) -> Callable[[float], float]:
    """Half-width from so many times as many pairs of the same scatter."""
    count, deviation = len(gap.pseudovalues), float(np.std(gap.pseudovalues, ddof=1))
    return lambda times: (
        student_quantile(count * times - 1.0, confidence) * deviation / math.sqrt(count * times)
    )


def _of_two(after: Estimate, before: Estimate, confidence: float) -> Callable[[float], float]:
    """Half-width from so many times as many replicas of each, of the same scatter."""
    return partial(welch_half_width, after.pseudovalues, before.pseudovalues, confidence)


def _smallest(half_width: Callable[[float], float], count: int, gap: float) -> int | None:
    """The smallest number of replicas above count whose half-width is below the gap; None beyond LONGEST times."""
    low, high = count, LONGEST * count
    if half_width(high) >= gap:
        return None
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if half_width(middle) < gap else (middle, high)
    return high
