"""Shot is placed inside, apart, clear of surfaces and low; shot that does not fit is refused."""

import numpy as np
import pytest

from sim_core import SceneError, pack_balls
from sim_core.scene.invariants import clearance, closest_pair, contained
from tests.helpers.scenes.cavities import balls_at, box, cylinder


@pytest.mark.parametrize("count", [1, 30, 200])
def test_balls_are_inside_apart_clear_and_low(count: int) -> None:
    room = cylinder(0.035, 0.04, sections=24)
    placed = pack_balls(room, count, 3e-3, np.random.default_rng(3), clear=50e-6)
    assert contained(room, placed).all()
    assert clearance(room.corners, placed, 3e-3).min() >= 1.5e-3 + 50e-6
    assert closest_pair(balls_at(placed))[0] >= 3e-3
    assert placed[:, 2].max() < 0.01


def test_the_same_generator_gives_the_same_places() -> None:
    room = box((0.02, 0.02, 0.02))
    one, two = (pack_balls(room, 20, 3e-3, np.random.default_rng(9)) for _ in range(2))
    assert (one == two).all()


def test_too_much_shot_and_too_narrow_a_room_are_refused() -> None:
    with pytest.raises(SceneError, match=r"of 400 balls of 3 mm find a free place in 8 cm³"):
        pack_balls(box((0.02, 0.02, 0.02)), 400, 3e-3, np.random.default_rng(0))
    with pytest.raises(SceneError, match="narrower than the ball"):
        pack_balls(box((0.002, 0.02, 0.02)), 1, 3e-3, np.random.default_rng(0))


def test_nothing_is_placed_below_the_floor() -> None:
    """The box is in layers of 1.5 diameters, filled from the floor up, not from the bottom."""
    room = box((0.02, 0.02, 0.04))
    placed = pack_balls(room, 10, 2e-3, np.random.default_rng(5), clear=50e-6, floor=0.02)
    assert placed[:, 2].min() >= 0.021 + 50e-6
    assert placed[:, 2].max() < 0.025
