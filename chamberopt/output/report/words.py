"""How metrics and objectives are called on the page: label, unit, and the factor from the stored number."""

from __future__ import annotations

from dataclasses import dataclass

from chamberopt.common.errors import InputError
from chamberopt.coverage.metrics import METRICS, parse_objective


@dataclass(frozen=True)
class Words:
    """label · unit · factor: shown = factor · stored; negative for an objective that is less of something.

    meaning: what the label stands for, where it does not say it itself.
    """

    label: str
    unit: str = ""
    factor: float = 1.0
    meaning: str = ""


def metric_words(name: str) -> Words:
    """Of a metric; shares of the surface are shown as %."""
    metric = METRICS.get(name)
    if metric is None:
        return Words(name.replace("_", " "))
    if metric.from_coverage:
        return Words(metric.summary, "%", 100.0)
    return Words(metric.summary, "" if metric.unit == "balls" else metric.unit)  # the label says it


def goal_words(name: str) -> Words:
    """Of an objective. One that is a metric, or a metric to be small, reads as that metric."""
    try:
        goal = parse_objective(name)
    except InputError:  # of another version of the program
        return Words(name.replace("_", " "))
    (first, weight), *others = goal.terms.items()
    if not others and abs(weight) == 1.0:
        words = metric_words(first)
        return Words(words.label, words.unit, weight * words.factor)
    return Words(name.replace("_", " "), meaning=goal.summary)
