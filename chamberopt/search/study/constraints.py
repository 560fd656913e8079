"""Constraints: limits in a study file, and whether a candidate's estimates meet them."""

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from pydantic import Field

from chamberopt.common import toml_errors
from chamberopt.common.errors import InputError
from chamberopt.common.estimate import NOT_RESOLVED, Estimate, student_quantile
from chamberopt.common.toml_errors import Problem
from chamberopt.coverage.metrics import find_metric, metric_names, metric_problem, named
from chamberopt.design.design import Design
from chamberopt.design.table_base import FileTable
from chamberopt.design.zones import LIMITED, Zone

NO_SIZE = 1e-12  # a limit below it is as good as 0, and a violation is not measured by it
FEASIBLE, NOT_KNOWN, INFEASIBLE = "feasible", "not known", "infeasible"
MET = {FEASIBLE: "met", NOT_KNOWN: "not known", INFEASIBLE: "not met"}  # a limit of a zone


class Violation(NamedTuple):
    """A limit that a candidate violates, or may violate, with the limited figure and a text."""

    figure: str  # name of the metric, or of the number of the design
    text: str  # the figure, and how it compares with the limit


class Limits(FileTable):
    """Least and largest value that a metric, or a number of the design, may have."""

    min: float | None = Field(default=None, description="least value allowed")
    max: float | None = Field(default=None, description="largest value allowed")

    def _problems(self) -> Iterator[Problem]:
        if self.min is None and self.max is None:
            yield Problem("", "empty; give min, max or both, e.g. { min = 0.9 }")
        if self.min is not None and self.max is not None and self.min > self.max:
            yield Problem("min", f"given {self.min:g}, above max = {self.max:g}")

    def hold(self, value: float) -> bool:
        """Return whether an exact number is within the limits."""
        low, high = self.min, self.max
        return (low is None or low <= value) and (high is None or value <= high)


def zone_constraints(design: Design) -> dict[str, Limits]:
    """Return the limits that a design sets for its zones, by the name of the limited metric."""
    return {metric: limits for zone in design.zones for _, metric, limits in zone_limits(zone)}


def zone_limits(zone: Zone) -> Iterator[tuple[str, str, Limits]]:
    """Yield each limit of a zone: its key in the design file, the limited metric, and the limit."""
    for key, limited in LIMITED.items():
        given = getattr(zone, key)
        if given is not None:
            numbers = given if isinstance(given, tuple) else (given,)
            for limit, (metric, side) in zip(numbers, limited, strict=True):
                yield key, f"{zone.name}.{metric}", Limits(**{side: limit})


def judge_zones(design: Design, metrics: Mapping[str, Estimate]) -> dict[str, list[dict[str, Any]]]:
    """Return which limits of each zone are met, by name of the zone, as plain JSON values.

    Each limit has a row: its key in the design file, the limit, the metric that it limits, and its
    standing. The standing is "met" or "not met" if it holds for the metric's whole interval, else
    "not known".
    """
    judged: dict[str, list[dict[str, Any]]] = {}
    for zone in design.zones:
        rows = judged.setdefault(zone.name, [])
        for key, metric, limits in zone_limits(zone):
            standing, _ = assess_feasibility({metric: limits}, metrics)
            limit = limits.max if limits.min is None else limits.min
            rows.append({"key": key, "limit": limit, "metric": metric, "standing": MET[standing]})
    return judged


def limit_problems(
    design: Design, vary: Mapping[str, tuple[float, float]], name: str, limits: Limits
) -> list[Problem]:
    """Return the reasons why a constraint makes no sense: an unknown name, or impossible limits.

    Args:
        vary: bounds of each number that the study varies.
        name: metric, or number of the design, that has the limits.
    """
    field, numbers = f"constraints.{name}", design.numbers()
    if metric := find_metric(name):
        if lacking := metric_problem(design, name):
            return [Problem(field, lacking)]
        if name in zone_constraints(design):
            text = "the zone limits it in the design already; change it there, or leave it out"
            return [Problem(field, text)]
        low, high = metric.lowest, metric.highest
    elif name in vary:
        low, high = vary[name]
    elif name in numbers:
        try:
            low = high = design.value(name)
        except InputError as error:
            return [Problem(field, str(error).removeprefix(f"{name}: "))]
    else:
        known = (*metric_names(design), *(numbers if "." in name else ()))
        return [Problem(field, f"not a metric; {toml_errors.did_you_mean(name, known)}")]
    within = f"{low:g}" if low == high else f"from {low:g} to {high:g}"
    change = "change the limit or [vary]" if name in numbers else "change the limit"
    remedy = f"but it is {within} in every candidate; {change}"
    problems = []
    if limits.min is not None and limits.min > high:
        problems.append(Problem(field, f"given min = {limits.min:g}, {remedy}"))
    if limits.max is not None and limits.max < low:
        problems.append(Problem(field, f"given max = {limits.max:g}, {remedy}"))
    return problems


def exact(values: Mapping[str, float | str]) -> dict[str, Estimate]:
    """Return a design's values that are numbers as exact estimates; texts are left out."""
    numbers = ((k, value) for k, value in values.items() if not isinstance(value, str))
    return {name: Estimate(value, 0.0) for name, value in numbers}


def expected_violation(figure: Estimate, limits: Limits) -> float:
    """Return the expected excess of a figure's true value over its limits, relative to the limits.

    It is the mean of max(0, x - limit) for x normally distributed about the estimate. Even an
    estimate within its limit has a small excess if it is uncertain. This keeps the search away from
    the limit by about the uncertainty. The result is the plain excess for an exact number, and 0
    for a figure with too few dents.
    """
    if figure.in_words == NOT_RESOLVED:
        return 0.0
    violation, error = 0.0, standard_error(figure)
    for limit, excess, _ in _excesses(figure, limits):
        if error > 0.0:
            z = excess / error
            tail = error * math.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
            excess = 0.5 * excess * math.erfc(-z / math.sqrt(2.0)) + tail
        violation += max(0.0, excess) / (abs(limit) if abs(limit) > NO_SIZE else 1.0)
    return violation


def describe_violations(name: str, figure: Estimate, limits: Limits) -> list[str]:
    """Return a text for each limit that the value of a figure violates, whatever its interval.

    The list is empty if the figure has too few dents.
    """
    if figure.in_words == NOT_RESOLVED:
        return []
    violated = (text for _, excess, text in _excesses(figure, limits) if excess > 0.0)
    return [f"{named(name)} {figure.value:.4g} {text}" for text in violated]


def assess_feasibility(
    constraints: Mapping[str, Limits], figures: Mapping[str, Estimate]
) -> tuple[str, tuple[Violation, ...]]:
    """Judge whether figures meet all limits with their whole 95 % intervals.

    Return FEASIBLE, NOT_KNOWN or INFEASIBLE, and the limits that are or may be violated.
    """
    feasibility, violations = FEASIBLE, []
    for name, limits in constraints.items():
        figure = figures[name]
        for _, excess, comparison in _excesses(figure, limits):
            if excess + figure.half_width <= 0.0:
                continue
            is_violated = excess > figure.half_width
            feasibility = INFEASIBLE if is_violated or feasibility == INFEASIBLE else NOT_KNOWN
            value = figure.in_words or f"{figure.value:.4g} ± {figure.half_width:.2g}"
            text = f"{named(name)} {value} {'' if is_violated else 'may be '}{comparison}"
            violations.append(Violation(name, text))
    return feasibility, tuple(violations)


def standard_error(figure: Estimate) -> float:
    """Return the standard error of an estimate, from its half-width and its number of replicas.

    It is 0 if the estimate is exact or has no interval.
    """
    if not 0.0 < figure.half_width < math.inf:
        return 0.0
    return figure.half_width / student_quantile(max(1, len(figure.pseudovalues) - 1))


def _excesses(figure: Estimate, limits: Limits) -> list[tuple[float, float, str]]:
    """Return each limit of a figure, the excess of the figure's value, and the violation in words.

    The excess is negative if the value is within the limit.
    """
    excesses = []
    if limits.min is not None:
        excesses.append((limits.min, limits.min - figure.value, f"< min {limits.min:g}"))
    if limits.max is not None:
        excesses.append((limits.max, figure.value - limits.max, f"> max {limits.max:g}"))
    return excesses
