"""The study at a glance: how the objective rose, and where in the bounds the good designs lie."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.disk import whole_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from chamberopt.history import Trial
    from chamberopt.study import StudyResult

# Okabe and Ito's colours, told apart by colour-blind readers.
BLUE, ORANGE, GREEN, GREY = "#0072B2", "#D55E00", "#009E73", "#9aa3ab"


def convergence_picture(path: Path, result: StudyResult) -> None:
    """Objective against evaluation with 95 % intervals, and against each parameter; written as .png."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    names = list(result.study.vary)
    columns = min(len(names), 4)
    rows = -(-len(names) // columns)
    figure = Figure(figsize=(11.0, 4.2 + 3.0 * rows), dpi=130, layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(rows + 1, columns, height_ratios=[1.35, *[1.0] * rows])
    _convergence(figure.add_subplot(grid[0, :]), result)
    search = [trial for trial in result.trials if trial.stage == "search"]
    first: Axes | None = None
    for i, name in enumerate(names):
        axes = figure.add_subplot(grid[1 + i // columns, i % columns], sharey=first)
        _against(axes, result, search, name)
        if i % columns == 0:
            axes.set_ylabel(_label(result))
        else:
            axes.tick_params(labelleft=False)
        first = first or axes
    with whole_file(path) as temporary:
        figure.savefig(temporary)


def _convergence(axes: Axes, result: StudyResult) -> None:
    from matplotlib.ticker import MaxNLocator

    search = [trial for trial in result.trials if trial.stage == "search"]
    confirmed = [trial for trial in result.trials if trial.stage == "confirm" and trial.objective]
    good = [trial for trial in search if trial.objective and trial.feasible]
    _bars(axes, good, BLUE, "evaluation, 95 % interval")
    _bars(axes, [t for t in search if t.objective and not t.feasible], GREY, "misses a constraint", mark="x")
    failed = [trial.number + 1 for trial in search if not trial.objective]
    if failed:
        label = "could not be simulated"
        axes.plot(failed, np.full(len(failed), 0.02), "|", color=GREY, label=label,
                  transform=axes.get_xaxis_transform(), clip_on=False)  # fmt: skip
    best = np.maximum.accumulate([t.score if t.feasible else -np.inf for t in search])
    shown = np.isfinite(best)
    axes.step(np.arange(1, len(search) + 1)[shown], best[shown], where="post", color=BLUE, alpha=0.5,
              label="best so far (as searched)")  # fmt: skip
    if confirmed:
        axes.axvspan(len(search) + 0.5, result.trials[-1].number + 1.5, color=GREEN, alpha=0.08, lw=0)
        _bars(axes, confirmed, GREEN, "confirmed on fresh seeds")
    level = result.start.evaluation.objective.value
    axes.axhline(level, color=ORANGE, lw=1.2, ls="--", label="start, confirmed")
    gain = result.gain
    axes.set_title(
        f"best {result.best.evaluation.objective.value:.3f}, start {level:.3f}: gain {gain.value:+.3f} ± "
        f"{gain.half_width:.3f}   ({result.algorithm})",
        loc="left",
        fontsize=11,
    )
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlabel("evaluation")
    axes.set_ylabel(_label(result))
    axes.set_xlim(0.5, result.trials[-1].number + 1.5)
    _plain(axes)
    axes.legend(fontsize=8, ncols=3, frameon=False, loc="lower right")


def _against(axes: Axes, result: StudyResult, search: list[Trial], name: str) -> None:
    """The search's candidates over one parameter: later ones darker; start and best as confirmed."""
    judged = [trial for trial in search if trial.objective]
    axes.scatter(
        [trial.parameters[name] for trial in judged],
        [trial.objective.value for trial in judged if trial.objective],
        c=[trial.number for trial in judged],
        cmap="Blues",
        vmin=-0.6 * max(1, len(search)),
        s=26,
        edgecolors="none",
    )
    chosen: tuple[tuple[Any, str, str, str], ...] = (
        (result.start, ORANGE, "o", "start"),
        (result.best, GREEN, "*", "best"),
    )
    for candidate, colour, mark, label in chosen:
        goal = candidate.evaluation.objective
        axes.plot(candidate.parameters[name], goal.value, mark, color=colour, label=label,
                  ms=13 if mark == "*" else 8, mec="white")  # fmt: skip
    low, high = result.study.vary[name]
    margin = 0.03 * (high - low)
    axes.set_xlim(low - margin, high + margin)
    axes.set_xlabel(name)
    _plain(axes)
    axes.legend(fontsize=8, frameon=False)


def _bars(axes: Axes, trials: list[Trial], colour: str, label: str, mark: str = "o") -> None:
    goals = [(t.number + 1, t.objective.value, t.objective.half_width) for t in trials if t.objective]
    if goals:
        x, y, error = zip(*goals, strict=True)
        axes.errorbar(x, y, yerr=error, fmt=mark, ms=5, lw=1, color=colour, label=label)


def _label(result: StudyResult) -> str:
    return result.study.objective.name.replace("_", " ")


def _plain(axes: Axes) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.25, lw=0.6)
