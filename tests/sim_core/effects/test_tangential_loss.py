"""Balls that lose a share s of their tangential velocity at each hit: (1 - s)^n after n hits."""

import numpy as np
import pytest

from sim_core import Balls, Physics, Scene, SceneError, Vibration, simulate, surface_effects
from tests.helpers.scenes.cavities import FLOOR, SIDES, box, uniform_restitution

DIAMETER = 3e-3
ROOM = box((0.2, 0.2, 0.02))


def one_ball(velocity: list[float]) -> Balls:
    return Balls(np.array([[0.05, 0.05, 0.01]]), np.array([velocity]), DIAMETER)


def physics(share: float, e: float = 1.0) -> Physics:
    """Without weight; the same constant restitution everywhere."""
    return Physics(
        restitution=uniform_restitution(e, 1e3, 0.0),
        surface=surface_effects(tangential_loss={"share": share}),
    )


@pytest.mark.parametrize("e", [1.0, 0.9])
@pytest.mark.parametrize("share", [0.0, 0.1, 0.6, 1.0])
def test_a_ball_between_floor_and_ceiling_keeps_a_power_of_its_tangential_velocity(
    share: float, e: float
) -> None:
    start = np.array([0.5, -0.2, 2.0])
    result = simulate(Scene(ROOM, one_ball(list(start)), physics(share, e), 0.06))
    hits = result.collisions.total
    assert hits > 4
    assert SIDES not in ROOM.tags[result.impacts.triangle]
    left = (1.0 - share) ** hits
    known = start * [left, left, (-e) ** hits]
    np.testing.assert_allclose(result.balls.velocities[0], known, rtol=1e-12, atol=1e-15)


def test_of_a_shaking_floor_it_is_the_velocity_relative_to_the_floor() -> None:
    """A floor that shakes along its normal takes nothing of the kick that it gives."""
    what = physics(0.3)._replace(vibration=Vibration(FLOOR, 50e-6, 20e3, 0.7))
    with_loss, without = (
        simulate(Scene(ROOM, one_ball([1.0, 0.4, -2.0]), one, 0.005)).balls.velocities[0]
        for one in (what, what._replace(surface=surface_effects()))
    )
    np.testing.assert_allclose(with_loss, without * [0.7, 0.7, 1.0], rtol=1e-12)
    assert abs(without[2] - 2.0) > 0.1


@pytest.mark.parametrize("share", [-0.1, 1.1, np.nan, "x"])
def test_a_wrong_share_is_refused_in_words(share: float) -> None:
    with pytest.raises(SceneError, match=r"tangential_loss\.share is "):
        surface_effects(tangential_loss={"share": share})
