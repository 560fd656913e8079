"""Compute what the page shows of a study that runs or has ended, from its results folder."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.estimate import Estimate, finite_or_none
from chamberopt.common.key_words import title_with_unit
from chamberopt.common.limits import MAX_RESULT_BYTES, require_size
from chamberopt.coverage.metrics import parse_objective
from chamberopt.design.design import Design
from chamberopt.documents.study import evaluated, reason_without_model, tried_sentence, why_refused
from chamberopt.documents.wanted import enough_time
from chamberopt.documents.wording import Label, metric_label, objective_label, per_cent
from chamberopt.page.page_words import on_page
from chamberopt.pictures.charts.colours import BLUE, COVERAGE_MAP, GREEN, GREY, ORANGE, hex_colours
from chamberopt.pictures.charts.figure_style import value_range
from chamberopt.pictures.charts.study import best_so_far
from chamberopt.search.observe import fit_model
from chamberopt.search.optimiser.search_model import SearchModel
from chamberopt.search.pareto import on_front
from chamberopt.search.sensitivity import NORMAL_95, Slice, analyse_sensitivity, is_supported
from chamberopt.search.study import load_study
from chamberopt.search.study.parameters import NONE, ParameterSpace
from chamberopt.search.study_folder import STUDY, StudyInputs, is_finished, read_inputs
from chamberopt.search.trial_log import HISTORY, Trial, read_trials

COLOURS = {
    "simulated": BLUE, "missed": GREY, "refused": GREY, "confirmed": GREEN, "start": ORANGE,
    "model": BLUE, "failed": GREY, "scale": hex_colours(COVERAGE_MAP, 32),
}  # fmt: skip
TIME = "process.treatment_time_s"
EXACT = "The objective follows from the numbers alone, so that there is no model of it."


def version(folder: Path) -> str:
    """Return a text that differs whenever the study of a folder has gone on."""
    log = folder / HISTORY
    size = log.lstat().st_size if log.is_file() else 0
    return f"{size}{' and finished' if is_finished(folder) else ''}"


def candidates_answer(folder: Path) -> dict[str, object]:
    """Return all candidates of a study so far, with what its plots show of them.

    Numbers are in the units of their labels. A candidate that was not simulated has no objective.
    One that is confirmed is named by its number in the search, which is `of`. One that was not
    searched is what the search's model recommends.

    Raises:
        InputError: the folder is no study's, or a file of it is damaged.
    """
    now, inputs = version(folder), read_inputs(folder)
    trials = _trials(folder, inputs)
    labels = [objective_label(name) for name in inputs.goals]
    smaller = labels[0].factor < 0.0
    shown = [evaluated(one, labels[0]) for one in trials]
    numbers, best = best_so_far(shown, smaller)
    objectives = [one.objective for one in shown if one.objective]
    best_trial = _best(trials)
    first = {
        trial.point: trial.number + 1 for trial in reversed(trials) if trial.stage != "confirm"
    }
    rows = [
        {
            "number": one.number,
            "of": (of := first.get(trial.point, one.number)),
            "name": _name(trial, one.number, of),
            "kind": _kind(trial),
            "is_start": _is_start(trial),
            "is_best": trial is best_trial,
            "standing": _standing(trial, best_trial, is_finished(folder)),
            "feasible": one.feasible,
            "objective": _interval(one.objective),
            "told": labels[0].number(trial.goals[0]) if trial.goals else "",
            "reason": on_page(why_refused(trial.reason)),
            "second": _interval(_second(trial, labels)),
            "values": one.parameters,
        }
        for one, trial in zip(shown, trials, strict=True)
    ]
    return {
        "version": now,
        "finished": is_finished(folder),
        "sentence": " ".join([tried_sentence(trials), *_meanings(labels)]),
        "objectives": [label.with_unit for label in labels],
        "varied": [
            {
                "name": name,
                "label": title_with_unit(name),
                "low": one.bounds[0],
                "high": one.bounds[1],
                "texts": one.texts,
            }
            for name, one in inputs.vary.items()
        ],
        "candidates": rows,
        "best": list(zip(numbers, best, strict=True)),
        "range": value_range(objectives, labels[0].most) if objectives else [0.0, 1.0],
        "most": [one.most if math.isfinite(one.most) else None for one in labels],
        "front": _front(trials) if len(labels) > 1 else [],
        "colours": COLOURS,
    }


def _name(trial: Trial, number: int, of: int) -> str:
    if of != number:
        return f"{of} again"
    return f"{of}, by the model" if trial.stage == "confirm" else str(of)


def _best(trials: Sequence[Trial]) -> Trial | None:
    """Return the best trial that meets the constraints, of those that confirm if there are any.

    The last confirmation of a candidate counts.
    """
    simulated = [one for one in trials if one.goals]
    again = {one.point: one for one in simulated if one.stage == "confirm"}
    feasible = [one for one in [*again.values()] or simulated if one.feasible]
    return max(feasible, key=lambda one: one.score, default=None)


def _standing(trial: Trial, best: Trial | None, is_over: bool) -> str:
    """Return what a candidate is to the study, beside what became of it; "" for nothing."""
    if trial is best:
        return "the best" if is_over else "the best so far"
    return "the start" if _is_start(trial) else ""


def _meanings(labels: Sequence[Label]) -> list[str]:
    """Return a sentence for each objective whose name has to be explained."""
    return [f"The objective is {one.text}: {one.meaning}." for one in labels if one.meaning]


def candidate_answer(folder: Path, number: int, design: Design) -> dict[str, object]:
    """Return the numbers and figures of one candidate of a study, as texts with their intervals.

    Args:
        number: number of the candidate, from 1.
        design: the design whose chamber the page shows. `differs` names its values in which it is
            another than the study's design with the numbers of the candidate. `time` is the
            peening time that is enough for the candidate, with the margin that the study's has at
            the start, if the design has another, as values.

    Raises InputError if there is no such candidate.
    """
    inputs = read_inputs(folder)
    trials = _trials(folder, inputs)
    if not 1 <= number <= len(trials):
        raise InputError(f"{number}: not a candidate of {folder.name}, which has {len(trials)}")
    trial = trials[number - 1]
    figures = [
        (label.in_full, label.format(goal))
        for label, goal in zip(map(objective_label, inputs.goals), trial.goals, strict=False)
    ]
    for name, metric in trial.metrics.items():
        label = metric_label(name)
        figures.append((label.text, label.format(metric)))
    values = {name: one for name, one in trial.parameters.items() if one != NONE}
    return {
        "number": number,
        "kind": _kind(trial),
        "reason": on_page(why_refused(trial.reason)),
        "values": values,
        "numbers": [(title_with_unit(name), str(one)) for name, one in values.items()],
        "figures": list(dict(figures).items()),
        "time": _time(trial, trials[0], design, values, inputs),
        "differs": [title_with_unit(name) for name in inputs.differences(design)],
    }


def _time(
    trial: Trial, first: Trial, design: Design, values: dict[str, float | str], inputs: StudyInputs
) -> dict[str, float]:
    """Return the peening time that is enough for a candidate, by its key, or nothing.

    There is nothing if it is not known, or if the design with the candidate's numbers has it.

    Args:
        first: the first candidate, which is the start of a search.
    """
    planned = float(inputs.study["design"]["process"]["treatment_time_s"])
    enough = enough_time(design, trial.metrics, planned, first.metrics if _is_start(first) else {})
    now = values.get(TIME, design.process.treatment_time)
    return {} if enough is None or enough == now else {TIME: enough}


def model_answer(folder: Path) -> dict[str, Any]:
    """Return what a model of a study's evaluations so far tells of each varied number.

    The value `reason` says why there is no model; it is empty if there is one. A curve has None
    where evaluations do not support it.

    Raises:
        InputError: the study or its design cannot be read, or a file of the folder is damaged.
    """
    study = load_study(folder / STUDY)
    label = objective_label(study.objective.goals[0])
    searched = [one for one in _trials(folder, read_inputs(folder)) if one.stage == "search"]
    if parse_objective(study.objective.goals[0]).is_exact:
        return {"reason": EXACT}
    space = ParameterSpace(study.design, study.vary, study.objective.over_tolerances == "worst")
    model = fit_model(space.domain, searched, study.all_constraints, learns_bounds=True)
    if model is None:
        failed = sum(not one.goals for one in searched)
        return {"reason": reason_without_model(len(searched), failed, len(study.vary))}
    best = max((one for one in searched if one.goals), key=lambda one: (one.feasible, one.score))
    noise = finite_or_none(best.goals[0].half_width) or 0.0
    found = analyse_sensitivity(model, space, best.parameters, noise)
    return {
        "reason": "",
        "best": best.number + 1,
        "slices": {one.name: _curve(model, one, label) for one in found.slices},
        "shares": [
            (one.name, one.share, per_cent(one.share))
            for one in sorted(found.slices, key=lambda one: -one.share)
        ],
        "check": _check(model, searched, label),
    }


def _trials(folder: Path, inputs: StudyInputs) -> list[Trial]:
    """Return the trials of a study's folder; there are none before the first has ended.

    Raises InputError if the log is damaged or of another study, or too large to be shown.
    """
    log = folder / HISTORY
    if not log.is_file():
        return []
    require_size(log, log.lstat().st_size, MAX_RESULT_BYTES, "file of a study")
    trials = read_trials(folder)
    for line, one in enumerate(trials):
        if (
            one.number != line
            or len(one.point) != len(inputs.vary)
            or one.parameters.keys() != inputs.vary.keys()
            or len(one.goals) not in (0, len(inputs.goals))
            or not all(math.isfinite(goal.value) for goal in one.goals)
        ):
            raise InputError(
                f"{log}:{line + 1}: damaged row; restore the file or run the study in a new folder"
            )
    return trials


def _is_start(trial: Trial) -> bool:
    return trial.number == 0 and trial.stage == "search"


def _kind(trial: Trial) -> str:
    if trial.stage == "confirm" and trial.goals:
        return "confirmed"
    if trial.goals:
        return "simulated" if trial.feasible else "missed"
    return "refused" if trial.refused or trial.highest is not None else "failed"


def _interval(estimate: Estimate | None) -> list[float | None] | None:
    """Return value and half-width; the half-width is None where it is not resolved."""
    if estimate is None:
        return None
    return [estimate.value, finite_or_none(estimate.half_width)]


def _second(trial: Trial, labels: Sequence[Label]) -> Estimate | None:
    return labels[1].scale(trial.goals[1]) if len(labels) > 1 < len(trial.goals) else None


def _front(trials: Sequence[Trial]) -> list[int]:
    """Return the numbers of the candidates on the Pareto front of a search, by first objective."""
    simulated = [one for one in trials if one.goals and one.stage == "search"]
    if not simulated:
        return []
    values = np.array([[goal.value for goal in one.goals] for one in simulated])
    there = on_front(values, np.array([one.feasible for one in simulated]))
    order = np.argsort(values[:, 0], kind="stable")
    return [simulated[k].number + 1 for k in order if there[k]]


def _curve(model: SearchModel, one: Slice, label: Label) -> list[list[float] | None]:
    """Return value, mean, and half-width of a slice at each of its places, or None.

    It is None where evaluations do not support the model.
    """
    size = abs(label.factor)
    rows = zip(one.values, label.factor * one.mean, size * one.half_width, strict=True)
    supported = is_supported(model, one)
    return [
        [*map(float, row)] if known else None for row, known in zip(rows, supported, strict=True)
    ]


def _check(model: SearchModel, searched: Sequence[Trial], label: Label) -> dict[str, Any]:
    """Return each simulated objective beside what the model tells of it by all others.

    It is empty if the model has left out evaluations, because there are too many.
    """
    learnt = [one for one in searched if one.goals or one.highest is not None]
    mean, deviation = model.score.left_out()
    if len(mean) != len(learnt):
        return {}
    rows, inside = [], 0
    for one, middle, sd in zip(learnt, mean.tolist(), deviation.tolist(), strict=True):
        if one.goals and one.goals[0].value >= model.floor:
            told = label.scale(Estimate(middle, NORMAL_95 * sd))
            value = label.factor * one.goals[0].value
            rows.append([one.number + 1, value, told.value, told.half_width])
            inside += abs(value - told.value) <= told.half_width
    sentence = (
        f"Each evaluation is left out in turn, and told by the others: {inside} of {len(rows)} lie "
        "within the model's 95 % interval."
    )
    return {"rows": rows, "sentence": sentence}
