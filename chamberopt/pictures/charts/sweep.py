"""Draw the map of a sweep, which simulates a grid of parameter values: its objective over them."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.key_words import title_with_unit
from chamberopt.pictures.charts.colours import BLUE, COVERAGE_MAP, GREY, ORANGE
from chamberopt.pictures.charts.figure_style import (
    SMALL,
    TITLE,
    keep_below,
    name_choices,
    new_figure,
    save_picture,
    style_axes,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.collections import PathCollection, QuadMesh
    from matplotlib.figure import Figure

    from chamberopt.pictures.charts.study import ObjectiveAxis
    from chamberopt.search.run_sweep import SweepResult
    from chamberopt.search.trial_log import Trial

MAX_PAIRS = 15  # panels of a picture: the pairs of six parameters


def sweep_map(path: Path, sweep: SweepResult, goal: ObjectiveAxis) -> list[str]:
    """Write the map of a sweep as .png.

    One parameter gives a curve with intervals, and two parameters give a map. More parameters give
    a map for each pair, over which the other parameters vary too.

    Args:
        goal: how the objective is named and scaled.

    Returns:
        Remarks for the user: a sentence if pairs of parameters are left out.
    """
    names = list(sweep.study.vary)
    pairs = list(combinations(names, 2))
    shown, remarks = pairs[:MAX_PAIRS], []
    if len(pairs) > MAX_PAIRS:
        remarks.append(
            f"map.png: shows {MAX_PAIRS} of the {len(pairs)} pairs of parameters; "
            "all are in history.csv"
        )
    columns = min(3, len(shown)) or 1
    rows = -(-len(shown) // columns) or 1
    size = (9.0, 5.6) if len(names) < 3 else (4.6 * columns, 3.9 * rows + 0.8)
    figure = new_figure(*size)
    if len(names) == 1:
        _draw_curve(figure.add_subplot(), sweep, names[0], goal)
    else:
        _draw_maps(figure, sweep, shown, (rows, columns), goal)
    figure.suptitle(_title(sweep, goal), fontsize=TITLE)
    save_picture(figure, path)
    return remarks


def _title(sweep: SweepResult, goal: ObjectiveAxis) -> str:
    count, best = f"{len(sweep.trials)} candidates", sweep.best
    if best is None or best.objective is None:
        return f"{count}, none of them feasible"
    return f"{count}; the best as simulated: {goal.number(best.objective)}, luck included"


def _draw_curve(axes: Axes, sweep: SweepResult, name: str, goal: ObjectiveAxis) -> None:
    """Draw the objective over a sweep's only parameter, with 95 % intervals."""
    for feasible, colour, line, label in (
        (True, BLUE, "-o", "95 % interval"),
        (False, GREY, "x", "misses a constraint"),
    ):
        rows = [
            (*_places(sweep, [trial], name), shown.value, shown.half_width)
            for trial in sweep.trials
            if trial.objective and trial.feasible == feasible
            for shown in (goal.scale(trial.objective),)
        ]
        if rows:
            x, y, half_width = zip(*sorted(rows), strict=True)
            axes.errorbar(x, y, yerr=half_width, fmt=line, ms=5, lw=1, color=colour, label=label)
    axes.axvline(_start(sweep, name), color=ORANGE, lw=1, ls="--", label="the design as it is")
    name_choices(axes.xaxis, sweep.study.vary[name].texts)
    keep_below(axes, goal.most)
    style_axes(axes, title_with_unit(name), goal.with_unit)
    axes.legend(fontsize=SMALL, frameon=False)


def _draw_maps(
    figure: Figure,
    sweep: SweepResult,
    pairs: list[tuple[str, str]],
    shape: tuple[int, int],
    goal: ObjectiveAxis,
) -> None:
    """Draw a map of the objective for each pair of parameters, with one colour bar for all."""
    is_grid = sweep.plan.method == "grid" and len(sweep.study.vary) == 2
    panels, colours = [], None
    for i, pair in enumerate(pairs):
        axes = figure.add_subplot(*shape, i + 1)
        panels.append(axes)
        colours = (_draw_squares if is_grid else _draw_points)(axes, sweep, pair, goal)
        _draw_marks(axes, sweep, pair)
        for axis, name in zip((axes.xaxis, axes.yaxis), pair, strict=True):
            name_choices(axis, sweep.study.vary[name].texts)
        axes.set_xlabel(title_with_unit(pair[0]))
        axes.set_ylabel(title_with_unit(pair[1]))
    if colours is not None:
        figure.colorbar(colours, ax=panels, label=goal.with_unit)
    figure.legend(
        *panels[0].get_legend_handles_labels(),
        loc="outside lower center",
        ncols=4,
        fontsize=SMALL,
        frameon=False,
    )


def _draw_squares(
    axes: Axes, sweep: SweepResult, pair: tuple[str, str], goal: ObjectiveAxis
) -> QuadMesh:
    """Draw the objective as coloured squares on the grid of two parameters.

    Candidates that could not be simulated stay white.
    """
    x, y = (np.unique(_places(sweep, sweep.trials, name)) for name in pair)
    objective = [trial.objective.value if trial.objective else np.nan for trial in sweep.trials]
    values = np.array(objective).reshape(len(x), len(y))  # the second parameter runs fastest
    return axes.pcolormesh(x, y, goal.factor * values.T, cmap=_colours(goal), shading="nearest")


def _draw_points(
    axes: Axes, sweep: SweepResult, pair: tuple[str, str], goal: ObjectiveAxis
) -> PathCollection:
    # Good candidates are drawn last, so that the best candidate on a spot is visible.
    evaluated = sorted(
        ((trial.objective.value, trial) for trial in sweep.trials if trial.objective),
        key=lambda row: row[0],
    )
    x, y = (_places(sweep, [trial for _, trial in evaluated], name) for name in pair)
    colours = [goal.factor * value for value, _ in evaluated]
    return axes.scatter(x, y, c=colours, cmap=_colours(goal), s=34, edgecolors="none")


def _colours(goal: ObjectiveAxis) -> str:
    """Return the name of the scale of colours whose good end is the better one of the objective."""
    return COVERAGE_MAP if goal.factor > 0.0 else f"{COVERAGE_MAP}_r"


def _draw_marks(axes: Axes, sweep: SweepResult, pair: tuple[str, str]) -> None:
    """Mark the unchanged design, the best candidate, and candidates without a valid result.

    Candidates without a valid result could not be simulated or miss a constraint.
    """
    infeasible = [trial for trial in sweep.trials if trial.objective and not trial.feasible]
    failed = [trial for trial in sweep.trials if not trial.objective]

    for trials, label, colour in (
        (infeasible, "misses a constraint", "black"),
        (failed, "could not be simulated", GREY),
    ):
        if trials:
            x, y = (_places(sweep, trials, name) for name in pair)
            axes.scatter(x, y, marker="x", s=22, lw=1, color=colour, label=label)
    # Open marks show the colour below them.
    start = (_start(sweep, name) for name in pair)
    axes.plot(*start, "o", color=ORANGE, mfc="none", mew=2.2, ms=13, label="the design as it is")
    if sweep.best is not None:
        place = [_places(sweep, [sweep.best], name) for name in pair]
        for colour, width, label in (("white", 4.0, ""), ("black", 1.6, "best as simulated")):
            axes.plot(*place, "s", color=colour, mfc="none", mew=width, ms=13,
                      label=label)  # fmt: skip


def _places(sweep: SweepResult, trials: Sequence[Trial], name: str) -> list[float]:
    """Return where the value of a parameter in each trial lies on an axis.

    It is the value itself, or for a text the position among the allowed texts.
    """
    return [sweep.study.vary[name].place(trial.parameters[name]) for trial in trials]


def _start(sweep: SweepResult, name: str) -> float:
    return sweep.study.vary[name].place(sweep.study.design.setting(name))
