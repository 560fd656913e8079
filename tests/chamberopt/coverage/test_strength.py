"""Peening strength against Kirk's curve and closed forms, and its spread over known surfaces."""

import numpy as np
import pytest
from scipy.optimize import brentq

from chamberopt.chamber.scene import chamber_mesh
from chamberopt.coverage.field.target_field import TargetField, WindowSetting, find_target_field
from chamberopt.coverage.field.windows import Places, Windows
from chamberopt.coverage.part_impacts import Hits
from chamberopt.coverage.strength import (
    LEVELS,
    MIN_BATCHES,
    impact_strength,
    intensity_uniformity,
    saturated_strength,
    strength_histogram,
    strength_near,
    uniformity_of,
)
from tests.helpers.synthetic import dents_at, no_hits, plane_chamber, plate_design, triangles_at

DESIGN = plate_design()
PLANE = plane_chamber()
DENSITY = DESIGN.shot.density
WEAK = 0.49  # strength on one half of the plane, over that on the other
OF_HALVES = 1.0 - (1.0 - WEAK) / (1.0 + WEAK)


def level_of(strength: float, highest: float) -> int:
    return min(int(LEVELS * strength / highest), LEVELS - 1)


def histogram_of(*impacts: tuple[float, float], highest: float = 1.0) -> np.ndarray:
    """One window, (1, LEVELS), from pairs of strength and rate."""
    found = np.zeros((1, LEVELS))
    for strength, rate in impacts:
        found[0, level_of(strength, highest)] += rate
    return found


def arc_height(strength: np.ndarray, rate: np.ndarray, time: float) -> float:
    """h(t) of impacts of these strengths and rates: each spot keeps its strongest dent."""
    order = np.argsort(-strength)
    steps = strength[order] - np.append(strength[order][1:], 0.0)
    return float((steps * -np.expm1(-np.cumsum(rate[order]) * time)).sum())


def exact_saturation(strength: np.ndarray, rate: np.ndarray) -> tuple[float, float]:
    """S and T, from the largest root of h(2 T) = 1.1 h(T)."""

    def gain(time: float) -> float:
        return arc_height(strength, rate, 2.0 * time) - 1.1 * arc_height(strength, rate, time)

    times = np.geomspace(1e-3, 1e4, 4000) / rate.sum()
    last = np.flatnonzero(np.array([gain(t) for t in times]) > 0.0)[-1]
    time = brentq(gain, times[last], times[last + 1])
    return arc_height(strength, rate, time), time


def hits_of(triangle: np.ndarray, diameter: np.ndarray, ball: float, speed: float = 3.0) -> Hits:
    """Impacts of balls of one diameter [m]."""
    k = len(triangle)
    energy = 0.5 * DENSITY * np.pi / 6.0 * ball**3 * speed**2
    columns = (np.full(k, speed), np.full(k, 90.0), diameter, np.full(k, energy))
    return Hits(triangle, np.zeros((k, 3)), *columns)


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


@pytest.mark.parametrize("ball", [0.5e-3, 3e-3])
def test_the_strength_of_an_impact_is_the_square_of_its_dent_over_its_ball(ball: float) -> None:
    """The ball's diameter comes from its energy and speed."""
    diameter = np.array([0.1e-3, 0.2e-3, 0.0])
    for speed in (0.5, 8.0):
        found = impact_strength(hits_of(np.zeros(3, dtype=int), diameter, ball, speed), DENSITY)
        assert found == pytest.approx(diameter**2 / ball)


def test_a_ball_that_stands_still_has_no_strength() -> None:
    still = hits_of(np.zeros(2, dtype=int), np.zeros(2), 1e-3, speed=0.0)
    assert (impact_strength(still, DENSITY) == 0.0).all()


@pytest.mark.parametrize("rate", [0.02, 1.0, 50.0])
def test_equal_impacts_follow_the_curve_of_kirk(rate: float) -> None:
    """h = s (1 - exp(-rate t)): h(2 T) = 1.1 h(T) where exp(-rate T) = 0.1."""
    strength, time = saturated_strength(histogram_of((1.0, rate)), highest=1.0)
    assert strength[0] == pytest.approx(0.9, rel=0.02)
    assert time[0] == pytest.approx(np.log(10.0) / rate, rel=0.03)


def test_mixed_impacts_agree_with_the_root_of_the_arc_height() -> None:
    rng = np.random.default_rng(1)
    for _ in range(20):
        strength, rate = rng.uniform(0.05, 1.0, 12), rng.uniform(0.1, 2.0, 12)
        strength[0] = 1.0
        exact, exact_time = exact_saturation(strength, rate)
        histogram = histogram_of(*zip(strength, rate, strict=True))
        found, time = saturated_strength(histogram, highest=1.0)
        assert found[0] == pytest.approx(exact, rel=0.02)
        assert time[0] == pytest.approx(exact_time, rel=0.1)


def test_at_the_saturation_time_twice_the_time_gives_a_tenth_more() -> None:
    rng = np.random.default_rng(2)
    histogram = rng.gamma(0.5, 1.0, (200, LEVELS))
    strength, time = saturated_strength(histogram, highest=1.0)
    rate = np.cumsum(histogram[:, ::-1], axis=1)[:, ::-1] - 0.5 * histogram
    once, twice = (-np.expm1(-rate * k * time[:, None]).mean(axis=1) for k in (1.0, 2.0))
    assert strength == pytest.approx(once)
    assert twice == pytest.approx(1.1 * once, rel=2e-3)


def test_more_balls_reach_the_same_strength_sooner() -> None:
    histogram = np.random.default_rng(3).gamma(0.5, 1.0, (50, LEVELS))
    strength, time = saturated_strength(histogram, highest=1.0)
    for times in (0.1, 2.0, 30.0):
        again, sooner = saturated_strength(times * histogram, highest=1.0)
        assert again == pytest.approx(strength, rel=3e-3)
        assert sooner == pytest.approx(time / times, rel=0.02)


def test_strength_is_in_proportion_to_those_of_the_impacts() -> None:
    histogram = np.random.default_rng(4).gamma(0.5, 1.0, (50, LEVELS))
    one, time = saturated_strength(histogram, highest=1.0)
    three, same_time = saturated_strength(histogram, highest=3.0)
    assert three == pytest.approx(3.0 * one)
    np.testing.assert_array_equal(time, same_time)


def test_a_window_without_dents_has_no_strength() -> None:
    middle = (LEVELS // 2 - 0.5) / LEVELS  # of a level
    histogram = np.concatenate([np.zeros((1, LEVELS)), histogram_of((middle, 1.0))])
    strength, time = saturated_strength(histogram, highest=1.0)
    assert strength[0] == 0.0
    assert np.isfinite(time).all()
    assert strength[1] == pytest.approx(0.9 * middle, rel=0.05)


def test_near_a_known_time_the_strength_is_found_in_few_steps() -> None:
    histogram = np.random.default_rng(5).gamma(2.0, 1.0, (100, LEVELS))
    strength, time = saturated_strength(histogram, highest=1.0)
    for off in (0.8, 1.0, 1.25):
        assert strength_near(histogram, 1.0, off * time) == pytest.approx(strength, rel=3e-3)


def test_the_histogram_holds_dented_area_over_the_area_of_the_window() -> None:
    up = np.tile([0.0, 0.0, 1.0], (3, 1))
    points = Places(np.array([[0.0, 0, 0], [5.0, 0, 0], [9.0, 0, 0]]), up, np.zeros(3, dtype=int))
    contacts = Places(np.array([[0.1, 0, 0], [0.2, 0, 0], [5.1, 0, 0]]), up, np.zeros(3, dtype=int))
    dent, level = np.array([0.2, 0.4, 0.3]), np.array([1, 7, 7])
    found = strength_histogram(
        Windows(points, 1.0), np.array([3.0, 2.0, 1.0]), contacts, dent, level
    )
    assert found.shape == (3, LEVELS)
    assert found[0, [1, 7]] == pytest.approx(np.pi / 4.0 * np.array([0.04, 0.16]) / 3.0)
    assert found[1, 7] == pytest.approx(np.pi / 4.0 * 0.09 / 2.0)
    assert found.sum() == pytest.approx(found[0, [1, 7]].sum() + found[1, 7])


# Uniformity


def shared(histogram: np.ndarray, batches: int) -> np.ndarray:
    """The same dents in each batch."""
    return np.tile(histogram / batches, (batches, 1, 1))


def test_an_even_surface_has_the_uniformity_one() -> None:
    histogram = np.tile(histogram_of((1.0, 2.0), (0.4, 3.0)), (60, 1))
    found = uniformity_of(shared(histogram, 8), 1.0, 1.0)
    assert found.value == pytest.approx(1.0, abs=1e-6)
    # Uneven coverage of even strength is as intense everywhere.
    uneven = np.linspace(1.0, 9.0, 60)[:, None] * histogram
    assert uniformity_of(shared(uneven, 8), 1.0, 1.0).value == pytest.approx(1.0, abs=2e-3)


def test_two_strengths_have_the_uniformity_of_their_two_values() -> None:
    """Half of the surface has twice the strength of the rest: mean 1.5, deviation 0.5."""
    strong, weak = histogram_of((1.0, 2.0)), histogram_of((0.5 - 1e-9, 2.0))
    histogram = np.concatenate([np.tile(strong, (40, 1)), np.tile(weak, (40, 1))])
    found = uniformity_of(shared(histogram, 8), 1.0, 1.0)
    assert found.value == pytest.approx(1.0 - 1.0 / 3.0, abs=0.01)


@pytest.mark.parametrize("reachable", [0.9, 0.5])
def test_what_is_out_of_reach_has_no_strength(reachable: float) -> None:
    """S is 0 on a share 1 - r: the square of its relative spread is 1 / r - 1."""
    histogram = np.tile(histogram_of((1.0, 2.0)), (60, 1))
    found = uniformity_of(shared(histogram, 8), 1.0, reachable)
    assert found.value == pytest.approx(1.0 - np.sqrt(1.0 / reachable - 1.0))


def test_scatter_of_counts_is_not_taken_for_unevenness() -> None:
    """Dents of two sizes fall at random, as often everywhere: about 60 in a window."""
    rng, field = np.random.default_rng(6), plane_field()
    sizes = np.array([0.1e-3, 0.2e-3])
    replicas = [[plane_dents(rng, 7.5, sizes)] for _ in range(8)]
    found = intensity_uniformity(field, replicas, DENSITY)
    assert 0.97 < found.value <= 1.0
    assert found.high >= 1.0 - 1e-6
    assert found.half_width < 0.05


def test_places_of_two_strengths_are_told_from_scatter() -> None:
    rng, field = np.random.default_rng(7), plane_field()
    replicas = [[plane_dents(rng, 7.5, None)] for _ in range(8)]
    found = intensity_uniformity(field, replicas, DENSITY)
    # The windows over the line between the halves, a fifteenth of the plane, have both.
    assert abs(found.value - OF_HALVES) < found.half_width + 0.02
    more = [[plane_dents(rng, 15.0, None)] for _ in range(8)]
    assert intensity_uniformity(field, more, DENSITY).value == pytest.approx(found.value, abs=0.02)


def test_few_replicas_have_no_interval_and_no_dents_no_figure() -> None:
    rng, field = np.random.default_rng(8), plane_field()
    few = [[plane_dents(rng, 30.0, None)] for _ in range(MIN_BATCHES - 1)]
    found = intensity_uniformity(field, few, DENSITY)
    assert found.half_width == np.inf
    assert found.value == pytest.approx(OF_HALVES, abs=0.05)
    nothing = intensity_uniformity(field, [[no_hits()]] * 8, DENSITY)
    assert (nothing.value, nothing.half_width) == (0.0, np.inf)
