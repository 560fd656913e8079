"""Compute the difference of a figure between two candidates, and the replicas to prove it."""

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

MAX_TIME_RATIO = 1000  # times the simulated time; the largest forecast


@dataclass(frozen=True)
class Difference:
    """A figure of a later candidate minus the same figure of the first candidate.

    Args:
        value: the difference.
        half_width: half-width of its interval.
        paired: True if replicas were compared pair by pair on the same seeds, as they correlate.
            False if the samples were compared as independent (Welch).
        time_ratio: `replicas` divided by the number of replicas that were simulated.
        replicas: number of replicas of the later candidate that would show the difference if it is
            as large as it looks. `replicas` and `time_ratio` are None if the difference is real or
            0, or if the ratio exceeds MAX_TIME_RATIO.
        in_words: text in place of the difference, if one of the two figures has no number.
    """

    value: float
    half_width: float
    paired: bool
    time_ratio: float | None = None
    replicas: int | None = None
    in_words: str = ""

    @property
    def real(self) -> bool:
        """True if the difference is larger than its half-width."""
        return not self.in_words and abs(self.value) > self.half_width

    @property
    def estimate(self) -> Estimate:
        """The difference as an Estimate: value and half-width, or words in place of them."""
        return Estimate(self.value, self.half_width, in_words=self.in_words)


def confidence_of_each(comparisons: int) -> float:
    """Return the confidence that each of `comparisons` intervals needs.

    With this confidence, all intervals hold at the same time with 95 %.

    Source: Bonferroni's inequality, O. J. Dunn, "Multiple comparisons among means",
    J. Am. Stat. Assoc. 56 (1961) 52.
    """
    return 1.0 - (1.0 - CONFIDENCE) / comparisons


def difference(
    after: Estimate, before: Estimate, same_seeds: bool, confidence: float = CONFIDENCE
) -> Difference:
    """Return the difference `after` - `before` with its interval.

    Replicas are compared pair by pair if both results have the same seeds and their replicas
    correlate.
    """
    count = len(after.pseudovalues)
    gap = (paired_difference if same_seeds else independent_difference)(after, before, confidence)
    paired = len(gap.pseudovalues) > 0  # one a pair; none from independent samples
    # The same twice differs by the rounding of its sums.
    value, half_width = (
        0.0 if abs(one) < ZERO_TOLERANCE else one for one in (gap.value, gap.half_width)
    )
    found = Difference(value, half_width, paired)
    if not (after.has_number and before.has_number):
        return replace(found, half_width=math.inf, in_words="not known")
    if found.real or found.value == 0.0 or min(count, len(before.pseudovalues)) < 2:
        return found
    if paired:
        scatter = _paired_half_width(gap, confidence)
    else:
        scatter = partial(welch_half_width, after.pseudovalues, before.pseudovalues, confidence)
    lasting = shared_half_width(gap.shared, confidence)
    # The bias comes from too few dents, so it is assumed to shrink like the scatter.
    needed = _smallest_number(
        lambda n: math.hypot(scatter(n / count), lasting) + gap.bias * math.sqrt(count / n),
        count,
        abs(gap.value),
    )
    return found if needed is None else replace(found, time_ratio=needed / count, replicas=needed)


def _paired_half_width(gap: Estimate, confidence: float) -> Callable[[float], float]:
    """Return a function that predicts the half-width of a difference from pairs of replicas.

    The function's argument is the future number of pairs divided by the present number.
    """
    count, deviation = len(gap.pseudovalues), float(np.std(gap.pseudovalues, ddof=1))
    return lambda ratio: (
        student_quantile(count * ratio - 1.0, confidence) * deviation / math.sqrt(count * ratio)
    )


def _smallest_number(half_width: Callable[[float], float], count: int, gap: float) -> int | None:
    """Return the smallest number of replicas above `count` with a half-width below `gap`.

    Return None if MAX_TIME_RATIO * count replicas are not enough.

    Args:
        half_width: function from a number of replicas to the half-width.
    """
    low, high = count, MAX_TIME_RATIO * count
    if half_width(high) >= gap:
        return None
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if half_width(middle) < gap else (middle, high)
    return high
