"""Text about a study: its question, search and Pareto front, and the influence of parameters."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.common.files import read_file
from chamberopt.common.key_words import AIMS, inner_first, title_with_unit, unit_of
from chamberopt.documents.document import (
    Beside,
    Block,
    Chart,
    Fold,
    Items,
    Section,
    Sentence,
    Table,
)
from chamberopt.documents.wording import (
    Label,
    metric_label,
    objective_label,
    per_cent,
    per_cent_closely,
    plain,
    with_interval,
    with_unit,
)
from chamberopt.documents.zones import limit_text
from chamberopt.pictures.charts.study import (
    EvaluatedCandidate,
    convergence_figure,
    influence_figure,
)
from chamberopt.search.optimiser.search_model import POINTS_PER_PARAMETER
from chamberopt.search.sensitivity import Slice
from chamberopt.search.study.schema import Objective, Optimizer
from chamberopt.search.study_folder import STUDY

if TYPE_CHECKING:
    from chamberopt.results.load import Result
    from chamberopt.results.records import ModelRecord, StudyRecord
    from chamberopt.search.trial_log import Trial

ALGORITHMS = {"sobol": "spread evenly", "surrogate": "chosen by a model of those before"}
NO_CONSTRAINTS = "There were no constraints."
MANY_REFUSED = 0.4  # share of the candidates from which on the reason is told


def question_section(result: Result) -> Section:
    """Return the section that states the question which the result answers.

    The question of a simulation is the coverage in one chamber. A study asks for the best chamber.
    """
    design, study = result.design, result.study
    part, area = design.part.mesh_path.name, exposed_target(result)
    reach = f" ({area})" if area else ""
    peening = (
        f"for {plain(design.process.treatment_time)} s in a chamber of shape "
        f"“{design.chamber.shape}”"
    )
    if study is None:
        text = f"How is the target of {part}{reach} covered when it is peened {peening}?"
        return Section("The question", [Sentence(text)])
    label = objective_label(result.objective_name)
    aim = "smallest" if label.factor < 0.0 else "largest"
    text = (
        f"Which chamber gives the {aim} {label.in_full}? "
        f"The part is {part}; its target{reach} is peened {peening}. "
        f"{study.evaluations} candidates were tried, {_chosen_by(study.algorithm)}."
    )
    constraints = _constraints(result)
    limits = f"Constraints: {', '.join(constraints)}." if constraints else NO_CONSTRAINTS
    varied = [
        (
            title_with_unit(name),
            (", " if isinstance(ends[0], str) else " to ").join(map(plain, ends)),
            plain(study.start.parameters[name]),
            plain(study.best.parameters[name]),
        )
        for name, ends in study.vary.items()
    ]
    table = Table("What was varied", ("parameter", "bounds", "start", "best"), varied)
    return Section("The question", [Beside([[Sentence(text), Sentence(limits)], [table]])])


def _chosen_by(phases: str) -> str:
    """Return in words how a search chose its candidates, by the names of its phases."""
    return ", then ".join(ALGORITHMS.get(one, f"by {one}") for one in phases.split(", then "))


def aim_in_words(tables: Mapping[str, Any]) -> str:
    """Return what a study is after, what it varies and how many chambers it tries, by its file."""
    objective = tables.get("objective", {})
    names = objective.get("pareto") or [objective.get("name", Objective().name)]
    aims = [AIMS[one] for one in names if one in AIMS]
    aim = " and ".join(aims) if aims and "sum" not in objective else "a weighted sum"
    varied = ", ".join(map(inner_first, tables.get("vary", {})))
    count = tables.get("optimizer", {}).get("evaluations", Optimizer().evaluations)
    return f"{aim}; varies {varied}; tries {count} chambers"


def exposed_target(result: Result) -> str:
    """Return a text with the area and reachable share of a target inside the chamber, else ""."""
    area = result.record.chamber.target_exposed_area_mm2
    share = per_cent_closely(result.record.field.reachable_share)
    left = ", without what no ball touches" if result.design.part.target.reachable else ""
    return (
        f"{plain(area)} mm² in the chamber{left}; the shot can reach {share} of it" if area else ""
    )


def _constraints(result: Result) -> list[str]:
    """Return the limits of the study file and of the design's zones, each as text."""
    tables: dict[str, Any] = {}
    if STUDY in result.record.files:
        tables = tomllib.loads(read_file(result.path(STUDY)).decode())
    of_study = [
        " and ".join(
            limit_in_words(name, "≥" if side == "min" else "≤", limit)
            for side, limit in limits.items()
        )
        for name, limits in tables.get("constraints", {}).items()
    ]
    zones = result.record.zones
    return of_study + [
        f"{limit_text(one)} of zone {zone.name}" for zone in zones for one in zone.limits
    ]


def limit_in_words(name: str, sign: str, limit: float) -> str:
    """Return a limit of a metric, or of a number of the design, in the unit that is shown."""
    if "." in name:
        return f"{inner_first(name)} {sign} {plain(limit)} {unit_of(name)}".rstrip()
    label = metric_label(name)
    return f"{label.text} {sign} {plain(label.factor * limit)} {label.unit}".rstrip()


def front_section(study: StudyRecord) -> Section | None:
    """Return the section on the Pareto front, or None for a study with a single objective."""
    if not study.front:
        return None
    labels = {name: objective_label(name) for name in study.front[0].objectives}
    first, second = (label.with_unit for label in labels.values())
    text = (
        f"The study had two objectives: {first}, and {second}. Each of these candidates was "
        "confirmed on fresh seeds, and no other is better in both objectives. "
        "The answer above is the best by the first objective."
    )
    rows = [
        (
            str(number),
            *(labels[name].number(value) for name, value in point.objectives.items()),
            *map(plain, point.parameters.values()),
        )
        for number, point in enumerate(study.front, start=1)
    ]
    head = ("", first, second, *map(title_with_unit, study.front[0].parameters))
    return Section("Two objectives", [Sentence(text), Table("The Pareto front", head, rows)])


def search_section(result: Result, trials: Sequence[Trial]) -> Section | None:
    """Return the section with every evaluation in its order and the reasons for failed ones.

    Return None if no evaluations are given.
    """
    if not trials:
        return None
    label = objective_label(result.objective_name)
    candidates = [evaluated(one, label) for one in trials]
    smaller = label.factor < 0.0
    figure, tooltips = convergence_figure(candidates, label.with_unit, smaller, label.most)
    caption = (
        "The objective of every evaluation in its order. The answer rests on the last ones, which "
        "ran on fresh seeds. Point at a mark to see its parameters."
    )
    content: list[Block] = [Chart("convergence", figure, caption, tooltips)]
    failed = [(str(one.number + 1), one.reason) for one in trials if one.reason]
    if failed:
        title = f"Evaluations not simulated, or that missed a constraint: {len(failed)}"
        reasons = Table("", ("evaluation", "reason"), failed, numbers=False)
        content.append(Fold(title, [reasons]))
    return Section("How the search went", content)


def tried_sentence(trials: Sequence[Trial]) -> str:
    """Return a sentence on what became of all candidates of a search."""
    search = [one for one in trials if one.stage != "confirm"]
    if not search:
        return "No candidate has been evaluated yet."
    reasons = [one.reason for one in search if one.refused or one.highest is not None]
    refused = len(reasons)
    simulated = sum(bool(one.goals) for one in search)
    again = sum(bool(one.goals) for one in trials) - simulated
    said = [f"{len(search)} proposed", f"{refused} refused by geometry before any simulation"]
    said.append(f"{simulated} simulated")
    if others := len(search) - refused - simulated:
        said.append(f"{others} that could not be simulated")
    if again:
        said.append(f"{again} confirmed with new seeds")
    often = f" {_most_frequent(reasons)}" if refused > MANY_REFUSED * len(search) else ""
    return f"{', '.join(said)}.{often}"


def _most_frequent(reasons: Sequence[str]) -> str:
    """Return a sentence on the reason, apart from its numbers, that most of the reasons have."""
    alike: dict[str, list[str]] = {}
    for one in reasons:
        alike.setdefault(re.sub(r"[-−\d.,()]+", "", one), []).append(one)
    most = max(alike.values(), key=len)
    text = why_refused(most[0])
    return f"For {len(most)} of {len(reasons)} refusals it is the same reason, as: {text}."


def why_refused(reason: str) -> str:
    """Return a candidate's reason for where it is told that it was not simulated."""
    return reason.removeprefix("not simulated: ")


def evaluated(one: Trial, label: Label) -> EvaluatedCandidate:
    """Return a trial as charts show it, in the unit of the objective's label."""
    objective = one.objective
    if objective is not None:
        objective = label.scale(objective)
    return EvaluatedCandidate(one.number + 1, one.stage, objective, one.feasible, one.parameters)


@dataclass(frozen=True)
class Influence:
    """The influence of a parameter on the objective, by the study's model of all evaluations.

    curve: the model's objective against the parameter, in the unit of `label`.
    loss: loss of objective if this parameter alone moves from its best value to the worst value
        within its bounds.
    half_width: half-width of the loss. None if the loss may be larger than stated.
    surely: largest loss that is certain for a value of the parameter. 0 if the interval of each
        loss contains zero.
    label: label of the objective.
    """

    curve: Slice
    loss: float
    half_width: float | None
    surely: float
    label: Label

    @property
    def name(self) -> str:
        return self.curve.name

    @property
    def loss_text(self) -> str:
        if self.half_width is None:
            return f"{with_unit(self.loss, self.label.unit)} or more"
        return f"up to {with_interval(self.loss, self.half_width, self.label.unit)}"


def influence_section(study: StudyRecord, label: Label) -> Section:
    """Return the section on the influence of each parameter on the objective."""
    rows = influences(study, label)
    content: list[Block] = [Items(influence_sentences(study, rows, label))]
    if rows:
        head = (
            "parameter",
            "moved alone costs",
            "where surest, at least",
            "own share of variance",
            "no loss within",
        )
        table = [
            (
                row.name,
                row.loss_text,
                with_unit(row.surely, label.unit) if row.surely else "not known",
                per_cent(row.curve.share),
                (" or " if row.curve.texts else " to ").join(map(plain, row.curve.flat)),
            )
            for row in rows
        ]
        caption = (
            "Each parameter alone. Band: 95 % interval of the model; nothing is drawn where "
            "evaluations leave it an upper limit alone. Shaded range: no more than the noise is "
            "lost. Above: how much of the variance over the bounds is that of the dashed line; "
            "what is missing to 100 % is how parameters act together."
        )
        figure = influence_figure(
            [row.curve for row in rows],
            study.start.parameters,
            study.best.parameters,
            label.with_unit,
            label.most,
        )
        content += [
            Table("By a model of all evaluations", head, table),
            Chart("slices", figure, caption),
        ]
    return Section("Which parameters mattered", content)


def influences(study: StudyRecord, label: Label) -> list[Influence]:
    """Return the influence of each parameter on the objective, the most influential first.

    The list is empty if the study has no model of its evaluations.

    Args:
        label: label of the objective, in whose unit numbers are returned.
    """
    if not study.model:
        return []
    found = [
        _influence(name, study.model, label)
        for name in study.vary
        if name in study.model.parameters
    ]
    return sorted(found, key=lambda one: (-one.surely, -one.loss))


def _influence(name: str, model: ModelRecord, label: Label) -> Influence:
    one, best, size = model.parameters[name], model.expected, abs(label.factor)
    losses = [size * (best.value - mean) for mean in one.mean]
    half_widths = [size * math.hypot(half, best.half_width) for half in one.half_width]
    worst = max(range(len(losses)), key=losses.__getitem__)
    certain = [loss - half for loss, half in zip(losses, half_widths, strict=True)]
    curve = Slice(
        name=name,
        values=np.array(one.values),
        mean=np.array([label.factor * value for value in one.mean]),
        half_width=np.array([size * value for value in one.half_width]),
        or_worse=np.array(one.or_worse),
        effect=np.array([label.factor * value for value in one.main_effect]),
        share=one.share_of_variance,
        flat=tuple(one.flat),
        texts=tuple(one.choices),
    )
    half_width = None if one.or_worse[worst] else half_widths[worst]
    return Influence(curve, max(0.0, losses[worst]), half_width, max(0.0, *certain), label)


def influence_sentences(study: StudyRecord, rows: Sequence[Influence], label: Label) -> list[str]:
    """Return sentences on the influence of the parameters on the objective, by the study's model.

    If the study has no model, a sentence gives the reason.
    """
    model, count = study.model, study.evaluations - study.failed
    if not model:
        return [reason_without_model(study.evaluations, study.failed, len(study.vary))]
    said, first = [], rows[0]
    if first.surely:
        said.append(
            f"{first.name} mattered most near the best design: moved alone from its best value "
            f"to another within its bounds, it costs {first.loss_text}, and "
            f"{with_unit(first.surely, label.unit)} or more where the model is surest."
        )
    if uncertain := [row.name for row in rows if not row.surely]:
        *others, last = uncertain
        listed = f"{', '.join(others)} and {last}" if others else last
        said.append(
            f"{count} simulated candidates are too few to show an influence of {listed}: "
            "the intervals reach zero."
        )
    if len(rows) > 1:
        said.append(_shares(rows))
    noise = with_unit(abs(label.factor) * model.noise, label.unit)
    said.append(
        f"In its shaded range, each parameter alone loses no more than the noise, {noise} (95 % "
        "sure; a narrow range may only mean that few candidates lie near it). "
        f"Of all designs with every parameter in its range, {per_cent(model.together)} lose no "
        "more than that."
    )
    return said


def _shares(rows: Sequence[Influence]) -> str:
    """Return a sentence on the share of the objective's variance that single parameters explain.

    The variance is over all values within the bounds of the study.
    """
    shares, rest = sum(row.curve.share for row in rows), ""
    if shares < 0.8:
        rest = (
            "; the rest is how parameters act together, so each curve below holds near the best "
            "design"
        )
    widest = max(rows, key=lambda row: row.curve.share)
    if widest is not rows[0]:
        rest += f". Over all of the bounds {widest.name} has the largest effect of its own"
    return (
        f"The effects of single parameters are {per_cent(shares)} of the variance over the "
        f"bounds{rest}."
    )


def reason_without_model(count: int, failed: int, parameters: int) -> str:
    """Return a sentence on why a study has no model of its evaluations.

    Args:
        count: number of evaluations, of which `failed` were not simulated.
        parameters: number of varied parameters.
    """
    needed = POINTS_PER_PARAMETER * parameters
    if count - failed < needed:
        evaluations = f"{count} evaluation{'s' * (count != 1)}" + (
            f", {failed} of them not simulated," if failed else ""
        )
        few = "is too few" if count == 1 else "are too few"
        return (
            f"{evaluations} {few} to tell what each parameter does: {needed} or more are needed "
            "for a model of them."
        )
    return "This result holds no model of the evaluations, so the effect of parameters is unknown."
