"""Coverage against time agrees with the figures at the treatment time, and ends where it should."""

from dataclasses import replace

import numpy as np
import pytest

from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.estimate import FIRST_OF_CALIBRATION, normal_quantile
from chamberopt.simulation.evaluate import prepare_target
from chamberopt.simulation.evaluation import Evaluation
from chamberopt.simulation.time_curve import MAX_TREATMENT_TIMES, coverage_against_time
from tests.helpers.synthetic import evaluation_of, plane_chamber, plate_design, random_dents

DESIGN = plate_design()
PLANE = plane_chamber()
TREATMENT, REPLICAS = DESIGN.process.treatment_time, 8
DENT = 1e-8  # m²


def curve_of(x: float, per_mm2: float) -> tuple[list[dict[str, float]], Evaluation]:
    """The curve of a plane with dent density x at the treatment time, from so many dents."""
    design = DESIGN.changed(
        {"process.accuracy.simulated_time_s": per_mm2 * DENT * 1e6 / x * TREATMENT / REPLICAS}
    )
    rng = np.random.default_rng(1)
    mean = 1e6 * per_mm2 / REPLICAS * PLANE.part.area
    hits = [random_dents(design, PLANE, mean, rng) for _ in range(REPLICAS)]
    evaluation = evaluation_of(design, PLANE, hits)
    field = prepare_target(design, PLANE, chamber_mesh(PLANE))
    return coverage_against_time(design, field, evaluation), evaluation


@pytest.mark.parametrize("x", [0.3, 1.0, 6.0])
def test_the_curve_goes_through_the_figures_of_the_treatment_time(x: float) -> None:
    """Dents fall at one rate everywhere: mean coverage is 1 - exp(-x t / T) at every time."""
    rows, evaluation = curve_of(x, per_mm2=200.0)
    metrics = evaluation.metrics
    at = next(row for row in rows if row["time_s"] == TREATMENT)
    assert at["mean_coverage"] == pytest.approx(metrics["mean_coverage"].value, abs=3e-3)
    assert at["half_width"] > 0.7 * metrics["mean_coverage"].half_width
    assert at["p05_coverage"] == pytest.approx(metrics["p05_coverage"].value)
    assert at["p05_half_width"] == pytest.approx(metrics["p05_coverage"].half_width, rel=0.2)
    for row in rows:
        exact = -np.expm1(-x * row["time_s"] / TREATMENT)
        assert row["mean_coverage"] == pytest.approx(exact, abs=3.0 * row["half_width"] + 5e-3)
        assert row["p05_coverage"] == pytest.approx(exact, abs=row["p05_half_width"] + 0.02)
        assert row["half_width"] >= 0.0
    for name in ("mean_coverage", "p05_coverage"):
        assert np.diff([row[name] for row in rows]).min() >= 0.0
    times = [row["time_s"] for row in rows]
    assert times == sorted(times)
    full = metrics["time_to_98_s"].value
    assert times[-1] == pytest.approx(
        np.clip(1.1 * full, TREATMENT, MAX_TREATMENT_TIMES * TREATMENT)
    )
    if full < times[-1]:
        after = next(row for row in rows if row["time_s"] >= full)
        assert after["p05_coverage"] >= 0.98 - 1e-6


def test_the_curve_holds_what_a_calibration_leaves_open() -> None:
    """A dent density that is known to 10 %: coverage moves by 0.1 x exp(-x) at every time."""
    plain, evaluation = curve_of(1.0, per_mm2=200.0)
    mean = evaluation.metrics["mean_coverage"]
    error = 0.1 * -(1.0 - mean.value) * np.log1p(-mean.value)
    wider = mean.with_shared(FIRST_OF_CALIBRATION, [0.6 * error, 0.8 * error])
    metrics = evaluation.metrics | {"mean_coverage": wider}
    field = prepare_target(DESIGN, PLANE, chamber_mesh(PLANE))
    design = DESIGN.changed({"process.accuracy.simulated_time_s": 2.0 * TREATMENT / REPLICAS})
    rows = coverage_against_time(design, field, replace(evaluation, metrics=metrics))
    for before, after in zip(plain, rows, strict=True):
        left = 1.0 - after["mean_coverage"]
        of_density = normal_quantile(0.95) * 0.1 * -left * np.log(left)
        assert after["half_width"] == pytest.approx(np.hypot(before["half_width"], of_density))


def test_without_dents_enough_there_is_no_percentile_and_no_longer_time() -> None:
    """Ten dents a window are enough for the mean at the treatment time, not at ten times it."""
    rows, evaluation = curve_of(1.0, per_mm2=10.0)
    found = evaluation.resolution
    assert found.has_mean
    assert not found.has_places
    assert all("p05_coverage" not in row for row in rows)
    assert rows[-1]["time_s"] <= TREATMENT * found.dents / found.needed_for_mean * (1.0 + 1e-9)
    few, evaluation = curve_of(1.0, per_mm2=2.0)
    assert not evaluation.resolution.has_mean
    assert few[-1]["time_s"] < TREATMENT
