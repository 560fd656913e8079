"""Several sonotrodes: each vibrating face goes with the wave of its own tag.

The clock's window is a whole number of periods of the fastest. The others need not fit into it: what each lacks to
whole periods is added to its phase at every window's end, counted in 2^-62 of a turn. Whole numbers are added without
rounding, so that a phase is off by 2^-63 of a turn a window at most: 3e-11 rad after the longest run.
"""

from fractions import Fraction
from typing import NamedTuple

import numpy as np

from sim_core.effects.vibration import Vibration, Wave
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.vec3 import Vec3

PARTS = 2**62  # of a turn: the sum of two is still an int64
PART = PARTS - 1
TURN = 2.0 * np.pi


class Waves(NamedTuple):
    """Several waves beside the Loop's one, which is then the slowest of them.

    ``numbers`` (k, 6): of each its swing [m], omega [rad/s], phase [rad] at the window's start, and axis; ``first``
    (k,) [rad]: the phase at the scene's start; ``gone``, ``step`` (k,) int64: how far it is past that now, but for
    whole turns, and how much farther each window, in PARTS of a turn. ``faces`` (obstacles,) int64: which of them a
    face goes with.
    """

    numbers: np.ndarray
    first: np.ndarray
    gone: np.ndarray
    step: np.ndarray
    faces: np.ndarray


def whole_periods(vibrations: tuple[Vibration, ...], window: float) -> float:
    """The window [s] nearest to the one given that is a whole number of periods of the fastest vibration."""
    if not vibrations:
        return window
    fastest = max(one.frequency for one in vibrations)
    return max(1.0, round(window * fastest)) / fastest


def new_waves(
    vibrations: tuple[Vibration, ...], waves: tuple[Wave, ...], window: float, tags: np.ndarray
) -> Waves | None:
    """At the scene's start; ``window`` [s] as whole_periods gives it, ``tags`` (obstacles,) of all obstacles.

    None where fewer than two vibrate: one wave needs no table.
    """
    if len(waves) < 2:
        return None
    fastest = Fraction(float(max(one.frequency for one in vibrations)))
    periods = [
        Fraction(float(one.frequency)) / fastest * round(Fraction(window) * fastest)
        for one in vibrations
    ]
    phases = np.array([wave.phase for wave in waves])
    faces = np.zeros(len(tags), dtype=np.int64)
    for k, one in enumerate(vibrations):
        faces[tags == one.tag] = k
    return Waves(
        np.array([[wave.swing, wave.omega, wave.phase, *wave.axis] for wave in waves]),
        phases,
        np.zeros(len(waves), dtype=np.int64),
        np.array([round(PARTS * (count % 1)) & PART for count in periods], dtype=np.int64),
        faces,
    )


@inlined
def face_wave(waves: Waves | None, wave: Wave | None, face: int) -> Wave | None:
    """The motion of the vibrating face of that number among the obstacles."""
    if waves is None or wave is None:
        return wave
    k, numbers = waves.faces[face], waves.numbers
    return Wave(
        numbers[k, 0],
        numbers[k, 1],
        numbers[k, 2],
        Vec3(numbers[k, 3], numbers[k, 4], numbers[k, 5]),
    )


@inlined
def move_alike(waves: Waves | None, face: int, other: int) -> bool:
    """True when two vibrating faces are of one sonotrode."""
    if waves is None:
        return True
    return bool(waves.faces[face] == waves.faces[other])


@jit
def shift_phases(waves: Waves | None) -> None:
    """A window has gone by."""
    if waves is None:
        return
    for k in range(len(waves.step)):
        waves.gone[k] = (waves.gone[k] + waves.step[k]) & PART
        waves.numbers[k, 2] = waves.first[k] + TURN * (waves.gone[k] / PARTS)
