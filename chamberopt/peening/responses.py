"""Scales on which figures respond to changes of a design's numbers in nearly straight lines.

Notation
    m    a figure, such as mean_coverage
    L    the scale on which m is nearly a straight line: ln(-ln(1 - m)) for a share of the area,
         ln m for another positive figure, m itself for the others          (FigureScale)

Avrami's coverage is 1 - exp(-x) with the dent density x, which goes with powers of amplitude, mass
and time: hence the scale of shares.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from chamberopt.common.estimate import FIRST_OF_CALIBRATION, Estimate
from chamberopt.coverage.coverage_intervals import NOT_RESOLVED
from chamberopt.coverage.metrics import ObjectiveFunction, find_metric
from chamberopt.simulation.estimates import weighted_sum

if TYPE_CHECKING:
    from collections.abc import Mapping


class FigureScale(NamedTuple):
    """A scale L(m) with its inverse and its slope dL/dm."""

    forward: Callable[[float], float]
    inverse: Callable[[float], float]
    slope: Callable[[float], float]


IDENTITY = FigureScale(lambda m: m, lambda value: value, lambda m: 1.0)
LOGARITHM = FigureScale(math.log, math.exp, lambda m: 1.0 / m)
SHARE = FigureScale(
    lambda m: math.log(-math.log1p(-m)),
    lambda value: -math.expm1(-math.exp(value)),
    lambda m: 1.0 / (math.log1p(-m) * (m - 1.0)),
)


def scale_of(name: str) -> FigureScale:
    """The scale of a metric."""
    metric = find_metric(name)
    if metric is None or metric.lowest < 0.0:
        return IDENTITY
    return SHARE if metric.highest == 1.0 else LOGARITHM


def on_scale(figure: Estimate, scale: FigureScale) -> Estimate:
    """The estimate of L from the estimate of m; without an interval where m has none.

    The half-width of L is so chosen that `back_from_scale` gives the half-width of m, because near
    full coverage the slope would make it far wider. Pseudo-values and shared errors are multiplied
    by the slope, as far as the half-width has room for them. A logarithm has no interval where the
    interval of m reaches 0.
    """
    if not math.isfinite(figure.half_width):
        return figure.not_known(figure.in_words or NOT_RESOLVED)
    try:
        value, slope = scale.forward(figure.value), abs(scale.slope(figure.value))
        half_width = value - scale.forward(figure.low)
    except (ValueError, ZeroDivisionError):
        return figure.not_known(figure.in_words or NOT_RESOLVED)
    with contextlib.suppress(ValueError):  # a share of 1 or more has no value on its scale
        half_width = min(half_width, scale.forward(figure.high) - value)
    scatter = figure.half_width - figure.beyond_scatter
    if scatter > 0.0:
        slope = min(slope, half_width / scatter)
    return replace(
        figure,
        value=value,
        half_width=half_width,
        pseudovalues=tuple(value + slope * (y - figure.value) for y in figure.pseudovalues),
        bias=max(0.0, half_width - slope * scatter),
        shared=tuple(slope * one for one in figure.shared),
        in_words="",
    )


def with_errors_of(nominal: Estimate, changed: Estimate) -> Estimate:
    """A changed design's L with the errors of calibration of the nominal L: both move together.

    A figure that the change leaves as it is has these errors already.
    """
    errors = nominal.shared[FIRST_OF_CALIBRATION:]
    if not errors or changed.shared[FIRST_OF_CALIBRATION:]:
        return changed
    return changed.with_shared(FIRST_OF_CALIBRATION, errors)


def back_from_scale(value: Estimate, scale: FigureScale) -> Estimate:
    """The estimate of m from the estimate of L; the half-width is the interval's wider side."""
    middle = scale.inverse(value.value)
    if value.in_words or not math.isfinite(value.half_width):
        return Estimate(middle, math.inf, in_words=value.in_words or NOT_RESOLVED)
    sides = (abs(scale.inverse(one) - middle) for one in (value.low, value.high))
    return Estimate(middle, max(sides))


def combine(figures: Mapping[str, Estimate], weights: Mapping[str, float]) -> Estimate:
    """Weighted sum of paired estimates; an estimate without a weight does not count."""
    used = {name: weight for name, weight in weights.items() if weight}
    if not used:
        return Estimate(0.0, 0.0)
    return weighted_sum(ObjectiveFunction("", "", used), dict(figures))
