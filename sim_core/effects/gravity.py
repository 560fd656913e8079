"""Uniform gravity, under which every ball flies along a parabola.

Source: Badreddine et al., "CAD based simulation of ultrasonic shot peening", eq. 1.
"""

import math
from typing import NamedTuple

from sim_core.errors import SceneError
from sim_core.numerics.jit import jit
from sim_core.numerics.vec3 import Vec3

STANDARD = 9.80665  # m/s², CGPM 1901


class Gravity(NamedTuple):
    """Acceleration of every ball in flight [m/s²], by default 1 g downwards."""

    x: float = 0.0
    y: float = 0.0
    z: float = -STANDARD


def checked_gravity(gravity: Gravity | None) -> Gravity | None:
    """Return gravity as plain floats for compiled code.

    Raises:
        SceneError: if it is not three finite numbers.
    """
    if gravity is None:
        return None
    try:
        x, y, z = gravity
        plain = Gravity(float(x), float(y), float(z))
    except (TypeError, ValueError):
        raise SceneError(f"gravity is {gravity!r}: give three numbers [m/s²]") from None
    if not all(math.isfinite(component) for component in plain):
        raise SceneError(f"gravity is {tuple(plain)} m/s²: it must be finite")
    return plain


@jit
def gravity_acceleration(gravity: Gravity | None) -> Vec3:
    """Return the acceleration of a ball in flight [m/s²]; zero without gravity."""
    if gravity is None:
        return Vec3(0.0, 0.0, 0.0)
    return Vec3(gravity.x, gravity.y, gravity.z)
