"""Peening strength of a place against Kirk's curve and closed forms."""

import numpy as np
import pytest
from scipy.optimize import brentq

from chamberopt.coverage.field.smooth_faces import Places
from chamberopt.coverage.field.windows import Windows
from chamberopt.coverage.part_impacts import Hits
from chamberopt.coverage.strength import (
    LEVELS,
    dent_rates,
    saturated_strength,
    strength_at,
    strength_histogram,
    strip_dents,
    time_near,
)
from chamberopt.design.almen_strip import strip_material
from tests.helpers.results.strength_histograms import histogram_of
from tests.helpers.synthetic import plate_design

DESIGN = plate_design()
DENSITY, STRIP = DESIGN.shot.density, strip_material(DESIGN.shot)


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


@pytest.mark.parametrize("ball", [0.5e-3, 3e-3])
def test_a_strip_is_dented_by_its_own_law(ball: float) -> None:
    """Whatever dent the part has; the ball's diameter comes from its energy and speed."""
    for speed in (2.0, 8.0):
        hits = hits_of(np.zeros(2, dtype=int), np.array([0.0, 1e-3]), ball, speed)
        dent, strength = strip_dents(hits, DENSITY, STRIP)
        e = STRIP.C0 * (speed / STRIP.v0_m_s) ** -0.25
        kirk = 1.278 * ball * ((1.0 - e * e) * DENSITY * speed**2 / STRIP.hardness) ** 0.25
        assert dent == pytest.approx(kirk, rel=1e-6)
        assert strength == pytest.approx(kirk**2 / ball, rel=1e-6)


def test_a_slow_ball_and_one_that_stands_still_leave_no_dent() -> None:
    for speed in (0.0, 0.9 * STRIP.v0_m_s):
        hits = hits_of(np.zeros(2, dtype=int), np.ones(2), 1e-3, speed)
        assert not np.any(strip_dents(hits, DENSITY, STRIP))


@pytest.mark.parametrize(
    ("material", "v0"), [("steel", 1.25), ("zirconia", 1.42), ("tungsten_carbide", 0.42)]
)
def test_the_yield_speed_of_a_strip_depends_on_the_shot(material: str, v0: float) -> None:
    """By hand, from Johnson's formula."""
    shot = DESIGN.shot.model_copy(update={"material": material})
    assert strip_material(shot).v0_m_s == pytest.approx(v0, rel=0.01)


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
        near = time_near(dent_rates(histogram), off * time)
        assert strength_at(dent_rates(histogram), near, 1.0) == pytest.approx(strength, rel=3e-3)


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
