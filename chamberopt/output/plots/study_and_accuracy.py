"""Diagrams: a study at a glance, how its objective rose and where the good designs lie; what accuracy costs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.common.files import atomic_write

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from chamberopt.coverage.statistics.confidence_interval import Estimate
    from chamberopt.optimize.run_study import StudyResult
    from chamberopt.optimize.storage.trial_log import Trial
    from chamberopt.simulation.convergence.study import Ladder

# Okabe and Ito's colours, told apart by colour-blind readers.
BLUE, ORANGE, GREEN, GREY = "#0072B2", "#D55E00", "#009E73", "#9aa3ab"
PURPLE, SKY, YELLOW = "#CC79A7", "#56B4E9", "#E69F00"


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
    with atomic_write(path) as temporary:
        figure.savefig(temporary)


def _convergence(axes: Axes, result: StudyResult) -> None:
    from matplotlib.ticker import MaxNLocator

    search = [trial for trial in result.trials if trial.stage == "search"]
    confirmed = [trial for trial in result.trials if trial.stage == "confirm" and trial.objective]
    good = [trial for trial in search if trial.objective and trial.feasible]
    _bars(axes, good, BLUE, "evaluation, 95 % interval")
    _bars(
        axes,
        [t for t in search if t.objective and not t.feasible],
        GREY,
        "misses a constraint",
        mark="x",
    )
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
        axes.axvspan(
            len(search) + 0.5, result.trials[-1].number + 1.5, color=GREEN, alpha=0.08, lw=0
        )
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
    axes.set_ylim(*reach([t.objective for t in (*search, *confirmed) if t.objective]))
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
    goals = [
        (t.number + 1, t.objective.value, t.objective.half_width) for t in trials if t.objective
    ]
    if goals:
        x, y, error = zip(*goals, strict=True)
        axes.errorbar(x, y, yerr=error, fmt=mark, ms=5, lw=1, color=colour, label=label)


def price_picture(path: Path, ladder: Ladder) -> None:
    """Work and precision: error against CPU seconds with the Pareto front named; bias of every rung; as .png."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13.0, 6.6), dpi=130, layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(1, 2, width_ratios=[1.7, 1.0])
    _work_precision(figure.add_subplot(grid[0, 0]), ladder)
    _biases(figure.add_subplot(grid[0, 1]), ladder)
    with atomic_write(path) as temporary:
        figure.savefig(temporary)


def _work_precision(axes: Axes, ladder: Ladder) -> None:
    """Replicas as circles with their law; a knob's bias at the price of the design's own number of replicas."""
    from chamberopt.simulation.convergence.error_law import NORMAL
    from chamberopt.simulation.convergence.recommendation import ASKED, recommend

    axes.set_xscale("log")
    axes.set_yscale("log")
    for accuracy in ASKED:
        axes.axhline(accuracy, color=GREY, lw=0.8, ls=":")
    levels, law = ladder.levels, ladder.law
    cost, error = np.array([one.cpu_s for one in levels]), np.array([one.error for one in levels])
    ends = NORMAL * np.array([[one.low for one in levels], [one.high for one in levels]])
    axes.errorbar(cost, error, yerr=np.abs(ends - error), fmt="o", ms=6, lw=1, color=BLUE, zorder=4,
                  label="4, 8, 16 … replicas of the reference: 95 % error")  # fmt: skip
    line = np.geomspace(0.6 * cost[0], 2.0 * cost[-1], 20)
    axes.plot(line, law.scale * line**-law.power, color=BLUE, lw=1, ls="--",
              label=rf"error ~ cost$^{{-{law.power:.2f} \pm {law.half_width:.2f}}}$")  # fmt: skip
    _bias_marks(axes, ladder)
    _front(axes, ladder)
    reached = [one for one in (recommend(ladder, accuracy) for accuracy in ASKED) if one.replicas]
    axes.errorbar([one.cpu_s for one in reached], [one.accuracy for one in reached], ls="",
                  xerr=[min(one.half_width, 0.9 * one.cpu_s) for one in reached], marker="*", ms=14, color="black",
                  zorder=6, label="recommended for 5 %, 1 %, 0.1 %: predicted")  # fmt: skip
    low, high = axes.get_xlim()
    axes.set_xlim(low, 1.6 * high)
    axes.set_xlabel("CPU seconds of an evaluation")
    axes.set_ylabel("error of the objective (half-width of a 95 % interval)")
    axes.set_title(f"more replicas alone: half the error for {law.halving[0]:.1f} times the time",
                   loc="left", fontsize=11)  # fmt: skip
    _plain(axes)
    axes.legend(fontsize=7.5, frameon=False, loc="lower left")


def _bias_marks(axes: Axes, ladder: Ladder) -> None:
    """A filled mark with its interval where a bias is known; an open one with an arrow for what it is at most."""
    from chamberopt.simulation.convergence.parameters import DESIGNED, TIME
    from chamberopt.simulation.convergence.recommendation import short

    knobs = [
        knob
        for knob in dict.fromkeys(rung.knob for rung in ladder.rungs)
        if knob not in (DESIGNED, TIME)
    ]
    for knob, colour, mark in zip(
        knobs, (ORANGE, GREEN, PURPLE, SKY, YELLOW), "sD^vP", strict=False
    ):
        for rung in (rung for rung in ladder.rungs if rung.knob == knob):
            y = abs(rung.bias.value) if rung.known else rung.bound
            reach = (
                [[min(rung.bias.half_width, 0.8 * y)], [rung.bias.half_width]]
                if rung.known
                else 0.2 * y
            )
            axes.errorbar(ladder.design.process.accuracy.replicas * rung.cpu.value, y, yerr=reach, fmt=mark, ms=6, lw=1,
                          uplims=not rung.known, color=colour, mfc=colour if rung.known else "white")  # fmt: skip
        axes.plot(
            [], [], mark, color=colour, mfc="white", label=f"bias of {short(knob)}; open: at most"
        )


def _front(axes: Axes, ladder: Ladder) -> None:
    """The Pareto front, numbered where it has become a quarter dearer, and the numbers' names."""
    from chamberopt.simulation.convergence.recommendation import choices

    best = choices(ladder)
    axes.plot([one.cpu_s for one in best], [one.error for one in best], color=GREY, lw=7, alpha=0.45, zorder=1,
              solid_capstyle="round", label="Pareto front, one knob off the reference")  # fmt: skip
    named, last = [], 0.0
    for one in best:
        if one.cpu_s > 1.25 * last:
            named.append(one)
            last = one.cpu_s
    for number, one in enumerate(named, start=1):
        axes.annotate(str(number), (one.cpu_s, one.error), (0, -13), textcoords="offset points", fontsize=7.5,
                      ha="center", va="center", color="#333333")  # fmt: skip
    text = "\n".join(
        ["on the Pareto front"]
        + [f"{number:>2}  {one.name}" for number, one in enumerate(named, start=1)]
    )
    axes.text(0.99, 0.99, text, transform=axes.transAxes, fontsize=7.5, va="top", ha="right", multialignment="left",
              color="#333333", bbox={"fc": "white", "ec": "none", "pad": 2.0})  # fmt: skip


def _biases(axes: Axes, ladder: Ladder) -> None:
    """Each rung's bias with its interval and its price, signed, from the top."""
    from matplotlib.ticker import MaxNLocator

    from chamberopt.simulation.convergence.parameters import TIME
    from chamberopt.simulation.convergence.recommendation import ASKED, SHARE, short

    rungs = ladder.rungs
    place = np.arange(len(rungs))[::-1]
    for y, rung in zip(place, rungs, strict=True):
        axes.errorbar(rung.bias.value, y, xerr=rung.bias.half_width, fmt="o", ms=5, lw=1.2, capsize=2, color=BLUE,
                      mfc=BLUE if rung.known else "white")  # fmt: skip
    times = [rung.cpu.value / ladder.reference.cpu.value for rung in rungs]
    names = [f"{short(r.knob)} {r.setting}  ({t:.2f}×)" for r, t in zip(rungs, times, strict=True)]
    axes.set_yticks(place, names, fontsize=8)
    axes.set_ylim(-1.3, len(rungs) - 0.5)  # the legend is below the last
    axes.axvline(0.0, color=GREY, lw=1)
    third = SHARE * ASKED[1]
    axes.axvspan(
        -third,
        third,
        color=GREEN,
        alpha=0.12,
        lw=0,
        label=f"a third of {ASKED[1]:g}; open: not told from 0",
    )
    # Short replicas are all noise: their interval may leave the picture.
    wide = 1.15 * max(third, *(rung.bound for rung in rungs if rung.knob != TIME))
    axes.set_xlim(-wide, wide)
    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.set_xlabel("bias of the objective, 95 % interval")
    axes.set_title("one knob off the reference (CPU time over its)", loc="left", fontsize=11)
    _plain(axes)
    axes.legend(fontsize=8, frameon=False, loc="lower left")


def reach(goals: list[Estimate]) -> tuple[float, float]:
    """From where to where an axis shows these: every value, and of each interval no more to a side than the span of the
    values. The interval of a time that may be never would press all else into one line.
    """
    values, half_widths = (
        np.array([goal.value for goal in goals]),
        np.array([goal.half_width for goal in goals]),
    )
    span = float(np.ptp(values))
    shown = (
        np.minimum(half_widths, span)
        if span > 0.0
        else np.where(np.isfinite(half_widths), half_widths, 0.0)
    )
    low, high = float((values - shown).min()), float((values + shown).max())
    margin = 0.05 * (high - low) or 0.5
    return low - margin, high + margin


def _label(result: StudyResult) -> str:
    return result.study.objective.goals[0].replace("_", " ")


def _plain(axes: Axes) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.25, lw=0.6)
