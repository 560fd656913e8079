"""One ball, up and down: every impact time and speed has a closed form or a one-line recursion."""

import math

import numpy as np
import pytest

from sim_core import Balls, Gravity, Physics, Restitution, Scene, Vibration, restitution_at, simulate
from tests.cavities import CEILING, FLOOR, box

DIAMETER = 3e-3
G = 9.80665


def one_ball(z: float, vz: float) -> Balls:
    return Balls(np.array([[0.011, 0.013, z]]), np.array([[0.0, 0.0, vz]]), DIAMETER)


def test_between_plates_without_gravity_impacts_come_every_gap_over_speed() -> None:
    room = box((0.03, 0.03, 0.02))
    log = simulate(Scene(room, one_ball(0.01, 2.0), Physics(), duration=1.0)).impacts
    gap = 0.02 - DIAMETER
    expected = (0.02 - DIAMETER / 2 - 0.01) / 2.0 + np.arange(len(log)) * gap / 2.0
    assert len(log) == 1 + int((1.0 - expected[0]) / (gap / 2.0))
    np.testing.assert_allclose(log.time, expected, rtol=0, atol=1e-13)
    np.testing.assert_array_equal(log.normal_speed, 2.0)
    tags = room.tags[log.triangle]
    assert (tags[::2] == CEILING).all()
    assert (tags[1::2] == FLOOR).all()


def test_under_gravity_a_drop_bounces_as_v_over_g() -> None:
    e, height = 0.8, 0.05
    physics = Physics(Gravity(), Restitution(((e, 100.0),) * 3, (1.0, 1.0)))
    log = simulate(Scene(box((0.03, 0.03, 0.2)), one_ball(height + DIAMETER / 2, 0.0), physics, 0.6)).impacts
    first = math.sqrt(2 * height / G)
    speeds = G * first * e ** np.arange(len(log))
    times = first + np.concatenate([[0.0], np.cumsum(2 * speeds[1:] / G)])
    assert len(log) >= 5
    np.testing.assert_allclose(log.normal_speed, speeds, rtol=1e-12)
    np.testing.assert_allclose(log.time, times, rtol=0, atol=1e-13)


def test_the_papers_law_slows_a_ball_between_plates() -> None:
    c0, v0 = 0.9, 0.7
    physics = Physics(None, Restitution(((c0, v0),) * 3, (1.0, 1.0)))
    log = simulate(Scene(box((0.03, 0.03, 0.02)), one_ball(0.01, 10.0), physics, 0.3)).impacts
    speed = 10.0
    for seen in log.normal_speed:
        assert seen == pytest.approx(speed, rel=1e-12)
        speed *= c0 if speed < v0 else c0 * (speed / v0) ** -0.25
    assert log.normal_speed[-1] < v0 < log.normal_speed[0]
    np.testing.assert_allclose(restitution_at(np.array([0.1, 0.7, 11.2]), c0, v0), [c0, c0, c0 / 2])


def reference_on_a_shaking_floor(
    z: float, v: float, duration: float, vibration: Vibration, ceiling: float, e: tuple[float, float]
) -> list[tuple[float, float]]:
    """(time, relative speed) of impacts on floor and ceiling, by fine marching and bisection; e = (floor, ceiling)."""
    omega, swing, phase = 2 * math.pi * vibration.frequency, vibration.amplitude, vibration.phase
    r = DIAMETER / 2

    def height(z0: float, v0: float, s: float) -> float:
        return z0 + v0 * s - 0.5 * G * s * s

    def floor(t: float) -> float:
        return swing * math.sin(omega * t + phase)

    t, hits = 0.0, []
    step = 1.0 / vibration.frequency / 400.0
    while True:
        s = 0.0
        left = False  # free of the surface it has just hit
        while True:
            before, s = s, s + step
            below = height(z, v, s) - r - floor(t + s)
            above = ceiling - r - height(z, v, s)
            if t + s > duration:
                return hits
            if below > 1e-12 and above > 1e-12:
                left = True
                continue
            which = 0 if below <= 1e-12 else 1
            if not left and before > 0.0:
                continue
            if not left:
                continue
            low, high = before, s
            for _ in range(80):
                mid = 0.5 * (low + high)
                gap = height(z, v, mid) - r - floor(t + mid) if which == 0 else ceiling - r - height(z, v, mid)
                low, high = (mid, high) if gap > 0.0 else (low, mid)
            break
        z, v, t = height(z, v, high), v - G * high, t + high
        surface = swing * omega * math.cos(omega * t + phase) if which == 0 else 0.0
        hits.append((t, abs(v - surface)))
        v = surface - e[which] * (v - surface)


@pytest.mark.parametrize("e", [1.0, 0.9, 0.6, 0.3])
def test_between_a_shaking_floor_and_a_ceiling_against_marching(e: float) -> None:
    vibration = Vibration(FLOOR, 25e-6, 20e3, phase=0.7)
    physics = Physics(Gravity(), Restitution(((e, 1e3),) * 3, (1.0, 1.0), elastic_below=0.0), vibration)
    log = simulate(Scene(box((0.03, 0.03, 0.02)), one_ball(0.009, -3.0), physics, 0.06)).impacts
    expected = reference_on_a_shaking_floor(0.009, -3.0, 0.06, vibration, 0.02, (e, e))
    # the map is chaotic: a rounding error grows by about 1e3 a floor hit, so ten impacts are compared, not thousands
    for k in range(min(8, len(expected))):
        assert log.time[k] == pytest.approx(expected[k][0], abs=1e-12 * 100.0**k), k
        assert log.normal_speed[k] == pytest.approx(expected[k][1], abs=1e-8 * 100.0**k), k
