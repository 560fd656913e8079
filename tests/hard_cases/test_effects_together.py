"""Effects beside one another, against what mechanics says of the two together.

All in one combination of effects, which is compiled once (and is one of fuzzed_effects.FEW): what a
test does not want is there with numbers that do nothing. Steel balls of 3 mm that fly through one
another.
"""

import math

import numpy as np
import pytest
import trimesh

from sim_core import (
    Balls,
    Drag,
    Friction,
    Gravity,
    PartRotation,
    Physics,
    RandomPhase,
    Rest,
    Scene,
    TriangleMesh,
    Vibration,
)
from sim_core.effects.contact_mode import ASLEEP, SLIDING
from sim_core.effects.gravity import STANDARD as G
from sim_core.loop.simulate import Simulation
from sim_core.scene.invariants import energy
from tests.hard_cases.outcome import LOSSLESS
from tests.helpers.scenes.cavities import FLOOR, box_around
from tests.helpers.scenes.turning_parts import PART
from tests.sim_core.contact.test_pushed_by_part import HALF, WIDE, arrival, paddle

R = 1.5e-3
STICKS = 1e9  # mu
SMOOTH = (0.0, 0.0)
EVERYTHING = Physics(
    Gravity(),
    LOSSLESS,
    Vibration(FLOOR, 0.0, 20e3),
    Rest(1e-3, 0.0),
    PartRotation(PART, rpm=0.0),
    Friction((SMOOTH,) * 3, SMOOTH),
    RandomPhase(),
    None,
    Drag(1e-12, 1e-17),
)


def room(mesh: TriangleMesh) -> TriangleMesh:
    """The same, its ceiling the surface that could vibrate."""
    top = (mesh.corners[:, :, 2] == mesh.vertices[:, 2].max()).all(axis=1)
    return TriangleMesh(mesh.vertices, mesh.triangles, np.where(top, FLOOR, mesh.tags))


def rough(mu: float, beta0: float) -> Friction:
    return Friction(((mu, beta0),) * 3, (mu, beta0))


def shot(positions: object, velocities: object = 0.0, spins: object = 0.0) -> Balls:
    places = np.atleast_2d(np.array(positions, dtype=float))
    speeds, turns = (
        np.broadcast_to(np.array(x, dtype=float), places.shape) for x in (velocities, spins)
    )
    return Balls(places, speeds, 2 * R, spins=turns)


@pytest.mark.long
def test_a_ball_dropped_on_a_turntable_goes_round_with_two_sevenths_of_its_speed() -> None:
    """A ball that rolls on a turntable goes round with 2/7 of its angular speed (J. A. Burns, Am.
    J. Phys. 49 (1981) 56). In hops that last s, each of which ends in sticking: at hit k it is at r
    (1 + 2i/7 omega s)^k.
    """
    omega, drop, hops = 10.0, 2e-4, 60
    disk = trimesh.creation.cylinder(radius=0.03, height=0.004, sections=48)
    physics = EVERYTHING._replace(
        part_rotation=PartRotation(PART, rpm=60.0 * omega / math.tau), friction=rough(STICKS, 0.0)
    )
    first = math.sqrt(2.0 * drop / G)
    start = shot([0.015, 0.0, 0.002 + R + drop])
    run = Simulation(Scene(room(box_around(disk, 0.04)), start, physics, 2.0))
    for k in (0, 1, 7, hops):
        run.play((2 * k + 1) * first + 1e-9, record=False)
        x, y, _ = run.balls().positions[0]
        expected = 0.015 * (1.0 + 2j / 7.0 * omega * 2.0 * first) ** k
        np.testing.assert_allclose([x, y], [expected.real, expected.imag], atol=2e-9)
    assert np.angle(complex(x, y)) > 2.0  # carried along, not against
    assert run.state.counts[0] == hops + 1


@pytest.mark.parametrize("mu", [0.1, 0.4])
def test_a_ball_that_a_rough_paddle_pushes_slips_on_the_floor_until_it_rolls(mu: float) -> None:
    """The paddle's face passes the ball at omega times half its width, and rubs; then the floor
    takes 2/7 of it all.
    """
    x, y, omega, beta0 = 0.002, 0.012, 10.0, 0.5
    physics = EVERYTHING._replace(
        part_rotation=PartRotation(PART, rpm=60.0 * omega / math.tau), friction=rough(mu, beta0)
    )
    angle = arrival(x, y)
    out, along = (
        np.array([-np.sin(angle), np.cos(angle), 0.0]),
        np.array([np.cos(angle), np.sin(angle), 0.0]),
    )
    speed = omega * math.sqrt(x * x + y * y - (WIDE + R) ** 2)
    rub = min(
        mu * 2.0 * speed, 2.0 / 7.0 * (1.0 + beta0) * omega * WIDE
    )  # along the face, which moves inwards
    kicked = 2.0 * speed * out - rub * along
    rolls = 2.0 / 7.0 * np.linalg.norm(kicked) / (mu * G)
    run = Simulation(Scene(room(paddle()), shot([x, y, R - HALF]), physics, 1.0))
    run.play(angle / omega * (1.0 - 1e-9), record=False)
    assert run.state.contact is not None
    assert run.state.contact.mode[0] == ASLEEP
    run.play(angle / omega * (1.0 + 1e-9), record=False)
    np.testing.assert_allclose(run.balls().velocities[0], kicked, atol=1e-6)
    np.testing.assert_allclose(
        run.balls().spins[0], -2.5 / R * np.cross(out, -rub * along), atol=1e-6
    )  # type: ignore[index]
    where = angle / omega + 0.5 * rolls
    run.play(where, record=False)
    np.testing.assert_allclose(run.balls().velocities[0], 6.0 / 7.0 * kicked, rtol=1e-6, atol=1e-7)


HEAVY = Drag(density=50.0)


def test_air_does_not_wake_nor_slow_what_lies_or_rolls_on_the_floor() -> None:
    """It is left alone there, as drag.py says; and is not slowed afterwards for the time it has
    spent there.
    """
    physics = EVERYTHING._replace(drag=HEAVY, friction=rough(0.3, 0.0))
    speed = 0.05
    places = [[-0.018, 0.015, R - HALF], [0.0, 0.01, R - HALF]]
    start = shot(places, [[speed, 0.0, 0.0], [0.0] * 3], [[0.0, speed / R, 0.0], [0.0] * 3])
    run = Simulation(Scene(room(paddle()), start, physics, 1.0))
    run.play(0.01, record=False)
    before, events = run.balls(), run.state.counts.copy()
    run.play(0.5, record=False)
    assert run.state.contact is not None
    assert run.state.contact.mode.tolist() == [SLIDING, ASLEEP]
    assert (run.state.counts[:3] == events[:3]).all()
    np.testing.assert_allclose(run.balls().velocities[0], [speed, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(
        run.balls().positions[0, 0] - before.positions[0, 0], 0.49 * speed, atol=1e-9
    )
    np.testing.assert_array_equal(run.balls().positions[1], before.positions[1])
    assert (run.balls().velocities[1] == 0.0).all()


def test_balls_that_do_not_meet_rub_roll_and_rest_as_each_does_alone() -> None:
    rng = np.random.default_rng(4)
    law = ((0.7, 1.0),) * 3
    physics = EVERYTHING._replace(
        restitution=LOSSLESS._replace(surfaces=law),
        friction=rough(0.3, 0.4),
        drag=Drag(),
        part_rotation=PartRotation(PART, rpm=40.0),
    )
    places = rng.uniform([0.004, 0.004, -0.018], [0.018, 0.018, 0.018], (6, 3))
    speeds, turns = rng.normal(0.0, 0.4, (6, 3)), rng.normal(0.0, 200.0, (6, 3))
    mesh, duration = room(paddle()), 1.0

    def end(which: slice) -> Balls:
        run = Simulation(
            Scene(mesh, shot(places[which], speeds[which], turns[which]), physics, duration)
        )
        run.play(duration, record=False)
        return run.balls()

    together = end(slice(None))
    assert energy(together) < 0.2 * energy(shot(places, speeds, turns))
    for ball in range(6):
        alone = end(slice(ball, ball + 1))
        for name in ("positions", "velocities", "spins"):
            np.testing.assert_array_equal(getattr(alone, name)[0], getattr(together, name)[ball])
