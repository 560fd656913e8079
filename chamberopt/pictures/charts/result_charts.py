"""The two-dimensional charts of the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.pictures.charts.colours import BLUE, GREEN, ORANGE
from chamberopt.pictures.charts.coverage import (
    CoverageCurve,
    HistogramData,
    draw_coverage_over_time,
    draw_histogram,
)
from chamberopt.pictures.charts.figure_style import SMALL, new_figure
from chamberopt.pictures.charts.study import EvaluatedCandidate, draw_convergence, slices_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from chamberopt.results.records import CoverageAtTime
    from chamberopt.search.sensitivity import Slice

WIDE, NARROW = (11.0, 3.8), (5.5, 4.0)  # inch
Y_LABEL = 40  # letters of a line that fit beside a chart
BIN_EDGES = np.linspace(0.0, 100.0, 41)  # of a coverage histogram [%]
STYLES = {
    "start": {"color": ORANGE, "ls": "--"},
    "best": {"color": GREEN, "ls": "-"},
    "result": {"color": BLUE, "ls": "-"},
}


def convergence_figure(
    candidates: Sequence[EvaluatedCandidate], y_label: str, smaller_is_better: bool
) -> tuple[Figure, dict[str, list[str]]]:
    """Every evaluation in its order, and tooltips with the parameters of each."""
    figure = new_figure(*WIDE)
    axes = figure.subplots()
    tooltips = draw_convergence(axes, candidates, fill(y_label, Y_LABEL), smaller_is_better)
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=5, fontsize=SMALL, frameon=False)
    return figure, tooltips


def influence_figure(
    slices: Sequence[Slice],
    start: Mapping[str, float | str],
    best: Mapping[str, float | str],
    y_label: str,
) -> Figure:
    """The objective over each parameter by the study's model."""
    label = fill(y_label, Y_LABEL)
    return slices_figure(slices, start, best, "loses no more than the noise", label)


def coverage_over_time_figure(
    curves: Mapping[str, Sequence[CoverageAtTime]], treatment_time: float
) -> Figure:
    """Mean and 5th percentile of coverage over peening time [s], by name of the result."""
    figure = new_figure(*NARROW)
    axes = figure.subplots()
    drawn = [CoverageCurve(name, rows, STYLES[name]) for name, rows in curves.items()]
    draw_coverage_over_time(axes, drawn, treatment_time)
    axes.set_title("thick: mean; thin: 95 % of the area has more", loc="left", fontsize=SMALL)
    if len(drawn) > 1:
        axes.legend(fontsize=SMALL, frameon=False, loc="lower right")
    return figure


def histogram_figure(coverage_and_area: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> Figure:
    """Share of the target's area by its coverage.

    Args:
        coverage_and_area: for each result by name, coverage 0..1 and area of triangles, (k,) each.
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
