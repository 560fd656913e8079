"""The answer in one sentence, with its uncertainty."""

from __future__ import annotations

from typing import TYPE_CHECKING

from chamberopt.coverage.metrics import NEVER
from chamberopt.output.report.formatting import estimated, plain
from chamberopt.output.report.words import goal_words

if TYPE_CHECKING:
    from chamberopt.coverage.statistics.confidence_interval import Estimate
    from chamberopt.output.results.load import Result


def answer(result: Result, start: Result | None, gain: Estimate | None) -> str:
    """Of a study: from where to where, and whether that is more than noise; of a simulation: its figures."""
    return _simulated(result) if start is None or gain is None else _searched(result, start, gain)


def _searched(result: Result, start: Result, gain: Estimate) -> str:
    goal = goal_words(result.objective_name)
    before, after = (estimated(one.objective, goal.factor, goal.unit) for one in (start, result))
    study = result.data["study"]
    if study["best"]["parameters"] == study["start"]["parameters"]:
        return f"No better chamber than the start was found: its {goal.label} is {before} (95 % interval)."
    shown = f"from {before} at the start to {after}"
    change = estimated(gain, goal.factor, goal.unit, sign=True)
    if gain.low > 0.0:
        verdict = f"a change of {change} (95 % intervals, both simulated anew on fresh seeds), which is more than noise"
        return f"The best chamber found brings the {goal.label} {shown}: {verdict}."
    verdict = f"the change of {change} is within the noise (95 % intervals, both simulated anew on fresh seeds)"
    return f"No chamber was found that is better for sure: the {goal.label} goes {shown}, but {verdict}."


def _simulated(result: Result) -> str:
    goal, seconds = goal_words(result.objective_name), result.design.process.treatment_time
    mean = estimated(result.metrics["mean_coverage"], 100.0, "%")
    said = f"After {plain(seconds)} s the target is covered to {mean} on average"
    if goal.label != goal_words("mean_coverage").label:
        said += f", and its {goal.label} is {estimated(result.objective, goal.factor, goal.unit)}"
    return f"{said} (95 % intervals); {full_coverage(result)}."


def full_coverage(result: Result) -> str:
    """When 98 % is reached everywhere, as far as that is known."""
    full = result.metrics.get("time_to_98_s")
    if full is None:
        return "this older result does not say when it would be covered to 98 %"
    if full.value >= NEVER:
        return "at this rate 95 % of its area would never be covered to 98 %"
    if full.half_width >= full.value:
        said = "is not known yet"
        return f"how long it takes until 95 % of its area is covered to 98 % {said}"
    return f"95 % of its area is covered to 98 % after {estimated(full, 1.0, 's')}"
