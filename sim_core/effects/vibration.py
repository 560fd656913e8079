"""The sonotrode: one tagged surface moves as a rigid body by amplitude sin(2π frequency t + phase), exactly.

Source: the process itself (a piezoelectric generator at a fixed frequency, amplitude zero-to-peak); the face's peak
speed is 2π frequency amplitude. Several of them: sonotrodes.py.
"""

import math
from typing import NamedTuple

import numpy as np

from sim_core.errors import SceneError, number
from sim_core.numerics.jit import jit
from sim_core.numerics.vec3 import Vec3

HIGHEST = 1e9  # Hz: generators have 1e5 at most; a wave of 1e300 would be searched for ever, period after period


class Vibration(NamedTuple):
    """Harmonic motion of the surface ``tag`` along ``axis``.

    ``amplitude`` [m] zero-to-peak; ``frequency`` [Hz]; ``phase`` [rad] at time 0.
    """

    tag: int
    amplitude: float
    frequency: float
    phase: float = 0.0
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)

    @property
    def peak_speed(self) -> float:
        """Largest speed of the face [m/s]."""
        return 2.0 * math.pi * self.frequency * self.amplitude

    @property
    def peak(self) -> np.ndarray:
        """Displacement of the face at its peak [m], (3,)."""
        return self.amplitude * np.array(self.axis) / np.linalg.norm(self.axis)


class Wave(NamedTuple):
    """Vibration as compiled code wants it: ``swing`` [m], ``omega`` [rad/s], ``phase`` [rad], ``axis``."""

    swing: float
    omega: float
    phase: float
    axis: Vec3


def checked_waves(vibration: Vibration | tuple[Vibration, ...] | None) -> tuple[Wave, ...]:
    """Of each that vibrates; raises SceneError for numbers out of range, and for one tag that vibrates twice."""
    if vibration is None:
        return ()
    if isinstance(vibration, Vibration):
        return (_checked_wave("vibration", vibration),)
    each: list[Vibration] = [*vibration] if isinstance(vibration, tuple) else []
    if not each or not all(isinstance(one, Vibration) for one in each):
        raise SceneError(
            f"physics.vibration is {vibration!r}: give a Vibration, several of them in a tuple, or None"
        )
    tags = [one.tag for one in each]
    for k, tag in enumerate(tags):
        if tag in tags[:k]:
            raise SceneError(
                f"vibration[{k}].tag is {tag}, as vibration[{tags.index(tag)}].tag: give each its own"
            )
    return tuple(_checked_wave(f"vibration[{k}]", one) for k, one in enumerate(each))


def _checked_wave(which: str, vibration: Vibration) -> Wave:
    for name in ("amplitude", "frequency", "phase"):
        number(f"{which}.{name}", getattr(vibration, name))
    if not 0.0 <= vibration.amplitude < math.inf:
        raise SceneError(f"{which}.amplitude is {vibration.amplitude} m: it must be 0 or more")
    if not 0.0 < vibration.frequency <= HIGHEST:
        raise SceneError(
            f"{which}.frequency is {vibration.frequency} Hz: it must be positive and at most {HIGHEST:g} Hz"
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
    """Velocity of the vibrating surface [m/s] at a time of the current window; zero without vibration."""
    if wave is None:
        return Vec3(0.0, 0.0, 0.0)
    speed = wave.swing * wave.omega * math.cos(wave.omega * time + wave.phase)
    return Vec3(speed * wave.axis.x, speed * wave.axis.y, speed * wave.axis.z)
