"""Scales on which figures respond to changes of a design's numbers in nearly straight lines.

Notation
    m    a figure, such as mean_coverage
    L    the scale on which m is nearly a straight line: ln(-ln(1 - m)) for a share of the area,
         ln m for another positive figure, m itself for all other figures   (FigureScale)

Avrami's coverage is 1 - exp(-x). The dent density x is proportional to powers of amplitude, mass
and time, so that ln x = ln(-ln(1 - m)) is a straight line over their logarithms.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from chamberopt.common.estimate import FIRST_OF_CALIBRATION, NOT_RESOLVED, Estimate
from chamberopt.coverage.metrics import ObjectiveFunction, find_metric
from chamberopt.simulation.estimates import weighted_sum

if TYPE_CHECKING:
    from collections.abc import Mapping


class FigureScale(NamedTuple):
    """A scale on which a figure responds nearly linearly: function, inverse and slope."""

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
    """Return the scale on which a metric responds to a design's numbers nearly in a straight line.

    It is ln(-ln(1 - m)) for a share m of an area, the logarithm for another metric that is never
    negative, and the metric itself for all other metrics.
    """
    metric = find_metric(name)
    if metric is None or metric.lowest < 0.0:
        return IDENTITY
    return SHARE if metric.highest == 1.0 else LOGARITHM


def on_scale(figure: Estimate, scale: FigureScale) -> Estimate:
    """Return the estimate of a figure on its scale, with an interval if the figure has an interval.

    The half-width on the scale is so chosen that `back_from_scale` returns the half-width of the
    figure. Half-width times slope of the scale would be far wider near full coverage. Pseudo-values
    and shared errors are multiplied by the slope, as far as the half-width has room for them. A
    logarithm has no interval where the interval of the figure reaches 0.
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
    """Give a changed design's figure the calibration errors of the nominal design's figure.

    Both figures are on their scale, on which calibration errors move them by the same amount. A
    figure that has calibration errors already stays as it is.
    """
    errors = nominal.shared[FIRST_OF_CALIBRATION:]
    if not errors or changed.shared[FIRST_OF_CALIBRATION:]:
        return changed
    return changed.with_shared(FIRST_OF_CALIBRATION, errors)


def back_from_scale(value: Estimate, scale: FigureScale) -> Estimate:
    """Return the estimate of a figure from its estimate on the scale.

    The scale makes the interval lopsided; the half-width is its longer side.
    """
    middle = scale.inverse(value.value)
    if value.in_words or not math.isfinite(value.half_width):
        return Estimate(middle, math.inf, in_words=value.in_words or NOT_RESOLVED)
    sides = (abs(scale.inverse(one) - middle) for one in (value.low, value.high))
    return Estimate(middle, max(sides))


def combine(figures: Mapping[str, Estimate], weights: Mapping[str, float]) -> Estimate:
    """Return the weighted sum of estimates that come from the same replicas.

    An estimate without a weight is left out.
    """
    used = {name: weight for name, weight in weights.items() if weight}
    if not used:
        return Estimate(0.0, 0.0)
    return weighted_sum(ObjectiveFunction("", "", used), dict(figures))
