"""Two balls meet, and at least one is not in free flight; or the turning part moves one that may not be.

A fast hit is the ordinary one: what a surface behind the ball does to it is the next event. To a slow one (below
Restitution.elastic_below) a ball that lies still is a still surface: friction holds it, and what would be handed on
is below elastic_below²/2 of energy per mass. Between balls on the move a slow hit is a single constrained impact: a
ball that stands on feet takes from an impulse along d only what they leave of it, P(d), so its share of the inverse
mass is |P(d)|² in place of 1, and elastic means elastic for the two together (Brogliato, Nonsmooth Mechanics (2016),
section 5.2). So it is between a turning part and what it moves.
"""

import math

import numpy as np

from sim_core._compile import inlined, jit
from sim_core.effects.rest import (
    ASLEEP,
    COUNTS_SINCE,
    DRIVEN,
    FEET,
    FLYING,
    HELD_AT,
    HOLDS,
    HOPS,
    JAMMED,
    MODE,
    ON_BALL,
    ROLLING,
    SLOW_HITS,
    STAYS_UNTIL,
    TOUCHED,
    Footing,
    drop_foot,
    foot_normal,
    onto_cone,
)
from sim_core.effects.restitution import Restitution, restitution_law
from sim_core.effects.turn import Turning, from_part
from sim_core.flight import Point, kick, point_under
from sim_core.resolve.ball_ball import pair_kick
from sim_core.resolve.footing import BOUNCES, move_on, settle, touch_down
from sim_core.vec3 import Vec3, along, dot, sub

JAM_HITS = 64  # slow hits in a row within HELD: a ball sliding off another is further along after a few
HELD = 0.01  # of a radius
PRESS = 1e-4  # s: so many in so short a time are no hops under weight (SHORTEST_HOP): a turning part closes the gap
TOUCHING = 1e-2  # s: what lies on a turning part is touched by it more often, in hops of 10 mm/s each 2 ms
PRESSED = 2
WAIT = 1e-3  # s: what is held a second time at one place is not called up for so long, and each time twice as long
MOST_HOLDS = 40  # after which that is for ever
BLOCKED = 0.01  # of an inverse mass: a push on balls that give way by less is no greater for it
# m/s: balls in touch that part by less are in touch for good. Slow hits part them twice as fast: two that went on as
# one (e = 0) would meet for ever by rounding
PARTING = 1e-9
# s: balls pressed together without any speed would meet again at once; they part for so long, which lifts them 50 nm
SHORTEST_HOP = 1e-4


@jit
def meet(
    footing: Footing,
    motion: np.ndarray,
    one: int,
    two: int,
    time: float,
    moment: float,
    restitution: Restitution | None,
    radius: float,
) -> bool:
    """Two balls meet now; True when one that lay still is moved, so that what leans on it must be woken."""
    first, second = _place(footing, motion, one, time), _place(footing, motion, two, time)
    apart, closing = sub(second.position, first.position), sub(second.velocity, first.velocity)
    distance = math.sqrt(dot(apart, apart))
    into = -dot(apart, closing) / distance
    if into < -PARTING:
        return False
    into = max(into, 0.0)  # pressed together without any speed
    still_one, still_two = footing.marks[one, MODE] >= ASLEEP, footing.marks[two, MODE] >= ASLEEP
    slow = into < footing.slow
    pressed = _is_pressed(footing, one, moment) or _is_pressed(footing, two, moment)
    scale = 1.0 / distance
    normal = Vec3(scale * apart.x, scale * apart.y, scale * apart.z)
    if slow and still_one and not pressed:
        _land_on(footing, motion, two, one, time, moment, second, normal, into, restitution, radius)
    elif slow and still_two and not pressed:
        _land_on(footing, motion, one, two, time, moment, first, _times(-1.0, normal), into, restitution, radius)
    elif not slow:
        change = pair_kick(apart, closing, restitution)
        _push(footing, motion, one, time, moment, first, change)
        _push(footing, motion, two, time, moment, second, _times(-1.0, change))
    else:
        if pressed:
            _let_go(footing, one, _times(-1.0, normal))
            _let_go(footing, two, normal)
        give_one, give_two = _response(footing, one, _times(-1.0, normal)), _response(footing, two, normal)
        total = max(dot(give_two, normal) - dot(give_one, normal), BLOCKED)
        press = -dot(sub(_pull(footing, two), _pull(footing, one)), normal)
        push = (into + max(into, SHORTEST_HOP * press, 2.0 * PARTING)) / total
        _push(footing, motion, one, time, moment, first, _times(push, give_one))
        _push(footing, motion, two, time, moment, second, _times(push, give_two))
    if pressed:
        _touch(footing, one, moment)
        _touch(footing, two, moment)
    _watch(footing, motion, one, time, moment, first.position, slow, radius)
    _watch(footing, motion, two, time, moment, second.position, slow, radius)
    return (still_one or still_two) and (pressed or not slow)


@jit
def _is_pressed(footing: Footing, ball: int, moment: float) -> bool:
    """True when the turning part pushes a ball that gets nowhere: what lies still in its way must give way."""
    return footing.marks[ball, DRIVEN] == PRESSED and moment - footing.memory[ball, TOUCHED] < TOUCHING


@jit
def _land_on(
    footing: Footing,
    motion: np.ndarray,
    ball: int,
    other: int,
    time: float,
    moment: float,
    here: Point,
    normal: Vec3,
    into: float,
    restitution: Restitution | None,
    radius: float,
) -> None:
    """A ball meets one that lies still: a surface like others."""
    if footing.marks[ball, MODE] >= ASLEEP:
        return
    landed = touch_down(footing, motion, ball, ON_BALL - other, 2.0 * radius, time, moment, here, normal)
    if landed == BOUNCES:
        e = 1.0 if restitution is None else _law(restitution, into)
        _push(footing, motion, ball, time, moment, here, _times((1.0 + e) * into, normal))


@jit
def _law(restitution: Restitution, speed: float) -> float:
    return restitution_law(speed, restitution.balls[0], restitution.balls[1])


@jit
def _pull(footing: Footing, ball: int) -> Vec3:
    return Vec3(footing.pull[ball, 0], footing.pull[ball, 1], footing.pull[ball, 2])


@jit
def _place(footing: Footing, motion: np.ndarray, ball: int, time: float) -> Point:
    return point_under(motion, ball, time, Vec3(footing.pull[ball, 0], footing.pull[ball, 1], footing.pull[ball, 2]))


@jit
def _times(s: float, a: Vec3) -> Vec3:
    return Vec3(s * a.x, s * a.y, s * a.z)


@jit
def _response(footing: Footing, ball: int, push: Vec3) -> Vec3:
    """Velocity change of a ball for a unit push per mass."""
    if footing.marks[ball, MODE] == FLYING:
        return push
    return onto_cone(footing, ball, push)


@jit
def _push(footing: Footing, motion: np.ndarray, ball: int, time: float, moment: float, at: Point, change: Vec3) -> None:
    if footing.marks[ball, MODE] == FLYING:
        kick(motion, ball, time, change)
    else:
        settle(footing, motion, ball, time, moment, Point(at.position, along(at.velocity, 1.0, change)))


@inlined
def drive(
    footing: Footing | None,
    turning: Turning,
    motion: np.ndarray,
    ball: int,
    time: float,
    moment: float,
    here: Point,
    away: Vec3,
    into: float,
    change: Vec3,
) -> None:
    """The turning part hits a ball at ``into`` [m/s]: ``change`` [m/s] is what a free ball would take from it, and
    ``away`` points to it from where it is touched, in the part's frame.
    """
    if footing is None:
        kick(motion, ball, time, change)
        return
    normal = from_part(turning, _times(1.0 / math.sqrt(dot(away, away)), away), time)
    _drive(footing, motion, ball, time, moment, here, normal, into, change)


@jit
def _drive(
    footing: Footing,
    motion: np.ndarray,
    ball: int,
    time: float,
    moment: float,
    here: Point,
    normal: Vec3,
    into: float,
    change: Vec3,
) -> None:
    footing.marks[ball, ROLLING] = 0
    if into < footing.slow:
        _let_go(footing, ball, normal)
        give = _response(footing, ball, normal)
        lift = SHORTEST_HOP * math.sqrt(dot(footing.gravity, footing.gravity))  # what lies on it hops, not too often
        change = _times((into + max(into, lift)) / max(dot(give, normal), BLOCKED), give)
    _push(footing, motion, ball, time, moment, here, change)
    _touch(footing, ball, moment)


@jit
def _touch(footing: Footing, ball: int, moment: float) -> None:
    footing.marks[ball, DRIVEN] = max(footing.marks[ball, DRIVEN], 1)
    footing.memory[ball, TOUCHED] = moment


@jit
def _let_go(footing: Footing, ball: int, push: Vec3) -> None:
    """Take away the feet on balls that a push presses: those must give way or press back."""
    foot = 0
    while foot < footing.marks[ball, FEET]:
        if footing.rows[ball, foot] <= ON_BALL and dot(foot_normal(footing, ball, foot), push) < 0.0:
            drop_foot(footing, ball, foot)
        else:
            foot += 1


@jit
def hold(
    footing: Footing, motion: np.ndarray, ball: int, time: float, moment: float, position: Vec3, radius: float
) -> None:
    """Hold a ball still where it is; one that was held there before is left alone for longer."""
    nothing = Vec3(0.0, 0.0, 0.0)
    if _has_gone(footing, ball, HELD_AT, position, radius):
        _mark(footing, ball, HELD_AT, position)
        footing.marks[ball, HOLDS] = 0
    else:
        footing.marks[ball, HOLDS] = min(footing.marks[ball, HOLDS] + 1, MOST_HOLDS)
    move_on(footing, motion, ball, time, moment, Point(position, nothing), nothing, JAMMED)
    holds = footing.marks[ball, HOLDS]
    footing.memory[ball, STAYS_UNTIL] = moment + WAIT * (2.0**holds - 1.0)


@jit
def _has_gone(footing: Footing, ball: int, mark: int, position: Vec3, radius: float) -> bool:
    """True when a ball is further than HELD from the place in those columns of its memory."""
    memory = footing.memory
    gone = sub(position, Vec3(memory[ball, mark], memory[ball, mark + 1], memory[ball, mark + 2]))
    return dot(gone, gone) > (HELD * radius) ** 2


@jit
def _mark(footing: Footing, ball: int, mark: int, position: Vec3) -> None:
    for axis in range(3):
        footing.memory[ball, mark + axis] = position[axis]


@jit
def _watch(
    footing: Footing,
    motion: np.ndarray,
    ball: int,
    time: float,
    moment: float,
    position: Vec3,
    slow: bool,
    radius: float,
) -> None:
    """Count a ball's small hops, and hold it still when they lead nowhere."""
    marks = footing.marks
    marks[ball, ROLLING] = 0
    if _has_gone(footing, ball, HOPS, position, radius) or (not slow and marks[ball, DRIVEN] == 0):
        _mark(footing, ball, HOPS, position)
        marks[ball, SLOW_HITS] = 0
        marks[ball, DRIVEN] = 0
        footing.memory[ball, COUNTS_SINCE] = moment
        return
    marks[ball, SLOW_HITS] += 1
    if marks[ball, SLOW_HITS] < JAM_HITS:
        return
    if marks[ball, DRIVEN] != 0:
        if moment - footing.memory[ball, COUNTS_SINCE] < PRESS:
            marks[ball, DRIVEN] = PRESSED
        else:
            marks[ball, DRIVEN] = 1 if moment - footing.memory[ball, TOUCHED] < TOUCHING else 0
        marks[ball, SLOW_HITS] = 0
        footing.memory[ball, COUNTS_SINCE] = moment
        return
    if marks[ball, MODE] >= ASLEEP:
        return
    velocity = _place(footing, motion, ball, time).velocity
    if dot(velocity, velocity) < footing.slow * footing.slow:
        marks[ball, SLOW_HITS] = 0
        hold(footing, motion, ball, time, moment, position, radius)
