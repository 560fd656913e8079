"""Compute coverage against peening time: mean and 5th percentile with intervals.

The dent density x is the dented area over the area. The errors of a calibration change x at all
times by the same factor. By Avrami's law C = 1 - exp(-x) they change a coverage C by
-(1 - C) ln(1 - C) times the logarithm of this factor.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.estimate import FIRST_OF_CALIBRATION, shared_half_width
from chamberopt.coverage.coverage_from_impacts import batches_of, kept_footprints, locate_dents
from chamberopt.coverage.coverage_intervals import (
    Products,
    mean_and_variance_estimates,
    multiply_dents,
)
from chamberopt.coverage.metrics import FULL_COVERAGE
from chamberopt.coverage.percentile import NEARLY_FULL

if TYPE_CHECKING:
    from chamberopt.common.estimate import Estimate
    from chamberopt.coverage.field.target_field import TargetField
    from chamberopt.design.load import Design
    from chamberopt.simulation.evaluation import Evaluation

TIMES = 20
POINTS = 4_000  # windows for the mean of each time
MAX_TREATMENT_TIMES = 5.0  # end of the curve at most; a longer time is another treatment


def coverage_against_time(
    design: Design, field: TargetField, evaluation: Evaluation
) -> list[dict[str, float]]:
    """Compute the coverage of the target at rising peening times.

    The curve ends where the 5th percentile of the coverage is 98 %, but not before the treatment
    time. It also ends after MAX_TREATMENT_TIMES treatment times, and where there are too few dents
    for the mean coverage.

    Returns:
        Rows with time_s, mean_coverage and half_width. If there are enough dents for the 5th
        percentile, they also have p05_coverage and p05_half_width.
    """
    treatment, found = design.process.treatment_time, evaluation.resolution
    full = evaluation.metrics["time_to_98_s"]
    end = float(np.clip(1.1 * full.value, treatment, MAX_TREATMENT_TIMES * treatment))
    # A mean takes the more dents, the longer the time is over the simulated time.
    end = min(end, treatment * found.dents / found.needed_for_mean)
    times = sorted({*(end * np.arange(1, TIMES + 1) / TIMES).tolist(), min(treatment, end)})
    gauge = field.gauge_round(field.some_points(POINTS), field.radius)
    located = [locate_dents(field, field.in_sector(hits)) for hits in evaluation.hits]
    prints = [kept_footprints(field, gauge, dents) for dents in located]
    batches = batches_of(prints)
    ratios = [time / design.process.recorded_time for time in times]
    of_all, of_rest = multiply_dents(
        batches, len(gauge.area), [*ratios, *(2.0 * ratio for ratio in ratios)]
    )
    rates = _rates_of_p05(evaluation.metrics["p05_coverage"], treatment, full)
    open_density = _open_density(evaluation.metrics["mean_coverage"])
    rows = []
    for number, time in enumerate(times):
        both = [number, number + len(times)]
        products = Products(of_all[:, both], of_rest[:, both])
        mean, _ = mean_and_variance_estimates(products, field.reach)
        half_width = math.hypot(mean.half_width, open_density * _by_density(mean.value))
        row = {"time_s": time, "mean_coverage": mean.value, "half_width": half_width}
        if rates:
            # The dent density grows in proportion to the time.
            low, middle, high = (-math.expm1(-rate * time) for rate in rates)
            row |= {"p05_coverage": middle, "p05_half_width": max(middle - low, high - middle)}
        rows.append(row)
    return rows


def _open_density(mean: Estimate) -> float:
    """Return the half-width that a calibration's errors give to the logarithm of the dent density.

    Args:
        mean: mean coverage after the treatment time, with these errors.
    """
    slope = _by_density(mean.value)
    return shared_half_width(mean.shared[FIRST_OF_CALIBRATION:]) / slope if slope > 1e-6 else 0.0


def _by_density(coverage: float) -> float:
    """Return the slope of a coverage over the logarithm of its dent density."""
    left = 1.0 - coverage
    return -left * math.log(left) if 0.0 < left < 1.0 else 0.0


def _rates_of_p05(p05: Estimate, treatment: float, full: Estimate) -> list[float]:
    """Return low, middle and high estimates of dents per second at the 5th percentile of coverage.

    The rate of dents is the growth of the dent density (dented area over area) per second. A
    coverage near 1 hardly tells a density from twice this density, but the time to full coverage
    does.

    Args:
        p05: the 5th percentile after the treatment time.
        treatment: treatment time [s].
        full: time until the percentile is FULL_COVERAGE [s].

    Returns:
        Three rates [1/s], or none where the percentile has no interval.
    """
    if p05.value > NEARLY_FULL:
        if not math.isfinite(full.half_width) or full.low <= 0.0:
            return []
        times = full.high, full.value, full.low
        return [-math.log(1.0 - FULL_COVERAGE) / time for time in times]
    if not math.isfinite(p05.half_width):
        return []
    shares = p05.low, p05.value, p05.high
    return [-math.log1p(-min(max(one, 0.0), 1.0 - 1e-12)) / treatment for one in shares]
