"""Coverage against peening time, mean and poorest twentieth, with intervals: for result.json."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.coverage.coverage_estimators import coverage_estimates, target_patches

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from chamberopt.simulation.evaluation import Evaluation

POINTS = 20
FARTHEST = 5.0  # treatment times: what is beyond is rather another treatment
VAGUE = 0.1  # half-width of the mean's 95 % interval beyond which a curve would only mislead


def coverage_against_time(
    design: Design, chamber: Chamber, evaluation: Evaluation
) -> list[dict[str, Any]]:
    """Rows of time_s, mean_coverage, half_width, p05_coverage, p05_half_width, from the first moments to the end.

    From dent rates: to where 98 % is reached, the treatment time at least, FARTHEST times it at most, and as far as the
    mean is known. Where every dent is marked: to the treatment's end, the mean alone.
    """
    if evaluation.against_time:
        return [
            {"time_s": at, "mean_coverage": mean.value, "half_width": mean.half_width}
            for at, mean in evaluation.against_time
        ]
    treatment = design.process.treatment_time
    full = evaluation.metrics["time_to_98_s"].value
    end = float(np.clip(1.1 * full, treatment, FARTHEST * treatment))
    times = sorted({treatment, *(end * np.arange(1, POINTS + 1) / POINTS).tolist()})
    rows = []
    for at in times:
        then = design.changed({"process.treatment_time_s": at})
        found = coverage_estimates(
            evaluation.replicas, chamber, target_patches(evaluation.replicas, chamber, then)
        )
        mean, poorest = found["mean_coverage"], found["p05_coverage"]
        if at > treatment and mean.half_width > VAGUE:
            break
        rows.append((at, mean.value, mean.half_width, poorest.value, poorest.half_width))
    at, mean_value, mean_width, poorest_value, poorest_width = np.array(rows).T
    kept = at == treatment
    columns = {
        "time_s": at,
        "mean_coverage": _rising(mean_value, mean_width, kept),
        "half_width": mean_width,
        "p05_coverage": _rising(poorest_value, poorest_width, kept),
        "p05_half_width": poorest_width,
    }
    return [
        dict(zip(columns, row, strict=True)) for row in np.array(list(columns.values())).T.tolist()
    ]


def _rising(value: np.ndarray, half_width: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """The nearest curve that never falls, as coverage does not, each point as sure as its interval; those kept stay.

    Each time is estimated on patches of its own, and a step between patches may else look like a fall.
    """
    from scipy.optimize import isotonic_regression

    weight = np.where(kept, 1e12, 1.0) / np.maximum(half_width, 1e-6) ** 2
    return np.asarray(isotonic_regression(value, weights=weight).x)
