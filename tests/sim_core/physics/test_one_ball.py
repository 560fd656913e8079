"""One ball, up and down: every impact time and speed has a closed form or a one-line recursion."""

import math

import numpy as np
import pytest

from sim_core import Balls, Gravity, Physics, Restitution, Scene, restitution_at, simulate
from sim_core.effects.gravity import STANDARD as G
from tests.helpers.scenes.cavities import CEILING, FLOOR, WEIGHTLESS, box

DIAMETER = 3e-3


def one_ball(z: float, vz: float) -> Balls:
    return Balls(np.array([[0.011, 0.013, z]]), np.array([[0.0, 0.0, vz]]), DIAMETER)


def test_between_plates_without_gravity_impacts_come_every_gap_over_speed() -> None:
    room = box((0.03, 0.03, 0.02))
    log = simulate(Scene(room, one_ball(0.01, 2.0), Physics(WEIGHTLESS), duration=1.0)).impacts
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
    log = simulate(
        Scene(box((0.03, 0.03, 0.2)), one_ball(height + DIAMETER / 2, 0.0), physics, 0.6)
    ).impacts
    first = math.sqrt(2 * height / G)
    speeds = G * first * e ** np.arange(len(log))
    times = first + np.concatenate([[0.0], np.cumsum(2 * speeds[1:] / G)])
    assert len(log) >= 5
    np.testing.assert_allclose(log.normal_speed, speeds, rtol=1e-12)
    np.testing.assert_allclose(log.time, times, rtol=0, atol=1e-13)


def test_the_papers_law_slows_a_ball_between_plates() -> None:
    c0, v0 = 0.9, 0.7
    physics = Physics(WEIGHTLESS, Restitution(((c0, v0),) * 3, (1.0, 1.0)))
    log = simulate(Scene(box((0.03, 0.03, 0.02)), one_ball(0.01, 10.0), physics, 0.3)).impacts
    speed = 10.0
    for seen in log.normal_speed:
        assert seen == pytest.approx(speed, rel=1e-12)
        speed *= c0 if speed < v0 else c0 * (speed / v0) ** -0.25
    assert log.normal_speed[-1] < v0 < log.normal_speed[0]
    some = np.array([0.1, 0.7, 11.2])
    np.testing.assert_allclose(restitution_at(some, (c0, v0)), [c0, c0, c0 / 2])
