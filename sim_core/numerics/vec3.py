"""3-vectors as NamedTuples: registers in compiled code, where a numpy row would be an allocation."""

from typing import NamedTuple

from sim_core.numerics.jit import jit


class Vec3(NamedTuple):
    """A vector (x, y, z); metres, metres per second or dimensionless as its name says."""

    x: float
    y: float
    z: float


@jit
def sub(a: Vec3, b: Vec3) -> Vec3:
    """a - b."""
    return Vec3(a.x - b.x, a.y - b.y, a.z - b.z)


@jit
def along(a: Vec3, s: float, b: Vec3) -> Vec3:
    """a + s b."""
    return Vec3(a.x + s * b.x, a.y + s * b.y, a.z + s * b.z)


@jit
def times(s: float, a: Vec3) -> Vec3:
    """s a."""
    return Vec3(s * a.x, s * a.y, s * a.z)


@jit
def cross(a: Vec3, b: Vec3) -> Vec3:
    """Vector product."""
    return Vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)


@jit
def dot(a: Vec3, b: Vec3) -> float:
    """Scalar product."""
    return a.x * b.x + a.y * b.y + a.z * b.z
