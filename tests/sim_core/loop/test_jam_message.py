"""Messages on a ball with too many events, by inelastic collapse, and on one that is too fast."""

import math

import numpy as np
import pytest

from sim_core import (
    Balls,
    Gravity,
    Physics,
    Restitution,
    Scene,
    SimulationError,
    Vibration,
    simulate,
)
from sim_core.loop.simulate import Simulation
from tests.helpers.scenes.cavities import ELASTIC, FLOOR, box

DIAMETER = 3e-3
SHAKING = Vibration(FLOOR, 25e-6, 20e3, -0.5 * math.pi)


def play(e: float, elastic_below: float) -> None:
    """A ball is a nanometre above a vibrating floor at its lowest, which then rises ever faster.

    The clock's window is one period, so that few events are too many.
    """
    law = (e, 1.0, 0.0)
    effects = Physics(Gravity(), Restitution((law,) * 3, law, elastic_below), SHAKING)
    place = [[0.01, 0.01, 0.5 * DIAMETER - SHAKING.amplitude + 1e-9]]
    ball = Balls(np.array(place), np.zeros((1, 3)), DIAMETER)
    run = Simulation(Scene(box((0.02, 0.02, 0.05)), ball, effects, 1.0))
    run.state = run.state._replace(clock=run.state.clock._replace(window=1.0 / SHAKING.frequency))
    run.play(0.01, record=False)


@pytest.mark.parametrize(
    ("e", "elastic_below", "remedy"),
    [
        (0.0, 0.01, "give a restitution above 0"),
        (0.5, 1e-5, "Raise elastic_below .* it is 1e-05 m/s, 0.01 m/s is usual"),
        (0.5, 1e-6, "Raise elastic_below .* it is 1e-06 m/s, 0.01 m/s is usual"),
        (0.5, 0.0, "Raise elastic_below .* it is 0 m/s, 0.01 m/s is usual"),
    ],
)
def test_endless_hits_of_one_face_are_inelastic_collapse(
    e: float, elastic_below: float, remedy: str
) -> None:
    with pytest.raises(
        SimulationError,
        match=rf"bounces ever faster .* vibrating surface \(triangle \d+\).* collapse.* {remedy}",
    ):
        play(e, elastic_below)


def test_usual_settings_do_not_collapse() -> None:
    play(0.5, 0.01)


@pytest.mark.parametrize("count", [1, 2])  # alone, no ball looks for others
def test_a_speed_that_no_shot_has_is_refused_with_its_reason(count: int) -> None:
    places = np.array([[5e-3, 0.01, 2.5e-3], [15e-3, 0.01, 2.5e-3]])[:count]
    balls = Balls(places, np.tile([0.0, 0.0, -1.0], (count, 1)), DIAMETER)
    effects = Physics(Gravity(), ELASTIC, Vibration(FLOOR, 1e-3, 1e9))
    with pytest.raises(SimulationError, match=r"a ball has .* faster than 1e\+06 m/s"):
        simulate(Scene(box((0.02, 0.02, 0.02)), balls, effects, 1e-3))
