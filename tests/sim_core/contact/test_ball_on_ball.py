"""Piles of balls, and balls that meet while one is in contact."""

from types import SimpleNamespace

import numpy as np
import pytest

from sim_core import Balls, Scene, pack_balls, simulate
from sim_core.contact.ball_on_ball import _press
from sim_core.effects.contact_mode import ASLEEP, JAMMED, ON_BALL
from sim_core.numerics.vec3 import Vec3
from tests.helpers.scenes.cavities import box
from tests.helpers.scenes.contact_mode import (
    CAPTURE,
    DIAMETER,
    TOUCH,
    R,
    energies,
    film,
    physics,
    rough_floor,
    shot,
)


@pytest.mark.parametrize("e", [0.0, 0.5, 0.9])
@pytest.mark.parametrize(("floor", "seed"), [("flat", 7), ("rough", 3), ("rough", 6)])
def test_in_a_settling_pile_nothing_overlaps(floor: str, seed: int, e: float) -> None:
    """film checks gaps every millisecond, also after restarts in which no ball lies still."""
    rng = np.random.default_rng(seed)
    room = box((0.012, 0.012, 0.06)) if floor == "flat" else rough_floor(rng)
    places = pack_balls(room, 50, DIAMETER, rng)
    balls = Balls(places, rng.normal(0.0, 0.5, places.shape), DIAMETER)
    for _ in range(6):
        run, frames = film(room, balls, physics(e, 0.005), 0.1)
        balls = frames[-1]
        assert run.state.counts[:3].sum() < 200_000
        assert run.state.contact is not None
        modes, rows = run.state.contact.mode, run.state.contact.supports.obstacles
        stood_on = ON_BALL - rows[rows <= ON_BALL]
        assert (modes[stood_on] >= ASLEEP).all()
        assert (np.diff(energies(frames)) < 50 * CAPTURE**2).all()
    assert np.abs(balls.velocities).max() < 0.1


def test_balls_that_go_on_as_one_in_flight_do_not_jam() -> None:
    """With e = 0 rounding decides whether such balls approach; they must not meet for ever."""
    rng = np.random.default_rng(6)
    room = box((0.025, 0.025, 0.06))
    places = pack_balls(room, 100, DIAMETER, rng)
    balls = Balls(places, rng.normal(0.0, 0.5, places.shape), DIAMETER)
    run, _ = film(room, balls, physics(0.0, 0.005), 0.01, 10)
    assert 100 < run.state.counts[1] < 3000
    assert run.state.contact is not None
    assert (run.state.contact.mode != JAMMED).all()


def test_another_balls_hit_wakes_it() -> None:
    """Equal balls, head on along the floor: (1 ± e)/2 of the speed."""
    e, v = 0.8, 0.5
    room = box((0.2, 0.02, 0.02))
    balls = shot([[0.05, 0.01, R], [0.1, 0.01, R]], [[v, 0.0, 0.0], [0.0, 0.0, 0.0]])
    meets = (0.05 - DIAMETER) / v
    end = simulate(Scene(room, balls, physics(e), meets + 0.1)).balls
    np.testing.assert_allclose(
        end.velocities[:, 0], [0.5 * (1 - e) * v, 0.5 * (1 + e) * v], rtol=1e-9
    )
    expected = np.array([0.1 - DIAMETER + 0.05 * (1 - e) * v, 0.1 + 0.05 * (1 + e) * v])
    np.testing.assert_allclose(end.positions[:, 0], expected, rtol=1e-9)
    np.testing.assert_allclose(end.positions[:, 2], R, atol=TOUCH)


@pytest.mark.parametrize("rubs", [False, True])
def test_balls_press_each_other_by_what_their_accelerations_lack(rubs: bool) -> None:
    """The one behind gains 3 and 30 m/s² on the other; with friction twice gravity is most."""
    for ahead, pressed in ((-3.0, 3.0), (-30.0, 2.0 * 9.81 if rubs else 30.0)):
        accelerations = np.array([[0.0, 1.0, 0.0], [ahead, 0.0, 0.0]])
        contact = SimpleNamespace(acceleration=accelerations, gravity=Vec3(0.0, 0.0, -9.81))
        friction = SimpleNamespace() if rubs else None
        found = _press.py_func(friction, contact, 0, 1, Vec3(1.0, 0.0, 0.0))
        assert found == pytest.approx(pressed)
