"""Frames of a simulation, and the energies in them, where they have closed forms."""

import numpy as np
import pytest

from sim_core import Balls, Friction, Gravity, Physics, Scene, energies, simulate
from tests.helpers.scenes.cavities import box

DIAMETER = 3e-3
MASS = 7800.0 * np.pi / 6.0 * DIAMETER**3
ROOM = box((0.1, 0.1, 0.5))
PULL = Gravity(1.0, -2.0, -9.0)


def test_a_ball_in_free_fall_trades_height_for_speed() -> None:
    start, velocity = np.array([0.03, 0.07, 0.4]), np.array([0.1, 0.2, 1.0])
    balls = Balls([start], [velocity], DIAMETER)
    times = np.array([0.0, 0.0123, 0.02, 0.1, 0.13])  # two of them in the first window, one ends it
    frames = simulate(Scene(ROOM, balls, Physics(PULL), 0.2), frames=times).frames
    pull, t = np.array(PULL), times[:, None]
    np.testing.assert_allclose(frames.velocities[:, 0], velocity + pull * t, atol=1e-14)
    np.testing.assert_allclose(
        frames.positions[:, 0], start + velocity * t + 0.5 * pull * t**2, atol=1e-15
    )
    seen = energies(frames, balls, PULL)
    kinetic = 0.5 * MASS * np.square(velocity + pull * t).sum(axis=1)
    np.testing.assert_allclose(seen.translational, kinetic, rtol=1e-13)
    np.testing.assert_array_equal(seen.rotational, 0.0)
    np.testing.assert_allclose(seen.total, seen.total[0], rtol=1e-13)
    np.testing.assert_array_equal(energies(frames, balls).potential, 0.0)


@pytest.mark.long
def test_a_rough_elastic_bounce_turns_translation_into_spin() -> None:
    """With beta0 = 1 and no limit on friction, a solid sphere without spin that hits with u along
    the wall keeps 3/7 u and has the spin 10/7 u / R: energy is kept.
    """
    along, down = 2.0, 1.5
    balls = Balls([[0.02, 0.05, 0.01]], [[along, 0.0, -down]], DIAMETER, spins=np.zeros((1, 3)))
    physics = Physics(friction=Friction(((1e3, 1.0),) * 3, (0.0, 0.0)))
    frames = simulate(Scene(ROOM, balls, physics, 0.02), frames=[0.0, 0.02]).frames
    assert frames.spins is not None
    np.testing.assert_allclose(frames.velocities[1, 0], [3.0 / 7.0 * along, 0.0, down], atol=1e-14)
    spin = 10.0 / 7.0 * along / (0.5 * DIAMETER)
    np.testing.assert_allclose(frames.spins[1, 0], [0.0, spin, 0.0], atol=1e-11)
    seen = energies(frames, balls)
    turning = 0.2 * MASS * (0.5 * DIAMETER) ** 2 * spin**2
    assert seen.rotational == pytest.approx([0.0, turning], rel=1e-13)
    np.testing.assert_allclose(seen.total, seen.total[0], rtol=1e-13)
    assert simulate(Scene(ROOM, balls, physics, 0.02)).frames.spins.shape == (0, 1, 3)  # type: ignore[union-attr]


def test_balls_of_several_sizes_and_densities_have_their_own_energy() -> None:
    diameters, densities = np.array([2e-3, 3e-3]), np.array([7800.0, 2500.0])
    places, speeds = np.array([[0.02, 0.05, 0.1], [0.08, 0.05, 0.2]]), np.array([1.0, -3.0])
    balls = Balls(places, np.outer(speeds, [0.0, 0.6, 0.8]), diameters, densities)
    # with the log, the same machine code as in test_ball_sizes
    scene = Scene(ROOM, balls, Physics(PULL), 1e-3, record_collisions=True)
    seen = energies(simulate(scene, frames=[0.0]).frames, balls)
    mass = densities * np.pi / 6.0 * diameters**3
    assert seen.translational[0] == pytest.approx(0.5 * mass @ speeds**2, rel=1e-14)
