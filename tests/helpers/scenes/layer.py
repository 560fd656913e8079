"""A layer of balls on a shaken floor, 5.4 diameters deep, as in experiments.

Source: C. Bizon, M. D. Shattuck, J. B. Swift, W. D. McCormick & H. L. Swinney, Phys. Rev. Lett. 80
(1998) 57: patterns at Γ = A omega² / g of 2 to 8 and f* = f sqrt(depth / g) of 0.2 to 0.6.
"""

import math

import numpy as np

from sim_core import (
    AnalyticCavity,
    Balls,
    Gravity,
    Physics,
    Restitution,
    Scene,
    TabulatedRestitution,
    TriangleMesh,
    Vibration,
    periodic_box,
)
from sim_core.effects.gravity import STANDARD as G
from sim_core.effects.restitution import ELASTIC_BELOW
from tests.helpers.scenes.cavities import CEILING, FLOOR, box, uniform_restitution

DIAMETER = 1e-3
DEPTH = 5.4 * DIAMETER
PER_AREA = 6.0  # balls for each D² of floor


def bizon_restitution(e: float, elastic_below: float = ELASTIC_BELOW) -> Restitution:
    """1 - (1 - e) (v / v0)^(3/4) below v0 = sqrt(g D), and e above, of all and everything."""
    v0 = math.sqrt(G * DIAMETER)
    speeds = v0 * np.linspace(0.0, 1.0, 41) ** 2
    law = TabulatedRestitution(speeds, 1.0 - (1.0 - e) * (speeds / v0) ** 0.75)
    return Restitution((law,) * 3, law, elastic_below)


def shaken_layer(
    count: int,
    gamma: float,
    f_star: float,
    cycles: float,
    e: float = 0.7,
    elastic_below: float = ELASTIC_BELOW,
    law: Restitution | None = None,
    width: float | None = None,
) -> Scene:
    """A loose lattice that falls on the floor, which starts from its lowest position.

    The floor is a square with sides, or periodic and ``width`` [m] wide.
    """
    frequency = f_star * math.sqrt(G / DEPTH)
    amplitude = gamma * G / (math.tau * frequency) ** 2
    side = math.sqrt(count / PER_AREA) * DIAMETER
    floor = (side, side)
    if width is not None:
        floor = (count / PER_AREA * DIAMETER / (width / DIAMETER), width)
    row, rows = (int(length / (1.04 * DIAMETER)) for length in floor)
    layer, place = np.divmod(np.arange(count), row * rows)
    x, y = (place % row + 0.5) * (floor[0] / row), (place // row + 0.5) * (floor[1] / rows)
    positions = np.stack([x, y, (0.6 + 1.05 * layer) * DIAMETER], axis=1)
    rng = np.random.default_rng(1)
    positions += rng.uniform(-0.01, 0.01, positions.shape) * DIAMETER
    balls = Balls(positions, rng.normal(0.0, 0.05, positions.shape), DIAMETER)
    shaking = Vibration(FLOOR, amplitude, frequency, -0.5 * math.pi)
    law = law or uniform_restitution(e, 1e6, elastic_below)
    top = positions[:, 2].max() + 60.0 * DIAMETER
    room: TriangleMesh | AnalyticCavity = box((*floor, top))
    if width is not None:
        room = periodic_box((0.0, 0.0, 0.0), (*floor, top), (FLOOR, CEILING))
    physics = Physics(Gravity(), law, shaking)
    return Scene(room, balls, physics, cycles / frequency, record=(FLOOR,))
