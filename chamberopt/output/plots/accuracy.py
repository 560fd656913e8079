"""The picture of a convergence study (`chamberopt accuracy`)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.output.plots.colours import BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, YELLOW
from chamberopt.output.plots.figures import new_figure, save_picture, style_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from chamberopt.simulation.convergence.study import ConvergenceStudy


def accuracy_picture(path: Path, ladder: ConvergenceStudy) -> None:
    """Work and precision: error against CPU seconds with the Pareto front named; bias of every rung; as .png."""
    figure = new_figure(13.0, 6.6)
    grid = figure.add_gridspec(1, 2, width_ratios=[1.7, 1.0])
    _work_precision(figure.add_subplot(grid[0, 0]), ladder)
    _biases(figure.add_subplot(grid[0, 1]), ladder)
    save_picture(figure, path)


def _work_precision(axes: Axes, ladder: ConvergenceStudy) -> None:
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
    style_axes(axes)
    axes.legend(fontsize=7.5, frameon=False, loc="lower left")


def _bias_marks(axes: Axes, ladder: ConvergenceStudy) -> None:
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


def _front(axes: Axes, ladder: ConvergenceStudy) -> None:
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


def _biases(axes: Axes, ladder: ConvergenceStudy) -> None:
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
    style_axes(axes)
    axes.legend(fontsize=8, frameon=False, loc="lower left")
