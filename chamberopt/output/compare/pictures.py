"""distributions.png of a comparison: coverage over area and time, impact speeds and angles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from chamberopt.common.estimate import Estimate
from chamberopt.coverage.metrics import NEVER
from chamberopt.output.compare.comparison import TIME, Comparison
from chamberopt.output.compare.distributions import Distributions, Histogram
from chamberopt.output.compare.table import two_digits
from chamberopt.output.disc_averages import DENTS_PER_DISC
from chamberopt.output.plots.colours import line_style
from chamberopt.output.plots.coverage import CoverageCurve, HistogramData, distributions_picture


def draw_distributions(path: Path, comparison: Comparison, found: Distributions) -> None:
    """Write the four panels as .png; their legends hold the numbers."""
    means = comparison.metrics["mean_coverage"]
    coverage_labels = [
        f"{label}: mean {100.0 * mean.value:.1f} ± {two_digits(100.0 * mean.half_width)} %, "
        f"{_mean_count(dents)} dents each"
        for label, mean, dents in zip(comparison.labels, means, found.dents, strict=True)
    ]
    coverage = _histogram(
        found.coverage, coverage_labels, "coverage of a triangle [%]", "target area"
    )
    if min(found.dents) < DENTS_PER_DISC:
        title = "few dents were simulated: their random scatter widens this histogram"
        coverage = replace(coverage, title=title)
    times = [result.metrics.get(TIME) for result in comparison.results]
    curves = [
        CoverageCurve(
            label if time is None else f"{label}: {_time_to_98(time)}",
            result.data.get("coverage_against_time") or [],
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


def _mean_count(dents: float) -> str:
    """A mean number of dents: without decimals from 10 on, else to two digits."""
    return f"{dents:.0f}" if dents >= 10.0 else f"{dents:.2g}"


def _time_to_98(time: Estimate) -> str:
    if time.value >= NEVER:
        return "98 % are never reached"
    accuracy = f" ± {two_digits(time.half_width)} s"
    return f"98 % after {time.value:.4g} s" + (
        " or far from it" if time.half_width > time.value else accuracy
    )


def _impact_labels(
    comparison: Comparison, found: Distributions, means: Sequence[float | None], unit: str
) -> list[str]:
    """Legend of impacts: their number and mean."""
    labels = []
    for label, count, mean in zip(comparison.labels, found.impacts, means, strict=True):
        number = "no single impacts: an older result" if count is None else f"{count:,} impacts"
        average = "" if mean is None else f", mean {mean:.3g} {unit}"
        labels.append(f"{label}: {number.replace(',', ' ')}{average}")
    return labels
