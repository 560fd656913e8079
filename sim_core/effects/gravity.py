"""Uniform gravity: every flight is a parabola. Badreddine et al., "CAD based simulation of ultrasonic shot peening",
eq. 1.
"""

from typing import NamedTuple

from sim_core._compile import jit
from sim_core.vec3 import Vec3

STANDARD = 9.80665  # m/s², CGPM 1901


class Gravity(NamedTuple):
    """Acceleration of every ball [m/s²]."""

    x: float = 0.0
    y: float = 0.0
    z: float = -STANDARD


@jit
def acceleration(gravity: Gravity | None) -> Vec3:
    """Acceleration in flight [m/s²]; zero without gravity."""
    if gravity is None:
        return Vec3(0.0, 0.0, 0.0)
    return Vec3(gravity.x, gravity.y, gravity.z)
