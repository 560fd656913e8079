"""Stops, turns and lift-off of a sliding ball against closed forms."""

import math

import numpy as np
import pytest

from sim_core import Scene, simulate
from sim_core.contact.path_end import MAX_TURN
from sim_core.effects.gravity import STANDARD as G
from tests.helpers.scenes.cavities import box
from tests.helpers.scenes.contact_mode import R, energies, film, physics, shot, slope
from tests.helpers.scenes.terrain import profile


def test_resistance_stops_a_sliding_ball_and_holds_it_on_a_gentle_slope() -> None:
    """v²/(2 resistance g) on the level; on a slope of tan < resistance it never starts."""
    v, resistance = 0.3, 0.4
    result = simulate(
        Scene(
            box((0.1, 0.02, 0.02)),
            shot([0.01, 0.01, R], [v, 0.0, 0.0]),
            physics(0.8, resistance),
            1.0,
        )
    )
    assert result.balls.positions[0, 0] - 0.01 == pytest.approx(
        v**2 / (2.0 * resistance * G), rel=1e-6
    )
    assert result.resting.since[0] == pytest.approx(v / (resistance * G), rel=1e-6)
    normal, down = slope(20.0)
    x = np.array([0.0, 0.1])
    ramp = profile(x, -math.tan(math.radians(20.0)) * x, 0.01, 0.05)
    start = 0.05 * down + (R + 1e-9) * normal
    for resistance, still in ((0.37, True), (0.36, False)):  # tan 20° = 0.364
        result = simulate(Scene(ramp, shot(start), physics(0.8, resistance), 0.2))
        assert (len(result.resting) == 1) is still


@pytest.mark.parametrize(
    "speed", [0.4, 4.0]
)  # the faster turns by less than MAX_TURN while it is searched in one piece
def test_resistance_is_against_the_motion_of_a_ball_that_turns_downhill(speed: float) -> None:
    """Thrown across a slope, against small steps of v' = g sin - resistance g cos v/|v|."""
    resistance, degrees, until = 0.25, 20.0, 0.3
    normal, down = slope(degrees)
    x = np.array([0.0, 0.5])
    ramp = profile(x, -math.tan(math.radians(degrees)) * x, 0.7 * speed, 0.05)
    start, v = 0.02 / down[0] * down + R * normal, np.array([0.0, speed, 0.0])
    _, frames = film(ramp, shot(start, v), physics(resistance=resistance), until, 10)
    step, place, brake = 1e-5, start.copy(), resistance * G * math.cos(math.radians(degrees))
    for _ in range(round(until / step)):
        place += step * v
        v = v + step * (G * math.sin(math.radians(degrees)) * down - brake * v / np.linalg.norm(v))
    lag = 0.5 * MAX_TURN * brake  # the force's direction is old by TURN at most
    np.testing.assert_allclose(frames[-1].positions[0], place, atol=0.5 * lag * until**2)
    np.testing.assert_allclose(frames[-1].velocities[0], v, atol=lag * until)


def test_it_lifts_off_at_the_ramps_end() -> None:
    """A parabola from the edge with the speed of the slide, 1.5 overlaps (15 nm) past the edge."""
    normal, down = slope(20.0)
    edge = 0.1 / down[0]
    z = -0.1 * math.tan(math.radians(20.0))
    cliff = profile(
        np.array([0.0, 0.1, 0.105, 0.3]), np.array([0.0, z, z - 0.05, z - 0.05]), 0.02, 0.05
    )
    start, push, length, after = (
        0.02 * down + R * normal,
        G * math.sin(math.radians(20.0)),
        edge - 0.02,
        0.05,
    )
    slide = math.sqrt(2.0 * length / push)
    balls = simulate(Scene(cliff, shot(start), physics(), slide + after)).balls
    flight = down * push * slide * after + 0.5 * after**2 * np.array([0.0, 0.0, -G])
    np.testing.assert_allclose(balls.positions[0], start + down * length + flight, atol=2e-8)


@pytest.mark.parametrize("speed", [0.002, 0.05, 0.1])
def test_slowly_over_an_edge_it_rolls_until_it_leaves_it(speed: float) -> None:
    """Round an edge of radius R a point leaves where cos a = (2 + v²/(g R))/3.

    Its speed is then v_x = sqrt(g R) cos^(3/2) a.

    The arc is taken in steps of 0.004 rad.
    """
    x = np.array([0.0, 0.1, 0.1 + 1e-6, 0.4])
    cliff = profile(x, np.array([0.0, 0.0, -0.05, -0.05]), 0.02, 0.05)
    _, frames = film(
        cliff, shot([0.0999, 0.0, R], [speed, 0.0, 0.0]), physics(), 1e-4 / speed + 0.06, 60
    )
    leaves = min(1.0, (2.0 + speed**2 / (G * R)) / 3.0)
    assert (np.diff(energies(frames)) < 1e-12).all()
    end = frames[-1]
    if end.positions[0, 2] > -0.05 + R + 1e-3:  # in flight, not down yet
        assert end.velocities[0, 0] == pytest.approx(math.sqrt(G * R) * leaves**1.5, rel=0.03)
