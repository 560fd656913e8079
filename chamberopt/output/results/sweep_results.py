"""What a sweep leaves on disk: its rows as a table, the best design, and the map as a picture."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.common.files import atomic_write, write_text
from chamberopt.common.versions import versions
from chamberopt.design.load import save_design
from chamberopt.optimize.storage.study_folder import RESULT
from chamberopt.optimize.storage.trial_log import Trial, read_trials, trials_as_csv
from chamberopt.output.plots.study_and_accuracy import BLUE, GREY, ORANGE
from chamberopt.output.results.load import FORMAT

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from chamberopt.optimize.run_sweep import SweepResult

COLOURS = "viridis"
MOST_PAIRS = 15  # panels of a picture: six parameters


def write_sweep(folder: str | Path, sweep: SweepResult) -> list[str]:
    """Complete the folder of a sweep that has ended; returns remarks, such as a picture that leaves pairs out.

    Beside design.toml, study.toml and history.jsonl, which run_sweep wrote: history.csv · result.json · map.png ·
    best.toml, unless no candidate is feasible.
    """
    folder = Path(folder)
    write_text(folder / "history.csv", trials_as_csv(read_trials(folder)))
    if sweep.best is not None:
        save_design(sweep.study.design.changed(sweep.best.parameters), folder / "best.toml")
    remarks = _picture(folder / "map.png", sweep)
    write_text(
        folder / RESULT, json.dumps(_about(sweep), indent=2, allow_nan=False) + "\n"
    )  # last: it is finished
    return remarks


def caution(sweep: SweepResult) -> str:
    """What to know of the best row of a sweep."""
    if sweep.best is None:
        return (
            "no candidate meets the constraints: loosen them or widen [vary]; there is no best.toml"
        )
    return (
        f"the best of {len(sweep.trials)} candidates is also the luckiest of them: its figures promise too much; for "
        "ones that do not, simulate best.toml with another process.seed, or search with chamberopt run"
    )


def _about(sweep: SweepResult) -> dict[str, Any]:
    plan, study, best = sweep.plan, sweep.study, sweep.best
    return {
        "kind": "sweep",
        "format": FORMAT,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "sweep": {
            "objective": study.objective.goals[0],
            "vary": {name: list(bounds) for name, bounds in study.vary.items()},
            "method": plan.method,
            "count": plan.count,
            "seed": plan.seed,
            "candidates": len(sweep.trials),
            "failed": sum(trial.objective is None for trial in sweep.trials),
            "missing_a_constraint": sum(
                t.objective is not None and not t.feasible for t in sweep.trials
            ),
            "accuracy": study.at_search_accuracy(study.design).process.accuracy.model_dump(
                exclude_none=True
            ),
            "best": best.row() if best else None,
            "seconds": round(sweep.seconds, 3),
        },
        "notes": [caution(sweep)],
        "versions": versions(),
    }


def _picture(path: Path, sweep: SweepResult) -> list[str]:
    """One parameter: objective with intervals · two: a map, in squares of the grid or as points · more: a map of
    each pair, in which the other parameters vary too.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    names = list(sweep.study.vary)
    pairs = list(combinations(names, 2))
    shown, remarks = pairs[:MOST_PAIRS], []
    if len(pairs) > MOST_PAIRS:
        remarks.append(
            f"map.png: shows {MOST_PAIRS} of the {len(pairs)} pairs of parameters; all are in history.csv"
        )
    columns = min(3, len(shown)) or 1
    rows = -(-len(shown) // columns) or 1
    size = (9.0, 5.6) if len(names) < 3 else (4.6 * columns, 3.9 * rows + 0.8)
    figure = Figure(figsize=size, dpi=130, layout="constrained")
    FigureCanvasAgg(figure)
    if len(names) == 1:
        _line(figure.add_subplot(), sweep, names[0])
    else:
        _maps(figure, sweep, shown, (rows, columns))
    figure.suptitle(_title(sweep), fontsize=11)
    with atomic_write(path) as temporary:
        figure.savefig(temporary)
    return remarks


def _title(sweep: SweepResult) -> str:
    count, best = f"{len(sweep.trials)} candidates", sweep.best
    if best is None or best.objective is None:
        return f"{count}, none of them feasible"
    return f"{count}; the best as simulated {best.objective.value:.3f} ± {best.objective.half_width:.2g}, luck included"


def _line(axes: Axes, sweep: SweepResult, name: str) -> None:
    """Objective against the only parameter, 95 % intervals."""
    for feasible, colour, mark in ((True, BLUE, "o"), (False, GREY, "x")):
        goals = [
            (trial.parameters[name], trial.objective.value, trial.objective.half_width)
            for trial in sweep.trials
            if trial.objective and trial.feasible == feasible
        ]
        if goals:
            x, y, error = zip(*sorted(goals), strict=True)
            label = "95 % interval" if feasible else "misses a constraint"
            axes.errorbar(
                x,
                y,
                yerr=error,
                fmt=f"-{mark}" if feasible else mark,
                ms=5,
                lw=1,
                color=colour,
                label=label,
            )
    axes.axvline(
        sweep.study.design.value(name), color=ORANGE, lw=1, ls="--", label="the design as it is"
    )
    axes.set_xlabel(name)
    axes.set_ylabel(_goal(sweep))
    axes.grid(alpha=0.25, lw=0.6)
    axes.legend(fontsize=8, frameon=False)


def _maps(
    figure: Figure, sweep: SweepResult, pairs: list[tuple[str, str]], shape: tuple[int, int]
) -> None:
    judged = [trial for trial in sweep.trials if trial.objective]
    # The good ones on top: of what lies on one spot of a pair the best is seen.
    judged.sort(key=lambda trial: trial.objective.value if trial.objective else 0.0)
    drawn = None
    panels = []
    for i, (across, up) in enumerate(pairs):
        axes = figure.add_subplot(*shape, i + 1)
        panels.append(axes)
        squares = sweep.plan.method == "grid" and len(sweep.study.vary) == 2
        drawn = _squares(axes, sweep, across, up) if squares else _points(axes, judged, across, up)
        _marks(axes, sweep, across, up)
    if drawn is not None:
        figure.colorbar(drawn, ax=panels, label=_goal(sweep))
    figure.legend(
        *panels[0].get_legend_handles_labels(),
        loc="outside lower center",
        ncols=4,
        fontsize=8,
        frameon=False,
    )


def _squares(axes: Axes, sweep: SweepResult, across: str, up: str) -> Any:
    """A grid of two parameters; what could not be simulated stays white."""
    goals = [trial.objective.value if trial.objective else np.nan for trial in sweep.trials]
    values = np.array(goals).reshape(
        sweep.plan.count, sweep.plan.count
    )  # the plan's order: the second runs fastest
    x, y = (np.linspace(*sweep.study.vary[name], sweep.plan.count) for name in (across, up))
    return axes.pcolormesh(x, y, values.T, cmap=COLOURS, shading="nearest")


def _points(axes: Axes, judged: list[Trial], across: str, up: str) -> Any:
    x, y = ([trial.parameters[name] for trial in judged] for name in (across, up))
    colours = [trial.objective.value for trial in judged if trial.objective]
    return axes.scatter(x, y, c=colours, cmap=COLOURS, s=34, edgecolors="none")


def _marks(axes: Axes, sweep: SweepResult, across: str, up: str) -> None:
    """Start, best, and what is not to be had."""
    design = sweep.study.design
    for trials, label, colour in (
        (
            [t for t in sweep.trials if t.objective and not t.feasible],
            "misses a constraint",
            "black",
        ),
        ([t for t in sweep.trials if not t.objective], "could not be simulated", GREY),
    ):
        if trials:
            x, y = ([trial.parameters[name] for trial in trials] for name in (across, up))
            axes.scatter(x, y, marker="x", s=22, lw=1, color=colour, label=label)
    axes.plot(
        design.value(across),
        design.value(up),
        "o",
        color=ORANGE,
        mec="white",
        ms=8,
        label="the design as it is",
    )
    if sweep.best is not None:
        place = sweep.best.parameters
        axes.plot(
            place[across],
            place[up],
            "*",
            color="white",
            mec="black",
            ms=13,
            label="best as simulated",
        )
    axes.set_xlabel(across)
    axes.set_ylabel(up)


def _goal(sweep: SweepResult) -> str:
    return sweep.study.objective.goals[0].replace("_", " ")
