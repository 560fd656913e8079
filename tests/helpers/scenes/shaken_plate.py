"""One ball on a shaken plate, in the plate's own units.

Phases, heights over g / omega², speeds over g / omega; the plate is at Γ sin(phase).
"""

import math

import numpy as np

from sim_core import (
    Balls,
    Gravity,
    Physics,
    Rest,
    Restitution,
    Scene,
    SimulationResult,
    Vibration,
    simulate,
)
from sim_core.effects.gravity import STANDARD as G
from tests.helpers.scenes.cavities import FLOOR, box

DIAMETER = 3e-3
CAPTURE = 1e-5  # of g / omega: a ball that bounces more slowly is on the plate
FAST = 1e-3  # slower bounces are not compared one by one


def plate(gamma: float, frequency: float, phase: float = 0.0) -> Vibration:
    return Vibration(FLOOR, gamma * G / (math.tau * frequency) ** 2, frequency, phase)


def shaken(vibration: Vibration, e: float, start: float, periods: float) -> SimulationResult:
    """A ball dropped from ``start`` (over g / omega²) above the plate's mean height, at rest."""
    omega = math.tau * vibration.frequency
    drop = start * G / omega**2
    room = box((0.01, 0.01, drop + 30.0 * vibration.amplitude + 0.02))
    ball = Balls(np.array([[4e-3, 5e-3, drop + 0.5 * DIAMETER]]), np.zeros((1, 3)), DIAMETER)
    law = Restitution(((e, 1e9),) * 3, (e, 1e9))
    rest = Rest(capture=CAPTURE * G / omega, on_vibrating=True)
    physics = Physics(Gravity(), law, vibration, rest)
    return simulate(Scene(room, ball, physics, periods / vibration.frequency))


def impacts(vibration: Vibration, e: float, start: float, periods: float) -> np.ndarray:
    """Phase and speed of the fast impacts, (n, 2), simulated."""
    log, omega = shaken(vibration, e, start, periods).impacts, math.tau * vibration.frequency
    hits = np.stack([log.time * omega + vibration.phase, log.normal_speed * omega / G], axis=1)
    return hits[hits[:, 1] > FAST]


def first_locking(e: float) -> float:
    """The Γ from which one impact a period, cos(phase) = π(1-e)/(1+e)/Γ, exists.

    J. M. Luck & A. Mehta, Phys. Rev. E 48 (1993) 3988.
    """
    return math.pi * (1.0 - e) / (1.0 + e)


def first_doubling(e: float) -> float:
    """The Γ up to which it is stable: the root of first_locking² + 4 (1+e²)²/(1+e)⁴."""
    return math.hypot(first_locking(e), 2.0 * (1.0 + e * e) / (1.0 + e) ** 2)


def in_step(gamma: float, e: float, periods: float, higher: float = 0.0) -> np.ndarray:
    """The ``impacts`` of a ball dropped into step with the plate, or from a little higher."""
    phase = math.acos(min(first_locking(e) / gamma, 1.0))
    start = gamma * math.sin(phase) + 0.5 * math.pi**2 + higher
    return impacts(plate(gamma, 11.5, phase - math.pi), e, start, periods)
