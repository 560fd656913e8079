"""The map of a sweep: its objective over one, two or more parameters."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.common.number_text import estimate_text
from chamberopt.output.plots.colours import BLUE, COVERAGE_MAP, GREY, ORANGE
from chamberopt.output.plots.figure_style import new_figure, readable, save_picture, style_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from chamberopt.optimize.run_sweep import SweepResult
    from chamberopt.optimize.storage.trial_log import Trial

MAX_PAIRS = 15  # panels of a picture: the pairs of six parameters


def sweep_map(path: Path, sweep: SweepResult) -> list[str]:
    """Write the map of a sweep as .png.

    One parameter gives a curve with intervals, two give a map, and more give one map a pair, in
    which the other parameters vary too.

    Returns:
        Remarks: a sentence when pairs are left out.
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
        _draw_curve(figure.add_subplot(), sweep, names[0])
    else:
        _draw_maps(figure, sweep, shown, (rows, columns))
    figure.suptitle(_title(sweep), fontsize=11)
    save_picture(figure, path)
    return remarks


def _title(sweep: SweepResult) -> str:
    count, best = f"{len(sweep.trials)} candidates", sweep.best
    if best is None or best.objective is None:
        return f"{count}, none of them feasible"
    return f"{count}; the best as simulated: {estimate_text(best.objective)}, luck included"


def _draw_curve(axes: Axes, sweep: SweepResult, name: str) -> None:
    """Draw the objective against the only parameter, with 95 % intervals."""
    for feasible, colour, line, label in (
        (True, BLUE, "-o", "95 % interval"),
        (False, GREY, "x", "misses a constraint"),
    ):
        rows = [
            (trial.parameters[name], trial.objective.value, trial.objective.half_width)
            for trial in sweep.trials
            if trial.objective and trial.feasible == feasible
        ]
        if rows:
            x, y, half_width = zip(*sorted(rows), strict=True)
            axes.errorbar(x, y, yerr=half_width, fmt=line, ms=5, lw=1, color=colour, label=label)
    start = sweep.study.design.value(name)
    axes.axvline(start, color=ORANGE, lw=1, ls="--", label="the design as it is")
    style_axes(axes, name, readable(sweep.study.objective.goals[0]))
    axes.legend(fontsize=8, frameon=False)


def _draw_maps(
    figure: Figure, sweep: SweepResult, pairs: list[tuple[str, str]], shape: tuple[int, int]
) -> None:
    """Draw one map a pair of parameters, with one colour bar and one legend."""
    is_grid = sweep.plan.method == "grid" and len(sweep.study.vary) == 2
    panels, colours = [], None
    for i, pair in enumerate(pairs):
        axes = figure.add_subplot(*shape, i + 1)
        panels.append(axes)
        colours = (_draw_squares if is_grid else _draw_points)(axes, sweep, pair)
        _draw_marks(axes, sweep, pair)
        axes.set_xlabel(pair[0])
        axes.set_ylabel(pair[1])
    if colours is not None:
        figure.colorbar(colours, ax=panels, label=readable(sweep.study.objective.goals[0]))
    figure.legend(
        *panels[0].get_legend_handles_labels(),
        loc="outside lower center",
        ncols=4,
        fontsize=8,
        frameon=False,
    )


def _draw_squares(axes: Axes, sweep: SweepResult, pair: tuple[str, str]) -> Any:
    """Draw a grid of two parameters; candidates that could not be simulated stay white."""
    count = sweep.plan.count
    objective = [trial.objective.value if trial.objective else np.nan for trial in sweep.trials]
    values = np.array(objective).reshape(count, count)  # the second parameter runs fastest
    x, y = (np.linspace(*sweep.study.vary[name], count) for name in pair)
    return axes.pcolormesh(x, y, values.T, cmap=COVERAGE_MAP, shading="nearest")


def _draw_points(axes: Axes, sweep: SweepResult, pair: tuple[str, str]) -> Any:
    # Good candidates are drawn last, so that the best of those on one spot is visible.
    evaluated = sorted(
        ((trial.objective.value, trial) for trial in sweep.trials if trial.objective),
        key=lambda row: row[0],
    )
    x, y = ([trial.parameters[name] for _, trial in evaluated] for name in pair)
    colours = [value for value, _ in evaluated]
    return axes.scatter(x, y, c=colours, cmap=COVERAGE_MAP, s=34, edgecolors="none")


def _draw_marks(axes: Axes, sweep: SweepResult, pair: tuple[str, str]) -> None:
    """Mark the design as it is, the best candidate, and candidates that failed."""
    infeasible = [trial for trial in sweep.trials if trial.objective and not trial.feasible]
    failed = [trial for trial in sweep.trials if not trial.objective]

    def places(trials: list[Trial]) -> list[list[float]]:
        return [[trial.parameters[name] for trial in trials] for name in pair]

    for trials, label, colour in (
        (infeasible, "misses a constraint", "black"),
        (failed, "could not be simulated", GREY),
    ):
        if trials:
            x, y = places(trials)
            axes.scatter(x, y, marker="x", s=22, lw=1, color=colour, label=label)
    start = (sweep.study.design.value(name) for name in pair)
    axes.plot(*start, "o", color=ORANGE, mec="white", ms=8, label="the design as it is")
    if sweep.best is not None:
        axes.plot(*places([sweep.best]), "*", color="white", mec="black", ms=13,
                  label="best as simulated")  # fmt: skip
