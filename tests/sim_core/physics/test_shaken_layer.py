"""A dense layer on a shaken floor runs to its end, and flies like a ball that does not bounce.

A layer many balls deep loses its energy at once: it leaves the floor where the floor's acceleration
is -g, and lands where a ball without restitution does (F. Melo, P. B. Umbanhowar & H. L. Swinney,
Phys. Rev. Lett. 72 (1994) 172).
"""

import math

import numpy as np
import pytest

from sim_core import simulate
from tests.helpers.scenes.layer import shaken_layer


def flight(gamma: float) -> tuple[float, float]:
    """Phases at which a ball without restitution leaves the floor and lands again."""
    leaves = math.asin(1.0 / gamma)
    s = np.linspace(1e-3, 4.0 * math.pi, 100_000)
    gap = gamma * (math.sin(leaves) + math.cos(leaves) * s - np.sin(leaves + s)) - 0.5 * s * s
    return leaves, leaves + float(s[(gap < 0.0).argmax()])


def require_flight(gamma: float, f_star: float, count: int, cycles: int, below: float) -> None:
    scene = shaken_layer(count, gamma, f_star, cycles, elastic_below=below)
    result = simulate(scene)
    (shaking,) = scene.physics.vibrations
    phase = math.tau * shaking.frequency * result.impacts.time + shaking.phase
    phase = phase[phase > 1.5 * math.pi]  # the lattice has fallen down
    leaves, lands = flight(gamma)
    since = (phase - leaves) % math.tau
    flown = lands - leaves
    assert len(phase) > 20 * count
    assert flown < math.tau
    in_flight = (since > 0.3 * flown) & (since < 0.9 * flown)
    assert in_flight.mean() < 0.05  # of which 0.35 would be there by chance
    assert ((since > 0.9 * flown) & (since < 0.9 * flown + 0.5 * math.pi)).mean() > 0.5


def test_a_layer_flies_like_a_ball_that_does_not_bounce() -> None:
    require_flight(2.5, 0.27, 216, 4, 0.01)


@pytest.mark.long
@pytest.mark.parametrize("below", [1e-2, 3e-3, 1e-3])
@pytest.mark.parametrize(("gamma", "f_star"), [(2.0, 0.27), (3.0, 0.44)])
def test_layers_run_to_the_end(gamma: float, f_star: float, below: float) -> None:
    """Ten balls fit in its width to the last bit: some rows are pressed flat between the walls."""
    require_flight(gamma, f_star, 600, 12, below)


@pytest.mark.long
@pytest.mark.parametrize("f_star", [0.27, 0.44])
def test_layers_at_strong_shaking_run_to_the_end(f_star: float) -> None:
    scene = shaken_layer(600, 4.6, f_star, 40)
    assert simulate(scene).collisions.balls > 1e6
