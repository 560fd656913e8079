"""Diagrams of what a study found: slices through its best design, and the front of two objectives."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from chamberopt.common.files import atomic_write
from chamberopt.coverage.statistics.confidence_interval import Estimate
from chamberopt.output.plots.study_and_accuracy import BLUE, GREEN, GREY, ORANGE, reach

if TYPE_CHECKING:
    from chamberopt.optimize.run_study import StudyResult
    from chamberopt.optimize.sensitivity import Sensitivity


def slices_picture(path: Path, result: StudyResult, sensitivity: Sensitivity) -> None:
    """The objective over each parameter as the model has it: slice with its interval, main effect, flat range; .png."""
    count = len(sensitivity.slices)
    columns = min(count, 4)
    rows = -(-count // columns)
    figure = _figure(3.4 * max(columns, 2), 3.3 * rows + 0.5)
    grid = figure.subplots(rows, columns, sharey=True, squeeze=False).ravel()
    for axes, one in zip(grid, sensitivity.slices, strict=False):
        axes.axvspan(
            *one.flat,
            color=GREEN,
            alpha=0.12,
            lw=0,
            label=f"loses no more than {sensitivity.noise:.2g}",
        )
        axes.fill_between(
            one.values,
            one.mean - one.half_width,
            one.mean + one.half_width,
            color=BLUE,
            alpha=0.15,
            lw=0,
        )
        axes.plot(
            one.values, one.mean, color=BLUE, label="the others as in the best, 95 % interval"
        )
        axes.plot(one.values, one.effect, color=GREY, ls="--", label="mean over the others")
        axes.axvline(result.best.parameters[one.name], color=GREEN, lw=1.2, label="best")
        axes.axvline(result.start.parameters[one.name], color=ORANGE, lw=1.0, ls=":", label="start")
        axes.set_xlabel(one.name)
        axes.set_title(f"{one.share:.0%} of the variance", loc="left", fontsize=9)
    for axes in grid[count:]:
        axes.set_visible(False)
    grid[0].set_ylabel(result.study.objective.goals[0].replace("_", " "))
    handles, labels = grid[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3, fontsize=8, frameon=False)
    _save(figure, path)


def front_picture(path: Path, result: StudyResult) -> None:
    """Both objectives of every candidate, the confirmed front with its intervals; .png."""
    from chamberopt.optimize.pareto import pareto_points

    figure = _figure(8.0, 6.0)
    axes = figure.subplots()
    every = pareto_points(result)
    groups = (
        ("search", False, GREY, "o", "searched"),
        ("search", True, BLUE, "o", "searched, on the front of the search"),
        ("confirm", False, ORANGE, "s", "confirmed on fresh seeds, beaten in both"),
        ("confirm", True, GREEN, "s", "confirmed on fresh seeds, on the front"),
    )
    for stage, there, colour, mark, label in groups:
        shown = sorted(
            (one.goals for one in every if (one.stage, one.on_front) == (stage, there)),
            key=lambda goals: goals[0].value,
        )
        x, y = ([goals[k].value for goals in shown] for k in (0, 1))
        bars: dict[str, Any] = {}
        if stage == "confirm":
            bars = {
                "xerr": [goals[0].half_width for goals in shown],
                "yerr": [goals[1].half_width for goals in shown],
            }
        line = "--" if stage == "confirm" and there else ""
        axes.errorbar(
            x, y, **bars, fmt=mark, ls=line, lw=1, ms=5 if bars else 3, color=colour, label=label
        )
    confirmed = [one.goals for one in every if one.stage == "confirm"]
    bare = [
        tuple(Estimate(goal.value, 0.0) for goal in one.goals)
        for one in every
        if one.stage == "search"
    ]
    across, up = zip(*confirmed, *bare, strict=True)
    axes.set_xlim(*reach(list(across)))
    axes.set_ylim(*reach(list(up)))
    x_name, y_name = (name.replace("_", " ") for name in result.study.objective.goals)
    axes.set_xlabel(f"{x_name}, better to the right")
    axes.set_ylabel(f"{y_name}, better upwards")
    axes.legend(fontsize=8, frameon=False)
    _save(figure, path)


def _figure(width: float, height: float) -> Any:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=130, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def _save(figure: Any, path: Path) -> None:
    with atomic_write(path) as temporary:
        figure.savefig(temporary)
