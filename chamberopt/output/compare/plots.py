"""distributions.png: coverage over area and against time, impact speeds and angles, candidates over one another."""

from __future__ import annotations

from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.common.files import atomic_write
from chamberopt.coverage.metrics import FULL_COVERAGE, NEVER
from chamberopt.output.compare.comparison import TIME, Comparison
from chamberopt.output.compare.distributions import Distributions, Histogram
from chamberopt.output.compare.table import two_digits
from chamberopt.output.disc_averages import DENTS_PER_DISC
from chamberopt.output.plots.study_and_accuracy import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    YELLOW,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# A candidate has both a colour and a line of its own.
COLOURS = (BLUE, ORANGE, GREEN, PURPLE, "#000000", YELLOW, SKY, GREY)
LINES = ("-", "--", "-.", ":", (0, (6, 1, 1, 1, 1, 1)), (0, (8, 2)), (0, (2, 1)), (0, (4, 1, 1, 1)))
KNOWN = 0.15  # half-width of coverage's interval: beyond, a line would say what nobody knows
MOST_BANDS = 3  # of the poorest twentieth, which are wide: of more candidates nothing could be seen


def distributions_picture(path: Path, comparison: Comparison, found: Distributions) -> None:
    """Four panels, each with a legend that has its numbers; written as .png."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(
        figsize=(13.0, 8.4 + 0.34 * len(comparison.labels)), dpi=130, layout="constrained"
    )
    FigureCanvasAgg(figure)
    panels = figure.subplots(2, 2)
    _coverage(panels[0, 0], comparison, found)
    _against_time(panels[0, 1], comparison)
    speeds = _said(comparison, found, found.mean_speed, "m/s")
    _steps(panels[1, 0], found.speed, speeds, "normal speed [m/s]", "impacts")
    angles = _said(comparison, found, found.mean_angle, "°")
    _steps(panels[1, 1], found.angle, angles, "impact angle [°], 90 is head on", "impacts")
    with atomic_write(path) as temporary:
        figure.savefig(temporary)


def _coverage(axes: Axes, comparison: Comparison, found: Distributions) -> None:
    means = comparison.metrics["mean_coverage"]
    said = [
        f"{label}: mean {100.0 * mean.value:.1f} ± {two_digits(100.0 * mean.half_width)} %, {_few(dents)} dents each"
        for label, mean, dents in zip(comparison.labels, means, found.dents, strict=True)
    ]
    _steps(axes, found.coverage, said, "coverage of a triangle [%]", "target area")
    if min(found.dents) < DENTS_PER_DISC:
        axes.set_title(
            "few dents were simulated: their own scatter widens this", loc="left", fontsize=9
        )


def _few(dents: float) -> str:
    """A mean number, whole unless that says too little: 0.5, 23."""
    return f"{dents:.0f}" if dents >= 10.0 else f"{dents:.2g}"


def _against_time(axes: Axes, comparison: Comparison) -> None:
    """Mean as a line with its band, the poorest twentieth thin; a mark where that reaches 98 %."""
    curves = [
        _known(result.data.get("coverage_against_time") or []) for result in comparison.results
    ]
    seconds = comparison.results[0].design.process.treatment_time_s
    end = max([seconds, *(curve[0][-1] for pair in curves for curve in pair if len(curve[0]))])
    for k, (label, pair) in enumerate(zip(comparison.labels, curves, strict=True)):
        colour, line = COLOURS[k % len(COLOURS)], LINES[k % len(LINES)]
        full = comparison.results[k].metrics.get(TIME)
        said = "" if full is None else f": {_time_said(full.value, full.half_width)}"
        axes.plot([], [], color=colour, ls=line, label=f"{label}{said}")
        if full is not None and full.value < NEVER:
            _mark(axes, full.value, full.half_width, end, colour, k)
        for (times, value, half), thick in zip(pair, (1.8, 0.9), strict=True):
            axes.plot([0, *times], [0, *(100.0 * value)], color=colour, ls=line, lw=thick)
            if thick > 1.0 or len(curves) <= MOST_BANDS:
                low, high = np.clip((value - half, value + half), 0.0, 1.0) * 100.0
                axes.fill_between(times, low, high, color=colour, alpha=0.13, lw=0)
    axes.axhline(100.0 * FULL_COVERAGE, color=GREY, lw=0.8)
    axes.axvline(seconds, color=GREY, lw=0.8)
    axes.text(seconds, 1.0, " treatment", fontsize=7.5, color="#555555")
    axes.set_xlim(0.0, 1.02 * end)
    axes.set_ylim(0.0, 104.0)
    text = "thick: mean; thin: 95 % of the area has more, and a mark where that reaches 98 %;"
    axes.set_title(f"{text}\nas far as known to ± {100.0 * KNOWN:g} %", loc="left", fontsize=9)
    _finish(axes, "peening time [s]", "coverage [%]")


def _known(rows: list[dict[str, float]]) -> list[np.ndarray]:
    """Mean and poorest twentieth, each (3, n): times, values, half-widths; up to where intervals grow too wide."""
    found = []
    for name, width in (("mean_coverage", "half_width"), ("p05_coverage", "p05_half_width")):
        there = takewhile(lambda row, width=width: row.get(width, np.inf) <= KNOWN, rows)  # type: ignore[misc]
        found.append(
            np.array([[row["time_s"], row[name], row[width]] for row in there]).reshape(-1, 3).T
        )
    return found


def _mark(axes: Axes, full: float, half_width: float, end: float, colour: str, k: int) -> None:
    """When 98 % are reached, with its interval; an arrow at the edge where that is later than the axis goes."""
    high = 100.0 * FULL_COVERAGE - 0.9 * k  # one below the other, where they are near
    if full > end:
        axes.plot(1.01 * end, high, ">", color=colour, ms=7, clip_on=False)
        return
    axes.errorbar(
        full,
        high,
        xerr=[[min(full, half_width)], [half_width]],
        fmt="D",
        ms=5,
        lw=1.2,
        capsize=2,
        color=colour,
    )


def _time_said(full: float, half_width: float) -> str:
    if full >= NEVER:
        return "98 % are never reached"
    return f"98 % after {full:.4g} s" + (
        " or far from it" if half_width > full else f" ± {two_digits(half_width)} s"
    )


def _said(
    comparison: Comparison, found: Distributions, means: tuple[float | None, ...], unit: str
) -> list[str]:
    """Legend of impacts: their number, and a mean."""
    said = []
    for label, count, mean in zip(comparison.labels, found.impacts, means, strict=True):
        counted = (
            "no single impacts: an older result"
            if count is None
            else f"{count:,} impacts".replace(",", " ")
        )
        said.append(f"{label}: {counted}" + ("" if mean is None else f", mean {mean:.3g} {unit}"))
    return said


def _steps(axes: Axes, histogram: Histogram, said: list[str], across: str, of: str) -> None:
    for k, (shares, label) in enumerate(zip(histogram.shares, said, strict=True)):
        style: dict[str, Any] = {
            "color": COLOURS[k % len(COLOURS)],
            "ls": LINES[k % len(LINES)],
            "lw": 1.6,
        }
        if shares is None:
            axes.plot([], [], label=label, **style)
        else:
            axes.stairs(100.0 * shares, histogram.edges, label=label, **style)
    wide = histogram.edges[1] - histogram.edges[0]
    axes.set_xlim(histogram.edges[0], histogram.edges[-1])
    axes.set_ylim(bottom=0.0)
    _finish(axes, across, f"share of the {of} [%], in steps of {wide:.2g}")


def _finish(axes: Axes, across: str, up: str) -> None:
    axes.set_xlabel(across)
    axes.set_ylabel(up)
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.25, lw=0.6)
    axes.legend(
        fontsize=8, frameon=False, loc="upper left", bbox_to_anchor=(0.0, -0.13), handlelength=4.0
    )
