"""Phases of sonotrodes that do not make whole periods in a time window of the simulation.

These are several sonotrodes, or a single sonotrode that is shaken slowly.

The clock restarts from 0 at the start of each time window. A window lasts a whole number of periods
of the fastest sonotrode. Where a period would be longer than a window, the window keeps its length,
so that its arrays stay as small at any frequency.

A face that does not make whole periods in a window carries its phase on. The missing phase is added
at every window's end, counted in 2^-62 of a turn. Whole numbers are added without rounding, so that
a phase is off by at most 2^-63 of a turn a window: 3e-11 rad after the longest simulation.
"""

from fractions import Fraction
from typing import NamedTuple, TypeVar

import numpy as np

from sim_core.effects.vibration import Vibration, Wave
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.vec3 import Vec3

# The type of a wave, which may be None in a scene without vibration.
AnyWave = TypeVar("AnyWave", Wave, Wave | None)

PARTS = 2**62  # parts of a turn: the sum of two turns still fits in an int64
PART = PARTS - 1
TURN = 2.0 * np.pi
ROUNDING = 2.0**-52  # share of a window made of whole periods


class SonotrodeWaves(NamedTuple):
    """Vibrations of k sonotrodes, as numbers for compiled code."""

    # amplitude [m], omega [rad/s], phase [rad] at the window's start, and axis of each sonotrode,
    # shape (k, 6)
    numbers: np.ndarray
    first: np.ndarray  # phase at the scene's start [rad], shape (k,)
    # phase since the scene's start without whole turns, in PARTS of a turn, shape (k,) int64
    gone: np.ndarray
    step: np.ndarray  # growth of ``gone`` each window, shape (k,) int64
    faces: np.ndarray  # the sonotrode of each obstacle, shape (obstacles,) int64


def carry_phases(vibrations: tuple[Vibration, ...], window: float) -> bool:
    """Return True if the phases must be carried on from one time window to the next.

    This is so for several vibrations, and for a vibration whose period exceeds ``window`` [s].
    """
    return len(vibrations) > 1 or any(window * one.frequency < 1.0 for one in vibrations)


def clock_window(vibrations: tuple[Vibration, ...], window: float) -> float:
    """Return ``window`` [s], rounded to a whole number of periods of the fastest vibration.

    A window shorter than a period is returned as it is.
    """
    fastest = max((one.frequency for one in vibrations), default=0.0)
    if window * fastest < 1.0:
        return window
    return round(window * fastest) / fastest


def new_waves(
    vibrations: tuple[Vibration, ...], waves: tuple[Wave, ...], window: float, tags: np.ndarray
) -> SonotrodeWaves | None:
    """Return the vibrations of all sonotrodes at the scene's start.

    The result is None for a single sonotrode that makes whole periods in a time window.

    Args:
        vibrations: vibrations of the sonotrodes.
        waves: the same vibrations, as numbers for compiled code.
        window: length of the window from clock_window [s].
        tags: tags of all obstacles, shape (obstacles,).
    """
    fastest = Fraction(float(max((one.frequency for one in vibrations), default=0.0)))
    of_fastest = Fraction(window) * fastest
    whole = round(of_fastest)
    if abs(of_fastest - whole) <= ROUNDING * whole:
        of_fastest = Fraction(whole)
        if len(waves) < 2:
            return None
    periods = [of_fastest * Fraction(float(one.frequency)) / fastest for one in vibrations]
    first = np.array([wave.phase for wave in waves])
    faces = np.zeros(len(tags), dtype=np.int64)
    for k, one in enumerate(vibrations):
        faces[tags == one.tag] = k
    return SonotrodeWaves(
        np.array([[wave.amplitude, wave.omega, wave.phase, *wave.axis] for wave in waves]),
        first,
        np.zeros(len(waves), dtype=np.int64),
        np.array([round(PARTS * (count % 1)) & PART for count in periods], dtype=np.int64),
        faces,
    )


@inlined
def wave_of_face(waves: SonotrodeWaves | None, wave: AnyWave, face: int) -> AnyWave:
    """Return the vibration of the face with the obstacle number ``face``.

    ``wave``: vibration of the only sonotrode, returned if ``waves`` is None.
    """
    if waves is None or wave is None:
        return wave
    k, numbers = waves.faces[face], waves.numbers
    axis = Vec3(numbers[k, 3], numbers[k, 4], numbers[k, 5])
    return Wave(numbers[k, 0], numbers[k, 1], numbers[k, 2], axis)


@inlined
def same_sonotrode(waves: SonotrodeWaves | None, face: int, other: int) -> bool:
    """Return True if two vibrating faces, given by obstacle number, are of the same sonotrode."""
    if waves is None:
        return True
    return bool(waves.faces[face] == waves.faces[other])


@jit
def shift_phases(waves: SonotrodeWaves | None) -> None:
    """Move the phases of all sonotrodes on by one time window."""
    if waves is None:
        return
    for k in range(len(waves.step)):
        waves.gone[k] = (waves.gone[k] + waves.step[k]) & PART
        waves.numbers[k, 2] = waves.first[k] + TURN * (waves.gone[k] / PARTS)
