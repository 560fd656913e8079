"""Logs of the shot's impacts on the recorded surfaces and, on request, of collisions between balls.

Each log has one array for each quantity. The compiled event loop writes into buffers of a fixed
size, whose rows are copied into a log when a buffer is full.
"""

from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np

from sim_core.geometry.analytic import AnalyticCavity
from sim_core.geometry.mesh import TriangleMesh
from sim_core.geometry.triangle_lookup import TriangleLookup, find_triangle
from sim_core.motion import BallEvent
from sim_core.numerics.jit import inlined
from sim_core.numerics.vec3 import Vec3, dot, scaled, set_vec3

BUFFER_SIZE = 65_536  # rows that the compiled loop writes before it hands them over


class Impact(NamedTuple):
    """A hit of a ball on a surface, in the surface's frame. A normal speed of 0 means no hit.

    tag: tag of the surface.
    triangle: a triangle of the flat face that was hit.
    touched: a point [m] of the face, which tells the exact triangle.
    position: position of the ball's centre [m].
    velocity: velocity of the ball relative to the surface, before the hit [m/s].
    normal_speed: normal component of this velocity [m/s].
    away: any vector along the mean surface's normal, from the surface to the ball.
    """

    tag: int
    triangle: int
    touched: Vec3
    position: Vec3
    velocity: Vec3
    normal_speed: float
    away: Vec3


class ImpactBuffer(NamedTuple):
    """Arrays of BUFFER_SIZE rows into which the compiled loop writes impacts, one row an impact.

    The columns are described at ImpactLog.

    filled: number of rows written, (1,).
    record: True if the surface of a tag is recorded, (MAX_TAGS,) bool.
    record_held: True if impacts of balls that rattle in a gap are logged too, (1,) bool.
    """

    time: np.ndarray
    ball: np.ndarray
    triangle: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    normal_speed: np.ndarray
    filled: np.ndarray
    record: np.ndarray
    record_held: np.ndarray


def new_impact_buffer(record: np.ndarray, record_held: bool) -> ImpactBuffer:
    """Return an empty buffer for impacts.

    ``record``: True for each surface whose impacts are recorded, by its tag, (MAX_TAGS,) bool.
    ``record_held``: True if impacts of balls that rattle in a gap are logged too.
    """
    return ImpactBuffer(
        time=np.zeros(BUFFER_SIZE),
        ball=np.zeros(BUFFER_SIZE, dtype=np.int32),
        triangle=np.zeros(BUFFER_SIZE, dtype=np.int32),
        position=np.zeros((BUFFER_SIZE, 3)),
        velocity=np.zeros((BUFFER_SIZE, 3)),
        normal_speed=np.zeros(BUFFER_SIZE),
        filled=np.zeros(1, dtype=np.int64),
        record=record,
        record_held=np.array([record_held]),
    )


@inlined
def no_impact() -> Impact:
    """Return an Impact with normal speed 0, for an event that is not a hit on a surface."""
    zero = Vec3(0.0, 0.0, 0.0)
    return Impact(0, 0, zero, zero, zero, 0.0, zero)


@inlined
def log_impact(
    buffer: ImpactBuffer, event: BallEvent, origin: float, impact: Impact, lookup: TriangleLookup
) -> None:
    """Write an impact into the buffer if its surface is recorded.

    ``origin``: end of the warm-up, from which logged times count [s since the start].
    """
    if not (impact.normal_speed > 0.0 and buffer.record[impact.tag]):
        return
    row = buffer.filled[0]
    buffer.time[row] = event.time_since_start - origin
    buffer.ball[row] = event.ball
    buffer.triangle[row] = find_triangle(lookup, impact.triangle, impact.touched)
    set_vec3(buffer.position, row, impact.position)
    set_vec3(buffer.velocity, row, impact.velocity)
    buffer.normal_speed[row] = impact.normal_speed
    buffer.filled[0] = row + 1


@dataclass(frozen=True)
class ImpactLog:
    """The logged impacts, one row an impact, in order of time.

    On a turning part, position and velocity are in the part's own frame, with the part placed as in
    the mesh.

    time: [s] since the end of the warm-up, (n,).
    ball, triangle: indices into the scene's balls and mesh, (n,) int32. An impact on an edge counts
        for the neighbour triangle that faces the ball more.
    position: position of the ball's centre [m], (n, 3).
    velocity: velocity before the impact, relative to the surface [m/s], (n, 3).
    normal_speed: positive normal speed [m/s], (n,).
    """

    time: np.ndarray
    ball: np.ndarray
    triangle: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    normal_speed: np.ndarray

    def __len__(self) -> int:
        return len(self.time)

    def only(self, rows: np.ndarray) -> "ImpactLog":
        """Return a log of the impacts that ``rows`` selects, a mask (n,) bool or indices."""
        return ImpactLog(**{name: column[rows] for name, column in vars(self).items()})


class CollisionBuffer(NamedTuple):
    """Arrays of BUFFER_SIZE rows into which the compiled loop writes collisions of two balls.

    The columns are described at CollisionLog.

    filled: number of rows written, (1,).
    record: True if collisions are logged now, (1,) bool.
    """

    time: np.ndarray
    one: np.ndarray
    two: np.ndarray
    position: np.ndarray
    normal: np.ndarray
    velocity: np.ndarray
    normal_speed: np.ndarray
    filled: np.ndarray
    record: np.ndarray


def new_collision_buffer(wanted: bool) -> CollisionBuffer | None:
    """Return an empty buffer whose logging is still off. Return None unless ``wanted``."""
    if not wanted:
        return None
    return CollisionBuffer(
        time=np.zeros(BUFFER_SIZE),
        one=np.zeros(BUFFER_SIZE, dtype=np.int32),
        two=np.zeros(BUFFER_SIZE, dtype=np.int32),
        position=np.zeros((BUFFER_SIZE, 3)),
        normal=np.zeros((BUFFER_SIZE, 3)),
        velocity=np.zeros((BUFFER_SIZE, 3)),
        normal_speed=np.zeros(BUFFER_SIZE),
        filled=np.zeros(1, dtype=np.int64),
        record=np.zeros(1, dtype=np.bool_),
    )


@inlined
def is_full(buffer: CollisionBuffer | None) -> bool:
    """Return True if the buffer has no row left for a further collision."""
    if buffer is None:
        return False
    return bool(buffer.filled[0] == len(buffer.time))


class Collision(NamedTuple):
    """Two balls at the moment when they touch. They do not collide if they already move apart.

    one, two: numbers of the balls.
    position: point where the balls touch [m].
    apart: vector from ball one to ball two [m].
    velocity: velocity of ball two relative to ball one, before the collision [m/s].
    """

    one: int
    two: int
    position: Vec3
    apart: Vec3
    velocity: Vec3


@inlined
def log_collision(buffer: CollisionBuffer, time: float, collision: Collision) -> None:
    """Write a collision into the buffer if collisions are logged now and the balls approach.

    ``time``: [s] since the end of the warm-up.
    """
    apart = collision.apart
    distance = np.sqrt(dot(apart, apart))
    speed = -dot(apart, collision.velocity) / distance
    if not (buffer.record[0] and speed > 0.0):
        return
    row = buffer.filled[0]
    buffer.time[row] = time
    buffer.one[row] = collision.one
    buffer.two[row] = collision.two
    set_vec3(buffer.position, row, collision.position)
    set_vec3(buffer.normal, row, scaled(1.0 / distance, apart))
    set_vec3(buffer.velocity, row, collision.velocity)
    buffer.normal_speed[row] = speed
    buffer.filled[0] = row + 1


@dataclass(frozen=True)
class CollisionLog:
    """The logged collisions, one row a collision of two balls, in order of time.

    time: [s] since the end of the warm-up, (n,).
    one, two: numbers of the balls, (n,) int32.
    position: point where the balls touch [m], (n, 3).
    normal: unit vector from ball one to ball two, (n, 3).
    velocity: velocity of ball two relative to ball one before the collision, without spins [m/s],
        (n, 3).
    normal_speed: positive speed of approach before the collision [m/s], (n,).
    """

    time: np.ndarray
    one: np.ndarray
    two: np.ndarray
    position: np.ndarray
    normal: np.ndarray
    velocity: np.ndarray
    normal_speed: np.ndarray

    def __len__(self) -> int:
        return len(self.time)


Log = TypeVar("Log", ImpactLog, CollisionLog)


def empty_buffer(buffer: ImpactBuffer | CollisionBuffer, kind: type[Log]) -> Log:
    """Return the rows of a buffer as a log of type ``kind``, and empty the buffer."""
    rows = int(buffer.filled[0])
    buffer.filled[0] = 0
    names = kind.__dataclass_fields__
    return kind(**{name: getattr(buffer, name)[:rows].copy() for name in names})


def joined(logs: list[Log], room: TriangleMesh | AnalyticCavity) -> Log:
    """Return one log with the rows of all logs, in order, and with positions [m] in the room.

    The positions in ``logs`` are relative to the room's middle.
    """
    kind = type(logs[0])
    names = kind.__dataclass_fields__
    whole = kind(**{name: np.concatenate([vars(log)[name] for log in logs]) for name in names})
    whole.position[:] += room.middle
    if isinstance(room, AnalyticCavity):
        whole.position[:] = room.put_back(whole.position)
    return whole
