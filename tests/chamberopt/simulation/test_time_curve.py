"""Coverage against time agrees with the figures at the treatment time, and ends where it says."""

import numpy as np
import pytest

from chamberopt.simulation.time_curve import MAX_TREATMENT_TIMES, coverage_against_time
from tests.helpers.synthetic import equal_dents, evaluation_of, patchwork, plate_design

DESIGN = plate_design()


@pytest.mark.parametrize(("dents", "end"), [(40.0, None), (4.0, MAX_TREATMENT_TIMES)])
def test_the_curve_goes_through_the_figures_of_the_treatment_time(
    dents: float, end: float | None
) -> None:
    """Dents fall at one rate on all triangles: mean coverage is 1 - exp(-rate t) at every time."""
    rng = np.random.default_rng(1)
    seconds, treatment, size, area = 1.0, DESIGN.process.treatment_time, 1e-8, 1e-6
    rate = dents * size / area / treatment
    chamber = patchwork(np.full(300, area))
    many = rate * seconds * area / size * 8
    tallies = [equal_dents(seconds, rng.poisson(many / 8, 300), size) for _ in range(8)]
    evaluation = evaluation_of(DESIGN, chamber, tallies)
    rows = coverage_against_time(DESIGN, chamber, evaluation)

    at = next(row for row in rows if row["time_s"] == treatment)
    assert at["mean_coverage"] == pytest.approx(evaluation.metrics["mean_coverage"].value)
    assert at["p05_half_width"] == pytest.approx(evaluation.metrics["p05_coverage"].half_width)
    for row in rows:
        assert row["mean_coverage"] == pytest.approx(
            -np.expm1(-rate * row["time_s"]), abs=3.0 * row["half_width"] + 0.02
        )
        assert row["half_width"] >= 0.0
    for name in ("mean_coverage", "p05_coverage"):
        assert np.diff([row[name] for row in rows]).min() >= 0.0
    times = [row["time_s"] for row in rows]
    assert times == sorted(times)
    full = evaluation.metrics["time_to_98_s"].value
    assert times[-1] == pytest.approx(
        end * treatment if end else max(treatment, min(1.1 * full, MAX_TREATMENT_TIMES * treatment))
    )
