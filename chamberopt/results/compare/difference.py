"""The difference of a figure between two candidates: is it real, and what would show it?"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from chamberopt.common.estimate import (
    CONFIDENCE,
    ZERO_TOLERANCE,
    Estimate,
    independent_difference,
    paired_difference,
    shared_half_width,
    student_quantile,
    welch_half_width,
)

MAX_TIME_RATIO = 1000  # no forecast beyond this many times the simulated time


@dataclass(frozen=True)
class Difference:
    """The figure of a later candidate minus that of the first.

    Args:
        value: the difference.
        half_width: of its interval.
        paired: whether replicas were compared pair by pair on the same seeds; else the samples are
            taken as independent (Welch).
        time_ratio: replicas over the number of replicas there are.
        replicas: number of replicas of the later candidate that would show the difference if it is
            as large as it looks. None, as is time_ratio, where the difference is real or 0, or
            beyond MAX_TIME_RATIO.
        in_words: what stands in the place of the number where one of the figures is not a number.
    """

    value: float
    half_width: float
    paired: bool
    time_ratio: float | None = None
    replicas: int | None = None
    in_words: str = ""

    @property
    def real(self) -> bool:
        """Whether the difference is larger than its half-width."""
        return not self.in_words and abs(self.value) > self.half_width

    @property
    def estimate(self) -> Estimate:
        """The difference with its interval."""
        return Estimate(self.value, self.half_width, in_words=self.in_words)


def confidence_of_each(comparisons: int) -> float:
    """Confidence of each interval such that all of them hold together with 95 %.

    Source: Bonferroni's inequality, O. J. Dunn, "Multiple comparisons among means",
    J. Am. Stat. Assoc. 56 (1961) 52.
    """
    return 1.0 - (1.0 - CONFIDENCE) / comparisons


def difference(
    after: Estimate, before: Estimate, same_seeds: bool, confidence: float = CONFIDENCE
) -> Difference:
    """Return after - before with its interval.

    Replicas are compared pair by pair where both have the same number on the same seeds.
    """
    count = len(after.pseudovalues)
    paired = same_seeds and count == len(before.pseudovalues) > 0
    gap = (paired_difference if paired else independent_difference)(after, before, confidence)
    found = Difference(
        0.0 if abs(gap.value) < ZERO_TOLERANCE else gap.value, gap.half_width, paired
    )
    if not (after.has_number and before.has_number):
        return replace(found, half_width=math.inf, in_words="not known")
    if found.real or found.value == 0.0 or min(count, len(before.pseudovalues)) < 2:
        return found
    if paired:
        scatter = _paired_half_width(gap, confidence)
    else:
        scatter = partial(welch_half_width, after.pseudovalues, before.pseudovalues, confidence)
    lasting = shared_half_width(gap.shared, confidence)
    # The bias comes from having few dents, so it is assumed to shrink as the scatter does.
    needed = _smallest_number(
        lambda n: math.hypot(scatter(n / count), lasting) + gap.bias * math.sqrt(count / n),
        count,
        abs(gap.value),
    )
    return found if needed is None else replace(found, time_ratio=needed / count, replicas=needed)


def _paired_half_width(gap: Estimate, confidence: float) -> Callable[[float], float]:
    """Return the half-width as a function of the number of pairs, as a multiple of today's."""
    count, deviation = len(gap.pseudovalues), float(np.std(gap.pseudovalues, ddof=1))
    return lambda ratio: (
        student_quantile(count * ratio - 1.0, confidence) * deviation / math.sqrt(count * ratio)
    )


def _smallest_number(half_width: Callable[[float], float], count: int, gap: float) -> int | None:
    """Return the smallest number of replicas above count whose half-width is below the gap.

    None if that is more than MAX_TIME_RATIO * count.
    """
    low, high = count, MAX_TIME_RATIO * count
    if half_width(high) >= gap:
        return None
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if half_width(middle) < gap else (middle, high)
    return high
