"""Places that are named in messages."""

import numpy as np

from chamberopt.chamber.checks.place_names import one_of


def test_the_place_named_of_a_ring_lies_on_it() -> None:
    """Points of the bore are nearer to the ring's middle, and have no weight."""
    angle = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    round_it = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    points = 1e-3 * np.concatenate([8.0 * round_it, 25.0 * round_it])
    named = one_of(points, np.repeat([0.0, 1.0], len(angle)))
    x, y, _ = map(float, named.strip("() m").split(", "))
    assert abs(np.hypot(x, y) - 25.0) < 0.1
