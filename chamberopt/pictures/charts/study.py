"""Draw charts of an optimisation study: search, influence of each parameter, Pareto front."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from chamberopt.common.estimate import Estimate
from chamberopt.common.key_words import title_with_unit
from chamberopt.common.number_text import estimate_text, plain
from chamberopt.pictures.charts.colours import BLUE, GREEN, GREY, ORANGE
from chamberopt.pictures.charts.figure_style import (
    SMALL,
    TITLE,
    keep_below,
    literal,
    name_choices,
    new_figure,
    save_picture,
    style_axes,
    value_range,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from chamberopt.search.run_study import StudyResult
    from chamberopt.search.sensitivity import Sensitivity, Slice

MAX_COLUMNS = 4  # panels side by side
WIDE = (11.0, 3.8)  # inch
Y_LABEL = 40  # letters of a line that fit beside a chart


class ObjectiveAxis(Protocol):
    """How charts name and scale an objective, as documents do: a time to be short is a time."""

    @property
    def with_unit(self) -> str:
        """Its name with its unit."""
        ...

    @property
    def factor(self) -> float:
        """Shown number over the objective; negative if the smaller is the better."""
        ...

    @property
    def most(self) -> float:
        """Largest number that can be shown."""
        ...

    def scale(self, estimate: Estimate) -> Estimate:
        """Return an objective in the unit of the axis."""
        ...

    def number(self, estimate: Estimate, sign: bool = False) -> str:
        """Return an objective as text, with its interval."""
        ...


@dataclass(frozen=True)
class EvaluatedCandidate:
    """One evaluation of a study as its chart shows it.

    Args:
        number: number of the evaluation in the order of the study, from 1.
        stage: "search" or "confirm".
        objective: its objective; None if the candidate was not simulated.
        feasible: true if it meets the constraints.
        parameters: values of the varied parameters by their dotted names.
    """

    number: int
    stage: str
    objective: Estimate | None
    feasible: bool
    parameters: Mapping[str, float | str] = field(default_factory=dict)


def convergence_picture(
    path: Path,
    result: StudyResult,
    candidates: Sequence[EvaluatedCandidate],
    objective: ObjectiveAxis,
) -> None:
    """Write charts of the objective by order of evaluation and over each parameter, as .png.

    Args:
        candidates: all evaluations of the study, in the unit of the objective's axis.
    """
    names = list(result.study.vary)
    columns = min(len(names), MAX_COLUMNS)
    rows = -(-len(names) // columns)
    figure = new_figure(11.0, 4.2 + 3.0 * rows)
    grid = figure.add_gridspec(rows + 1, columns, height_ratios=[1.35, *[1.0] * rows])
    axes = figure.add_subplot(grid[0, :])
    smaller = objective.factor < 0.0
    draw_convergence(axes, candidates, objective.with_unit, smaller, objective.most)
    start, best = (one.evaluation.objective for one in (result.start, result.best))
    axes.axhline(
        objective.factor * start.value, color=ORANGE, lw=1.2, ls="--", label="start, as confirmed"
    )
    axes.set_title(
        f"best {objective.number(best)}, start {objective.number(start)}: "
        f"change {objective.number(result.gain, sign=True)}",
        loc="left",
        fontsize=TITLE,
    )
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower left", ncols=4, fontsize=SMALL, frameon=False,
                  title="lower panels: the later in the search, the darker",
                  title_fontsize=SMALL, alignment="left")  # fmt: skip
    first: Axes | None = None
    for i, name in enumerate(names):
        axes = figure.add_subplot(grid[1 + i // columns, i % columns], sharey=first)
        _draw_parameter(axes, result, candidates, name, objective)
        keep_below(axes, objective.most)
        if i % columns == 0:
            axes.set_ylabel(fill(objective.with_unit, Y_LABEL))
        else:
            axes.tick_params(labelleft=False)
        first = first or axes
    save_picture(figure, path)


def draw_convergence(
    axes: Axes,
    candidates: Sequence[EvaluatedCandidate],
    y_label: str,
    smaller_is_better: bool = False,
    most: float = math.inf,
) -> dict[str, list[str]]:
    """Draw the objective of every evaluation in its order, with 95 % intervals.

    The best candidate so far and the confirmations (second evaluations) of candidates are drawn
    too.

    Args:
        most: the largest value of the objective that is possible.

    Returns:
        Tooltips for svg_text: value and parameters of each point, by the gid (id) of the line.
    """
    from matplotlib.ticker import MaxNLocator

    search = [one for one in candidates if one.stage == "search"]
    evaluated = [one for one in search if one.objective]
    confirmed = [one for one in candidates if one.stage == "confirm" and one.objective]
    feasible = [one for one in evaluated if one.feasible]
    infeasible = [one for one in evaluated if not one.feasible]
    failed = [one.number for one in search if not one.objective]
    last = max((one.number for one in candidates), default=1) + 0.5
    tooltips = {}
    for group, colour, marker, label in (
        (feasible, BLUE, "o", "evaluation, 95 % interval"),
        (infeasible, GREY, "x", "misses a constraint"),
        (confirmed, GREEN, "o", "confirmed on fresh seeds"),
    ):
        if group:
            x, y, half_width = zip(*map(_point, group), strict=True)
            bars = [one if math.isfinite(one) else 0.0 for one in half_width]
            axes.errorbar(x, y, yerr=bars, fmt=marker, ms=5, lw=1, color=colour, label=label,
                          gid=label)  # fmt: skip
            tooltips[label] = [_tooltip(one) for one in group]
    # A value without an interval is the least sure, and must not look like the surest.
    if rough := [one for one in (*evaluated, *confirmed) if not math.isfinite(_point(one)[2])]:
        x, y, _ = zip(*map(_point, rough), strict=True)
        axes.plot(x, y, "o", mfc="none", mec=GREY, ms=11, label="ringed: not resolved")
    if failed:
        axes.plot(failed, np.full(len(failed), 0.02), "|", color=GREY, clip_on=False,
                  label="not simulated", transform=axes.get_xaxis_transform())  # fmt: skip
    if feasible:
        numbers, values = best_so_far(feasible, smaller_is_better)
        axes.step([*numbers, search[-1].number], [*values, values[-1]], where="post", color=BLUE,
                  alpha=0.5, label="best so far (as searched)")  # fmt: skip
    if confirmed:
        axes.axvspan(len(search) + 0.5, last, color=GREEN, alpha=0.08, lw=0)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlim(0.5, last)
    if shown := [one.objective for one in (*evaluated, *confirmed) if one.objective]:
        axes.set_ylim(*value_range(shown, most))
    style_axes(axes, "evaluation", y_label)
    return tooltips


def best_so_far(
    candidates: Sequence[EvaluatedCandidate], smaller_is_better: bool
) -> tuple[list[int], list[float]]:
    """Return the number of each feasible candidate of a search, and the best objective until it.

    Confirmations are left out: the best of a few would look like a fall.
    """
    found = [(one.number, one.objective.value) for one in candidates
             if one.stage != "confirm" and one.feasible and one.objective]  # fmt: skip
    best = np.minimum if smaller_is_better else np.maximum
    return [number for number, _ in found], best.accumulate([y for _, y in found]).tolist()


def _point(candidate: EvaluatedCandidate) -> tuple[int, float, float]:
    assert candidate.objective is not None
    return candidate.number, candidate.objective.value, candidate.objective.half_width


def _tooltip(candidate: EvaluatedCandidate) -> str:
    assert candidate.objective is not None
    rows = [f"{name} = {plain(one)}" for name, one in candidate.parameters.items()]
    first = f"evaluation {candidate.number}: {estimate_text(candidate.objective)}"
    return "\n".join([first, *rows])


def _draw_parameter(
    axes: Axes,
    result: StudyResult,
    candidates: Sequence[EvaluatedCandidate],
    name: str,
    objective: ObjectiveAxis,
) -> None:
    """Draw the objective of each candidate over one parameter, later candidates darker.

    The unchanged design and the best design are marked, with their confirmed values.
    """
    varied = result.study.vary[name]
    search = [one for one in candidates if one.stage == "search"]
    shown = [
        one for one in search if one.objective and is_there(one.parameters[name], varied.texts)
    ]
    axes.scatter(
        [varied.place(one.parameters[name]) for one in shown],
        [one.objective.value for one in shown if one.objective],
        c=[one.number for one in shown],
        cmap="Blues",
        vmin=-0.6 * max(1, len(search)),
        s=26,
        edgecolors="none",
    )
    for confirmed, colour, marker, size, label in (
        (result.start, ORANGE, "o", 8, "start"),
        (result.best, GREEN, "*", 13, "best"),
    ):
        if not is_there(confirmed.parameters[name], varied.texts):
            continue
        value = objective.factor * confirmed.evaluation.objective.value
        place = varied.place(confirmed.parameters[name])
        axes.plot(place, value, marker, color=colour, label=label, ms=size, mec="white")
    low, high = varied.bounds
    margin = (0.2 if varied.texts else 0.03) * (high - low)
    axes.set_xlim(low - margin, high + margin)
    name_choices(axes.xaxis, varied.texts)
    style_axes(axes, literal(title_with_unit(name)))
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=SMALL, frameon=False)


def is_there(value: float | str, texts: Sequence[str]) -> bool:
    """Return True if a value is the value of a parameter: a number, or one of the allowed texts.

    Where a candidate lacks the parameter, any other text stands in place of the value.
    """
    return not isinstance(value, str) or value in texts


def slices_picture(
    path: Path, result: StudyResult, sensitivity: Sensitivity, objective: ObjectiveAxis
) -> None:
    """Write charts of the objective over each parameter, by the study's model, as .png."""
    figure = slices_figure(
        [one.scaled(objective.factor) for one in sensitivity.slices],
        result.start.parameters,
        result.best.parameters,
        f"loses no more than {abs(objective.factor) * sensitivity.noise:.2g}",
        fill(objective.with_unit, Y_LABEL),
        objective.most,
    )
    save_picture(figure, path)


def slices_figure(
    slices: Sequence[Slice],
    start: Mapping[str, float | str],
    best: Mapping[str, float | str],
    flat_label: str,
    y_label: str,
    most: float = math.inf,
) -> Figure:
    """Return charts of the objective over each parameter, as the study's model predicts it.

    Each chart varies a parameter of the best design. It shows the interval of the prediction, the
    mean over the other parameters, and the range in which the objective is hardly worse. It shows
    nothing where the evaluations leave the model no more than an upper limit.

    Args:
        slices: predictions over each parameter.
        start, best: parameter values of the unchanged and of the best design.
        flat_label: legend for the shaded range of a parameter.
        most: the largest value of the objective that is possible.
    """
    columns = min(len(slices), MAX_COLUMNS)
    rows = -(-len(slices) // columns)
    figure = new_figure(3.4 * max(columns, 2), 3.3 * rows + 0.5)
    panels = figure.subplots(rows, columns, sharey=True, squeeze=False).ravel()
    for axes, one in zip(panels, slices, strict=False):
        of_slice, of_mean = "model, the others as in the best", "mean over the others"
        # The model takes evaluations below its floor as its floor: there it is an upper limit.
        mean, effect = (np.where(one.or_worse, np.nan, x) for x in (one.mean, one.effect))
        width = one.half_width
        if one.texts:
            for text in one.flat:
                place = _place(one, text)
                axes.axvspan(
                    place - 0.2, place + 0.2, color=GREEN, alpha=0.12, lw=0, label=flat_label
                )
            axes.errorbar(one.values, mean, width, fmt="o", color=BLUE, label=of_slice)
            axes.plot(one.values, effect, "D", mfc="none", color=GREY, label=of_mean)
            name_choices(axes.xaxis, one.texts)
        else:
            low, high = mean - width, mean + width
            axes.axvspan(*one.flat, color=GREEN, alpha=0.12, lw=0, label=flat_label)
            axes.fill_between(one.values, low, high, color=BLUE, alpha=0.15, lw=0)
            axes.plot(one.values, mean, color=BLUE, label=of_slice)
            axes.set_xlim(one.values.min(), one.values.max())  # also where nothing is drawn
            axes.plot(one.values, effect, color=GREY, ls="--", label=of_mean)
        axes.axvline(_place(one, best[one.name]), color=GREEN, lw=1.2, label="best")
        if is_there(start[one.name], one.texts):
            axes.axvline(_place(one, start[one.name]), color=ORANGE, lw=1.0, ls=":", label="start")
        axes.set_title(f"alone {one.share:.0%} of the variance", loc="left", fontsize=SMALL)
        style_axes(axes, literal(title_with_unit(one.name)))
    for axes in panels[len(slices) :]:
        axes.set_visible(False)
    keep_below(panels[0], most)
    panels[0].set_ylabel(y_label)
    found = [axes.get_legend_handles_labels() for axes in panels[: len(slices)]]
    legend = {label: one for pair in found for one, label in zip(*pair, strict=True)}
    figure.legend(legend.values(), legend.keys(), loc="outside upper center",
                  ncols=5 if columns > 2 else 2, fontsize=SMALL, frameon=False)  # fmt: skip
    return figure


def _place(of: Slice, value: float | str) -> float:
    return float(of.texts.index(value) if isinstance(value, str) else value)


def pareto_picture(path: Path, result: StudyResult, objectives: Sequence[ObjectiveAxis]) -> None:
    """Write a chart of one objective against the other for every candidate, as .png.

    It marks the Pareto front: the confirmed candidates that no other candidate beats in one
    objective without being worse in the other.
    """
    from chamberopt.search.pareto import pareto_points

    figure = new_figure(8.0, 6.0)
    axes = figure.subplots()
    candidates = pareto_points(result)
    groups = (
        ("search", False, GREY, "o", "searched"),
        ("search", True, BLUE, "o", "searched, on the front of the search"),
        ("confirm", False, ORANGE, "s", "confirmed on fresh seeds, beaten in both"),
        ("confirm", True, GREEN, "s", "confirmed on fresh seeds, on the front"),
    )
    for stage, on_front, colour, marker, label in groups:
        shown = sorted(
            (
                [axis.scale(goal) for axis, goal in zip(objectives, one.goals, strict=True)]
                for one in candidates
                if (one.stage, one.on_front) == (stage, on_front)
            ),
            key=lambda goals: goals[0].value,
        )
        x, y = ([goals[k].value for goals in shown] for k in (0, 1))
        bars: dict[str, Any] = {}
        if stage == "confirm":
            x_error, y_error = ([goals[k].half_width for goals in shown] for k in (0, 1))
            bars = {"xerr": x_error, "yerr": y_error}
        axes.errorbar(x, y, **bars, fmt=marker, ls="--" if bars and on_front else "", lw=1,
                      ms=5 if bars else 3, color=colour, label=label)  # fmt: skip
    # Only confirmed candidates have intervals.
    x_goals, y_goals = (
        [
            axis.scale(
                one.goals[k] if one.stage == "confirm" else Estimate(one.goals[k].value, 0.0)
            )
            for one in candidates
        ]
        for k, axis in enumerate(objectives)
    )
    x_axis, y_axis = objectives
    axes.set_xlim(*value_range(x_goals, x_axis.most))
    axes.set_ylim(*value_range(y_goals, y_axis.most))
    right, up = (
        "the left" if x_axis.factor < 0.0 else "the right",
        "downwards" if y_axis.factor < 0.0 else "upwards",
    )
    style_axes(
        axes,
        f"{x_axis.with_unit}, better to the {right}",
        fill(f"{y_axis.with_unit}, better {up}", Y_LABEL),
    )
    axes.legend(fontsize=SMALL, frameon=False)
    save_picture(figure, path)


def convergence_figure(
    candidates: Sequence[EvaluatedCandidate],
    y_label: str,
    smaller_is_better: bool,
    most: float = math.inf,
) -> tuple[Figure, dict[str, list[str]]]:
    """Return a chart of the objective of every evaluation in order, and tooltips for it."""
    figure = new_figure(*WIDE)
    axes = figure.subplots()
    tooltips = draw_convergence(axes, candidates, fill(y_label, Y_LABEL), smaller_is_better, most)
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=5, fontsize=SMALL, frameon=False)
    return figure, tooltips


def influence_figure(
    slices: Sequence[Slice],
    start: Mapping[str, float | str],
    best: Mapping[str, float | str],
    y_label: str,
    most: float = math.inf,
) -> Figure:
    """Return charts of the objective that the study's model predicts over each parameter.

    Args:
        slices: predictions over each parameter.
        start, best: parameter values of the unchanged and of the best design.
    """
    label = fill(y_label, Y_LABEL)
    return slices_figure(slices, start, best, "loses no more than the noise", label, most)
