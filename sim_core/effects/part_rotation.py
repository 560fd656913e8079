"""A part that turns about an axis, steadily or to and fro, and flights relative to it.

The triangles of the part stand still in its frame, so that their tree is built once. In this frame
a ball's parabola becomes a curve. Its position, velocity and acceleration follow from the turning
frame, with Coriolis, centrifugal and Euler terms.

Notation:
    phi: angle of the part [rad]; phi = psi, or A sin(psi) where it turns to and fro
    psi: argument [rad], growing at ``rate`` [rad/s]; A: ``amplitude`` [rad]
    w(t): the flight projected on the plane across the axis, as a complex number [m]
    E: exp(-i phi); the part sees E w, whose third derivative is E''' w + 3 E'' w' + 3 E' w''
    J: bound on that derivative [m/s³], ``jerk``; the curve differs from the parabola that touches
        it at t = 0 by at most J t³/6

Source: Goldstein, Poole & Safko, Classical Mechanics, 3rd ed., section 4.10.
"""

import math
from typing import NamedTuple

import numpy as np

from sim_core.errors import SceneError, number
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.vec3 import Flight, Vec3, add_scaled, cross, dot, sub

MAX_RPM = 1e5  # 1/min; also the limit of the speed to and fro; no peened part turns a tenth as fast
MAX_AMPLITUDE = 100.0 * math.pi  # rad
TURN = 2.0 * math.pi
MORE_THAN_ONE = 1.01  # turns


class PartRotation(NamedTuple):
    """Rotation of the surface ``tag``, and of what holds it, about an axis: steady or to and fro.

    At angle 0 the part is placed as in the mesh. Impacts on the part are logged in its own frame,
    that is, on the part as placed in the mesh.

    Args:
        tag: surface tag of the part.
        axis_point: a point of the axis [m].
        axis: direction of the axis. Angles are right-handed about it.
        rpm: speed of a steady rotation [1/min]. The angle is 2π rpm/60 t + phase.
        amplitude: zero-to-peak angle [rad] of a rotation to and fro. The angle is amplitude sin(2π
            frequency t + phase).
        frequency: frequency of a rotation to and fro [Hz].
        phase: angle, or phase of the sine, at time 0 [rad].
        with_part: tags of further surfaces that turn with the part, such as its holder.
    """

    tag: int
    axis_point: tuple[float, float, float] = (0.0, 0.0, 0.0)
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    rpm: float | None = None
    amplitude: float | None = None
    frequency: float | None = None
    phase: float = 0.0
    with_part: tuple[int, ...] = ()

    @property
    def tags(self) -> tuple[int, ...]:
        """Tags of all surfaces that turn, the part first."""
        return (self.tag, *self.with_part)


class RotationAxis(NamedTuple):
    """Axis and range of a part's rotation, from which the part's obstacles are built."""

    tags: tuple[int, ...]  # of the surfaces that turn
    point: tuple[float, float, float]  # a point of the axis [m]
    axis: tuple[float, float, float]  # unit vector
    amplitude: float  # largest angle to each side [rad]; infinite for a steady rotation

    def turns(self, tags: np.ndarray) -> np.ndarray:
        """Return True for each tag (k,) of a surface that turns."""
        return np.isin(tags, self.tags)


class RotationState(NamedTuple):
    """Rotation of the part, as numbers for compiled code."""

    axis: Vec3  # unit vector
    point: Vec3  # a point of the axis, relative to the mesh's middle [m]
    rate: float  # growth of the argument psi [rad/s]
    amplitude: float  # amplitude of a rotation to and fro [rad]
    to_and_fro: bool  # True if the angle is ``amplitude`` times the sine of the argument
    speed: float  # bound on the angle's first derivative [rad/s]
    acceleration: float  # bound on its second derivative [rad/s²]
    jerk: float  # bound on its third derivative [rad/s³]
    # Argument psi at the window's start [rad], shape (1,). It is carried from window to window, so
    # that the angle has no step there however long the simulation is.
    argument: np.ndarray


def new_rotation_state(turn: PartRotation | None, middle: np.ndarray) -> RotationState | None:
    """Return the rotation of the part at time 0, as numbers for compiled code.

    ``middle``: middle of the mesh [m], (3,).

    Raises:
        SceneError: for numbers out of range.
    """
    if turn is None:
        return None
    axis = checked_axis(turn)
    assert axis is not None
    amplitude, to_and_fro = 0.0, turn.rpm is None
    if turn.rpm is not None:
        rate = TURN * float(turn.rpm) / 60.0
        bounds = (abs(rate), 0.0, 0.0)
    else:
        assert turn.amplitude is not None
        assert turn.frequency is not None
        amplitude, rate = float(turn.amplitude), TURN * float(turn.frequency)
        bounds = (amplitude * rate, amplitude * rate**2, amplitude * rate**3)
    point = Vec3(*(float(k) for k in np.array(axis.point) - middle))
    argument = np.array([float(turn.phase) % TURN])
    return RotationState(Vec3(*axis.axis), point, rate, amplitude, to_and_fro, *bounds, argument)


def checked_axis(turn: PartRotation | None) -> RotationAxis | None:
    """Check the rotation of the part, and return its axis and range.

    Raises:
        SceneError: for a number out of range. The message names its field.
    """
    if turn is None:
        return None
    fastest = TURN * MAX_RPM / 60.0
    for name in ("rpm", "amplitude", "frequency", "phase"):
        if getattr(turn, name) is not None:
            number(f"part_rotation.{name}", getattr(turn, name))
    one_of_two = (turn.rpm is None) != (turn.amplitude is None)
    if not one_of_two or (turn.amplitude is None) != (turn.frequency is None):
        raise SceneError("part_rotation: give either rpm, or amplitude and frequency")
    if turn.rpm is not None and not abs(turn.rpm) <= MAX_RPM:
        raise SceneError(
            f"part_rotation.rpm is {turn.rpm}: it must lie between {-MAX_RPM:g} and {MAX_RPM:g}"
        )
    if turn.amplitude is not None and turn.frequency is not None:
        if not 0.0 <= turn.amplitude <= MAX_AMPLITUDE:
            raise SceneError(
                f"part_rotation.amplitude is {turn.amplitude} rad: it must lie between 0 and "
                f"{MAX_AMPLITUDE:.0f}"
            )
        if not 0.0 < turn.frequency < math.inf:
            raise SceneError(f"part_rotation.frequency is {turn.frequency} Hz: it must be positive")
        if not TURN * turn.frequency * turn.amplitude <= fastest:
            raise SceneError(
                f"part_rotation.amplitude of {turn.amplitude:g} rad at {turn.frequency:g} Hz "
                f"turns faster than {fastest:.0f} rad/s: make one of them smaller"
            )
    if not math.isfinite(turn.phase):
        raise SceneError(f"part_rotation.phase is {turn.phase} rad: it must be finite")
    if len(turn.axis) != 3 or not 0.0 < math.hypot(*turn.axis) < math.inf:
        raise SceneError(f"part_rotation.axis is {turn.axis}: it must be a direction")
    if len(turn.axis_point) != 3 or not all(math.isfinite(k) for k in turn.axis_point):
        raise SceneError(f"part_rotation.axis_point is {turn.axis_point}: give three numbers [m]")
    length = math.hypot(*turn.axis)
    x, y, z = (float(k) / length for k in turn.axis)
    px, py, pz = (float(k) for k in turn.axis_point)
    amplitude = math.inf if turn.amplitude is None else float(turn.amplitude)
    return RotationAxis(tuple(map(int, turn.tags)), (px, py, pz), (x, y, z), amplitude)


def angle_at(rotation: RotationState, time: float) -> float:
    """Return the part's angle [rad] at ``time`` since the start of the present time window [s]."""
    argument = float(rotation.argument[0]) + rotation.rate * time
    return rotation.amplitude * math.sin(argument) if rotation.to_and_fro else argument


def rotate_points(
    points: np.ndarray, point: np.ndarray, axis: np.ndarray, angle: float
) -> np.ndarray:
    """Return points turned by an angle about a line, by the formula of Rodrigues.

    Args:
        points: points [m], shape (..., 3).
        point: a point of the line [m].
        axis: unit vector along the line.
        angle: angle [rad], right-handed about ``axis``.
    """
    offset = points - point
    lift = (offset @ axis)[..., None] * axis
    across = offset - lift
    moved = point + lift + math.cos(angle) * across
    return np.asarray(moved + math.sin(angle) * np.cross(axis, across))


@jit
def shift_rotation(rotation: RotationState | None, window: float) -> None:
    """Rewrite the part's rotation for a clock that starts ``window`` [s] later."""
    if rotation is None:
        return
    rotation.argument[0] = (rotation.argument[0] + rotation.rate * window) % TURN


@inlined
def time_of_one_turn(rotation: RotationState | None, length: float) -> float:
    """Return a time [s], ``length`` or longer, within which the part reaches each of its angles.

    A still ball that the part has not touched by then will never be touched.
    """
    if rotation is None:
        return length
    if rotation.rate == 0.0:
        return length
    return max(length, MORE_THAN_ONE * TURN / abs(rotation.rate))


@jit
def _turn_back(rotation: RotationState, vector: Vec3, c: float, s: float) -> Vec3:
    """Return a vector turned about the part's axis, backwards.

    ``c`` and ``s`` are cosine and sine of the angle.
    """
    lift = (1.0 - c) * dot(rotation.axis, vector)
    side = cross(rotation.axis, vector)
    return Vec3(
        c * vector.x - s * side.x + lift * rotation.axis.x,
        c * vector.y - s * side.y + lift * rotation.axis.y,
        c * vector.z - s * side.z + lift * rotation.axis.z,
    )


@jit
def relative_flight(rotation: RotationState, flight: Flight, time: float) -> Flight:
    """Return position, velocity and acceleration of a ball as seen from the turning part.

    ``flight``: position, velocity and acceleration in the room at ``time`` [s], counted from the
    start of the time window.
    """
    argument = rotation.argument[0] + rotation.rate * time
    angle, speed, change = argument, rotation.rate, 0.0
    if rotation.to_and_fro:
        angle = rotation.amplitude * math.sin(argument)
        speed = rotation.amplitude * rotation.rate * math.cos(argument)
        change = -rotation.rate * rotation.rate * angle
    c, s = math.cos(angle), math.sin(angle)
    offset = _turn_back(rotation, sub(flight.position, rotation.point), c, s)
    side = cross(rotation.axis, offset)
    relative = add_scaled(_turn_back(rotation, flight.velocity, c, s), -speed, side)
    bend = _turn_back(rotation, flight.acceleration, c, s)
    bend = add_scaled(bend, -2.0 * speed, cross(rotation.axis, relative))  # Coriolis
    bend = add_scaled(bend, -speed * speed, cross(rotation.axis, side))  # centrifugal
    bend = add_scaled(bend, -change, side)  # Euler
    return Flight(add_scaled(offset, 1.0, rotation.point), relative, bend)


@jit
def to_room_frame(rotation: RotationState, vector: Vec3, time: float) -> Vec3:
    """Return a vector of the turning part's frame as it points in the room at ``time`` [s]."""
    argument = rotation.argument[0] + rotation.rate * time
    angle = rotation.amplitude * math.sin(argument) if rotation.to_and_fro else argument
    return _turn_back(rotation, vector, math.cos(angle), -math.sin(angle))


@jit
def slip_velocity(rotation: RotationState, flight: Flight, away: Vec3, time: float) -> Vec3:
    """Return a ball's velocity [m/s] relative to the surface of the turning part that it touches.

    The result is in the part's frame.

    Args:
        rotation: rotation of the part.
        flight: flight of the ball in the part's frame. Its velocity is relative to the frame at the
            ball's centre, and its normal component is the same at the touched point.
        away: vector from the touched point to the ball's centre [m].
        time: time since the start of the present time window [s].
    """
    speed = rotation.rate
    if rotation.to_and_fro:
        speed *= rotation.amplitude * math.cos(rotation.argument[0] + rotation.rate * time)
    return add_scaled(flight.velocity, speed, cross(rotation.axis, away))


@jit
def jerk_bound(rotation: RotationState, reach: float, speed: float, acceleration: float) -> float:
    """Return a bound on the third derivative of a flight as seen from the turning part [m/s³].

    Args:
        rotation: rotation of the part.
        reach: largest distance of the flight from the axis [m].
        speed: bound on the ball's speed across the axis, in the room [m/s].
        acceleration: acceleration across the axis, in the room [m/s²].
    """
    first = rotation.speed
    second = rotation.acceleration + first * first
    third = rotation.jerk + 3.0 * first * rotation.acceleration + first * first * first
    return third * reach + 3.0 * second * speed + 3.0 * first * acceleration
