"""A flat upright cell, shaken as a whole: the tails of the balls' horizontal speeds.

F. Rouyer & N. Menon, Phys. Rev. Lett. 85 (2000) 3676: steel balls of 1.6 mm between plates, 48 by
32 diameters, P(v) ~ exp(-|v|^p) with p = 1.55 ± 0.1 for all numbers of balls and strengths of the
shaking. Floor and ceiling move; smooth plates and sides that move along themselves do nothing.
"""

import math
from collections.abc import Iterator

import numpy as np

from benchmarks.cases.row import Row, mean_and_half_width
from sim_core import Balls, Gravity, Physics, Restitution, Scene, Vibration, pack_balls, simulate
from tests.helpers.scenes.cavities import CEILING, FLOOR, box

DIAMETER = 1.6e-3  # m
WIDE, DEEP, HIGH = 48.0, 1.05, 32.0  # diameters
GAMMA, FREQUENCY = 32.0, 60.0  # strength A omega² / g, and Hz
STEEL = (0.93, 1.0, 0.0)
SECONDS, FRAMES, SEEDS = 8.0, 400, 4


def tail(count: int, seed: int) -> float:
    """p of the horizontal velocities in the middle third of the cell's height."""
    from scipy.stats import gennorm

    amplitude = GAMMA * 9.80665 / (math.tau * FREQUENCY) ** 2
    room = box((WIDE * DIAMETER, DEEP * DIAMETER, HIGH * DIAMETER))
    rng = np.random.default_rng(seed)
    places = pack_balls(room, count, DIAMETER, rng, 0.02 * DIAMETER)
    balls = Balls(places, rng.normal(0.0, 0.5, places.shape), DIAMETER)
    shaking = tuple(Vibration(tag, amplitude, FREQUENCY, 0.0) for tag in (FLOOR, CEILING))
    law = Restitution((STEEL,) * 3, STEEL)
    scene = Scene(room, balls, Physics(Gravity(), law, shaking), SECONDS, 2.0, record=())
    frames = simulate(scene, np.linspace(0.0, SECONDS, FRAMES + 1)[1:]).frames
    height = frames.positions[:, :, 2] / (HIGH * DIAMETER)
    middle = frames.velocities[:, :, 0][np.abs(height - 0.5) < 1.0 / 6.0]
    return float(gennorm.fit(middle, floc=0.0)[0])


def rows() -> Iterator[Row]:
    for count in (150, 300, 500):
        found = np.array([tail(count, seed) for seed in range(SEEDS)])
        yield Row("shaken cell", f"{count} balls", "exponent p of P(v) ~ exp(-|v|^p)", 1.55, 0.1,
                  *mean_and_half_width(found))  # fmt: skip
