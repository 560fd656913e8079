"""A flat upright cell, shaken as a whole: the tails of the balls' horizontal speeds.

F. Rouyer & N. Menon, Phys. Rev. Lett. 85 (2000) 3676: steel balls of 1.6 mm between plates, 48 by
32 diameters, P(v) ~ exp(-|v|^p) with p = 1.55 ± 0.1 for all numbers of balls and strengths of the
shaking. Floor and ceiling move; smooth plates and sides that move along themselves do nothing.
"""

import math
from collections.abc import Iterator

import numpy as np

from benchmarks.cases.row import Row, mean_and_half_width
from sim_core import (
    Balls,
    Friction,
    Gravity,
    Physics,
    Restitution,
    Scene,
    Vibration,
    pack_balls,
    simulate,
)
from sim_core.effects.gravity import STANDARD
from tests.helpers.scenes.cavities import CEILING, FLOOR, box

DIAMETER = 1.6e-3  # m
WIDE, DEEP, HIGH = 48.0, 1.05, 32.0  # diameters
GAMMA, FREQUENCY = 32.0, 60.0  # strength A omega² / g, and Hz
STEEL = (0.93, 1.0, 0.0)
RUBBING = (0.2, 0.4)  # mu and beta0 of balls, floor and ceiling; the plates stay smooth
SECONDS, FRAMES, SEEDS = 8.0, 400, 4
SLICES = {"middle third of the height": 1.0 / 3.0, "slice of two diameters": 2.0 / HIGH}


def tails(count: int, friction: tuple[float, float] | None, seed: int) -> list[float]:
    """p of the horizontal velocities in each of SLICES about the middle of the cell's height."""
    from scipy.stats import gennorm

    amplitude = GAMMA * STANDARD / (math.tau * FREQUENCY) ** 2
    room = box((WIDE * DIAMETER, DEEP * DIAMETER, HIGH * DIAMETER))
    rng = np.random.default_rng(seed)
    places = pack_balls(room, count, DIAMETER, rng, 0.02 * DIAMETER)
    balls = Balls(places, rng.normal(0.0, 0.5, places.shape), DIAMETER)
    shaking = tuple(Vibration(tag, amplitude, FREQUENCY, 0.0) for tag in (FLOOR, CEILING))
    law = Restitution((STEEL,) * 3, STEEL)
    rubbing = None if friction is None else Friction((friction, friction, (0.0, 0.0)), friction)
    physics = Physics(Gravity(), law, shaking, friction=rubbing)
    scene = Scene(room, balls, physics, SECONDS, 2.0, record=())
    frames = simulate(scene, np.linspace(0.0, SECONDS, FRAMES + 1)[1:]).frames
    off_middle = np.abs(frames.positions[:, :, 2] / (HIGH * DIAMETER) - 0.5)
    across = frames.velocities[:, :, 0]
    return [
        float(gennorm.fit(across[off_middle < 0.5 * part], floc=0.0)[0]) for part in SLICES.values()
    ]


def rows() -> Iterator[Row]:
    for count, friction in ((150, None), (300, None), (500, None), (150, RUBBING), (500, RUBBING)):
        name = "no friction" if friction is None else f"friction {friction[0]}"
        found = np.array([tails(count, friction, seed) for seed in range(SEEDS)])
        for part, exponents in zip(SLICES, found.T, strict=True):
            yield Row("shaken cell", f"{count} balls, {name}, {part}",
                      "exponent p of P(v) ~ exp(-|v|^p)", 1.55, 0.1,
                      *mean_and_half_width(exponents))  # fmt: skip
