"""Balls that hop on one spot or sit in a gap: series of hits on surfaces that lead nowhere.

A stay is a series of MIN_HITS or more successive hits of a ball on surfaces, over MIN_TIME or more,
that all lie within a ball's radius of the first one sideways, while the ball hits surfaces more
often than other balls. In a stay the ball is *jammed* if it also stays within a ball's radius in
height and hits, on average, at less than SLOW of the sonotrode's peak speed. Otherwise it is
*locked*: it hops up and down on one spot.

Sideways means across gravity, or, without gravity, across the motion of the sonotrode. A ball that
lands to lie still, slide or roll is in no stay: contact mode tells of it. On a turning part a hit
lies where it is on the part.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sim_core.effects.contact_mode import ContactState, is_flying
from sim_core.effects.gravity import Gravity
from sim_core.effects.vibration import Wave
from sim_core.geometry.ball_sizes import BallSizes, radius_of_ball
from sim_core.loop.impact_log import Impact
from sim_core.motion import BallEvent
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.vec3 import Vec3, dot, set_vec3, sub, vec3_at

# A ball of a healthy gas makes so many hits within its radius sideways with a chance of some 1e-5,
# and in a low chamber, where hits follow fast, so long with as small a one.
MIN_HITS = 10
MIN_TIME = 0.1  # s
# Share of the sonotrode's peak speed. The shot's hits have about that speed. A ball in a gap just
# narrower than itself has a hundredth of it.
SLOW = 0.1
LOCKED, JAMMED = 0, 1  # kinds of stays, places in Stays.time and Stays.recorded


class Stays(NamedTuple):
    """The present series of hits of each of n balls at one place, and its past stays.

    axis: unit vector of height.
    radius: radius of balls that are all alike [m].
    slow: mean normal speed [m/s] below which a ball is jammed.
    place: position of the ball's centre at the first hit of the series [m], (n, 3).
    began, last: times of the first and last hit [s since the start], (n,).
    rise: largest difference in height from the first hit [m], (n,).
    speed: sum of the normal speeds of the hits [m/s], (n,).
    hits: number of the hits, (n,) int32. 0 if there is no series.
    logged: number of those on recorded surfaces, (n,) int32.
    meetings: number of collisions with balls during the series, (n,) int32.
    time: duration of past stays of each kind, LOCKED and JAMMED [s], (n, 2).
    recorded: number of the hits on recorded surfaces in past stays of each kind, (n, 2) int64.
    spot: position of the ball's centre at the start of its latest stay [m], (n, 3).
    """

    axis: Vec3
    radius: float
    slow: float
    place: np.ndarray
    began: np.ndarray
    last: np.ndarray
    rise: np.ndarray
    speed: np.ndarray
    hits: np.ndarray
    logged: np.ndarray
    meetings: np.ndarray
    time: np.ndarray
    recorded: np.ndarray
    spot: np.ndarray


@dataclass(frozen=True)
class Trapped:
    """The k balls that hopped on one spot, or sat in a gap, for some of the recorded time.

    ball: numbers of the balls, (k,).
    locked: time for which each of them hopped on one spot [s], (k,).
    jammed: time for which it sat in a gap [s], (k,).
    locked_hits, jammed_hits: number of its hits on the recorded surfaces in this time, (k,).
    at_end: True if it did so at the end, (k,) bool.
    position: position of its centre when it began to do so for the last time [m], (k, 3).
    """

    ball: np.ndarray
    locked: np.ndarray
    jammed: np.ndarray
    locked_hits: np.ndarray
    jammed_hits: np.ndarray
    at_end: np.ndarray
    position: np.ndarray

    def __len__(self) -> int:
        return len(self.ball)


def new_stays(
    balls: int, radius: float, gravity: Gravity | None, waves: tuple[Wave, ...]
) -> Stays:
    """Return the stays of balls that have not hit anything yet.

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
        hits=whole(),
        logged=whole(),
        meetings=whole(),
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
) -> None:
    """Add a ball's hit on a surface to its series, or begin a new series with it.

    Args:
        impact: the hit. A normal speed of 0 means no hit.
        recorded: True if impacts on the surface are logged now.
    """
    ball = event.ball
    if not impact.normal_speed > 0.0:
        return
    if not is_flying(contact, ball):
        stays.hits[ball] = 0
        return
    away = sub(impact.position, vec3_at(stays.place, ball))
    height = dot(away, stays.axis)
    radius = radius_of_ball(sizes, stays.radius, ball)
    if stays.hits[ball] == 0 or dot(away, away) - height * height > radius * radius:
        if stays.hits[ball] >= MIN_HITS:
            end_stay(stays, radius, ball)
        set_vec3(stays.place, ball, impact.position)
        stays.began[ball] = event.time_since_start
        stays.rise[ball] = 0.0
        stays.speed[ball] = 0.0
        stays.hits[ball] = 0
        stays.logged[ball] = 0
        stays.meetings[ball] = 0
        height = 0.0
    stays.last[ball] = event.time_since_start
    stays.rise[ball] = max(stays.rise[ball], abs(height))
    stays.speed[ball] += impact.normal_speed
    stays.hits[ball] += 1
    stays.logged[ball] += recorded


@inlined
def note_meeting(stays: Stays, one: int, two: int) -> None:
    """Count a collision of two balls."""
    stays.meetings[one] += 1
    stays.meetings[two] += 1


@jit
def end_stay(stays: Stays, radius: float, ball: int) -> bool:
    """Add a ball's series of hits to its past stays if it was a stay. Return True if it was.

    ``radius``: radius of the ball [m].
    """
    hits, lasted = stays.hits[ball], stays.last[ball] - stays.began[ball]
    if hits < MIN_HITS or lasted < MIN_TIME or hits <= stays.meetings[ball]:
        return False
    slow = stays.speed[ball] < stays.slow * hits
    kind = JAMMED if slow and stays.rise[ball] < radius else LOCKED
    stays.time[ball, kind] += lasted
    stays.recorded[ball, kind] += stays.logged[ball]
    set_vec3(stays.spot, ball, vec3_at(stays.place, ball))
    return True


def begin_anew(stays: Stays) -> None:
    """Forget all series and past stays, as recording begins now."""
    for column in (stays.hits, stays.time, stays.recorded):
        column[:] = 0


def trapped(stays: Stays, radii: np.ndarray, middle: np.ndarray) -> Trapped:
    """End all stays, and return the balls that were in one since the recording began.

    Args:
        radii: radius of each ball [m], (n,).
        middle: middle of the mesh [m], (3,).
    """
    at_end = np.array([end_stay(stays, float(radii[k]), k) for k in range(len(radii))], np.bool_)
    stays.hits[:] = 0
    balls = np.flatnonzero(stays.time.any(axis=1))
    (locked, jammed), (locked_hits, jammed_hits) = stays.time[balls].T, stays.recorded[balls].T
    position = stays.spot[balls] + middle
    return Trapped(balls, locked, jammed, locked_hits, jammed_hits, at_end[balls], position)
