"""3-vectors as NamedTuples: registers in compiled code, where a numpy row would be allocated."""

from typing import NamedTuple

import numpy as np

from sim_core.numerics.jit import jit


class Vec3(NamedTuple):
    """A vector (x, y, z). Its unit, if any, is given where the vector is used."""

    x: float
    y: float
    z: float


class Flight(NamedTuple):
    """A ball's centre on its parabola now: position [m], velocity [m/s], acceleration [m/s²]."""

    position: Vec3
    velocity: Vec3
    acceleration: Vec3


class Touch(NamedTuple):
    """Contact of a ball with a surface.

    away: any vector along the normal, from the surface to the ball.
    relative: velocity of the ball minus the velocity of the surface, before the hit [m/s].
    tag: tag of the surface.
    kind: kind of the obstacle: FACE, CAPSULE, VIBRATING_FACE or CYLINDER_WALL.
    triangle: triangle of the surface. Of a flat face it is any one, unless parts are thin.
    """

    away: Vec3
    relative: Vec3
    tag: int
    kind: int
    triangle: int


@jit
def sub(a: Vec3, b: Vec3) -> Vec3:
    """Return the difference a - b."""
    return Vec3(a.x - b.x, a.y - b.y, a.z - b.z)


@jit
def add_scaled(a: Vec3, s: float, b: Vec3) -> Vec3:
    """Return the sum a + s b."""
    return Vec3(a.x + s * b.x, a.y + s * b.y, a.z + s * b.z)


@jit
def scaled(s: float, a: Vec3) -> Vec3:
    """Return the product s a."""
    return Vec3(s * a.x, s * a.y, s * a.z)


@jit
def cross(a: Vec3, b: Vec3) -> Vec3:
    """Return the vector product of a and b."""
    return Vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)


@jit
def dot(a: Vec3, b: Vec3) -> float:
    """Return the scalar product of a and b."""
    return a.x * b.x + a.y * b.y + a.z * b.z


@jit
def vec3_at(array: np.ndarray, row: int) -> Vec3:
    """Return the first three numbers of a row of an array (n, 3) or wider, as a vector."""
    return Vec3(array[row, 0], array[row, 1], array[row, 2])


@jit
def set_vec3(array: np.ndarray, row: int, a: Vec3) -> None:
    """Write a vector into the first three numbers of a row of an array."""
    for axis in range(3):
        array[row, axis] = a[axis]


@jit
def position_after(flight: Flight, delay: float) -> Vec3:
    """Return the position [m] of a flying ball after ``delay`` [s]."""
    moved = add_scaled(flight.position, delay, flight.velocity)
    return add_scaled(moved, 0.5 * delay * delay, flight.acceleration)


@jit
def velocity_after(flight: Flight, delay: float) -> Vec3:
    """Return the velocity [m/s] of a flying ball after ``delay`` [s]."""
    return add_scaled(flight.velocity, delay, flight.acceleration)


@jit
def flight_after(flight: Flight, delay: float) -> Flight:
    """Return position, velocity and acceleration of a flying ball after ``delay`` [s]."""
    return Flight(position_after(flight, delay), velocity_after(flight, delay), flight.acceleration)
