"""Figures where about 5 % of the target is out of reach: their intervals know how well that is."""

import math

import numpy as np
import pytest

from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.estimate import Estimate
from chamberopt.coverage.field.surface_points import CERTAIN, Reach, reach_from
from chamberopt.coverage.field.target_field import WindowSetting, find_target_field
from chamberopt.coverage.percentile import P05_COVERAGE, DentSums, quantile_estimate, time_to_98
from chamberopt.simulation.estimates import SeenDents, estimate_metrics, reach_notes
from tests.chamberopt.coverage.field.test_crease_angles import SIDE, block, rain_on_slopes
from tests.helpers.synthetic import chamber_round, dents_at, plate_design, triangles_at

DESIGN = plate_design(process__treatment_time_s=1.0, process__accuracy__simulated_time_s=1.0)
DENT, REPLICAS, POINTS = 0.3e-3, 6, (4000, 5000, 7500, 10_000, 15_000, 20_000)


def of_valley(out_of_reach: float, points: int) -> tuple[Reach, dict[str, Estimate], list[str]]:
    """Reach, figures and notes of a valley of 90 degrees, whose bottom no ball can touch.

    On both sides a strip as wide as the ball's radius is out of reach, less what balls overlap.
    """
    radius = SIDE * out_of_reach / 0.995
    mesh, slopes = block(-90.0)
    chamber = chamber_round(mesh, slopes)
    setting = WindowSetting(1e-6, points, 2.0 * radius, DENT)
    field = find_target_field(chamber, chamber_mesh(chamber), setting)
    seen = SeenDents.none(field)
    for seed in range(REPLICAS):
        place = rain_on_slopes(-90.0, seed)
        place = place[np.hypot(place[:, 0], place[:, 2]) > radius]
        seen.add([*seen.in_sector, dents_at(DESIGN, triangles_at(chamber, place), place, DENT)])
    found = estimate_metrics(seen, seen.in_sector, chamber, DESIGN).metrics
    return field.reach, found, list(reach_notes(field.reach))


@pytest.mark.long
def test_at_the_limit_the_choice_of_points_does_not_throw_the_fifth_percentile() -> None:
    found = [of_valley(0.05, points) for points in POINTS]
    above, below = (of_valley(share, 20_000)[1]["p05_coverage"] for share in (0.04, 0.07))
    assert above.low > 0.5 * above.value > 0.0
    assert below.value == below.half_width == 0.0
    for reach, metrics, notes in found:
        p05, time = metrics["p05_coverage"], metrics["time_to_98_s"]
        assert abs(reach.beyond(0.95)) < CERTAIN
        assert abs(reach.share - 0.95) < CERTAIN * reach.error < 0.02
        assert 0.0 < p05.value < above.value
        assert p05.low <= 0.0
        assert p05.high > 0.8 * above.value  # both cases are in the interval
        assert time.in_words.startswith("more than ")
        assert "never" not in time.in_words
        assert "not resolved" in notes[0]
        assert "process.accuracy.points" in notes[0]
    # No two choices exclude one another, and none says that it is all or nothing.
    values = [metrics["p05_coverage"] for _, metrics, _ in found]
    for one in values:
        assert all(abs(one.value - other.value) < one.half_width for other in values)


def test_never_is_said_where_too_much_is_surely_out_of_reach() -> None:
    reach, metrics, notes = of_valley(0.08, 20_000)
    assert reach.beyond(0.95) < -CERTAIN
    assert metrics["p05_coverage"].value == metrics["p05_coverage"].half_width == 0.0
    assert metrics["time_to_98_s"].in_words == "never"
    assert notes[0].endswith("and the coverage that 95 % of the area exceeds is 0")


def dents(level: float) -> DentSums:
    """Sums of dents of 8 batches in windows from level / 2 to level, with a little scatter."""
    rng = np.random.default_rng(1)
    mean = np.linspace(0.5, 1.0, 2000) * level
    number = rng.poisson(200.0 * mean, (8, 2000))
    return DentSums(np.ones(8, dtype=int), number / 200.0, number.sum(axis=0).astype(float))


def test_the_percentile_passes_continuously_from_0_as_the_reach_grows() -> None:
    sums, error = dents(1.0), 1e-3
    shares = 0.95 + error * np.linspace(-4.0, 4.0, 81)
    found = [quantile_estimate(P05_COVERAGE, sums, Reach(r, error), 1.0) for r in shares]
    value = np.array([one.value for one in found])
    half = float(value[-1])
    assert value[0] == 0.0
    assert (np.diff(value) > -1e-3).all()
    assert np.diff(value).max() < 0.05 * half
    assert value[40] == pytest.approx(0.5 * half, rel=0.05)
    for one, share in zip(found, shares, strict=True):
        if abs(share - 0.95) < 0.999 * CERTAIN * error:
            assert one.low <= 0.0
            assert one.high >= 0.95 * half


def test_full_coverage_at_the_limit_of_reach_takes_more_than_a_time() -> None:
    sums, reach = dents(9.0), Reach(0.9505, 1e-3)
    p05 = quantile_estimate(P05_COVERAGE, sums, reach, 1.0)
    time = time_to_98(p05, sums, reach, 1.0, 100.0)
    assert p05.low <= 0.0 < p05.value < 0.9
    assert time.half_width == math.inf
    assert time.in_words.startswith("more than ")
    least = float(time.in_words.split()[2].replace(",", ""))
    assert 50.0 < least < 100.0 * math.log(50.0) / 4.0  # of windows from 4.5 to 9


def test_the_error_of_a_reach_of_1_is_that_of_the_rule_of_three() -> None:
    whole = reach_from(np.ones(40_000, dtype=bool))
    assert whole.share == 1.0
    assert 1.96 * whole.error == pytest.approx(3.0 / 40_000, rel=1e-3)
    assert whole.largest == 1.0
    rng = np.random.default_rng(2)
    half = reach_from(rng.random(40_000) < 0.5)
    assert half.error == pytest.approx(0.5 / 200.0, rel=0.7)
    assert half.beyond(half.share - 2.0 * half.error) == pytest.approx(2.0)
    assert Reach(0.95).beyond(0.95) == -math.inf
    assert Reach(0.96).beyond(0.95) == math.inf
