"""Coefficients of restitution that are refused, and slow bounces that never end."""

from typing import Any

import numpy as np
import pytest

from sim_core import Gravity, Physics, Restitution, Scene, SceneError, SimulationError, simulate
from tests.helpers.scenes.cavities import balls_at, box, uniform_restitution

ROOM = box((0.02, 0.02, 0.02))
BALL = balls_at(np.array([[0.01, 0.01, 0.0025]]))


@pytest.mark.parametrize(
    ("c0", "elastic_below"), [(True, 0.01), ("0.9", 0.01), (0.9, True), (0.9, "0.01")]
)
def test_only_numbers_are_coefficients(c0: Any, elastic_below: Any) -> None:
    for restitution in (
        Restitution(((c0, 1.0), (0.9, 1.0), (0.9, 1.0)), (0.9, 1.0), elastic_below),
        Restitution(((0.9, 1.0),) * 3, (c0, 1.0), elastic_below),
    ):
        with pytest.raises(SceneError, match=r"^restitution\..* give "):
            simulate(Scene(ROOM, BALL, Physics(Gravity(), restitution), 0.01))


def test_without_a_lower_limit_the_remedy_is_one() -> None:
    """The bounces of a ball with e = 0.5 come to an end in time, but not in number."""
    physics = Physics(Gravity(), uniform_restitution(0.5, 0.7, elastic_below=0.0))

    with pytest.raises(SimulationError, match=r"elastic_below is 0 m/s.*; give 0\.01 m/s"):
        simulate(Scene(ROOM, BALL, physics, 1.0))
