"""Draw charts of coverage and impacts: histograms, and coverage over peening time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.coverage.metrics import FULL_COVERAGE
from chamberopt.pictures.charts.colours import BLUE, DARK_GREY, GREEN, GREY, ORANGE
from chamberopt.pictures.charts.figure_style import (
    SMALL,
    literal,
    new_figure,
    save_picture,
    style_axes,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from chamberopt.common.estimate import Estimate
    from chamberopt.results.records import CoverageAtTime

MAX_HALF_WIDTH = 0.15  # largest half-width of an interval at which a curve is still drawn
MAX_BANDS = 3  # results with a band around the 5th percentile; more bands would hide each other
NARROW = (5.5, 4.0)  # inch, in a report
BIN_EDGES = np.linspace(0.0, 100.0, 41)  # of a coverage histogram in a report [%]
STYLES = {
    "start": {"color": ORANGE, "ls": "--"},
    "best": {"color": GREEN, "ls": "-"},
    "result": {"color": BLUE, "ls": "-"},
}


@dataclass(frozen=True)
class HistogramData:
    """A histogram to draw: several results in the same bins, with texts and styles.

    Args:
        edges: bin edges, shape (n + 1,).
        shares: for each result the share of area or impacts in each bin, shape (n,), or None.
        labels: legend text of each result.
        styles: colour and line style of each result.
        x_label, y_label, title: texts of the axes.
    """

    edges: np.ndarray
    shares: Sequence[np.ndarray | None]
    labels: Sequence[str]
    styles: Sequence[Mapping[str, Any]]
    x_label: str
    y_label: str
    title: str = ""


@dataclass(frozen=True)
class CoverageCurve:
    """The coverage of one result over peening time, to draw as a curve.

    Args:
        label: legend.
        rows: coverage at several times, in ascending order.
        style: colour and line style.
        time_to_98: peening time until 95 % of the area is covered to 98 % [s], if known.
    """

    label: str
    rows: Sequence[CoverageAtTime]
    style: Mapping[str, Any] = field(default_factory=dict)
    time_to_98: Estimate | None = None


def distributions_picture(
    path: Path,
    coverage: HistogramData,
    curves: Sequence[CoverageCurve],
    treatment_time: float,
    impacts: Sequence[HistogramData],
) -> None:
    """Write four charts as .png: coverage as histogram and over time, and two of impacts.

    Legends give means and other numbers.

    Args:
        treatment_time: treatment time of the design [s].
        impacts: two histograms, such as of speed and angle.
    """
    figure = new_figure(13.0, 8.4 + 0.34 * len(curves))
    panels = figure.subplots(2, 2)
    draw_coverage_over_time(panels[0, 1], curves, treatment_time, MAX_HALF_WIDTH)
    panels[0, 1].set_title(
        "thick: mean; thin: 95 % of the area has more, and a mark where that reaches 98 %;\n"
        f"as far as known to ± {100.0 * MAX_HALF_WIDTH:g} %",
        loc="left",
        fontsize=SMALL,
    )
    for axes, histogram in zip(panels.ravel()[[0, 2, 3]], (coverage, *impacts), strict=True):
        draw_histogram(axes, histogram)
    for axes in panels.ravel():
        axes.legend(
            fontsize=SMALL,
            frameon=False,
            loc="upper left",
            bbox_to_anchor=(0.0, -0.13),
            handlelength=4,
        )
    save_picture(figure, path)


def draw_histogram(axes: Axes, data: HistogramData) -> None:
    """Draw the outline of a histogram in per cent for each result."""
    for shares, name, style in zip(data.shares, data.labels, data.styles, strict=True):
        label = literal(name)
        if shares is None:  # the result has only its legend
            axes.plot([], [], label=label, lw=1.6, **style)
        else:
            axes.stairs(100.0 * shares, data.edges, label=label, lw=1.6, **style)
    axes.set_xlim(data.edges[0], data.edges[-1])
    axes.set_ylim(bottom=0.0)
    axes.set_title(literal(data.title), loc="left", fontsize=SMALL)
    style_axes(axes, data.x_label, data.y_label)


def draw_coverage_over_time(
    axes: Axes,
    curves: Sequence[CoverageCurve],
    treatment_time: float,
    max_half_width: float = math.inf,
) -> None:
    """Draw the mean coverage as a thick line and its 5th percentile as a thin line, with bands.

    Args:
        treatment_time: treatment time of the design [s].
        max_half_width: half-width of the interval above which a line ends.
    """
    lines = [_known_lines(curve.rows, max_half_width) for curve in curves]
    last = [line[0][-1] for pair in lines for line in pair if line.size]
    end = max([treatment_time, *last])
    for k, (curve, pair) in enumerate(zip(curves, lines, strict=True)):
        axes.plot([], [], label=literal(curve.label), **curve.style)
        if curve.time_to_98 is not None and not curve.time_to_98.in_words:
            _draw_time_to_98(axes, curve, end, 100.0 * FULL_COVERAGE - 0.9 * k)
        for (times, value, half_width), width in zip(pair, (1.8, 0.9), strict=True):
            axes.plot([0.0, *times], [0.0, *(100.0 * value)], lw=width, **curve.style)
            if width > 1.0 or len(curves) <= MAX_BANDS:
                low, high = np.clip((value - half_width, value + half_width), 0.0, 1.0) * 100.0
                axes.fill_between(times, low, high, color=curve.style["color"], alpha=0.25, lw=0)
    axes.axhline(100.0 * FULL_COVERAGE, color=GREY, lw=0.8)
    axes.axvline(treatment_time, color=GREY, lw=0.8)
    axes.text(treatment_time, 1.0, " treatment", fontsize=SMALL, color=DARK_GREY)
    axes.set_xlim(0.0, 1.02 * end)
    axes.set_ylim(-2.0, 104.0)  # keeps a line at zero off the axis
    style_axes(axes, "peening time [s]", "coverage [%]")


def _known_lines(rows: Sequence[CoverageAtTime], max_half_width: float) -> list[np.ndarray]:
    """Return the lines of mean coverage and of its 5th percentile, as far as they are known.

    Each line has rows with times, values and half-widths, shape (3, n). It ends before the first
    point with a half-width above `max_half_width`.
    """
    means = [(row.time_s, row.mean_coverage, row.half_width) for row in rows]
    percentiles = [
        (row.time_s, row.p05_coverage, row.p05_half_width)
        for row in rows
        if row.p05_coverage is not None and row.p05_half_width is not None
    ]
    lines = []
    for table in (means, percentiles):
        known = list(takewhile(lambda row: row[2] <= max_half_width, table))
        lines.append(np.array(known).reshape(-1, 3).T)
    return lines


def _draw_time_to_98(axes: Axes, curve: CoverageCurve, end: float, height: float) -> None:
    """Mark the time at which 95 % of the area is 98 % covered, with its interval.

    A time beyond the end of the axis is an arrow at the edge.

    Args:
        end: end of the axis [s].
        height: height of the mark [%]. Each result has another height, so that near marks do not
            overlap.
    """
    assert curve.time_to_98 is not None
    time, half_width = curve.time_to_98.value, curve.time_to_98.half_width
    colour = curve.style["color"]
    if time > end:
        axes.plot(1.01 * end, height, ">", color=colour, ms=7, clip_on=False)
        return
    x_error = [[min(time, half_width)], [half_width]]
    axes.errorbar(time, height, xerr=x_error, fmt="D", ms=5, lw=1.2, capsize=2, color=colour)


def coverage_over_time_figure(
    curves: Mapping[str, Sequence[CoverageAtTime]], treatment_time: float
) -> Figure:
    """Return a chart of mean and 5th percentile of coverage over peening time [s].

    Args:
        curves: coverage at several times, by the name of the result.
        treatment_time: treatment time of the design [s].
    """
    drawn = [CoverageCurve(name, rows, STYLES[name]) for name, rows in curves.items()]
    return coverage_figure(drawn, treatment_time)


def coverage_figure(drawn: Sequence[CoverageCurve], treatment_time: float) -> Figure:
    """Return a chart of curves of coverage over peening time, up to the treatment time [s]."""
    figure = new_figure(*NARROW)
    axes = figure.subplots()
    draw_coverage_over_time(axes, drawn, treatment_time)
    axes.set_title("thick: mean; thin: 95 % of the area has more", loc="left", fontsize=SMALL)
    if len(drawn) > 1:
        axes.legend(fontsize=SMALL, frameon=False, loc="lower right")
    return figure


def histogram_figure(coverage_and_area: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> Figure:
    """Return a chart of how much of the target's area has which coverage.

    Args:
        coverage_and_area: for each result by its name, coverages 0..1 and the areas that have them,
            (k,) each.
    """
    shares = [
        np.histogram(100.0 * coverage, BIN_EDGES, weights=area)[0] / max(area.sum(), 1e-300)
        for coverage, area in coverage_and_area.values()
    ]
    figure = new_figure(*NARROW)
    axes = figure.subplots()
    names = list(coverage_and_area)
    styles = [STYLES[name] for name in names]
    labels = "coverage [%]", "share of the target's area [%]"
    draw_histogram(axes, HistogramData(BIN_EDGES, shares, names, styles, *labels))
    if len(names) > 1:
        axes.legend(fontsize=SMALL, frameon=False)
    return figure
