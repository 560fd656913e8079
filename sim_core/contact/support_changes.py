"""What a ball in contact mode does next: which feet it keeps, and so how it moves on."""

import math

import numpy as np

from sim_core.contact.rolling import braked, crept, off_its_feet
from sim_core.effects.contact_mode import (
    ASLEEP,
    CALLED,
    FEET,
    FLYING,
    JAMMED,
    KISS,
    LEAVES,
    LIES_SINCE,
    MODE,
    ON_BALL,
    PROPS,
    ROLLING,
    ROUNDING,
    STAYS_UNTIL,
    STOPS,
    WAKES,
    Footing,
    add_foot,
    drop_foot,
    enrol,
    foot_normal,
    onto_cone,
)
from sim_core.geometry.bvh import Tree
from sim_core.geometry.obstacles import CAPSULE
from sim_core.motion import Point, kick, set_off
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.vec3 import Vec3, along, cross, dot

# how a hit on a still surface ends
BOUNCES, ROLLS, CAUGHT = 0, 1, 2

ONE_SURFACE = math.cos(
    math.radians(25.0)
)  # faces that meet at less than 25 degrees stand for a smooth surface
SAME_HOP = 1.05  # of the speed a facet's turn gives: landing on the next facet, not from a height
SHARE = 0.5  # of capture: how fast a ball may come down again when the plane under it has left what is round
NO_WAY_OUT = 0.01  # wedged between its feet and an edge a ball would have to go ten times as far as it is deep
NO_FOOT = -1
LAST_LEFT = -2


@jit
def settle(
    footing: Footing, motion: np.ndarray, ball: int, time: float, moment: float, at: Point
) -> None:
    """Let a ball go on from ``at`` on those of its feet that hold it. ``time``, ``moment`` [s]: on the window's clock,
    and since the start.

    A foot hit faster than capture is taken away: the search finds it again at once, as the wall it then is. One on a
    ball that has begun to move is none: the two are a pair like others again.
    """
    footing.marks[ball, CALLED] = 0
    foot = 0
    while foot < footing.marks[ball, FEET]:
        other = ON_BALL - footing.rows[ball, foot]
        if other >= 0 and footing.marks[other, MODE] < ASLEEP:
            drop_foot(footing, ball, foot)
        else:
            foot += 1
    velocity = crept(footing.grip, footing, ball, at.velocity)
    foot = 0
    while foot < footing.marks[ball, FEET]:
        normal = foot_normal(footing, ball, foot)
        out = dot(normal, velocity)
        if out < -footing.capture or out > KISS * footing.capture:
            drop_foot(footing, ball, foot)
        else:
            if out > 0.0:
                velocity = along(velocity, -out, normal)
            foot += 1
    velocity = onto_cone(footing, ball, velocity)
    speed = math.sqrt(dot(velocity, velocity))
    foot = 0
    while foot < footing.marks[ball, FEET]:
        if dot(foot_normal(footing, ball, foot), velocity) > ROUNDING * (1.0 + speed):
            drop_foot(footing, ball, foot)
        else:
            foot += 1
    pull = onto_cone(footing, ball, footing.gravity)
    mode = FLYING
    if footing.marks[ball, FEET] > 0:
        velocity, pull, mode = braked(footing.grip, footing, ball, time, velocity, pull)
    move_on(footing, motion, ball, time, moment, Point(at.position, velocity), pull, mode)


@jit
def move_on(
    footing: Footing,
    motion: np.ndarray,
    ball: int,
    time: float,
    moment: float,
    at: Point,
    pull: Vec3,
    mode: int,
) -> None:
    """Give a ball its path and its place on the roster."""
    if mode >= ASLEEP and footing.marks[ball, MODE] < ASLEEP:
        footing.memory[ball, LIES_SINCE] = moment
    if mode != JAMMED:
        footing.memory[ball, STAYS_UNTIL] = 0.0
        footing.marks[ball, PROPS] = 0
    enrol(footing, ball, mode)
    off_its_feet(footing.grip, ball, time, mode)
    for axis in range(3):
        footing.pull[ball, axis] = pull[axis]
    set_off(motion, ball, time, at, pull)


@inlined
def deflect(
    footing: Footing | None,
    motion: np.ndarray,
    ball: int,
    time: float,
    moment: float,
    here: Point,
    change: Vec3,
) -> None:
    """Change a ball's velocity by ``change`` [m/s]."""
    if footing is None:
        kick(motion, ball, time, change)
        return
    footing.marks[ball, ROLLING] = 0
    if footing.marks[ball, MODE] == FLYING:
        kick(motion, ball, time, change)
    else:
        settle(
            footing,
            motion,
            ball,
            time,
            moment,
            Point(here.position, along(here.velocity, 1.0, change)),
        )


@inlined
def set_out(
    footing: Footing | None,
    motion: np.ndarray,
    ball: int,
    time: float,
    here: Point,
    away: Vec3,
    radius: float,
) -> Point:
    """Put a ball that meets an edge back to ``radius`` [m] from it: contact is up to 1e-13 m deep there, and thousands
    of small hops on one edge would add up. It goes out along the planes of its feet, not into them.
    """
    if footing is None:
        return here
    distance = math.sqrt(dot(away, away))
    if distance >= radius:
        return here
    free = onto_cone(footing, ball, away)
    share = dot(free, free) / (
        distance * distance
    )  # of a step along ``free``: how far it leads out
    if share < NO_WAY_OUT:
        return here
    pull = Vec3(footing.pull[ball, 0], footing.pull[ball, 1], footing.pull[ball, 2])
    there = Point(
        along(here.position, (radius - distance) / (distance * share), free), here.velocity
    )
    set_off(motion, ball, time, there, pull)
    return there


@inlined
def land(
    footing: Footing | None,
    tree: Tree,
    motion: np.ndarray,
    ball: int,
    row: int,
    time: float,
    moment: float,
    here: Point,
    away: Vec3,
) -> int:
    """A ball meets a still surface: does it bounce, roll on as if the surface were one, or stay in contact?"""
    if footing is None:
        return BOUNCES
    scale = 1.0 / math.sqrt(dot(away, away))
    normal = Vec3(scale * away.x, scale * away.y, scale * away.z)
    round_over = tree.radius if tree.kinds[row] == CAPSULE else math.inf
    return touch_down(footing, motion, ball, row, round_over, time, moment, here, normal)


@jit
def touch_down(
    footing: Footing,
    motion: np.ndarray,
    ball: int,
    row: int,
    round_over: float,
    time: float,
    moment: float,
    here: Point,
    normal: Vec3,
) -> int:
    """The same for anything that stands still, with the radius [m] on which the centre goes round it."""
    velocity = here.velocity
    speed = math.sqrt(dot(velocity, velocity))
    into = max(0.0, -dot(normal, velocity))
    presses = dot(normal, footing.gravity) < 0.0
    scope = math.inf
    if round_over < math.inf:  # so far, that coming down on the round again is slower than capture
        weight = math.sqrt(dot(footing.gravity, footing.gravity))
        scope = (
            SHARE
            * round_over
            * footing.capture
            / max(speed, math.sqrt(weight * round_over), footing.capture)
        )
    came_from, last = _smooth_neighbour(footing, ball, normal)
    footing.marks[ball, ROLLING] = 0
    if came_from != NO_FOOT and presses:
        crease = cross(last, normal)
        sine = math.sqrt(dot(crease, crease))
        if into <= SAME_HOP * speed * sine + footing.capture:
            stays = came_from >= 0 and _lies_in_valley(
                footing, last, normal, velocity, crease, sine
            )
            if came_from >= 0 and not stays:
                drop_foot(footing, ball, came_from)
            flat = along(velocity, into, normal)
            size = math.sqrt(dot(flat, flat))
            if not stays and size > 0.5 * speed:  # turned into the new face's plane, not slowed
                velocity = Vec3(flat.x * speed / size, flat.y * speed / size, flat.z * speed / size)
            add_foot(footing, ball, row, normal, here.position, scope)
            settle(footing, motion, ball, time, moment, Point(here.position, velocity))
            return ROLLS
    pull = Vec3(footing.pull[ball, 0], footing.pull[ball, 1], footing.pull[ball, 2])
    held = footing.marks[ball, FEET] > 0  # between two surfaces it would bounce without end
    if into < footing.capture and (presses or held or dot(normal, pull) < 0.0):
        add_foot(footing, ball, row, normal, here.position, scope)
        settle(footing, motion, ball, time, moment, here)
        return CAUGHT
    return BOUNCES


@jit
def _smooth_neighbour(footing: Footing, ball: int, normal: Vec3) -> tuple[int, Vec3]:
    """Which foot, or the one just left, is most nearly in the plane with this normal; NO_FOOT if none is nearly so."""
    found, best, last = NO_FOOT, ONE_SURFACE, normal
    for foot in range(footing.marks[ball, FEET]):
        other = foot_normal(footing, ball, foot)
        if dot(normal, other) > best:
            found, best, last = foot, dot(normal, other), other
    if footing.marks[ball, ROLLING] != 0:
        other = Vec3(footing.memory[ball, 0], footing.memory[ball, 1], footing.memory[ball, 2])
        if dot(normal, other) > best:
            found, last = LAST_LEFT, other
    return found, last


@jit
def _lies_in_valley(
    footing: Footing, one: Vec3, two: Vec3, velocity: Vec3, crease: Vec3, sine: float
) -> bool:
    """True when both faces run down to their crease and the ball hardly moves across it: it stays on both."""
    pull = footing.gravity
    down_one = along(pull, -dot(pull, one), one)
    down_two = along(pull, -dot(pull, two), two)
    if dot(two, down_one) >= 0.0 or dot(one, down_two) >= 0.0 or sine == 0.0:
        return False
    across = along(velocity, -dot(velocity, crease) / (sine * sine), crease)
    return dot(across, across) < footing.capture * footing.capture


@inlined
def step(
    footing: Footing | None,
    motion: np.ndarray,
    ball: int,
    what: int,
    time: float,
    moment: float,
    here: Point,
) -> bool:
    """A ball comes to the end of its path in contact (see end_of_path); False if it does not."""
    if footing is None:
        return False
    return _step(footing, motion, ball, what, time, moment, here)


@jit
def _step(
    footing: Footing,
    motion: np.ndarray,
    ball: int,
    what: int,
    time: float,
    moment: float,
    here: Point,
) -> bool:
    if what <= LEAVES:
        foot = LEAVES - what
        for axis in range(3):
            footing.memory[ball, axis] = footing.normals[ball, foot, axis]
        drop_foot(footing, ball, foot)
        settle(footing, motion, ball, time, moment, here)
        footing.marks[ball, ROLLING] = 1
        return True
    if what == STOPS:
        velocity = here.velocity
        pull = Vec3(footing.pull[ball, 0], footing.pull[ball, 1], footing.pull[ball, 2])
        # the brake has used up what was left of the speed, and not merely been set anew
        if dot(velocity, velocity) <= 1e-18 * max(1.0, dot(pull, pull)):
            velocity = Vec3(0.0, 0.0, 0.0)
        settle(footing, motion, ball, time, moment, Point(here.position, velocity))
        return True
    if what == WAKES:
        settle(footing, motion, ball, time, moment, here)
        return True
    return False
