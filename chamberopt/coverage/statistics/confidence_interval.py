"""A number and how sure it is: mean of pseudo-values, Student's interval, and what is left of bias."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

CONFIDENCE = 0.95
ZERO_TOLERANCE = 1e-12  # what rounding leaves of a zero


@dataclass(frozen=True)
class Estimate:
    """A value with the half-width of its 95 % interval, and the pseudo-values (n,), one a replica, behind both.

    bias: how far the value may lie off however many such replicas there were; half_width has it in it.
    """

    value: float
    half_width: float
    pseudovalues: tuple[float, ...] = field(default=(), repr=False)
    bias: float = 0.0

    @property
    def low(self) -> float:
        return self.value - self.half_width

    @property
    def high(self) -> float:
        return self.value + self.half_width


def estimate(
    pseudovalues: Sequence[float] | np.ndarray,
    lowest: float = -math.inf,
    highest: float = math.inf,
    bias: float = 0.0,
    confidence: float = CONFIDENCE,
) -> Estimate:
    """Mean of the pseudo-values, clipped to the range the quantity can have, with its Student-t interval.

    Where the clip bites, the pseudo-values are moved with it: what is made of them later (an objective, a gain)
    then has the same value as what is made of the clipped estimates.
    """
    values = np.asarray(pseudovalues, dtype=float)
    mean = float(np.clip(values.mean(), lowest, highest))
    values = values + (mean - values.mean())
    n = len(values)
    half_width, bias = float("inf"), float(bias)
    if n > 1:
        half_width = (
            student_quantile(n - 1, confidence) * float(values.std(ddof=1)) / math.sqrt(n) + bias
        )
    return Estimate(mean, half_width, tuple(values.tolist()), bias)


def student_quantile(freedom: float, confidence: float = CONFIDENCE) -> float:
    """How many standard errors the interval reaches to each side."""
    from scipy.special import stdtrit  # scipy.stats would take a second to import

    return float(stdtrit(freedom, 0.5 + confidence / 2.0))


def paired_difference(
    after: Estimate, before: Estimate, confidence: float = CONFIDENCE
) -> Estimate:
    """after - before with its 95 % interval, from replicas run on the same seeds, pair by pair.

    The jackknife of the difference: its pseudo-values are the differences of the two. A peening chamber is
    chaotic, so equal seeds hardly correlate, but where they do the interval is right too. Different numbers of
    replicas make no pairs: they are taken as independent.
    """
    if not after.pseudovalues or len(after.pseudovalues) != len(before.pseudovalues):
        return independent_difference(after, before, confidence)
    gaps = np.subtract(after.pseudovalues, before.pseudovalues)
    pairs = estimate(gaps, bias=after.bias + before.bias, confidence=confidence)
    return Estimate(after.value - before.value, pairs.half_width, pairs.pseudovalues, pairs.bias)


def independent_difference(
    after: Estimate, before: Estimate, confidence: float = CONFIDENCE
) -> Estimate:
    """after - before with its 95 % interval when the two were simulated independently (Welch's t)."""
    value, bias = after.value - before.value, after.bias + before.bias
    if (
        min(len(after.pseudovalues), len(before.pseudovalues)) < 2
    ):  # nothing to count with: intervals in quadrature
        return Estimate(value, math.hypot(after.half_width, before.half_width), (), bias)
    scatter = welch_half_width(after.pseudovalues, before.pseudovalues, confidence)
    return Estimate(value, scatter + bias, (), bias)


def welch_half_width(
    after: Sequence[float],
    before: Sequence[float],
    confidence: float = CONFIDENCE,
    times: float = 1.0,
) -> float:
    """Half-width of the interval of a difference of means, had each so many times as many values of this scatter.

    B. L. Welch, "The generalization of 'Student's' problem when several different population variances are
    involved", Biometrika 34 (1947) 28.
    """
    a, b = times * len(after), times * len(before)
    va, vb = float(np.var(after, ddof=1)) / a, float(np.var(before, ddof=1)) / b
    if va + vb == 0.0:
        return 0.0
    freedom = (va + vb) ** 2 / (va**2 / (a - 1.0) + vb**2 / (b - 1.0))
    return student_quantile(freedom, confidence) * math.sqrt(va + vb)
