"""What collisions keep: energy of an elastic gas, momentum of a pair, and what they may only
lose.
"""

import numpy as np
import pytest

from sim_core import Balls, Gravity, Physics, Restitution, Scene, TriangleMesh, pack_balls, simulate
from sim_core.scene.invariants import closest_pair, contained, energy
from tests.helpers.scenes.cavities import WEIGHTLESS, box, cylinder, uniform_restitution

DIAMETER = 3e-3


def gas(mesh: TriangleMesh, count: int, speed: float, seed: int) -> Balls:
    rng = np.random.default_rng(seed)
    return Balls(
        pack_balls(mesh, count, DIAMETER, rng), rng.normal(0.0, speed, (count, 3)), DIAMETER
    )


def test_an_elastic_gas_in_a_box_keeps_its_energy_over_a_million_collisions() -> None:
    room = box((0.03, 0.03, 0.03))
    start = gas(room, 60, 3.0, 1)
    physics = Physics(gravity=Gravity())
    result = simulate(Scene(room, start, physics, duration=30.0, record=()))
    assert result.collisions.total > 1_000_000
    drift = energy(result.balls, physics.gravity) / energy(start, physics.gravity) - 1.0
    assert abs(drift) < 1e-11
    assert contained(room, result.balls.positions).all()
    assert closest_pair(result.balls)[0] > DIAMETER - 1e-12


def test_an_elastic_gas_keeps_its_energy_between_slanted_faces_too() -> None:
    room = cylinder(0.02, 0.02, sections=37)
    start = gas(room, 40, 3.0, 2)
    result = simulate(Scene(room, start, Physics(WEIGHTLESS), duration=12.0, record=()))
    assert result.collisions.total > 200_000
    assert abs(energy(result.balls) / energy(start) - 1.0) < 1e-11


def test_two_balls_meet_head_on_and_keep_their_momentum() -> None:
    room = box((0.1, 0.1, 0.1))
    e = 0.5
    physics = Physics(WEIGHTLESS, Restitution(((1.0, 1.0),) * 3, (e, 100.0)))
    balls = Balls(
        np.array([[0.04, 0.05, 0.05], [0.06, 0.05, 0.05]]),
        np.array([[2.0, 0, 0], [-1.0, 0, 0]]),
        DIAMETER,
    )
    end = simulate(Scene(room, balls, physics, duration=0.01)).balls
    mean, half = (
        0.5,
        0.5 * e * 3.0,
    )  # centre of mass speed kept; relative speed reversed and multiplied by e
    np.testing.assert_allclose(
        end.velocities, [[mean - half, 0, 0], [mean + half, 0, 0]], atol=1e-14
    )


def test_dissipation_never_raises_the_energy() -> None:
    room = cylinder(0.02, 0.02)
    physics = Physics(Gravity(), uniform_restitution(0.9, 0.7))
    balls = gas(room, 40, 3.0, 3)
    before = energy(balls, physics.gravity)
    for _ in range(20):
        balls = simulate(Scene(room, balls, physics, duration=0.005)).balls
        now = energy(balls, physics.gravity)
        assert now <= before * (1.0 + 1e-13)
        before = now


@pytest.mark.long
def test_energy_over_ten_million_collisions() -> None:
    room = cylinder(0.02, 0.02, sections=37)
    start = gas(room, 60, 3.0, 4)
    result = simulate(Scene(room, start, Physics(Gravity()), duration=330.0, record=()))
    assert result.collisions.total > 10_000_000
    assert abs(energy(result.balls, Gravity()) / energy(start, Gravity()) - 1.0) < 1e-11
