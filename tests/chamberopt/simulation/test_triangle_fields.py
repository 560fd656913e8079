"""What each triangle got, against counts by hand; intervals that hold the truth as often as they say."""

from pathlib import Path

import numpy as np
import pytest

from chamberopt.common.errors import InputError
from chamberopt.coverage.dents import dent_diameter
from chamberopt.coverage.part_impacts import (
    Hits,
    hits_on_part,
    load_hits,
    save_hits,
    sort_hits_by_triangle,
)
from chamberopt.simulation.triangle_fields import (
    QUANTITIES,
    _speed_quantile,
    compute_triangle_fields,
    coverage_bounds,
)
from tests.helpers.synthetic import impact_log, patchwork, plate_design, poisson_evaluation

DESIGN = plate_design()


def hits_of(rng: np.random.Generator, count: np.ndarray) -> Hits:
    """So many hits (m,) of a triangle each, in no order."""
    triangle = rng.permutation(np.repeat(np.arange(len(count), dtype=np.int32), count))
    columns = rng.uniform(0.1, 5.0, (4, len(triangle))).astype(np.float32)
    return Hits(triangle, *columns)


def test_hits_are_the_impacts_on_the_part_with_their_size_and_energy() -> None:
    chamber = patchwork(np.full(3, 1e-6))
    log = impact_log([2, 0, 2], [[0, 0, -3.0], [3.0, 0, -3.0], [0, 0, -0.1]], [3.0, 3.0, 0.1])
    hits = hits_on_part(log, chamber, DESIGN)
    material, shot = DESIGN.materials.part, DESIGN.shot
    np.testing.assert_array_equal(hits.triangle, [2, 0, 2])
    np.testing.assert_allclose(hits.angle, [90.0, 45.0, 90.0], rtol=1e-5)
    mass = shot.density * np.pi / 6 * shot.diameter**3
    np.testing.assert_allclose(hits.energy, 0.5 * mass * np.array([9.0, 9.0, 0.01]), rtol=1e-5)
    size = dent_diameter(
        np.array([3.0]),
        shot.diameter,
        shot.density,
        material.hardness,
        material.restitution,
        material.yield_speed,
    )
    np.testing.assert_allclose(hits.dent, [size[0], size[0], 0.0], rtol=1e-5)


def test_hits_come_back_from_their_file_by_triangle(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    parts = [hits_of(rng, np.array([3, 0, 5, 1])), hits_of(rng, np.array([2, 0, 0, 4]))]
    save_hits(tmp_path / "hits.npz", sort_hits_by_triangle(parts, 4))
    found = load_hits(tmp_path / "hits.npz")
    assert [len(found.of(t)) for t in range(4)] == [5, 0, 5, 5]
    assert len(found.on(np.array([True, False, False, True]))) == 10
    for t in range(4):
        for column in ("speed", "angle", "dent", "energy"):
            whole = np.concatenate([getattr(part, column)[part.triangle == t] for part in parts])
            np.testing.assert_array_equal(getattr(found.of(t), column), whole)


def test_a_damaged_or_missing_hits_file_is_said(tmp_path: Path) -> None:
    path = tmp_path / "hits.npz"
    with pytest.raises(InputError, match=r"older version.*simulate again"):
        load_hits(path)
    save_hits(path, sort_hits_by_triangle([hits_of(np.random.default_rng(1), np.array([3, 4]))], 2))
    whole = path.read_bytes()
    for damaged in (b"", whole[: len(whole) // 2], b"PK" + bytes(200)):
        path.write_bytes(damaged)
        with pytest.raises(InputError, match="damaged"):
            load_hits(path)


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
    """400 triangles with dents at one rate, sizes scattered by half: 95 % of the intervals, and more for few dents."""
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
