"""Contact mode: a ball that gravity holds against still surfaces slides on them, or lies still.

A hit slower than ``capture`` on a still surface into which gravity presses is plastic, and from then on the ball
keeps the surface's normal n as a *foot*: its velocity and its acceleration are the projections of what they would be
on the cone {n_k x >= 0} of its feet (Moreau, J. Math. Pures Appl. 56 (1977) 65: the constrained acceleration is the
one nearest to the free one), so its motion is a parabola again, its own. ``resistance`` slows it by that share of the
load on its feet: sliding friction without rotation, or, where balls rub (friction.py), what rolling resists. What is
neglected at a capture is below capture²/2 of energy per mass.

Nothing rests on the vibrating surface or on a turning part: hits there keep their law. A ball that lies still is
itself such a surface to hits slower than Restitution.elastic_below, as if friction held it, so heaps come to rest
from below. Two balls that lean on each other while they move go on in small hops; one that has made many without
getting anywhere is held where it is (jammed) until one of the balls around it has gone; held at one place again and
again, for twice as long each time. A faster hit wakes a ball, and with it what stands on it. The turning part moves
what it touches, slow or not, and what is pressed between it and a ball that lies still moves that one.
"""

import math
from typing import NamedTuple

import numpy as np

from sim_core.effects.friction import FrictionState
from sim_core.effects.gravity import Gravity, gravity_acceleration
from sim_core.effects.restitution import ELASTIC_BELOW, Restitution
from sim_core.errors import SceneError, number
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.vec3 import Vec3, add_scaled, cross, dot

CAPTURE = 1e-3  # m/s: drops from 50 nm; a ten-thousandth of the shot's speed. Lower costs bounces: 22 a decade at e 0.9
RESISTANCE = 0.005  # [-]: of steel balls on steel, the order of magnitude (assumed); slower than that they lie still

MAX_SUPPORTS = 4  # three hold a ball; a fourth while it is decided which

# how a ball moves
FLYING, SLIDING, ASLEEP, JAMMED = 0, 1, 2, 3

# columns of Footing.marks
MODE, SUPPORTS, ROLLING, SLOW_HITS = 0, 1, 2, 3
WAKE_PENDING = 4  # what it leans on has begun to move, and it has not seen to that yet
DRIVEN = 5  # 1: the turning part has touched it, or a pressed one; 2: pressed, it is pushed and gets nowhere
NEIGHBOURS_HOLDING_JAM = 6  # balls about a jammed one, while some of them move
HOLDS = 7  # how often it was held where it is

# columns of Footing.memory; times [s] since the start
LEFT = 0  # normal of the foot left last
HOPS = 3  # where its small hops began [m]
LIES_SINCE = 6
HELD_AT = 7  # where it was held last [m]
STAYS_UNTIL = 10  # a call does not wake it before
NEIGHBOUR_SUM = 11  # sum of the numbers of its PROPS
COUNTS_SINCE = 12  # when its SLOW_HITS were 0
TOUCHED = 13  # when it was last driven

# what ends a path in contact, in place of an obstacle's number (calendar.py has -1 and -2)
GOES_ON = -1
STOPS = -3  # or turns: the resistance is set anew
WAKES = -4
STILL = -5
RECHECK = -6  # a jammed ball looks whether those about it are still there
LEAVES = -10  # minus the foot's place

ON_BALL = -2  # minus the ball's number: the row of a foot on a ball that lies still

DETACH_TOLERANCE = 0.01  # of capture: a foot left so slowly, against gravity, is not left
ROUNDING = 1e-12  # [-]: of a projection
STILL_BELOW = 1e-9  # of gravity: an acceleration this small is rounding


class Rest(NamedTuple):
    """``capture`` [m/s]: normal speed below which a hit on a still surface ends in contact; ``resistance`` [-]: the
    deceleration of a ball in contact, as a share of its load.
    """

    capture: float = CAPTURE
    resistance: float = RESISTANCE


class ContactState(NamedTuple):
    """What contact mode keeps of n balls.

    ``acceleration`` (n, 3): each ball's own acceleration [m/s²]; ``normals`` (n, 4, 3) of its feet; ``spots`` (n, 4, 4): where
    [m] a foot was set and how far the ball may go from there on what is round; ``rows`` (n, 4) int32: the obstacles it
    stands on, or see ON_BALL; ``marks`` (n, 8) int32, see MODE; ``memory`` (n, 14), see LEFT; ``contact_list``, ``contact_index``
    (n,) int32 and ``contact_count`` (1,): the balls not in flight, each one's place among them, and how many. ``capture``,
    ``resistance`` as in Rest; ``slow`` [m/s]: pair hits below lose nothing; ``friction_state``: friction, if there is any.
    """

    acceleration: np.ndarray
    normals: np.ndarray
    spots: np.ndarray
    rows: np.ndarray
    marks: np.ndarray
    memory: np.ndarray
    contact_list: np.ndarray
    contact_index: np.ndarray
    contact_count: np.ndarray
    capture: float
    resistance: float
    slow: float
    gravity: Vec3
    friction_state: FrictionState | None


def checked_rest(rest: Rest | None) -> Rest | None:
    """The same as plain floats; raises SceneError for numbers out of range."""
    if rest is None:
        return None
    plain = Rest(number("rest.capture", rest.capture), number("rest.resistance", rest.resistance))
    if not 0.0 < plain.capture < math.inf:
        raise SceneError(f"rest.capture is {plain.capture} m/s: it must be positive")
    if not 0.0 <= plain.resistance < math.inf:
        raise SceneError(f"rest.resistance is {plain.resistance}: it must be 0 or more")
    return plain


def new_contact_state(
    rest: Rest | None,
    balls: int,
    gravity: Gravity | None,
    restitution: Restitution | None,
    friction_state: FrictionState | None,
) -> ContactState | None:
    """All balls in flight; None without the effect."""
    if rest is None:
        return None
    acceleration = gravity_acceleration(gravity)
    return ContactState(
        np.tile(np.array(acceleration), (balls, 1)),
        np.zeros((balls, MAX_SUPPORTS, 3)),
        np.zeros((balls, MAX_SUPPORTS, 4)),
        np.full((balls, MAX_SUPPORTS), -1, dtype=np.int32),
        np.zeros((balls, 8), dtype=np.int32),
        np.zeros((balls, 14)),
        np.zeros(balls, dtype=np.int32),
        np.full(balls, -1, dtype=np.int32),
        np.zeros(1, dtype=np.int64),
        rest.capture,
        rest.resistance,
        ELASTIC_BELOW if restitution is None else restitution.elastic_below,
        Vec3(*(float(x) for x in acceleration)),
        friction_state,
    )


@inlined
def ball_acceleration(contact: ContactState | None, ball: int, gravity: Gravity | None) -> Vec3:
    """A ball's acceleration [m/s²]: gravity, or what its feet leave of it."""
    if contact is None:
        return gravity_acceleration(gravity)
    return Vec3(
        contact.acceleration[ball, 0], contact.acceleration[ball, 1], contact.acceleration[ball, 2]
    )


@inlined
def static_law(contact: ContactState | None, restitution: Restitution | None) -> Restitution | None:
    """The law of hits on still surfaces: with contact mode, hits lose energy at all speeds."""
    if contact is None:
        return restitution
    if restitution is None:
        return restitution
    return Restitution(restitution.surfaces, restitution.balls, 0.0)


@jit
def support_normal(contact: ContactState, ball: int, support: int) -> Vec3:
    """Unit normal of a foot, towards the ball."""
    return Vec3(
        contact.normals[ball, support, 0],
        contact.normals[ball, support, 1],
        contact.normals[ball, support, 2],
    )


@jit
def stands_on_ball(contact: ContactState, ball: int, other: int) -> bool:
    """True when a ball has a foot on another."""
    stands = False
    for support in range(contact.marks[ball, SUPPORTS]):
        stands |= contact.rows[ball, support] == ON_BALL - other
    return stands


@jit
def _fits(contact: ContactState, ball: int, x: Vec3, slack: float) -> bool:
    fits = True
    for support in range(contact.marks[ball, SUPPORTS]):
        fits &= dot(support_normal(contact, ball, support), x) >= -slack
    return fits


@jit
def onto_cone(contact: ContactState, ball: int, x: Vec3) -> Vec3:
    """The vector nearest to x in the cone that the ball's feet leave: x itself, or on one foot's plane, or on two.

    The nearest one is unique; it is told by its multipliers, all of which push (Kuhn-Tucker).
    """
    supports = contact.marks[ball, SUPPORTS]
    size = np.sqrt(dot(x, x))
    slack = ROUNDING * size
    if _fits(contact, ball, x, slack):
        return x
    for one in range(supports):
        n = support_normal(contact, ball, one)
        push = -dot(n, x)
        y = add_scaled(x, push, n)
        if push >= -slack and _fits(contact, ball, y, slack):
            return y
    for one in range(supports):
        n = support_normal(contact, ball, one)
        for two in range(one + 1, supports):
            m = support_normal(contact, ball, two)
            line = cross(n, m)
            square = dot(line, line)
            if square < 1e-20:
                continue
            c = dot(n, m)
            a, b = -dot(n, x), -dot(m, x)
            loose = slack + 1e-15 * size / square
            if (a - c * b) / square < -loose or (b - c * a) / square < -loose:
                continue
            share = dot(line, x) / square
            y = Vec3(share * line.x, share * line.y, share * line.z)
            if _fits(contact, ball, y, slack):
                return y
    return Vec3(0.0, 0.0, 0.0)


@jit
def drop_support(contact: ContactState, ball: int, support: int) -> None:
    """Take a foot away; those after it move up."""
    last = contact.marks[ball, SUPPORTS] - 1
    for k in range(support, last):
        contact.rows[ball, k] = contact.rows[ball, k + 1]
        for axis in range(3):
            contact.normals[ball, k, axis] = contact.normals[ball, k + 1, axis]
        for axis in range(4):
            contact.spots[ball, k, axis] = contact.spots[ball, k + 1, axis]
    contact.rows[ball, last] = -1
    contact.marks[ball, SUPPORTS] = last


@jit
def add_support(
    contact: ContactState, ball: int, row: int, normal: Vec3, position: Vec3, scope: float
) -> None:
    """Stand on an obstacle too, good up to ``scope`` [m] from here; the oldest foot gives way to a fifth."""
    if contact.marks[ball, SUPPORTS] == MAX_SUPPORTS:
        drop_support(contact, ball, 0)
    support = contact.marks[ball, SUPPORTS]
    contact.rows[ball, support] = row
    for axis in range(3):
        contact.normals[ball, support, axis] = normal[axis]
        contact.spots[ball, support, axis] = position[axis]
    contact.spots[ball, support, 3] = scope
    contact.marks[ball, SUPPORTS] = support + 1


@jit
def set_mode(contact: ContactState, ball: int, mode: int) -> None:
    """Write down how a ball moves, and keep the roster of those not in flight."""
    contact.marks[ball, MODE] = mode
    contact_index = contact.contact_index[ball]
    if mode == FLYING and contact_index >= 0:
        contact.contact_count[0] -= 1
        last = contact.contact_list[contact.contact_count[0]]
        contact.contact_list[contact_index] = last
        contact.contact_index[last] = contact_index
        contact.contact_index[ball] = -1
    elif mode != FLYING and contact_index < 0:
        contact.contact_list[contact.contact_count[0]] = ball
        contact.contact_index[ball] = contact.contact_count[0]
        contact.contact_count[0] += 1
