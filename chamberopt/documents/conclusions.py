"""Sentences and rows of the report: the answer, influence of parameters, accuracy and cost."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

from chamberopt.chamber.checks.calibration import misfit_texts
from chamberopt.common.estimate import Estimate
from chamberopt.coverage.coverage_intervals import NOT_RESOLVED
from chamberopt.coverage.metrics import OBJECTIVES
from chamberopt.documents.wording import (
    AnswerLine,
    Label,
    metric_label,
    objective_label,
    per_cent,
    plain,
    with_interval,
    with_unit,
)
from chamberopt.documents.zones import zone_lines
from chamberopt.search.candidates import POINTS_PER_PARAMETER
from chamberopt.search.study.constraints import MET

if TYPE_CHECKING:
    from chamberopt.results.load import Result
    from chamberopt.results.records import ModelRecord, StudyRecord

STEPS = {
    "chamber": "to build the chamber",
    "simulate": "to simulate",
    "coverage": "to compute the coverage",
}
STOP_REASONS = {
    "replicas": "the requested number of replicas",
    "accuracy": "the requested accuracy was reached",
    "max_replicas": "the largest allowed number; the requested accuracy was not reached",
}
COLLISIONS = {
    "walls": "with walls and part",
    "balls": "between balls",
    "sonotrode": "with the sonotrode",
}


def answer(result: Result, start: Result | None, gain: Estimate | None) -> str:
    """The answer in one sentence, with its uncertainty.

    For a study: objective of start and best, and whether the change is more than noise. For a
    simulation: its coverage.
    """
    label = objective_label(result.objective_name)
    if start is None or gain is None:
        mean = metric_label("mean_coverage")
        treatment_time = result.design.process.treatment_time
        if result.metrics["mean_coverage"].in_words == NOT_RESOLVED:
            return (
                "Too few dents were simulated to tell how much of the target is covered after "
                f"{plain(treatment_time)} s."
            )
        text = (
            f"After {plain(treatment_time)} s the target is covered to "
            f"{mean.format(result.metrics['mean_coverage'])} on average"
        )
        if label.text != mean.text:
            text += f", and its {label.text} is {label.format(result.objective)}"
        return f"{text} (95 % intervals); {full_coverage(result)}."
    named = label.text if result.objective_name in OBJECTIVES else label.in_full
    before, after = label.format(start.objective), label.format(result.objective)
    study = result.study
    if study is not None and study.best.parameters == study.start.parameters:
        return (
            f"No better chamber than the start was found: its {named} is {before} (95 % interval)."
        )
    if NOT_RESOLVED in (start.objective.in_words, result.objective.in_words):
        return (
            "Too few dents were simulated to tell whether the best chamber found is better than "
            "the start."
        )
    values = f"from {before} at the start to {after}"
    change = label.format(gain, sign=True)
    intervals = "(95 % intervals, both simulated again with fresh seeds)"
    if gain.low > 0.0:
        return (
            f"The best chamber found changes the {named} {values}: a change of {change} "
            f"{intervals}, which is more than noise."
        )
    return (
        f"No chamber was found that is certainly better: the {named} goes {values}, but the "
        f"change of {change} is within the noise {intervals}."
    )


def answer_lines(result: Result, zones: Mapping[str, Any]) -> list[AnswerLine]:
    """What belongs to the answer: zones with their limits, constraints, doubts of a calibration.

    Args:
        zones: as zone_contents returns them.
    """
    lines = [*zone_lines(zones), *_constraint_lines(result)]
    calibration = result.design.calibration
    doubts = [*misfit_texts(calibration), calibration.not_mmA] if calibration else []
    return lines + [
        AnswerLine("calibration", f"{one[0].upper()}{one[1:]}.", True) for one in doubts if one
    ]


def _constraint_lines(result: Result) -> Iterator[AnswerLine]:
    """Which constraints the best, the start and candidates better than the best may not meet.

    The zones of the best have sentences of their own.
    """
    limited = {limit.metric for zone in result.record.zones for limit in zone.limits}
    study, label = result.study, objective_label(result.objective_name)
    if study is None:
        return
    for one in study.confirmed:
        violations = one.violations
        about: Literal["best", "start", "other"] = "other"
        if one.parameters == study.best.parameters:
            about, whose = "best", "The best chamber found"
            violations = [found for found in violations if found.figure not in limited]
        elif one.parameters == study.start.parameters:
            about, whose = "start", "The start"
        elif one.objective.value > result.objective.value:
            whose = f"Another chamber, whose {label.text} is {label.format(one.objective)}"
        else:
            continue
        if violations:
            texts = ", ".join(found.text for found in violations)
            yield AnswerLine(about, f"{whose}: constraints {MET[one.standing]}: {texts}.", True)


def full_coverage(result: Result) -> str:
    """Half a sentence: when 95 % of the target is covered to 98 %, as far as that is known."""
    time = result.metrics.get("time_to_98_s")
    if time is None:
        return "this older result does not say when it would be covered to 98 %"
    if time.in_words == "never":
        return "at this rate 95 % of its area would never be covered to 98 %"
    if time.in_words == NOT_RESOLVED:
        return "too few dents were simulated to tell when 95 % of its area is covered to 98 %"
    return f"95 % of its area is covered to 98 % after {Label('', 's').format(time)}"


def accuracy_rows(result: Result) -> dict[str, str]:
    """The intervals of the answer, and the replicas behind them."""
    objective, mean = objective_label(result.objective_name), metric_label("mean_coverage")
    record, field = result.record, result.record.field
    needed = field.simulated_s_needed.p05_times_intensity
    rows = {
        f"95 % interval of the {objective.text}": objective.format(result.objective),
        f"95 % interval of the {mean.text}": mean.format(result.metrics["mean_coverage"]),
        "replicas, each with its own seed": f"{record.replicas}",
        "number of replicas": STOP_REASONS.get(record.stopped_by, record.stopped_by),
        "dents in the median window": plain(field.dents_in_median_window, 3),
        "simulation that resolves every figure": f"{plain(needed, 2)} s of all replicas"
        if needed and not result.resolves_places
        else "",
    }
    if result.study:
        search = result.study.accuracy.search
        replicas = f"up to {search.replicas} replicas"
        if half_width := search.objective_half_width:
            replicas = f"± {half_width:g} requested"
        time = search.simulated_time_s
        rows["a candidate of the search"] = replicas + (f" of {plain(time)} s" if time else "")
    rows["chamber's walls"] = "exact planes and cylinders" if record.analytic else "triangles"
    return {name: text for name, text in rows.items() if text}


def cost_rows(
    result: Result, evaluations: Sequence[Mapping[str, Any]]
) -> dict[str, dict[str, str]]:
    """What the result cost.

    Returns:
        "answer": simulated time, collisions and run time of the result itself; for a study also
        "evaluations": their numbers and the run time of all.
    """
    record, study = result.record, result.study
    collisions = record.collisions
    kinds = [
        f"{_count(collisions[name])} {kind}"
        for name, kind in COLLISIONS.items()
        if name in collisions
    ]
    rows = {
        "answer": {
            "simulated time": f"{plain(record.simulated_time_s)} s",
            "collisions": f"{_count(collisions.get('total', 0))}: {', '.join(kinds)}",
            **{STEPS.get(name, name): f"{s:.2f} s" for name, s in record.timings_s.items()},
        }
    }
    if study:
        rows["evaluations"] = {
            "in the search": _count(study.evaluations),
            "of these not simulated": _count(study.failed),
            "of these given up after a few replicas": _count(study.given_up),
            "of these miss a constraint": _count(study.missing_a_constraint),
            "confirmations": _count(sum(row["stage"] == "confirm" for row in evaluations)),
            "run time of all": f"{plain(study.seconds, 3)} s",
        }
    return rows


def _count(number: float) -> str:
    return plain(float(number), 12)


def influence(study: StudyRecord, label: Label) -> dict[str, Any]:
    """Which parameters mattered, by the study's model of all its evaluations.

    Args:
        label: of the objective; numbers are returned in its unit.

    Returns:
        "said": sentences; "parameters": one row each, the most important first, empty without a
        model. A row holds
            loss, loss_half_width: cost of moving this parameter alone from its best value to the
                worst one within its bounds; without a half-width it may cost more.
            loss_text: the same in words.
            surely: cost of such a move that is certain, 0 if the intervals reach zero.
            share: of the objective's variance over the bounds, by its main effect.
            flat: range in which it may lie without losing more than the noise.
            values, mean, half_width, effect: its curves.
    """
    model, count, names = study.model, study.evaluations, list(study.vary)
    if not model:
        said = [_reason_without_model(count, study.failed, len(names))]
        return {"parameters": [], "said": said}
    rows = sorted(
        (_parameter_row(name, study, model, label) for name in names if name in model.parameters),
        key=lambda row: (-row["surely"], -row["loss"]),
    )
    sentences = []
    first = rows[0]
    if first["surely"]:
        sentences.append(
            f"{first['name']} mattered most near the best design: moved alone from its best value "
            f"to another within its bounds, it costs {first['loss_text']}, and "
            f"{with_unit(first['surely'], label.unit)} or more where the model is surest."
        )
    if uncertain := [row["name"] for row in rows if not row["surely"]]:
        *others, last = uncertain
        listed = f"{', '.join(others)} and {last}" if others else last
        sentences.append(
            f"{count} evaluations are too few to show an influence of {listed}: "
            "the intervals reach zero."
        )
    shares = sum(row["share"] for row in rows)
    if len(rows) > 1:
        rest = ""
        if shares < 0.8:
            rest = (
                "; the rest is how parameters act together, so each curve below holds near the "
                "best design"
            )
        widest = max(rows, key=lambda row: row["share"])
        if widest is not first:
            rest += f". Over all of the bounds {widest['name']} has the largest effect of its own"
        sentences.append(
            "The effects of single parameters are "
            f"{per_cent(shares)} of the variance over the bounds{rest}."
        )
    noise = with_unit(abs(label.factor) * model.noise, label.unit)
    sentences.append(
        f"In its shaded range, each parameter alone loses no more than the noise, {noise}. "
        f"Of all designs with every parameter in its range, {per_cent(model.together)} lose no "
        "more than that."
    )
    return {"parameters": rows, "said": sentences}


def _parameter_row(
    name: str, study: StudyRecord, model: ModelRecord, label: Label
) -> dict[str, Any]:
    parameter, best = model.parameters[name], model.expected
    size = abs(label.factor)
    losses = [size * (best.value - mean) for mean in parameter.mean]
    half_widths = [size * math.hypot(half, best.half_width) for half in parameter.half_width]
    or_worse = parameter.or_worse
    worst = max(range(len(losses)), key=losses.__getitem__)
    certain = [loss - half for loss, half in zip(losses, half_widths, strict=True)]
    loss, half_width = max(0.0, losses[worst]), half_widths[worst]
    text = f"up to {with_interval(loss, half_width, label.unit)}"
    if or_worse[worst]:
        text = f"{with_unit(loss, label.unit)} or more"
    return {
        "name": name,
        "share": parameter.share_of_variance,
        "loss": loss,
        "loss_half_width": None if or_worse[worst] else half_width,
        "loss_text": text,
        "surely": max(0.0, *certain),
        "flat": parameter.flat,
        "texts": parameter.choices,
        "start": study.start.parameters[name],
        "best": study.best.parameters[name],
        "values": parameter.values,
        "mean": [label.factor * value for value in parameter.mean],
        "half_width": [size * value for value in parameter.half_width],
        "or_worse": or_worse,
        "effect": [label.factor * value for value in parameter.main_effect],
    }


def _reason_without_model(count: int, failed: int, parameters: int) -> str:
    needed = POINTS_PER_PARAMETER * parameters
    if count - failed < needed:
        evaluations = f"{count} evaluations" + (
            f", {failed} of them not simulated," if failed else ""
        )
        return (
            f"{evaluations} are too few to tell what each parameter does: {needed} or more are "
            "needed for a model of them."
        )
    return "This result holds no model of the evaluations, so the effect of parameters is unknown."
