"""Vibration of the sonotrode: one tagged surface moves to and fro.

It moves as a rigid body, or bends with a profile of amplitude_profile.py.

Notation:
    u(t) = A sin(omega t + phase): displacement along the axis [m]
    A: amplitude, zero to peak [m], ``amplitude``; omega = 2π frequency [rad/s], ``omega``
    A omega: peak speed of the face [m/s]

Source: the process itself, a piezoelectric generator at a fixed frequency. Several sonotrodes are
in sonotrodes.py.
"""

import math
from typing import NamedTuple

import numpy as np

from sim_core.errors import SceneError, number
from sim_core.numerics.jit import jit
from sim_core.numerics.vec3 import Vec3, scaled

MAX_FREQUENCY = 1e9  # Hz: generators have 1e5 at most; the search at 1e300 would not end


class AmplitudeProfile(NamedTuple):
    """Amplitude over a face that bends: the share of the vibration's amplitude at each place.

    Args:
        points: pairs of distance [m] and share, from 0 to 1, in ascending order. The first distance
            is 0 and the last one is that of the face's rim, or more.
        middle: point [m] from which distances count, across the axis of the vibration.
    """

    points: tuple[tuple[float, float], ...]
    middle: tuple[float, float, float] = (0.0, 0.0, 0.0)


class Vibration(NamedTuple):
    """Harmonic motion of one surface along a fixed axis.

    Args:
        tag: tag of the surface.
        amplitude: zero-to-peak amplitude [m].
        frequency: frequency [Hz].
        phase: phase at time 0 [rad].
        axis: direction of the motion.
        profile: amplitude over the face, in shares of ``amplitude``; None for a rigid face.
    """

    tag: int
    amplitude: float
    frequency: float
    phase: float = 0.0
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    profile: AmplitudeProfile | None = None

    @property
    def peak_speed(self) -> float:
        """Largest speed of the face [m/s]."""
        return 2.0 * math.pi * self.frequency * self.amplitude

    @property
    def peak(self) -> np.ndarray:
        """Displacement of the face at its peak [m], shape (3,)."""
        return self.amplitude * np.array(self.axis) / np.linalg.norm(self.axis)


class Wave(NamedTuple):
    """Vibration for compiled code: amplitude [m], omega [rad/s], phase [rad] and unit axis."""

    amplitude: float
    omega: float
    phase: float
    axis: Vec3


def checked_waves(vibration: Vibration | tuple[Vibration, ...] | None) -> tuple[Wave, ...]:
    """Return the vibration of each vibrating surface, as numbers for compiled code.

    Raises:
        SceneError: for numbers out of range, and for a repeated tag.
    """
    if vibration is None:
        return ()
    if isinstance(vibration, Vibration):
        return (_checked_wave("vibration", vibration),)
    each: list[Vibration] = [*vibration] if isinstance(vibration, tuple) else []
    if not each or not all(isinstance(one, Vibration) for one in each):
        raise SceneError(
            f"physics.vibration is {vibration!r}: give a Vibration, a tuple of several, or None"
        )
    tags = [one.tag for one in each]
    for k, tag in enumerate(tags):
        if tag in tags[:k]:
            raise SceneError(
                f"vibration[{k}].tag is {tag}, the same as vibration[{tags.index(tag)}].tag: "
                "give each its own"
            )
    return tuple(_checked_wave(f"vibration[{k}]", one) for k, one in enumerate(each))


def _checked_wave(which: str, vibration: Vibration) -> Wave:
    """Return the vibration of one surface, as numbers for compiled code.

    Raises SceneError for numbers out of range. The message calls the vibration ``which``.
    """
    for name in ("amplitude", "frequency", "phase"):
        number(f"{which}.{name}", getattr(vibration, name))
    if not 0.0 <= vibration.amplitude < math.inf:
        raise SceneError(f"{which}.amplitude is {vibration.amplitude} m: it must be 0 or more")
    if not 0.0 < vibration.frequency <= MAX_FREQUENCY:
        raise SceneError(
            f"{which}.frequency is {vibration.frequency} Hz: it must be positive and at most "
            f"{MAX_FREQUENCY:g} Hz"
        )
    if not math.isfinite(vibration.phase):
        raise SceneError(f"{which}.phase is {vibration.phase} rad: it must be finite")
    length = math.hypot(*vibration.axis)
    if not 0.0 < length < math.inf:
        raise SceneError(f"{which}.axis is {vibration.axis}: it must be a direction")
    return Wave(
        float(vibration.amplitude),
        2.0 * math.pi * vibration.frequency,
        float(vibration.phase) % (2.0 * math.pi),
        Vec3(*(float(k) / length for k in vibration.axis)),
    )


@jit
def surface_velocity(wave: Wave | None, time: float) -> Vec3:
    """Return the velocity [m/s] of the vibrating surface; zero without vibration.

    ``time``: time since the start of the present time window [s].
    """
    if wave is None:
        return Vec3(0.0, 0.0, 0.0)
    speed = wave.amplitude * wave.omega * math.cos(wave.omega * time + wave.phase)
    return scaled(speed, wave.axis)
