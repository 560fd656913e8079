"""What a ball in contact mode does next: which feet it keeps, and so how it moves on."""

import math

import numpy as np

from sim_core.contact.rolling import braked, crept, reset_spin
from sim_core.effects.contact_mode import (
    ASLEEP,
    DETACH_TOLERANCE,
    FLYING,
    JAMMED,
    LEAVES,
    LIES_SINCE,
    MODE,
    NEIGHBOURS_HOLDING_JAM,
    ON_BALL,
    ROLLING,
    ROUNDING,
    STAYS_UNTIL,
    STOPS,
    SUPPORTS,
    WAKE_PENDING,
    WAKES,
    ContactState,
    add_support,
    drop_support,
    onto_cone,
    set_mode,
    support_normal,
)
from sim_core.geometry.bvh import Tree
from sim_core.geometry.obstacles import CAPSULE
from sim_core.motion import BallState, change_velocity, set_path
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.vec3 import Vec3, add_scaled, cross, dot

# how a hit on a still surface ends
BOUNCES, ROLLS, CAUGHT = 0, 1, 2

ONE_SURFACE = math.cos(
    math.radians(25.0)
)  # faces that meet at less than 25 degrees stand for a smooth surface
SAME_HOP = 1.05  # of the speed a facet's turn gives: landing on the next facet, not from a height
SHARE = 0.5  # of capture: how fast a ball may come down again when the plane under it has left what is round
NO_WAY_OUT = 0.01  # wedged between its feet and an edge a ball would have to go ten times as far as it is deep
NO_SUPPORT = -1
LAST_LEFT = -2


@jit
def settle(
    contact: ContactState,
    motion: np.ndarray,
    ball: int,
    time: float,
    time_since_start: float,
    at: BallState,
) -> None:
    """Let a ball go on from ``at`` on those of its feet that hold it. ``time``, ``time_since_start`` [s]: on the window's clock,
    and since the start.

    A foot hit faster than capture is taken away: the search finds it again at once, as the wall it then is. One on a
    ball that has begun to move is none: the two are a pair like others again.
    """
    contact.marks[ball, WAKE_PENDING] = 0
    support = 0
    while support < contact.marks[ball, SUPPORTS]:
        other = ON_BALL - contact.rows[ball, support]
        if other >= 0 and contact.marks[other, MODE] < ASLEEP:
            drop_support(contact, ball, support)
        else:
            support += 1
    velocity = crept(contact.friction_state, contact, ball, at.velocity)
    support = 0
    while support < contact.marks[ball, SUPPORTS]:
        normal = support_normal(contact, ball, support)
        out = dot(normal, velocity)
        if out < -contact.capture or out > DETACH_TOLERANCE * contact.capture:
            drop_support(contact, ball, support)
        else:
            if out > 0.0:
                velocity = add_scaled(velocity, -out, normal)
            support += 1
    velocity = onto_cone(contact, ball, velocity)
    speed = math.sqrt(dot(velocity, velocity))
    support = 0
    while support < contact.marks[ball, SUPPORTS]:
        if dot(support_normal(contact, ball, support), velocity) > ROUNDING * (1.0 + speed):
            drop_support(contact, ball, support)
        else:
            support += 1
    acceleration = onto_cone(contact, ball, contact.gravity)
    mode = FLYING
    if contact.marks[ball, SUPPORTS] > 0:
        velocity, acceleration, mode = braked(
            contact.friction_state, contact, ball, time, velocity, acceleration
        )
    move_on(
        contact,
        motion,
        ball,
        time,
        time_since_start,
        BallState(at.position, velocity),
        acceleration,
        mode,
    )


@jit
def move_on(
    contact: ContactState,
    motion: np.ndarray,
    ball: int,
    time: float,
    time_since_start: float,
    at: BallState,
    acceleration: Vec3,
    mode: int,
) -> None:
    """Give a ball its path and its place on the roster."""
    if mode >= ASLEEP and contact.marks[ball, MODE] < ASLEEP:
        contact.memory[ball, LIES_SINCE] = time_since_start
    if mode != JAMMED:
        contact.memory[ball, STAYS_UNTIL] = 0.0
        contact.marks[ball, NEIGHBOURS_HOLDING_JAM] = 0
    set_mode(contact, ball, mode)
    reset_spin(contact.friction_state, ball, time, mode)
    for axis in range(3):
        contact.acceleration[ball, axis] = acceleration[axis]
    set_path(motion, ball, time, at, acceleration)


@inlined
def deflect(
    contact: ContactState | None,
    motion: np.ndarray,
    ball: int,
    time: float,
    time_since_start: float,
    here: BallState,
    change: Vec3,
) -> None:
    """Change a ball's velocity by ``change`` [m/s]."""
    if contact is None:
        change_velocity(motion, ball, time, change)
        return
    contact.marks[ball, ROLLING] = 0
    if contact.marks[ball, MODE] == FLYING:
        change_velocity(motion, ball, time, change)
    else:
        settle(
            contact,
            motion,
            ball,
            time,
            time_since_start,
            BallState(here.position, add_scaled(here.velocity, 1.0, change)),
        )


@inlined
def set_out(
    contact: ContactState | None,
    motion: np.ndarray,
    ball: int,
    time: float,
    here: BallState,
    away: Vec3,
    radius: float,
) -> BallState:
    """Put a ball that meets an edge back to ``radius`` [m] from it: contact is up to 1e-13 m deep there, and thousands
    of small hops on one edge would add up. It goes out along the planes of its feet, not into them.
    """
    if contact is None:
        return here
    distance = math.sqrt(dot(away, away))
    if distance >= radius:
        return here
    free = onto_cone(contact, ball, away)
    share = dot(free, free) / (
        distance * distance
    )  # of a step along ``free``: how far it leads out
    if share < NO_WAY_OUT:
        return here
    acceleration = Vec3(
        contact.acceleration[ball, 0], contact.acceleration[ball, 1], contact.acceleration[ball, 2]
    )
    there = BallState(
        add_scaled(here.position, (radius - distance) / (distance * share), free), here.velocity
    )
    set_path(motion, ball, time, there, acceleration)
    return there


@inlined
def land(
    contact: ContactState | None,
    tree: Tree,
    motion: np.ndarray,
    ball: int,
    row: int,
    time: float,
    time_since_start: float,
    here: BallState,
    away: Vec3,
) -> int:
    """A ball meets a still surface: does it bounce, roll on as if the surface were one, or stay in contact?"""
    if contact is None:
        return BOUNCES
    scale = 1.0 / math.sqrt(dot(away, away))
    normal = Vec3(scale * away.x, scale * away.y, scale * away.z)
    round_over = tree.radius if tree.kinds[row] == CAPSULE else math.inf
    return touch_down(contact, motion, ball, row, round_over, time, time_since_start, here, normal)


@jit
def touch_down(
    contact: ContactState,
    motion: np.ndarray,
    ball: int,
    row: int,
    round_over: float,
    time: float,
    time_since_start: float,
    here: BallState,
    normal: Vec3,
) -> int:
    """The same for anything that stands still, with the radius [m] on which the centre goes round it."""
    velocity = here.velocity
    speed = math.sqrt(dot(velocity, velocity))
    into = max(0.0, -dot(normal, velocity))
    presses = dot(normal, contact.gravity) < 0.0
    scope = math.inf
    if round_over < math.inf:  # so far, that coming down on the round again is slower than capture
        weight = math.sqrt(dot(contact.gravity, contact.gravity))
        scope = (
            SHARE
            * round_over
            * contact.capture
            / max(speed, math.sqrt(weight * round_over), contact.capture)
        )
    came_from, last = _smooth_neighbour(contact, ball, normal)
    contact.marks[ball, ROLLING] = 0
    if came_from != NO_SUPPORT and presses:
        crease = cross(last, normal)
        sine = math.sqrt(dot(crease, crease))
        if into <= SAME_HOP * speed * sine + contact.capture:
            stays = came_from >= 0 and _lies_in_valley(
                contact, last, normal, velocity, crease, sine
            )
            if came_from >= 0 and not stays:
                drop_support(contact, ball, came_from)
            flat = add_scaled(velocity, into, normal)
            size = math.sqrt(dot(flat, flat))
            if not stays and size > 0.5 * speed:  # turned into the new face's plane, not slowed
                velocity = Vec3(flat.x * speed / size, flat.y * speed / size, flat.z * speed / size)
            add_support(contact, ball, row, normal, here.position, scope)
            settle(
                contact, motion, ball, time, time_since_start, BallState(here.position, velocity)
            )
            return ROLLS
    acceleration = Vec3(
        contact.acceleration[ball, 0], contact.acceleration[ball, 1], contact.acceleration[ball, 2]
    )
    contact_count = (
        contact.marks[ball, SUPPORTS] > 0
    )  # between two surfaces it would bounce without end
    if into < contact.capture and (presses or contact_count or dot(normal, acceleration) < 0.0):
        add_support(contact, ball, row, normal, here.position, scope)
        settle(contact, motion, ball, time, time_since_start, here)
        return CAUGHT
    return BOUNCES


@jit
def _smooth_neighbour(contact: ContactState, ball: int, normal: Vec3) -> tuple[int, Vec3]:
    """Which foot, or the one just left, is most nearly in the plane with this normal; NO_FOOT if none is nearly so."""
    found, best, last = NO_SUPPORT, ONE_SURFACE, normal
    for support in range(contact.marks[ball, SUPPORTS]):
        other = support_normal(contact, ball, support)
        if dot(normal, other) > best:
            found, best, last = support, dot(normal, other), other
    if contact.marks[ball, ROLLING] != 0:
        other = Vec3(contact.memory[ball, 0], contact.memory[ball, 1], contact.memory[ball, 2])
        if dot(normal, other) > best:
            found, last = LAST_LEFT, other
    return found, last


@jit
def _lies_in_valley(
    contact: ContactState, one: Vec3, two: Vec3, velocity: Vec3, crease: Vec3, sine: float
) -> bool:
    """True when both faces run down to their crease and the ball hardly moves across it: it stays on both."""
    acceleration = contact.gravity
    down_one = add_scaled(acceleration, -dot(acceleration, one), one)
    down_two = add_scaled(acceleration, -dot(acceleration, two), two)
    if dot(two, down_one) >= 0.0 or dot(one, down_two) >= 0.0 or sine == 0.0:
        return False
    across = add_scaled(velocity, -dot(velocity, crease) / (sine * sine), crease)
    return dot(across, across) < contact.capture * contact.capture


@inlined
def step(
    contact: ContactState | None,
    motion: np.ndarray,
    ball: int,
    what: int,
    time: float,
    time_since_start: float,
    here: BallState,
) -> bool:
    """A ball comes to the end of its path in contact (see end_of_path); False if it does not."""
    if contact is None:
        return False
    return _step(contact, motion, ball, what, time, time_since_start, here)


@jit
def _step(
    contact: ContactState,
    motion: np.ndarray,
    ball: int,
    what: int,
    time: float,
    time_since_start: float,
    here: BallState,
) -> bool:
    if what <= LEAVES:
        support = LEAVES - what
        for axis in range(3):
            contact.memory[ball, axis] = contact.normals[ball, support, axis]
        drop_support(contact, ball, support)
        settle(contact, motion, ball, time, time_since_start, here)
        contact.marks[ball, ROLLING] = 1
        return True
    if what == STOPS:
        velocity = here.velocity
        acceleration = Vec3(
            contact.acceleration[ball, 0],
            contact.acceleration[ball, 1],
            contact.acceleration[ball, 2],
        )
        # the brake has used up what was left of the speed, and not merely been set anew
        if dot(velocity, velocity) <= 1e-18 * max(1.0, dot(acceleration, acceleration)):
            velocity = Vec3(0.0, 0.0, 0.0)
        settle(contact, motion, ball, time, time_since_start, BallState(here.position, velocity))
        return True
    if what == WAKES:
        settle(contact, motion, ball, time, time_since_start, here)
        return True
    return False
