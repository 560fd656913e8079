"""Draw distributions.png of a comparison: coverage over area and time, speeds and angles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from chamberopt.common.estimate import Estimate
from chamberopt.common.number_text import estimate_text
from chamberopt.pictures.charts.colours import line_style
from chamberopt.pictures.charts.coverage import CoverageCurve, HistogramData, distributions_picture
from chamberopt.results.compare.comparison import TIME, Comparison
from chamberopt.results.compare.distributions import Distributions, Histogram


def draw_distributions(path: Path, comparison: Comparison, found: Distributions) -> None:
    """Write the chart of a comparison as .png.

    Its four panels show coverage over area, coverage over time, impact speeds and impact angles.
    """
    coverage_labels = [
        f"{label}: mean {estimate_text(mean, 100.0, '%')}"
        for label, mean in zip(comparison.labels, comparison.metrics["mean_coverage"], strict=True)
    ]
    gauge = comparison.results[0].design.process.accuracy.gauge_mm2
    x_label = f"coverage in windows of {gauge:g} mm² [%]"
    coverage = _histogram(found.coverage, coverage_labels, x_label, "target area")
    few = [
        label
        for label, result in zip(comparison.labels, comparison.results, strict=True)
        if not result.resolves_places
    ]
    if few:
        shares = [
            share if result.resolves_places else None
            for share, result in zip(coverage.shares, comparison.results, strict=True)
        ]
        title = f"not drawn, too few dents: {', '.join(few)}"
        coverage = replace(coverage, shares=shares, title=title)
    times = [result.metrics.get(TIME) for result in comparison.results]
    curves = [
        CoverageCurve(
            label if time is None else f"{label}: {_time_to_98(time)}",
            result.record.coverage_against_time,
            line_style(k),
            time,
        )
        for k, (label, result, time) in enumerate(
            zip(comparison.labels, comparison.results, times, strict=True)
        )
    ]
    impacts = [
        _histogram(histogram, _impact_labels(comparison, found, means, unit), x_label, "impacts")
        for histogram, means, unit, x_label in (
            (found.speed, found.mean_speed, "m/s", "normal speed [m/s]"),
            (found.angle, found.mean_angle, "°", "impact angle [°], 90 is head on"),
        )
    ]
    treatment_time = comparison.results[0].design.process.treatment_time_s
    distributions_picture(path, coverage, curves, treatment_time, impacts)


def _histogram(
    histogram: Histogram, labels: Sequence[str], x_label: str, counted: str
) -> HistogramData:
    bin_width = histogram.edges[1] - histogram.edges[0]
    y_label = f"share of the {counted} [%], in steps of {bin_width:.2g}"
    styles = [line_style(k) for k in range(len(labels))]
    return HistogramData(histogram.edges, histogram.shares, labels, styles, x_label, y_label)


def _time_to_98(time: Estimate) -> str:
    if time.in_words == "never":
        return "98 % are never reached"
    return f"98 % after {estimate_text(time, unit='s')}"


def _impact_labels(
    comparison: Comparison, found: Distributions, means: Sequence[float | None], unit: str
) -> list[str]:
    """Return a legend text for each result: its number of impacts, and their mean speed or angle.

    Args:
        means: mean speed or angle of each result, None without impacts.
        unit: unit of the means.
    """
    labels = []
    for label, count, mean in zip(comparison.labels, found.impacts, means, strict=True):
        average = "" if mean is None else f", mean {mean:.3g} {unit}"
        labels.append(f"{label}: {count:,} impacts".replace(",", " ") + average)
    return labels
