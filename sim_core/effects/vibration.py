"""The sonotrode: one tagged surface moves as a rigid body by amplitude sin(2π frequency t + phase), exactly.

Source: the process itself (a piezoelectric generator at a fixed frequency, amplitude zero-to-peak); the face's peak
speed is 2π frequency amplitude.
"""

import math
from typing import NamedTuple

from sim_core._compile import jit
from sim_core.errors import SceneError, number
from sim_core.vec3 import Vec3

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


class Wave(NamedTuple):
    """Vibration as compiled code wants it: ``swing`` [m], ``omega`` [rad/s], ``phase`` [rad], ``axis``."""

    swing: float
    omega: float
    phase: float
    axis: Vec3


def checked_wave(vibration: Vibration | None) -> Wave | None:
    """Raises SceneError for numbers out of range."""
    if vibration is None:
        return None
    for name in ("amplitude", "frequency", "phase"):
        number(f"vibration.{name}", getattr(vibration, name))
    if not 0.0 <= vibration.amplitude < math.inf:
        raise SceneError(f"vibration.amplitude is {vibration.amplitude} m: it must be 0 or more")
    if not 0.0 < vibration.frequency <= HIGHEST:
        raise SceneError(
            f"vibration.frequency is {vibration.frequency} Hz: it must be positive and at most {HIGHEST:g} Hz"
        )
    if not math.isfinite(vibration.phase):
        raise SceneError(f"vibration.phase is {vibration.phase} rad: it must be finite")
    length = math.hypot(*vibration.axis)
    if not 0.0 < length < math.inf:
        raise SceneError(f"vibration.axis is {vibration.axis}: it must be a direction")
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
