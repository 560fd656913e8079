"""Collisions of balls with one another, logged on request."""

import math
from dataclasses import replace

import numpy as np
import pytest

from sim_core import Balls, Gravity, Physics, Rest, Restitution, Scene, SceneError, simulate
from sim_core.effects.gravity import STANDARD
from sim_core.loop.impact_log import BUFFER_SIZE
from sim_core.loop.simulate import Simulation
from tests.helpers.scenes.cavities import ELASTIC, WEIGHTLESS, box
from tests.helpers.scenes.gas import lattice_gas

ROOM = box((0.1, 0.1, 0.1))


@pytest.mark.parametrize("rest", [None, pytest.param(Rest(), marks=pytest.mark.long)])
def test_two_balls_meet_where_and_when_they_must(rest: Rest | None) -> None:
    """Both fall alike, so that they meet as without gravity, lower down: in contact mode too.

    The touching point divides the line of centres as the radii do.
    """
    radii = np.array([1e-3, 2e-3]) if rest is None else np.array([1.5e-3, 1.5e-3])
    reach, miss = radii.sum(), 0.5e-3
    places = np.array([[0.03, 0.05, 0.09], [0.07, 0.05 + miss, 0.09]])
    balls = Balls(places, np.array([[3.0, 0, 0], [-1.0, 0, 0]]), 2.0 * radii)
    scene = Scene(ROOM, balls, Physics(Gravity(), rest=rest), 0.02, record_collisions=True)
    log = simulate(scene).ball_collisions
    assert log is not None
    assert len(log) == 1
    time = (0.04 - math.sqrt(reach**2 - miss**2)) / 4.0
    normal = np.array([math.sqrt(reach**2 - miss**2), miss, 0.0]) / reach
    sign = 1.0 if log.one[0] == 0 else -1.0
    fallen = np.array([0.0, 0.0, -0.5 * STANDARD * time**2])
    first = places[0] + np.array([3.0 * time, 0.0, 0.0]) + fallen
    assert {int(log.one[0]), int(log.two[0])} == {0, 1}
    np.testing.assert_allclose(log.time, [time], atol=1e-15)
    np.testing.assert_allclose(log.normal[0], sign * normal, atol=1e-12)
    np.testing.assert_allclose(log.position[0], first + radii[0] * normal, atol=1e-14)
    np.testing.assert_allclose(log.velocity[0], [-4.0 * sign, 0.0, 0.0], atol=1e-14)
    np.testing.assert_allclose(log.normal_speed, [4.0 * normal[0]], rtol=1e-12)


def test_every_collision_of_a_gas_is_logged_once_and_the_log_changes_no_bit() -> None:
    """The speeds at which pairs of an ideal gas meet have the mean sqrt(π kT), and their square
    4 kT, and normals have no direction: their components' squares average 1/3.

    Chapman & Cowling, The Mathematical Theory of Non-uniform Gases, 3rd ed. (1970), section 5.21.
    """
    gas, effects = lattice_gas(8, 0.1, seed=2), Physics(WEIGHTLESS, ELASTIC)
    plain = Scene(gas.room, gas.balls, effects, 0.5, warmup=0.1, record=())
    logged = replace(plain, record_collisions=True)
    without, result = simulate(plain), simulate(logged)
    assert without.ball_collisions is None
    np.testing.assert_array_equal(without.balls.positions, result.balls.positions)
    np.testing.assert_array_equal(without.balls.velocities, result.balls.velocities)
    assert without.collisions == result.collisions
    log = result.ball_collisions
    assert log is not None
    warm = simulate(Scene(gas.room, gas.balls, effects, 0.1, record=())).collisions.balls
    assert len(log) == result.collisions.balls - warm > BUFFER_SIZE
    assert (np.diff(log.time) >= 0.0).all()
    assert 0.0 <= log.time[0] < log.time[-1] <= 0.5
    np.testing.assert_allclose(np.linalg.norm(log.normal, axis=1), 1.0, rtol=1e-13)
    np.testing.assert_allclose(
        -np.einsum("ij,ij->i", log.normal, log.velocity), log.normal_speed, rtol=1e-9
    )
    error = 5.0 / math.sqrt(len(log))
    assert log.normal_speed.mean() == pytest.approx(math.sqrt(math.pi * gas.kt), rel=error)
    assert np.square(log.normal_speed).mean() == pytest.approx(4.0 * gas.kt, rel=error)
    np.testing.assert_allclose(np.square(log.normal).mean(axis=0), 1.0 / 3.0, rtol=error)


def test_the_log_adds_up_to_the_change_of_velocity() -> None:
    """Each collision of equal balls changes both velocities by (1 + e)/2 of the normal speed."""
    e, rng = 0.7, np.random.default_rng(3)
    places = np.stack(np.meshgrid(*[np.linspace(0.03, 0.07, 4)] * 3), axis=-1).reshape(-1, 3)
    balls = Balls(places, 0.2 * rng.normal(size=places.shape), 0.01)
    physics = Physics(WEIGHTLESS, Restitution(((1.0, 1.0),) * 3, (e, 1e3), elastic_below=0.0))
    result = simulate(Scene(ROOM, balls, physics, 0.04, record_collisions=True))
    log = result.ball_collisions
    assert log is not None
    assert len(log) > 20
    assert len(result.impacts) == 0
    velocities = balls.velocities.copy()
    change = 0.5 * (1.0 + e) * log.normal_speed[:, None] * log.normal
    np.add.at(velocities, log.one, -change)
    np.add.at(velocities, log.two, change)
    np.testing.assert_allclose(velocities, result.balls.velocities, atol=1e-12)


def test_without_the_wish_there_is_no_buffer() -> None:
    gas = lattice_gas(2, 0.1, seed=2)
    assert Simulation(Scene(gas.room, gas.balls, Physics(), 1.0)).state.collision_buffer is None
    with pytest.raises(SceneError, match=r"record_collisions is True, but physics\."):
        Scene(gas.room, gas.balls, Physics(ball_collisions=None), 1.0, record_collisions=True)
    with pytest.raises(SceneError, match="record_collisions is 2"):
        Scene(gas.room, gas.balls, Physics(), 1.0, record_collisions=2)  # type: ignore[arg-type]
