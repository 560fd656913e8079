"""A ball in an analytical cylinder: seen from above it flies along chords of a circle, whatever
gravity does.

At radius R - r each chord is as long as the last, 2 (R - r) sin(alpha) for a ball that leaves the
side at the angle alpha to it; angular momentum about the axis is kept. A polygon of a mesh has no
such orbit.
"""

import math

import numpy as np
import pytest

from sim_core import (
    Balls,
    Gravity,
    ImpactLog,
    Physics,
    Restitution,
    Scene,
    Vibration,
    cylinder_cavity,
    simulate,
)
from sim_core.effects.gravity import STANDARD as G
from sim_core.geometry.analytic import CEILING, FLOOR, SIDE
from sim_core.impulses.collision import RECONTACT_ANGLE
from tests.helpers.scenes.cavities import ELASTIC

# the same machine code as in the analytical chambers that shake
STILL = Vibration(1, 0.0, 20e3)
RADIUS, HEIGHT, DIAMETER = 0.035, 0.02, 3e-3
REACH = RADIUS - 0.5 * DIAMETER
CENTRE = np.array([0.3, -0.2])
ROOM = cylinder_cavity(2.0 * RADIUS, 0.0, HEIGHT, (1, 0, 2), (0.3, -0.2))


def flown(
    start: tuple[float, float, float], velocity: tuple[float, float, float], duration: float
) -> ImpactLog:
    """Of one ball that starts so far from the axis, and so high [m]."""
    place = np.array([[*CENTRE, 0.0]]) + np.array(start)
    balls = Balls(place, np.array([velocity]), DIAMETER)
    return simulate(Scene(ROOM, balls, Physics(Gravity(), ELASTIC, STILL), duration)).impacts


def sides(log: ImpactLog) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times (n,), places from the axis (n, 2) and velocities (n, 2), seen from above, of impacts on
    the round side.
    """
    own = log.triangle == SIDE
    return log.time[own], log.position[own, :2] - CENTRE, log.velocity[own, :2]


@pytest.mark.long
@pytest.mark.parametrize("alpha", [1.5, 0.7, 0.05, 1e-3])
def test_circling_it_hits_at_even_times(alpha: float) -> None:
    speed = 3.0
    period = 2.0 * REACH * math.sin(alpha) / speed
    start, way = (0.0, REACH * math.cos(alpha), 0.01), (speed, 0.0, 0.0)  # the middle of a chord
    log = flown(start, way, 200.4 * period)
    time, place, velocity = sides(log)
    np.testing.assert_allclose(time, (0.5 + np.arange(200)) * period, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(np.hypot(*place.T), REACH, rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(
        log.normal_speed[log.triangle == SIDE], speed * math.sin(alpha), rtol=1e-9
    )
    momentum = place[:, 0] * velocity[:, 1] - place[:, 1] * velocity[:, 0]
    np.testing.assert_allclose(momentum, -start[1] * speed, rtol=1e-12)
    angle = np.unwrap(np.arctan2(*place.T))
    np.testing.assert_allclose(np.diff(angle), 2.0 * alpha, rtol=0.0, atol=1e-9)


def test_up_and_down_it_bounces_as_if_there_were_no_side() -> None:
    """Between floor and ceiling under gravity, elastic: impacts alternate with the times of the
    closed form.
    """
    up = 2.0
    log = flown((0.01, 0.0, 0.5 * DIAMETER + 0.001), (1.3, 0.4, up), 0.5)
    bounces = log.triangle != SIDE
    height = HEIGHT - DIAMETER
    ground = math.sqrt(up**2 + 2.0 * G * 0.001)
    top = math.sqrt(ground**2 - 2.0 * G * height)
    rise = (ground - top) / G
    first = (up - top) / G
    times = first + rise * np.arange(bounces.sum())
    np.testing.assert_allclose(log.time[bounces], times, rtol=0.0, atol=1e-12)
    np.testing.assert_array_equal(log.triangle[bounces][:4], [CEILING, FLOOR, CEILING, FLOOR])
    assert (log.triangle == SIDE).sum() > 5


def test_along_a_diameter_through_the_axis() -> None:
    time, place, _ = sides(flown((0.0, 0.0, 0.01), (0.0, 2.0, 0.0), 0.2))
    np.testing.assert_allclose(
        time, (0.5 + np.arange(len(time))) * 2.0 * REACH / 2.0, rtol=0.0, atol=1e-13
    )
    np.testing.assert_array_equal(np.sign(place[:, 1])[:4], [1.0, -1.0, 1.0, -1.0])


@pytest.mark.parametrize("outward", [1.0, -1.0])
def test_a_ball_that_starts_in_contact(outward: float) -> None:
    """Going out it is in contact now; coming back it crosses first."""
    speed = 1.5
    time, _, _ = sides(flown((REACH, 0.0, 0.01), (outward * speed, 0.0, 0.0), 0.15))
    first = 0.0 if outward > 0.0 else 2.0 * REACH / speed
    np.testing.assert_allclose(
        time, first + np.arange(len(time)) * 2.0 * REACH / speed, rtol=0.0, atol=1e-13
    )


@pytest.mark.parametrize("off", [0.0, 1e-9, -1e-9])
def test_sliding_along_the_side_it_circles_at_its_own_speed(off: float) -> None:
    """Thrown along the side: hops of 2 REACH sin(HOP), each turning it by 2 HOP; the chord is
    shorter than the arc.
    """
    speed = 0.8
    time, place, velocity = sides(flown((REACH, 0.0, 0.01), (off, speed, 0.0), 0.1))
    np.testing.assert_allclose(np.hypot(*place.T), REACH, rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(np.hypot(*velocity.T), speed, rtol=1e-12)
    angle = np.unwrap(np.arctan2(place[:, 1], place[:, 0]))
    np.testing.assert_allclose(angle, speed * time / REACH, rtol=1e-6, atol=3.0 * RECONTACT_ANGLE)
    assert len(time) == pytest.approx(0.1 * speed / (2.0 * REACH * RECONTACT_ANGLE), rel=0.01)


def test_restitution_lets_it_slide_and_takes_no_more_speed() -> None:
    """Inelastic collapse: normal speeds fall as e^n, each hop is shorter by e, and after a finite
    time it slides.
    """
    e, along, normal = 0.5, 1.0, 0.2
    law = Restitution(((1.0, 100.0), (1.0, 100.0), (e, 100.0)), (1.0, 1.0), elastic_below=0.0)
    physics = Physics(Gravity(), law, STILL)
    balls = Balls(
        np.array([[CENTRE[0] + REACH, CENTRE[1], 0.01]]), np.array([[normal, along, 0.0]]), DIAMETER
    )
    end = simulate(Scene(ROOM, balls, physics, 0.1))
    assert np.hypot(*end.balls.velocities[0, :2]) == pytest.approx(along, rel=1e-6)
    round_side = end.impacts.triangle == SIDE
    np.testing.assert_allclose(
        end.impacts.normal_speed[round_side][:5], normal * e ** np.arange(5.0), rtol=1e-9
    )
    collapsed = 2.0 * REACH / along**2 * normal * e / (1.0 - e)  # each hop lasts 2 REACH v_n / v²
    assert round_side.sum() == pytest.approx(
        (0.1 - collapsed) * along / (2.0 * REACH * RECONTACT_ANGLE), rel=0.01
    )


def test_along_the_axis_it_never_meets_the_side() -> None:
    log = flown((0.02, 0.0, 0.01), (0.0, 0.0, 1.0), 0.3)
    assert len(log) > 10
    assert (log.triangle != SIDE).all()
