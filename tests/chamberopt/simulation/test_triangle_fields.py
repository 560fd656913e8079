"""Fields of triangles against counts by hand, and intervals that hold the truth in 95 %."""

import numpy as np
import pytest

from chamberopt.coverage.part_impacts import Hits, sort_hits_by_triangle
from chamberopt.output.plots.quantities import QUANTITIES
from chamberopt.simulation.triangle_fields import (
    _speed_quantile,
    compute_triangle_fields,
    coverage_bounds,
)
from tests.helpers.synthetic import patchwork, plate_design, poisson_evaluation

DESIGN = plate_design()


def hits_of(rng: np.random.Generator, count: np.ndarray) -> Hits:
    """So many hits (m,) of a triangle each, in no order."""
    triangle = rng.permutation(np.repeat(np.arange(len(count), dtype=np.int32), count))
    columns = rng.uniform(0.1, 5.0, (4, len(triangle))).astype(np.float32)
    return Hits(triangle, *columns)


def test_the_90th_percentile_is_the_speed_that_nine_of_ten_hits_do_not_exceed() -> None:
    rng = np.random.default_rng(2)
    hits = hits_of(rng, np.array([10, 0, 1, 37]))
    found = _speed_quantile(sort_hits_by_triangle([hits], 4), 0.9)
    for t in (0, 2, 3):
        speeds = np.sort(hits.speed[hits.triangle == t])
        assert found[t] == speeds[int(np.ceil(0.9 * len(speeds))) - 1]
    assert np.isnan(found[1])


def test_per_triangle_columns_add_up() -> None:
    chamber = patchwork(np.full(50, 1e-6))
    evaluation = poisson_evaluation(DESIGN, chamber, per_mm2=8.0)
    found = compute_triangle_fields(DESIGN, chamber, evaluation)
    hits = sort_hits_by_triangle(evaluation.hits, 50)
    times = DESIGN.process.treatment_time / evaluation.total.simulated_time
    assert np.nansum(found["energy_per_mm2"]) == pytest.approx(
        1e3 * hits.hits.energy.sum(dtype=float) * times
    )
    assert (found["p90_normal_speed"] >= found["mean_normal_speed"] - 1e-6)[
        found["impacts"] > 0
    ].all()
    assert {quantity.column for quantity in QUANTITIES.values()} <= set(found)


@pytest.mark.parametrize("dents", [0.3, 2.0, 20.0])
def test_the_interval_of_a_triangles_coverage_holds_the_truth(dents: float) -> None:
    """On 400 triangles 95 % of the intervals hold the truth, and more where dents are few."""
    rng = np.random.default_rng(4)
    area, m, times = 1e-6, 400, 5.0
    count = rng.poisson(dents, m)
    triangle = np.repeat(np.arange(m, dtype=np.int32), count)
    diameter = rng.uniform(0.5e-4, 1.5e-4, len(triangle)).astype(np.float32)
    none = np.zeros(len(triangle), dtype=np.float32)
    hits = sort_hits_by_triangle([Hits(triangle, none, none, diameter, none)], m)
    truth = -np.expm1(-dents * np.pi / 4 * (1e-8 + 1e-8 / 12) / area * times)

    low, high = coverage_bounds(hits, np.full(m, area), times)
    held = np.mean((low <= truth) & (truth <= high))
    assert 0.94 <= held <= 1.0
    if dents == 20.0:  # ... and it is no wider than a normal interval says
        assert held < 0.99


def test_without_any_dent_nothing_is_known() -> None:
    none = np.zeros(0, dtype=np.float32)
    hits = sort_hits_by_triangle([Hits(np.zeros(0, dtype=np.int32), none, none, none, none)], 3)
    low, high = coverage_bounds(hits, np.array([1e-6, np.nan, 1e-6]), 1.0)
    np.testing.assert_array_equal([low, high], [[0.0, np.nan, 0.0], [1.0, np.nan, 1.0]])
