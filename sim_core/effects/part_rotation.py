"""A part that turns about an axis, steadily or to and fro, and how a ball's flight looks from it.

In the part's frame its triangles stand still, so their tree is built once; a ball's parabola becomes a curve whose
position, velocity and acceleration are those of a turning frame (Goldstein, Poole & Safko, Classical Mechanics, 3rd
ed., section 4.10: Coriolis, centrifugal and Euler terms). That curve differs from the parabola that touches it by at
most J t³/6, with J a bound on its third derivative: in the plane across the axis the flight w(t) is seen as
E w with E = exp(-i angle), and E w has the third derivative E''' w + 3 E'' w' + 3 E' w''.
"""

import math
from typing import NamedTuple

import numpy as np

from sim_core.errors import SceneError, number
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.vec3 import Vec3, along, cross, dot, sub

FASTEST = 1e5  # rpm; and the angular speed of 1e5 rpm for a part that swings. No peened part turns a tenth as fast.
LARGEST_SWING = 100.0 * math.pi  # rad, zero-to-peak
TURN = 2.0 * math.pi
ROUND_AGAIN = 1.01  # turns: a little more than one


class PartRotation(NamedTuple):
    """Rotation of the surface ``tag`` about an axis: steady (``rpm``) or to and fro.

    At angle 0 the part is where the mesh has it. Impacts on it are logged in its own frame, that
    is, on the part as the mesh has it.

    Args:
        tag: surface tag of the part.
        axis_point: a point of the axis [m].
        axis: direction of the axis; angles are right-handed about it.
        rpm: steady rotation [1/min]: the angle is 2π rpm/60 t + phase.
        amplitude: zero-to-peak angle [rad] of a rotation to and fro, with ``frequency``: the angle
            is amplitude sin(2π frequency t + phase).
        frequency: of the rotation to and fro [Hz].
        phase: angle, or phase of the sine, at time 0 [rad].
    """

    tag: int
    axis_point: tuple[float, float, float] = (0.0, 0.0, 0.0)
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    rpm: float | None = None
    amplitude: float | None = None
    frequency: float | None = None
    phase: float = 0.0


class Axle(NamedTuple):
    """What of a Turn the shape of the moving obstacles depends on; hashable.

    ``point`` [m] and unit ``axis``; ``swing`` [rad], infinite for a part that goes round.
    """

    tag: int
    point: tuple[float, float, float]
    axis: tuple[float, float, float]
    swing: float


class Turning(NamedTuple):
    """Turn as compiled code wants it.

    ``axis`` (unit) and ``point`` [m], relative to the mesh's middle; ``rate`` [rad/s] at which the argument grows;
    ``swings``: the angle is ``swing`` times its sine, or the argument itself; ``speed``, ``acceleration``, ``jerk``
    [rad/s, s², s³]: bounds on the angle's derivatives; ``argument`` (1,) [rad]: at the window's start, carried from
    window to window, so that the angle has no step there however long the run.
    """

    axis: Vec3
    point: Vec3
    rate: float
    swing: float
    swings: bool
    speed: float
    acceleration: float
    jerk: float
    argument: np.ndarray


class Seen(NamedTuple):
    """A ball as seen from the part: position [m], velocity [m/s] and acceleration [m/s²] in its turning frame."""

    position: Vec3
    velocity: Vec3
    acceleration: Vec3


def checked_turn(turn: PartRotation | None, middle: np.ndarray) -> Turning | None:
    """Raises SceneError for numbers out of range; ``middle`` (3,) [m] is the mesh's."""
    if turn is None:
        return None
    axle = checked_axle(turn)
    assert axle is not None
    rate, swing, swings = 0.0, 0.0, turn.rpm is None
    if turn.rpm is not None:
        rate = TURN * float(turn.rpm) / 60.0
        bounds = (abs(rate), 0.0, 0.0)
    else:
        assert turn.amplitude is not None
        assert turn.frequency is not None
        swing, rate = float(turn.amplitude), TURN * float(turn.frequency)
        bounds = (swing * rate, swing * rate**2, swing * rate**3)
    point = np.array(axle.point) - middle
    return Turning(
        Vec3(*axle.axis),
        Vec3(*(float(k) for k in point)),
        rate,
        swing,
        swings,
        *bounds,
        np.array([float(turn.phase) % TURN]),
    )


def checked_axle(turn: PartRotation | None) -> Axle | None:
    """The axis of a Turn; raises SceneError for numbers out of range."""
    if turn is None:
        return None
    fastest = TURN * FASTEST / 60.0
    for name in ("rpm", "amplitude", "frequency", "phase"):
        if getattr(turn, name) is not None:
            number(f"part_rotation.{name}", getattr(turn, name))
    if (turn.rpm is None) == (turn.amplitude is None) or (turn.amplitude is None) != (
        turn.frequency is None
    ):
        raise SceneError("part_rotation: give either rpm, or amplitude and frequency")
    if turn.rpm is not None and not abs(turn.rpm) <= FASTEST:
        raise SceneError(
            f"part_rotation.rpm is {turn.rpm}: it must lie between {-FASTEST:g} and {FASTEST:g}"
        )
    if turn.amplitude is not None and turn.frequency is not None:
        if not 0.0 <= turn.amplitude <= LARGEST_SWING:
            raise SceneError(
                f"part_rotation.amplitude is {turn.amplitude} rad: it must lie between 0 and {LARGEST_SWING:.0f}"
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
    return Axle(
        int(turn.tag),
        (px, py, pz),
        (x, y, z),
        math.inf if turn.amplitude is None else float(turn.amplitude),
    )


def angle_now(turning: Turning, time: float) -> float:
    """The part's angle [rad] at a time of the current window."""
    argument = float(turning.argument[0]) + turning.rate * time
    return turning.swing * math.sin(argument) if turning.swings else argument


def turned(points: np.ndarray, point: np.ndarray, axis: np.ndarray, angle: float) -> np.ndarray:
    """Points (..., 3) [m] turned by an angle [rad] about a line (Rodrigues)."""
    offset = points - point
    lift = (offset @ axis)[..., None] * axis
    across = offset - lift
    return np.asarray(
        point + lift + math.cos(angle) * across + math.sin(angle) * np.cross(axis, across)
    )


@jit
def shift_rotation(turning: Turning | None, window: float) -> None:
    """Move the clock's zero forward by ``window`` [s]: the angle at the new zero is that at the old window's end."""
    if turning is None:
        return
    turning.argument[0] = (turning.argument[0] + turning.rate * window) % TURN


@inlined
def one_turn(turning: Turning | None, length: float) -> float:
    """Time [s] by which the part has been wherever it gets, at least ``length``: what lies still and has not been
    touched by then never will be.
    """
    if turning is None:
        return length
    if turning.rate == 0.0:
        return length
    return max(length, ROUND_AGAIN * TURN / abs(turning.rate))


@jit
def _turn_back(turning: Turning, vector: Vec3, c: float, s: float) -> Vec3:
    """A vector of the room in the part's frame: turned by minus the angle whose cosine and sine are c and s."""
    lift = (1.0 - c) * dot(turning.axis, vector)
    side = cross(turning.axis, vector)
    return Vec3(
        c * vector.x - s * side.x + lift * turning.axis.x,
        c * vector.y - s * side.y + lift * turning.axis.y,
        c * vector.z - s * side.z + lift * turning.axis.z,
    )


@jit
def seen_from_part(
    turning: Turning, position: Vec3, velocity: Vec3, acceleration: Vec3, time: float
) -> Seen:
    """A ball as the part sees it; all arguments in the room's frame, ``time`` [s] of the current window."""
    argument = turning.argument[0] + turning.rate * time
    angle, speed, change = argument, turning.rate, 0.0
    if turning.swings:
        sine = turning.swing * math.sin(argument)
        angle = sine
        speed = turning.swing * turning.rate * math.cos(argument)
        change = -turning.rate * turning.rate * sine
    c, s = math.cos(angle), math.sin(angle)
    offset = _turn_back(turning, sub(position, turning.point), c, s)
    side = cross(turning.axis, offset)
    relative = along(_turn_back(turning, velocity, c, s), -speed, side)
    bend = along(
        _turn_back(turning, acceleration, c, s), -2.0 * speed, cross(turning.axis, relative)
    )
    bend = along(along(bend, -speed * speed, cross(turning.axis, side)), -change, side)
    return Seen(along(offset, 1.0, turning.point), relative, bend)


@jit
def from_part(turning: Turning, vector: Vec3, time: float) -> Vec3:
    """A vector of the part's frame in the room's."""
    argument = turning.argument[0] + turning.rate * time
    angle = turning.swing * math.sin(argument) if turning.swings else argument
    return _turn_back(turning, vector, math.cos(angle), -math.sin(angle))


@jit
def slip(turning: Turning, seen: Seen, away: Vec3, time: float) -> Vec3:
    """The ball's velocity [m/s] relative to the surface it touches, in the part's frame.

    ``away`` [m]: from the touched point to the ball's centre. The frame's velocity is that at the centre; the normal
    component is the same at both.
    """
    speed = turning.rate
    if turning.swings:
        speed *= turning.swing * math.cos(turning.argument[0] + turning.rate * time)
    return along(seen.velocity, speed, cross(turning.axis, away))


@jit
def jerk_bound(turning: Turning, reach: float, speed: float, acceleration: float) -> float:
    """J [m/s³] of a flight that stays within ``reach`` [m] of the axis, slower than ``speed`` [m/s] across it.

    ``acceleration`` [m/s²]: acceleration across the axis, in the room.
    """
    first = turning.speed
    second = turning.acceleration + first * first
    third = turning.jerk + 3.0 * first * turning.acceleration + first * first * first
    return third * reach + 3.0 * second * speed + 3.0 * first * acceleration
