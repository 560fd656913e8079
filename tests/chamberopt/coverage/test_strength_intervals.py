"""Figures of peening strength over surfaces of which they are known."""

from functools import cache

import numpy as np
import pytest

from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.estimate import Estimate
from chamberopt.coverage.field.surface_points import Reach
from chamberopt.coverage.field.target_field import TargetField, WindowSetting, find_target_field
from chamberopt.coverage.part_impacts import Hits
from chamberopt.coverage.strength import strip_dents
from chamberopt.coverage.strength_intervals import (
    MIN_BATCHES,
    StrengthHistograms,
    estimates_of,
    level_histograms,
    strength_estimates,
)
from chamberopt.design.almen_strip import strip_material
from tests.helpers.results.strength_histograms import histogram_of
from tests.helpers.synthetic import dents_at, no_hits, plane_chamber, plate_design, triangles_at

DESIGN = plate_design()
PLANE = plane_chamber()
BALL = DESIGN.shot.diameter
WEAK = 0.49  # strength on one half of the plane, over that on the other
OF_HALVES = 1.0 - (1.0 - WEAK) / (1.0 + WEAK)


@cache
def plane_field() -> TargetField:
    setting = WindowSetting(1e-6, 20_000, 3e-3, 1e-3)
    return find_target_field(PLANE, chamber_mesh(PLANE), setting)


def plane_dents(rng: np.random.Generator, per_mm2: float, diameter: np.ndarray | None) -> Hits:
    """Random dents; without a diameter they are weaker on one half of the plane."""
    count = rng.poisson(per_mm2 * 225.0)
    place = np.column_stack([rng.uniform(-7.499e-3, 7.499e-3, (count, 2)), np.zeros(count)])
    if diameter is None:
        size = np.where(place[:, 0] > 0.0, 0.2e-3, 0.2e-3 * np.sqrt(WEAK))
    else:
        size = rng.choice(diameter, count)
    return dents_at(DESIGN, triangles_at(PLANE, place), place, size)


def known(histogram: np.ndarray, reachable: float = 1.0) -> dict[str, Estimate]:
    """Figures of eight batches with the same dents, each simulated for two seconds."""
    parts = np.tile(histogram / 8, (8, 1, 1))
    return estimates_of(StrengthHistograms(parts, np.full(8, 2.0), 1.0), Reach(reachable))


def uniformity(histogram: np.ndarray, reachable: float = 1.0) -> Estimate:
    return known(histogram, reachable)["intensity_uniformity"]


def figures(field: TargetField, replicas: list[list[Hits]]) -> dict[str, Estimate]:
    """Figures where the strength of each dent is the square of its diameter over that of a ball."""

    def dents(hits: Hits) -> tuple[np.ndarray, np.ndarray]:
        return hits.dent, hits.dent**2 / BALL

    found = level_histograms(field, replicas, 2.0, dents)
    return estimates_of(found, field.reach)


def test_an_even_surface_has_the_uniformity_one() -> None:
    histogram = np.tile(histogram_of((1.0, 2.0), (0.4, 3.0)), (60, 1))
    found = uniformity(histogram)
    assert found.value == pytest.approx(1.0, abs=1e-6)
    # Uneven coverage of even strength is as intense everywhere.
    uneven = np.linspace(1.0, 9.0, 60)[:, None] * histogram
    assert uniformity(uneven).value == pytest.approx(1.0, abs=2e-3)


def test_two_strengths_have_the_uniformity_of_their_two_values() -> None:
    """Half of the surface has twice the strength of the rest: mean 1.5, deviation 0.5."""
    strong, weak = histogram_of((1.0, 2.0)), histogram_of((0.5 - 1e-9, 2.0))
    histogram = np.concatenate([np.tile(strong, (40, 1)), np.tile(weak, (40, 1))])
    found = uniformity(histogram)
    assert found.value == pytest.approx(1.0 - 1.0 / 3.0, abs=0.01)


@pytest.mark.parametrize("reachable", [0.9, 0.5])
def test_what_is_out_of_reach_has_no_strength(reachable: float) -> None:
    """S is 0 on a share 1 - r: the square of its relative spread is 1 / r - 1."""
    histogram = np.tile(histogram_of((1.0, 2.0)), (60, 1))
    found = uniformity(histogram, reachable)
    assert found.value == pytest.approx(1.0 - np.sqrt(1.0 / reachable - 1.0))


def test_scatter_of_counts_is_not_taken_for_unevenness() -> None:
    """Dents of two sizes fall at random, as often everywhere: about 60 in a window."""
    rng, field = np.random.default_rng(6), plane_field()
    sizes = np.array([0.1e-3, 0.2e-3])
    replicas = [[plane_dents(rng, 7.5, sizes)] for _ in range(8)]
    found = figures(field, replicas)["intensity_uniformity"]
    assert 0.97 < found.value <= 1.0
    assert found.high >= 1.0 - 1e-6
    assert found.half_width < 0.05


def test_places_of_two_strengths_are_told_from_scatter() -> None:
    rng, field = np.random.default_rng(7), plane_field()
    replicas = [[plane_dents(rng, 7.5, None)] for _ in range(8)]
    found = figures(field, replicas)["intensity_uniformity"]
    # The windows over the line between the halves, a fifteenth of the plane, have both.
    assert abs(found.value - OF_HALVES) < found.half_width + 0.02
    more = [[plane_dents(rng, 15.0, None)] for _ in range(8)]
    assert figures(field, more)["intensity_uniformity"].value == pytest.approx(
        found.value, abs=0.02
    )


def test_few_replicas_have_no_interval_and_no_dents_no_figure() -> None:
    rng, field = np.random.default_rng(8), plane_field()
    few = [[plane_dents(rng, 30.0, None)] for _ in range(MIN_BATCHES - 1)]
    found = figures(field, few)["intensity_uniformity"]
    assert found.half_width == np.inf
    assert found.value == pytest.approx(OF_HALVES, abs=0.05)


def test_without_a_dent_nothing_is_known() -> None:
    strip = strip_material(DESIGN.shot)
    found = strength_estimates(plane_field(), [[no_hits()]] * 8, 2.0, DESIGN.shot.density, strip)
    assert all((one.value, one.half_width) == (0.0, np.inf) for one in found.values())


# Mean, percentiles, saturation


def test_equal_impacts_saturate_as_the_curve_of_kirk() -> None:
    """h = s (1 - exp(-b t)): T = ln 10 / b and S = 0.9 s; 16 s had two dents a window."""
    histogram = np.tile(histogram_of((1.0, 2.0)), (60, 1))
    found = known(histogram)
    assert found["saturation_time_s"].value == pytest.approx(np.log(10.0) * 16.0 / 2.0, rel=0.03)
    for name in ("strength_um", "strength_p05_um", "strength_p95_um"):
        assert found[name].value == pytest.approx(0.9e6, rel=0.02), name


def test_percentiles_are_those_of_two_strengths() -> None:
    strong, weak = histogram_of((1.0, 2.0)), histogram_of((0.5 - 1e-9, 2.0))
    histogram = np.concatenate([np.tile(strong, (40, 1)), np.tile(weak, (40, 1))])
    found = known(histogram)
    assert found["strength_p95_um"].value == pytest.approx(0.9e6, rel=0.02)
    assert found["strength_p05_um"].value == pytest.approx(0.45e6, rel=0.03)
    assert found["strength_um"].value == pytest.approx(0.675e6, rel=0.02)


def test_scatter_of_counts_moves_no_percentile() -> None:
    """Dents of two sizes fall at random, as often everywhere: all places are alike."""
    rng, field = np.random.default_rng(9), plane_field()
    sizes = np.array([0.1e-3, 0.2e-3])
    found = figures(field, [[plane_dents(rng, 7.5, sizes)] for _ in range(8)])
    mean = found["strength_um"]
    for name in ("strength_p05_um", "strength_p95_um"):
        assert abs(found[name].value - mean.value) < found[name].half_width + mean.half_width
        assert found[name].half_width < 0.1 * mean.value


@pytest.mark.parametrize("per_mm2", [0.02, 0.06, 0.15])
def test_with_few_dents_the_strength_lies_between_that_of_windows_and_of_one(
    per_mm2: float,
) -> None:
    """Each half of the plane comes to 0.9 of its strength, whatever its dents are."""
    rng, field = np.random.default_rng(11), plane_field()
    found = figures(field, [[plane_dents(rng, per_mm2, None)] for _ in range(8)])["strength_um"]
    true = 0.9e6 * 0.5 * (1.0 + WEAK) * 0.2e-3**2 / BALL
    assert found.half_width == np.inf
    assert 0.0 < found.bias < found.value
    assert abs(found.value - true) < found.bias


def test_twice_the_simulated_time_saturates_in_twice_the_time() -> None:
    strip, density = strip_material(DESIGN.shot), DESIGN.shot.density
    rng, field = np.random.default_rng(10), plane_field()
    batches = [[plane_dents(rng, 7.5, np.array([0.2e-3]))] for _ in range(8)]
    one, two = (strength_estimates(field, batches, s, density, strip) for s in (1.0, 2.0))
    ratio = two["saturation_time_s"].value / one["saturation_time_s"].value
    assert ratio == pytest.approx(2.0)
    # All balls have one speed, so that each place comes to 0.9 of one strength.
    strength = strip_dents(batches[0][0], density, strip)[1][0]
    assert one["strength_um"].value == pytest.approx(0.9e6 * strength, rel=0.03)
