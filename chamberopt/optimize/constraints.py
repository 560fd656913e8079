"""What a candidate must keep: by how much a figure misses its limits, and whether its interval says so too."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from chamberopt.coverage.statistics.confidence_interval import Estimate, student_quantile

if TYPE_CHECKING:
    from chamberopt.optimize.study import Limits

FEASIBLE, NOT_KNOWN, INFEASIBLE = "feasible", "not known", "infeasible"


def shortfall(figure: Estimate, limits: Limits) -> float:
    """By how much the true figure is to be expected beyond its limits, relative to them; what is exact is plain.

    The mean of max(0, limit - x) over x normal about the estimate: a figure just within its limit, known badly, has a
    price too, and the search keeps off by about what it cannot tell.
    """
    missed = 0.0
    for limit, beyond in _beyond(figure, limits):
        error = standard_error(figure)
        if error > 0.0:
            z = beyond / error
            beyond = 0.5 * beyond * math.erfc(-z / math.sqrt(2.0)) + error * math.exp(
                -0.5 * z * z
            ) / math.sqrt(2.0 * math.pi)
        missed += max(0.0, beyond) / (abs(limit) or 1.0)
    return missed


def violations(name: str, figure: Estimate, limits: Limits) -> list[str]:
    """Which limits the estimate itself misses, in words; empty when none."""
    said = []
    if limits.min is not None and figure.value < limits.min:
        said.append(f"{name} {figure.value:.4g} < min {limits.min:g}")
    if limits.max is not None and figure.value > limits.max:
        said.append(f"{name} {figure.value:.4g} > max {limits.max:g}")
    return said


def feasibility_of(
    constraints: Mapping[str, Limits], figures: Mapping[str, Estimate]
) -> tuple[str, str]:
    """Whether all limits are kept, to the end of the 95 % intervals, and why not, or why it is not known."""
    standing, reasons = FEASIBLE, []
    for name, limits in constraints.items():
        figure = figures[name]
        for limit, beyond in _beyond(figure, limits):
            if beyond + figure.half_width <= 0.0:
                continue
            missed = beyond > figure.half_width
            standing = INFEASIBLE if missed or standing == INFEASIBLE else NOT_KNOWN
            side = "min" if limit == limits.min else "max"
            sign = "<" if side == "min" else ">"
            within = f"{figure.value:.4g} ± {figure.half_width:.2g}"
            said = f"{name} {within} {sign} {side} {limit:g}"
            reasons.append(said if missed else f"{name} {within} may be {sign} {side} {limit:g}")
    return standing, "; ".join(reasons)


def standard_error(figure: Estimate) -> float:
    """Of an estimate, as its interval has it; 0 of what is exact or has no interval."""
    if not 0.0 < figure.half_width < math.inf:
        return 0.0
    return figure.half_width / student_quantile(max(1, len(figure.pseudovalues) - 1))


def _beyond(figure: Estimate, limits: Limits) -> list[tuple[float, float]]:
    """Each limit, and how far beyond it the estimate lies: negative when it is kept."""
    found = []
    if limits.min is not None:
        found.append((limits.min, limits.min - figure.value))
    if limits.max is not None:
        found.append((limits.max, figure.value - limits.max))
    return found
