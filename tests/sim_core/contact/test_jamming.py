"""A ball is held in a jam and let go when its neighbours have gone."""

import pytest

from sim_core import Scene
from sim_core.contact.jamming import hold_still
from sim_core.effects.contact_mode import JAMMED
from sim_core.effects.gravity import STANDARD as G
from sim_core.loop.contact_neighbours import count_neighbours
from sim_core.loop.simulate import Simulation
from sim_core.motion import BallEvent
from sim_core.numerics.vec3 import Vec3
from tests.helpers.scenes.contact_mode import DIAMETER, ROOM, TOUCH, mode, physics, shot


def held_beside_another(leaves: float) -> Simulation:
    """Ball 0 is held in the air, 1 um beside ball 1, which goes aside at ``leaves`` [m/s]."""
    balls = shot(
        [[0.005, 0.01, 0.03], [0.005 + DIAMETER + 1e-6, 0.01, 0.03]],
        [[0.0, 0.0, 0.0], [leaves, 0.0, 0.0]],
    )
    run = Simulation(Scene(ROOM, balls, physics(), 1.0))
    assert run.state.contact is not None
    hold_beside(run, 0.0)
    return run


def hold_beside(run: Simulation, moment: float) -> None:
    """Hold ball 0 where it is, as if it had jammed."""
    assert run.state.contact is not None
    here = Vec3(*(float(x) for x in run.state.motion[0, :3]))
    event = BallEvent(0, 0.0, moment)
    hold_still(run.state.contact, run.state.motion, event, here)
    count_neighbours(run.state.contact, run.state.motion, event)


def test_a_held_ball_falls_when_one_of_those_around_it_has_gone() -> None:
    """20 um at 0.1 m/s takes 0.2 ms; it looks every 2 ms."""
    run = held_beside_another(0.1)
    assert mode(run) == JAMMED
    run.play(0.03, record=False)
    fallen = 0.03 - run.balls().positions[0, 2]
    assert 0.5 * G * (0.03 - 0.003) ** 2 < fallen <= 0.5 * G * 0.03**2


def test_a_ball_held_at_one_place_again_and_again_is_left_there_for_longer_each_time() -> None:
    """1, 3, 7 ... ms: so that jams cost the logarithm of the time, and none hangs for ever."""
    run = held_beside_another(0.1)
    for times in range(1, 6):
        hold_beside(run, 0.0)
        assert run.state.contact is not None
        assert run.state.contact.stays_until[0] == pytest.approx(1e-3 * (2**times - 1))
    run.play(0.03, record=False)
    assert mode(run) == JAMMED
    run.play(0.031 + 0.03, record=False)
    fallen = 0.03 - run.balls().positions[0, 2]
    assert 0.5 * G * 0.027**2 < fallen <= 0.5 * G * 0.03**2 + TOUCH
