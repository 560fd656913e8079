"""Balls that hop on one spot or sit in a gap: series of hits on surfaces that lead nowhere.

A series holds the successive hits of a ball on surfaces that lie within a ball's radius of its
first hit sideways, and during which the ball hits surfaces more often than other balls. In a series
of MIN_HITS or more the ball is

- *rattling* in a gap, as long as all hits so far also lie within a ball's radius in height, come
  from surfaces that face each other, and are slow: below SLOW of the sonotrode's peak speed on
  average. It is held in its gap;
- *hopping* on one spot, if it never rattled and the series lasts for MIN_TIME or more.

Whether a ball rattles is decided at each hit by the hits so far, so that a simulation that is cut
short decides alike. The first MIN_HITS - 1 hits of a series, with which a ball gets into its gap,
are therefore like any others. A ball that has rattled stays held: its slow hits count as those of a
rattling ball, also when it lands or creeps along the gap, until one lies more than its diameter
from the one before.

Sideways means across gravity, or, without gravity, across the motion of the sonotrode. A series
also ends when the ball lands to lie still, slide or roll, of which contact mode tells. Hops that
end like this are not those of a hopping ball. The series of a rattling ball also ends when the ball
gets out of its gap upwards or downwards. On a turning part a hit lies where it is on the part.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sim_core.effects.ball_sizes import BallSizes, radius_of_ball
from sim_core.effects.contact_mode import ContactState, is_flying
from sim_core.effects.gravity import Gravity
from sim_core.effects.vibration import Wave
from sim_core.loop.impact_log import Impact
from sim_core.motion import BallEvent
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.vec3 import Vec3, add_scaled, dot, scaled, set_vec3, sub, vec3_at

# A ball that flies freely makes so many hits within its radius sideways with a chance of some 1e-5,
# and in a low chamber, where hits follow fast, so long with as small a chance.
MIN_HITS = 10
MIN_TIME = 0.1  # s
# Share of the sonotrode's peak speed. The shot's hits have about that speed. A ball in a gap just
# narrower than itself has a hundredth of it.
SLOW = 0.1
# Length of the mean of unit normals, below which surfaces face each other. It is 1 for a single
# plane, and smaller than this for a gap from 0.87 of the ball's width on.
FACING = 0.5
HOPPING, RATTLING = 0, 1  # kinds of stays, places in Stays.time and Stays.recorded


class Stays(NamedTuple):
    """The present series of hits of each of n balls at one place, and its past stays.

    axis: unit vector of height.
    radius: radius of balls that are all alike [m].
    slow: mean normal speed [m/s] below which a ball is rattling.
    place: position of the ball's centre at the first hit of the series [m], (n, 3).
    began, last: times of the first and last hit [s since the start], (n,).
    rise: largest difference in height from the first hit [m], (n,).
    speed: sum of the normal speeds of the hits [m/s], (n,).
    normal: sum of the unit normals of the hits, (n, 3).
    hits: number of the hits, (n,) int32. 0 if there is no series.
    logged: number of those on recorded surfaces, (n,) int32.
    meetings: number of collisions with balls during the series, (n,) int32.
    rattled: last hit at which the ball was rattling [s since the start], (n,). 0 if there
        is none, and negative if the ball got away since.
    time: time for which each ball was HOPPING in past series, and RATTLING so far [s], (n, 2).
    recorded: number of the hits on recorded surfaces in past series of hops, and of those at which
        the ball was rattling, (n, 2) int64.
    spot: position of the ball's centre at the start of its latest series of hops, or at its last
        rattling hit [m], (n, 3).
    """

    axis: Vec3
    radius: float
    slow: float
    place: np.ndarray
    began: np.ndarray
    last: np.ndarray
    rise: np.ndarray
    speed: np.ndarray
    normal: np.ndarray
    hits: np.ndarray
    logged: np.ndarray
    meetings: np.ndarray
    rattled: np.ndarray
    time: np.ndarray
    recorded: np.ndarray
    spot: np.ndarray


@dataclass(frozen=True)
class Trapped:
    """The k balls that hopped on one spot, or sat in a gap, for some of the recorded time.

    ball: numbers of the balls, (k,).
    hopping: time for which each of them hopped on one spot [s], (k,).
    rattling: time for which it sat in a gap [s], (k,).
    hopping_hits: number of its hits on the recorded surfaces in this time, (k,).
    rattling_hits: number of its hits on the recorded surfaces at which it was rattling, (k,).
    at_end: True if it did so at the end, (k,) bool.
    position: position of its centre when it began to do so for the last time [m], (k, 3).
    """

    ball: np.ndarray
    hopping: np.ndarray
    rattling: np.ndarray
    hopping_hits: np.ndarray
    rattling_hits: np.ndarray
    at_end: np.ndarray
    position: np.ndarray

    def __len__(self) -> int:
        return len(self.ball)


def new_stays(balls: int, radius: float, gravity: Gravity | None, waves: tuple[Wave, ...]) -> Stays:
    """Return the series of balls that have not hit anything yet.

    Args:
        balls: number of the balls.
        radius: radius of balls that are all alike [m].
        waves: vibrations of the sonotrodes.
    """
    axis = np.array(waves[0].axis if waves else (0.0, 0.0, 1.0))
    if gravity is not None and any(gravity):
        axis = np.array(gravity) / math.hypot(*gravity)
    peak = max((one.amplitude * one.omega for one in waves), default=math.inf)

    def whole() -> np.ndarray:
        return np.zeros(balls, dtype=np.int32)

    def real() -> np.ndarray:
        return np.zeros(balls)

    return Stays(
        axis=Vec3(*(float(x) for x in axis)),
        radius=radius,
        slow=SLOW * peak,
        place=np.zeros((balls, 3)),
        began=real(),
        last=real(),
        rise=real(),
        speed=real(),
        normal=np.zeros((balls, 3)),
        hits=whole(),
        logged=whole(),
        meetings=whole(),
        rattled=real(),
        time=np.zeros((balls, 2)),
        recorded=np.zeros((balls, 2), dtype=np.int64),
        spot=np.zeros((balls, 3)),
    )


@inlined
def note_hit(
    stays: Stays,
    sizes: BallSizes | None,
    contact: ContactState | None,
    event: BallEvent,
    impact: Impact,
    recorded: bool,
) -> bool:
    """Add a ball's hit on a surface to its series, or begin a new series with it.

    Args:
        impact: the hit. A normal speed of 0 means no hit.
        recorded: True if impacts on the surface are logged now.

    Returns: True if the ball is rattling in a gap.
    """
    ball = event.ball
    if not impact.normal_speed > 0.0:
        return False
    away = sub(impact.position, vec3_at(stays.place, ball))
    height = dot(away, stays.axis)
    radius = radius_of_ball(sizes, stays.radius, ball)
    held = _is_still_held(stays, radius, ball, impact)
    if held:
        _note_held(stays, event, impact.position, recorded)
    landed = not is_flying(contact, ball)
    is_out = abs(stays.rattled[ball]) > stays.began[ball] and abs(height) > radius
    if landed or is_out or dot(away, away) - height * height > radius * radius:
        if stays.hits[ball] >= MIN_HITS:
            end_series(stays, ball, landed)
        stays.hits[ball] = 0
    if landed:
        return held
    if stays.hits[ball] == 0:
        _begin_series(stays, event, impact.position)
        height = 0.0
    normal = scaled(1.0 / math.sqrt(dot(impact.away, impact.away)), impact.away)
    set_vec3(stays.normal, ball, add_scaled(normal, 1.0, vec3_at(stays.normal, ball)))
    stays.last[ball] = event.time_since_start
    stays.rise[ball] = max(stays.rise[ball], abs(height))
    stays.speed[ball] += impact.normal_speed
    stays.hits[ball] += 1
    stays.logged[ball] += recorded
    if not held and stays.hits[ball] >= MIN_HITS and _is_rattling(stays, radius, ball):
        _note_held(stays, event, impact.position, recorded)
        return True
    return held


@inlined
def _is_still_held(stays: Stays, radius: float, ball: int, impact: Impact) -> bool:
    """Return whether a hit is one more of a ball that rattled, and note if it got away.

    Args:
        radius: radius of the ball [m].
    """
    if not stays.rattled[ball] > 0.0:
        return False
    away = sub(impact.position, vec3_at(stays.spot, ball))
    if dot(away, away) > 4.0 * radius * radius:
        stays.rattled[ball] *= -1.0
        return False
    return impact.normal_speed < stays.slow


@jit
def _is_rattling(stays: Stays, radius: float, ball: int) -> bool:
    """Return whether a ball is rattling in a gap, by all hits of its series.

    Args:
        radius: radius of the ball [m].
    """
    hits, normal = stays.hits[ball], vec3_at(stays.normal, ball)
    faces = dot(normal, normal) < (FACING * hits) ** 2
    slow = stays.speed[ball] < stays.slow * hits
    return bool(faces and slow and stays.rise[ball] < radius and hits > stays.meetings[ball])


@inlined
def _note_held(stays: Stays, event: BallEvent, position: Vec3, recorded: bool) -> None:
    """Add a hit of a rattling ball to its time in the gap.

    Args:
        position: of the ball's centre [m].
        recorded: True if impacts on the surface are logged now.
    """
    ball, now = event.ball, event.time_since_start
    since = stays.rattled[ball] if stays.rattled[ball] > 0.0 else stays.began[ball]
    stays.time[ball, RATTLING] += now - since
    stays.recorded[ball, RATTLING] += recorded
    stays.rattled[ball] = now
    set_vec3(stays.spot, ball, position)


@inlined
def _begin_series(stays: Stays, event: BallEvent, position: Vec3) -> None:
    ball, zero = event.ball, Vec3(0.0, 0.0, 0.0)
    set_vec3(stays.place, ball, position)
    set_vec3(stays.normal, ball, zero)
    stays.began[ball] = event.time_since_start
    stays.rise[ball] = 0.0
    stays.speed[ball] = 0.0
    stays.logged[ball] = 0
    stays.meetings[ball] = 0


@inlined
def note_meeting(stays: Stays, one: int, two: int) -> None:
    """Count a collision of two balls."""
    stays.meetings[one] += 1
    stays.meetings[two] += 1


@jit
def end_series(stays: Stays, ball: int, landed: bool) -> bool:
    """Add a ball's series of hits to the time for which it was hopping, if it was.

    Args:
        landed: True if the series ends because the ball lands.

    Returns: True if the ball was hopping.
    """
    hits, lasted = stays.hits[ball], stays.last[ball] - stays.began[ball]
    if hits < MIN_HITS or hits <= stays.meetings[ball]:
        return False
    if abs(stays.rattled[ball]) > stays.began[ball]:
        return False
    if landed or lasted < MIN_TIME:
        return False
    stays.time[ball, HOPPING] += lasted
    stays.recorded[ball, HOPPING] += stays.logged[ball]
    set_vec3(stays.spot, ball, vec3_at(stays.place, ball))
    return True


def is_on_one_side(stays: Stays, ball: int) -> bool:
    """Return True if a ball's present series of hits is on surfaces of which none faces another."""
    hits = int(stays.hits[ball])
    normal = float(np.linalg.norm(stays.normal[ball]))
    return hits > max(MIN_HITS, int(stays.meetings[ball])) and normal >= FACING * hits


def begin_anew(stays: Stays, now: float) -> None:
    """Forget all series so far, as recording begins now [s]. Balls that are held stay so."""
    for column in (stays.hits, stays.time, stays.recorded):
        column[:] = 0
    stays.rattled[:] = np.where(stays.rattled > 0.0, now, 0.0)


def held_now(stays: Stays, middle: np.ndarray) -> np.ndarray:
    """Return the places of the balls that are held in gaps [m], (k, 3).

    Args:
        middle: middle of the mesh [m], (3,).
    """
    return np.asarray(stays.spot[stays.rattled > 0.0] + middle)


def trapped(stays: Stays, middle: np.ndarray) -> Trapped:
    """End all series, and return the balls that were hopping or rattling since recording began.

    Args:
        middle: middle of the mesh [m], (3,).
    """
    hopped = np.array([end_series(stays, k, False) for k in range(len(stays.hits))], bool)
    at_end = hopped | (stays.rattled > 0.0)
    stays.hits[:] = 0
    balls = np.flatnonzero(stays.time.any(axis=1))
    time, hits = stays.time[balls], stays.recorded[balls]
    return Trapped(
        ball=balls,
        hopping=time[:, HOPPING],
        rattling=time[:, RATTLING],
        hopping_hits=hits[:, HOPPING],
        rattling_hits=hits[:, RATTLING],
        at_end=at_end[balls],
        position=stays.spot[balls] + middle,
    )
