"""Draw the picture of an accuracy study (`chamberopt accuracy`): errors and biases over cost."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.pictures.charts.colours import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, YELLOW
from chamberopt.pictures.charts.figure_style import (
    SMALL,
    TITLE,
    new_figure,
    save_picture,
    style_axes,
)
from chamberopt.simulation.error_law import NORMAL
from chamberopt.simulation.numerical_parameters import DESIGNED, GAUGE, TIME, short_name
from chamberopt.simulation.recommendation import ACCURACIES, BIAS_SHARE, recommend

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from chamberopt.simulation.convergence import ConvergenceStudy


def accuracy_picture(path: Path, study: ConvergenceStudy) -> None:
    """Write charts of an accuracy study as .png: error against cost, and bias of each setting."""
    figure = new_figure(13.0, 6.6)
    left, right = figure.subplots(1, 2, width_ratios=[1.5, 1.0])
    _draw_errors(left, study)
    _draw_biases(right, study)
    save_picture(figure, path)


def _draw_errors(axes: Axes, study: ConvergenceStudy) -> None:
    """Draw the error of the objective against the cost of an evaluation in CPU seconds.

    Marks show errors of several numbers of replicas with a fitted curve, the biases of coarser
    settings, and the recommended settings. A bias is drawn at the cost of as many replicas as the
    design has.
    """
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.set_xscale("log")
    axes.set_yscale("log")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())
    for accuracy in ACCURACIES:
        axes.axhline(accuracy, color=GREY, lw=0.8, ls=":")
    sizes, law = study.sizes, study.law
    rows = [[one.cpu_s, one.error, *np.multiply(NORMAL, one.interval)] for one in sizes]
    cost, error, low, high = np.array(rows).T
    axes.errorbar(cost, error, yerr=[error - low, high - error], fmt="o", ms=6, lw=1, color=BLUE,
                  zorder=4, label="4, 8, 16 … replicas of the reference: 95 % error")  # fmt: skip
    if law is not None and law.halving is not None:
        line = np.geomspace(0.6 * cost[0], 2.0 * cost[-1], 20)
        label = rf"error ~ cost$^{{-{law.power:.2f} \pm {law.half_width:.2f}}}$"
        axes.plot(line, law.scale * line**-law.power, color=BLUE, lw=1, ls="--", label=label)
    _draw_bias_marks(axes, study)
    advice = [recommend(study, accuracy) for accuracy in ACCURACIES]
    reached = [(one.cpu_s, one.accuracy) for one in advice if one.replicas]
    if reached:
        axes.plot(*zip(*reached, strict=True), "*", ms=14, color=BLACK, zorder=6,
                  label="recommended for 5 %, 1 %, 0.1 %: predicted cost")  # fmt: skip
    title = "error of the objective against cost"
    if law is not None and law.halving is not None:
        title = f"more replicas alone: half the error for {law.halving[0]:.1f} times the CPU time"
    axes.set_title(title, loc="left", fontsize=TITLE)
    error_label = "error of the objective (half-width of 95 % interval)"
    style_axes(axes, "CPU seconds of an evaluation", error_label)
    axes.legend(fontsize=SMALL, frameon=False, loc="best")


def _draw_bias_marks(axes: Axes, study: ConvergenceStudy) -> None:
    """Draw a mark for the bias of each numerical setting, its difference from the finest setting.

    The mark is filled if the bias is more than noise. Else it is open, and at the upper limit of
    the bias.
    """
    # The gauge changes the measured quantity, not its accuracy.
    names = dict.fromkeys(run.parameter for run in study.runs)
    others = (name for name in names if name not in (DESIGNED, GAUGE, TIME))
    colours = (ORANGE, GREEN, PURPLE, SKY, YELLOW, GREY)
    for name, colour, marker in zip(others, colours, "sD^vPX", strict=False):
        label = f"bias of {short_name(name)}; open: at most"
        axes.plot([], [], marker, color=colour, mfc="white", label=label)
        for run in (run for run in study.runs if run.parameter == name):
            cost = study.design.process.accuracy.replicas * run.cpu.value
            bias, half_width = abs(run.bias.value), run.bias.half_width
            if run.is_biased:
                bars = [[min(half_width, 0.8 * bias)], [half_width]]
                axes.errorbar(cost, bias, yerr=bars, fmt=marker, ms=6, lw=1, color=colour)
            else:
                limit = run.max_bias
                axes.errorbar(cost, limit, yerr=0.2 * limit, uplims=True, fmt=marker, ms=6, lw=1,
                              color=colour, mfc="white")  # fmt: skip


def _draw_biases(axes: Axes, study: ConvergenceStudy) -> None:
    """Draw each numerical setting's bias (difference from the finest setting) with its interval.

    Beside each setting stands its CPU time over the CPU time of the finest settings.
    """
    from matplotlib.ticker import MaxNLocator

    runs = study.runs
    heights = np.arange(len(runs))[::-1]
    names = []
    for height, run in zip(heights, runs, strict=True):
        axes.errorbar(run.bias.value, height, xerr=run.bias.half_width, fmt="o", ms=5, lw=1.2,
                      capsize=2, color=BLUE, mfc=BLUE if run.is_biased else "white")  # fmt: skip
        ratio = run.cpu.value / study.reference.cpu.value
        names.append(f"{short_name(run.parameter)} {run.setting}  ({ratio:.2f}×)")
    axes.set_yticks(heights, names, fontsize=SMALL)
    axes.set_ylim(-1.3, len(runs) - 0.5)  # leaves room for the legend below the last run
    axes.axvline(0.0, color=GREY, lw=1)
    allowed = BIAS_SHARE * ACCURACIES[1]
    label = f"a third of {ACCURACIES[1]:g}; open: not significant"
    axes.axvspan(-allowed, allowed, color=GREEN, alpha=0.12, lw=0, label=label)
    # Intervals of short replicas are so wide that they may leave the picture.
    limit = 1.15 * max(allowed, *(run.max_bias for run in runs if run.parameter != TIME))
    axes.set_xlim(-limit, limit)
    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.set_title("one setting off the reference (CPU time over its)", loc="left", fontsize=TITLE)
    style_axes(axes, "bias of the objective, 95 % interval")
    axes.legend(fontsize=SMALL, frameon=False, loc="lower left")
