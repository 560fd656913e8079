"""Balls that do not collide fly through each other, each as if it were alone, bit for bit."""

import numpy as np
import pytest

from sim_core import (
    BallCollisions,
    Balls,
    Gravity,
    Physics,
    Rest,
    Scene,
    SceneError,
    Vibration,
    pack_balls,
    simulate,
)
from sim_core.loop.jam_message import touching
from sim_core.loop.simulate import Simulation
from tests.helpers.scenes.cavities import FLOOR, box, cylinder, uniform_restitution

DIAMETER = 3e-3
THROUGH = Physics(
    Gravity(),
    uniform_restitution(0.9, 0.7),
    Vibration(FLOOR, 25e-6, 20e3, 0.3),
    ball_collisions=None,
)
ROOM = cylinder(0.012, 0.02, sections=12)


def shot(count: int) -> Balls:
    rng = np.random.default_rng(5)
    return Balls(pack_balls(ROOM, count, DIAMETER, rng), rng.normal(0.0, 3.0, (count, 3)), DIAMETER)


@pytest.mark.parametrize(
    "physics",
    [THROUGH, pytest.param(THROUGH._replace(rest=Rest()), marks=pytest.mark.long)],
    ids=["flying", "contact mode"],
)
def test_each_ball_has_the_history_it_has_alone(physics: Physics) -> None:
    balls = shot(12)
    together = simulate(Scene(ROOM, balls, physics, 0.3))
    assert together.collisions.balls == 0
    for ball in range(len(balls)):
        one = Balls(balls.positions[[ball]], balls.velocities[[ball]], DIAMETER)
        for given in (physics, physics._replace(ball_collisions=BallCollisions())):
            alone = simulate(Scene(ROOM, one, given, 0.3))
            own = together.impacts.ball == ball
            for column in ("time", "triangle", "position", "velocity", "normal_speed"):
                np.testing.assert_array_equal(
                    getattr(together.impacts, column)[own], getattr(alone.impacts, column)
                )
            assert (together.balls.positions[ball] == alone.balls.positions[0]).all()
            assert (together.balls.velocities[ball] == alone.balls.velocities[0]).all()


def test_two_balls_fly_through_each_other() -> None:
    room = box((0.1, 0.02, 0.02))
    start = Balls(
        np.array([[0.02, 0.01, 0.01], [0.08, 0.01, 0.01]]),
        np.array([[1.0, 0, 0], [-1.0, 0, 0]]),
        DIAMETER,
    )
    end = simulate(Scene(room, start, Physics(ball_collisions=None), 0.05)).balls
    np.testing.assert_allclose(end.positions[:, 0], [0.07, 0.03], atol=1e-15)
    np.testing.assert_array_equal(end.velocities, start.velocities)


def test_nothing_is_kept_of_pairs_and_overlaps_are_no_error() -> None:
    in_one_place = Balls(np.full((3, 3), 0.01) - [0.01, 0.01, 0.0], np.zeros((3, 3)), DIAMETER)
    run = Simulation(Scene(ROOM, in_one_place, Physics(ball_collisions=None), 1.0))
    assert run.state.neighbours is None
    assert run.state.queue.meetings is None
    assert len(run.state.queue.wall_time) == 3
    run.play(0.1, record=False)
    # a jam is not of those
    assert touching(run.scene, ROOM.corners, in_one_place.positions, 0) == ([], False)
    with pytest.raises(SceneError, match="overlap"):
        Scene(ROOM, in_one_place, Physics(), 1.0)


def test_a_ball_faster_than_any_shot_is_followed_and_what_is_no_effect_is_named() -> None:
    fast = Balls(np.array([[0.0, 0.0, 0.01]]), np.array([[9e5, 0.0, 0.0]]), DIAMETER)
    assert simulate(Scene(ROOM, fast, Physics(ball_collisions=None), 1e-5)).collisions.walls > 100
    with pytest.raises(
        SceneError, match=r"physics\.ball_collisions is False: give a BallCollisions, or None"
    ):
        Scene(ROOM, fast, Physics(ball_collisions=False), 1.0)  # type: ignore[arg-type]
