"""Coverage against peening time: mean and 5th percentile with intervals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from chamberopt.coverage.coverage_intervals import coverage_estimates, target_patches

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from chamberopt.simulation.evaluation import Evaluation

POINTS = 20
MAX_TREATMENT_TIMES = 5.0  # a longer time would rather be another treatment
MAX_HALF_WIDTH = 0.1  # of the mean's interval; a less certain curve would mislead


def coverage_against_time(
    design: Design, chamber: Chamber, evaluation: Evaluation
) -> list[dict[str, float]]:
    """Coverage of the target at rising peening times.

    By the model "avrami" the curve goes on until the 5th percentile is 98 %, at least to the
    treatment time and at most to MAX_TREATMENT_TIMES of it, as long as the mean is known well
    enough. By the model "dents" it is the mean alone and ends with the treatment.

    Returns:
        Rows with time_s, mean_coverage, half_width and, by "avrami", p05_coverage and
        p05_half_width.
    """
    if evaluation.marked is not None:
        return [
            {"time_s": at, "mean_coverage": mean.value, "half_width": mean.half_width}
            for at, mean in evaluation.marked.curve
        ]
    treatment = design.process.treatment_time
    full = evaluation.metrics["time_to_98_s"].value
    end = float(np.clip(1.1 * full, treatment, MAX_TREATMENT_TIMES * treatment))
    rows = []
    for at in sorted({treatment, *(end * np.arange(1, POINTS + 1) / POINTS).tolist()}):
        patches = target_patches(evaluation.replicas, chamber, at)
        found = coverage_estimates(evaluation.replicas, chamber, patches)
        mean, p05 = found["mean_coverage"], found["p05_coverage"]
        if at > treatment and mean.half_width > MAX_HALF_WIDTH:
            break
        rows.append((at, mean.value, mean.half_width, p05.value, p05.half_width))
    time, mean_value, mean_width, p05_value, p05_width = np.array(rows).T
    fixed = time == treatment
    columns = {
        "time_s": time,
        "mean_coverage": _nearest_rising(mean_value, mean_width, fixed),
        "half_width": mean_width,
        "p05_coverage": _nearest_rising(p05_value, p05_width, fixed),
        "p05_half_width": p05_width,
    }
    return [
        dict(zip(columns, row, strict=True)) for row in np.array(list(columns.values())).T.tolist()
    ]


def _nearest_rising(value: np.ndarray, half_width: np.ndarray, fixed: np.ndarray) -> np.ndarray:
    """The nearest curve that never falls, with weights from the intervals.

    Each time is estimated on patches of its own, so a step from one to the next could look like a
    fall.

    Args:
        fixed: points that must keep their value, (n,) bool.
    """
    from scipy.optimize import isotonic_regression

    weight = np.where(fixed, 1e12, 1.0) / np.maximum(half_width, 1e-6) ** 2
    return np.asarray(isotonic_regression(value, weights=weight).x)
