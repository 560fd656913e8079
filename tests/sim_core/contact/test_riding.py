"""A ball that sticks to a shaken plate, against the map of a bouncing ball that sticks.

The map is that of J. M. Luck & A. Mehta, Phys. Rev. E 48 (1993) 3988, here in plain Python and in
the units of tests/helpers/scenes/shaken_plate.py. Bounces are followed until they are slower than
CAPTURE; then the ball is on the plate, until the plate's acceleration is -g.
"""

import math
from collections.abc import Iterator
from itertools import takewhile

import numpy as np
import pytest

from sim_core import (
    Balls,
    Friction,
    Gravity,
    Physics,
    RandomPhase,
    Rest,
    Restitution,
    Scene,
    SceneError,
    Vibration,
    simulate,
)
from sim_core.contact.riding import AT_ONCE, time_to_let_go
from sim_core.numerics.roots import NEVER
from tests.helpers.scenes.cavities import box, cylinder
from tests.helpers.scenes.shaken_plate import (
    CAPTURE,
    DIAMETER,
    FAST,
    G,
    first_doubling,
    first_locking,
    impacts,
    in_step,
    plate,
)


def landing(gamma: float, phase: float, height: float, speed: float) -> float:
    """Phase at which a ball meets the plate again that has left it at ``phase``."""

    def gap(s: float) -> float:
        return height + speed * s - 0.5 * s * s - gamma * math.sin(phase + s)

    low, high = 1e-7, 1e-3
    while gap(high) > 0.0:
        low, high = high, high + 1e-3
    while (middle := 0.5 * (low + high)) not in (low, high):
        low, high = (middle, high) if gap(middle) > 0.0 else (low, middle)
    return phase + high


def small_bounce(gamma: float, phase: float, speed: float) -> float:
    """Duration of a bounce that leaves the plate with a small speed relative to it.

    From the series of the gap, of which rounding leaves nothing.
    """
    pressing = 1.0 - gamma * math.sin(phase)
    third, fourth = gamma * math.cos(phase), -gamma * math.sin(phase)
    s = 2.0 * speed / pressing
    for _ in range(50):
        s = 2.0 * (speed + third * s * s / 6.0 + fourth * s**3 / 24.0) / pressing
    return s


def the_map(gamma: float, e: float, start: float, phase: float) -> Iterator[tuple[float, float]]:
    """Phase and speed of one impact after the other, of a ball dropped from ``start``."""
    speed = 0.0
    after = landing(gamma, phase, start, speed)
    while True:
        speed -= after - phase
        phase, approach = after, gamma * math.cos(after) - speed
        yield phase, approach
        height, rebound = gamma * math.sin(phase), e * approach
        pressing = 1.0 - height
        if pressing > 0.0 and rebound < CAPTURE:
            if gamma <= 1.0:
                return
            phase += (math.asin(1.0 / gamma) - phase) % math.tau
            height, rebound, pressing = gamma * math.sin(phase), 0.0, 0.0
        speed = gamma * math.cos(phase) + rebound
        if 0.0 < rebound < 1e-3 * pressing**2:
            after = phase + small_bounce(gamma, phase, rebound)
        else:
            after = landing(gamma, phase, height, speed)


def mapped(vibration: Vibration, e: float, start: float, periods: float) -> np.ndarray:
    """What ``impacts`` returns, by the map."""
    gamma = vibration.amplitude * (math.tau * vibration.frequency) ** 2 / G
    end = vibration.phase + math.tau * periods
    hits = list(takewhile(lambda hit: hit[0] < end, the_map(gamma, e, start, vibration.phase)))
    return np.array([hit for hit in hits if hit[1] > FAST])


GAMMAS = (0.8, 1.2, 1.5, 1.7, 1.77, 1.9, 2.0, 3.0, 4.6, 5.0)
CASES = [
    *((gamma, 0.5, 11.5) for gamma in GAMMAS),
    *((gamma, 0.5, 0.4) for gamma in (0.8, 2.0, 4.6)),
    *(pytest.param(gamma, 0.5, 60.0, marks=pytest.mark.long) for gamma in (0.8, 2.0, 4.6)),
    *((gamma, 0.0, 11.5) for gamma in (1.2, 2.5, 4.6)),
    (1.2, 0.8, 11.5),
]


@pytest.mark.parametrize(("gamma", "e", "frequency"), CASES)
def test_every_impact_is_that_of_the_map(gamma: float, e: float, frequency: float) -> None:
    """As long as two maps whose e differ by 1e-8 say the same: some flights are chaotic."""
    vibration, start = plate(gamma, frequency), gamma + 0.3
    expected, beside = (mapped(vibration, near, start, 60) for near in (e, e + 1e-8))
    seen = impacts(vibration, e, start, 60)
    count = min(len(expected), len(beside))
    spread = np.maximum.accumulate(np.abs(expected[:count] - beside[:count]).max(axis=1))
    together = int((spread < 1e-3).sum())
    assert together > 8
    assert len(seen) >= together  # it does not stick before the map does
    off = np.abs(seen[:together] - expected[:together]).max(axis=1)
    assert (off < 1e-7 + 10.0 * spread[:together]).all()
    if together == len(expected):
        assert len(seen) == together


@pytest.mark.parametrize("e", [0.5, 0.7])
def test_locking_and_period_doubling_are_where_theory_has_them(e: float) -> None:
    first, last = first_locking(e), first_doubling(e)
    for gamma in (1.05 * first, 0.98 * last):
        phases = in_step(gamma, e, 400)[-16:, 0] % math.tau
        np.testing.assert_allclose(phases, math.acos(first / gamma), rtol=0.0, atol=1e-6)
    doubled = in_step(1.01 * last, e, 1000)[-16:, 0] % math.tau
    np.testing.assert_allclose(doubled[2:], doubled[:-2], rtol=0.0, atol=1e-6)
    assert abs(doubled[1] - doubled[0]) > 0.05


def test_below_the_weight_a_ball_rides_for_ever() -> None:
    vibration = plate(0.95, 11.5)
    room = box((0.01, 0.01, 0.06))
    ball = Balls(np.array([[4e-3, 5e-3, 0.02]]), np.zeros((1, 3)), DIAMETER)
    law = Restitution(((0.5, 1e9),) * 3, (0.5, 1e9))
    physics = Physics(Gravity(), law, vibration, Rest(on_vibrating=True))
    frames = np.linspace(1.0, 3.0, 500)
    result = simulate(Scene(room, ball, physics, 3.0), frames)
    floor = vibration.amplitude * np.sin(math.tau * 11.5 * frames)
    np.testing.assert_allclose(
        result.frames.positions[:, 0, 2] - 0.5 * DIAMETER, floor, rtol=0.0, atol=2e-11
    )
    assert result.impacts.time.max() < 1.0
    assert result.collisions.sonotrode < 50


def test_a_riding_ball_slides_over_the_plate_and_its_seams() -> None:
    """From side to side, without friction, also on a plate that moves at a slant to its face."""
    vibration = plate(0.9, 9.0)._replace(axis=(0.0, 0.3, 1.0))
    room = box((0.03, 0.02, 0.05))
    start = np.array([[4e-3, 5e-3, 0.5 * DIAMETER + 2e-3]])
    ball = Balls(start, np.array([[0.11, 0.07, 0.0]]), DIAMETER)
    sides = Restitution(((1.0, 1e9), (0.4, 1e9), (1.0, 1e9)), (1.0, 1e9))
    frames = np.linspace(1.0, 4.0, 300)
    physics = Physics(Gravity(), sides, vibration, Rest(on_vibrating=True))
    result = simulate(Scene(room, ball, physics, 4.0), frames)
    up = vibration.amplitude / math.hypot(0.3, 1.0)
    np.testing.assert_allclose(
        result.frames.positions[:, 0, 2] - 0.5 * DIAMETER,
        up * np.sin(math.tau * 9.0 * frames),
        rtol=0.0,
        atol=2e-11,
    )
    speeds = np.abs(result.balls.velocities[0, :2])
    np.testing.assert_allclose(speeds, (0.11, 0.07), rtol=1e-9)
    flown = np.array([0.11, 0.07]) * 4.0 + start[0, :2] - 0.5 * DIAMETER
    width = np.array([0.03, 0.02]) - DIAMETER
    folded = np.abs((flown + width) % (2.0 * width) - width)
    np.testing.assert_allclose(
        result.balls.positions[0, :2] - 0.5 * DIAMETER, folded, rtol=0.0, atol=1e-8
    )


def test_a_riding_ball_goes_on_from_face_to_face_of_a_plate() -> None:
    """The floor of a cylinder is many faces; elastic sides keep the speed along it."""
    vibration = plate(0.9, 9.0)
    ball = Balls(np.array([[1e-3, -2e-3, 4e-3]]), np.array([[0.11, 0.07, 0.0]]), DIAMETER)
    law = Restitution(((1.0, 1e9), (0.4, 1e9), (1.0, 1e9)), (1.0, 1e9))
    frames = np.linspace(1.0, 3.0, 300)
    physics = Physics(Gravity(), law, vibration, Rest(on_vibrating=True))
    result = simulate(Scene(cylinder(0.015, 0.05), ball, physics, 3.0), frames)
    floor = vibration.amplitude * np.sin(math.tau * 9.0 * frames)
    np.testing.assert_allclose(
        result.frames.positions[:, 0, 2] - 0.5 * DIAMETER, floor, rtol=0.0, atol=2e-11
    )
    assert np.hypot(*result.balls.velocities[0, :2]) == pytest.approx(math.hypot(0.11, 0.07))


def test_a_ball_that_falls_on_one_that_rides_comes_to_rest_on_it() -> None:
    vibration = plate(0.6, 11.5)
    room = box((0.0032, 0.0032, 0.03))
    places = np.array([[1.6e-3, 1.6e-3, 4e-3], [1.6e-3, 1.6e-3, 9e-3]])
    law = Restitution(((0.5, 1e9),) * 3, (0.5, 1e9))
    physics = Physics(Gravity(), law, vibration, Rest(on_vibrating=True))
    scene = Scene(room, Balls(places, np.zeros((2, 3)), DIAMETER), physics, 2.0)
    result = simulate(scene, np.linspace(1.5, 2.0, 200))
    low, high = result.frames.positions[:, 0, 2], result.frames.positions[:, 1, 2]
    floor = vibration.amplitude * np.sin(math.tau * 11.5 * np.linspace(1.5, 2.0, 200))
    assert np.abs(low - floor - 0.5 * DIAMETER).max() < 2e-5
    assert (high - low - DIAMETER > -1e-12).all()
    assert (high - low - DIAMETER).max() < 5e-5


@pytest.mark.parametrize(("weight", "strength"), [(1.0, 2.0), (1.0, 1.0), (-0.5, 2.0), (-2.0, 1.0)])
def test_time_to_let_go_is_where_a_scan_has_it(weight: float, strength: float) -> None:
    omega = 3.0
    for angle in np.linspace(-7.0, 90.0, 501):
        presses = strength * np.sin(angle + np.linspace(0.0, 4.0 * math.pi, 40_001)) < weight
        expected = NEVER if presses.all() else 4.0 * math.pi / 40_000 / omega * presses.argmin()
        found = time_to_let_go(weight, strength, omega, angle)
        if expected == NEVER or strength <= weight:
            assert found == NEVER
        else:
            assert found == pytest.approx(expected, abs=4e-4 / omega + AT_ONCE)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"rest": Rest(on_vibrating=1)}, "rest.on_vibrating is 1: give True or False"),
        ({"friction": Friction(((0.3, 0.2),) * 3, (0.3, 0.2))}, "physics.friction is given"),
        ({"random_phase": RandomPhase()}, "physics.random_phase is given"),
    ],
)
def test_what_is_not_supported_is_refused(more: dict[str, object], message: str) -> None:
    ball = Balls(np.array([[5e-3, 5e-3, 5e-3]]), np.zeros((1, 3)), DIAMETER)
    physics = Physics(Gravity(), None, plate(0.5, 50.0), Rest(on_vibrating=True))
    with pytest.raises(SceneError, match=message):
        Scene(box((0.01, 0.01, 0.02)), ball, physics._replace(**more), 1.0)
