"""The turning part moves what it touches, slow or not, and that moves what lies still in its way.

A slow hit is a single constrained impact, as that of two balls in leaning.py.
"""

import math

import numpy as np

from sim_core.contact.constrained_impulse import BLOCKED, SHORTEST_HOP, impart, response
from sim_core.effects.contact_mode import (
    DRIVEN,
    FEET,
    ON_BALL,
    ROLLING,
    TOUCHED,
    Footing,
    drop_foot,
    foot_normal,
)
from sim_core.effects.part_rotation import Turning, from_part
from sim_core.motion import Point, kick
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.vec3 import Vec3, dot, times

TOUCHING = (
    1e-2  # s: what lies on a turning part is touched by it more often, in hops of 10 mm/s each 2 ms
)
PRESSED = 2  # of DRIVEN


@inlined
def taken_from_part(
    footing: Footing | None,
    turning: Turning,
    ball: int,
    time: float,
    away: Vec3,
    into: float,
    change: Vec3,
) -> Vec3:
    """The velocity change [m/s] of a ball that the turning part hits at ``into`` [m/s], without friction.

    ``change`` [m/s]: what a free ball would take; ``away`` points to it from where it is touched, in the part's frame.
    """
    if footing is None:
        return change
    if into >= footing.slow:
        return change
    return _constrained(
        footing, ball, from_part(turning, times(1.0 / math.sqrt(dot(away, away)), away), time), into
    )


@jit
def _constrained(footing: Footing, ball: int, normal: Vec3, into: float) -> Vec3:
    let_go(footing, ball, normal)
    give = response(footing, ball, normal)
    lift = SHORTEST_HOP * math.sqrt(
        dot(footing.gravity, footing.gravity)
    )  # what lies on it hops, not too often
    return times((into + max(into, lift)) / max(dot(give, normal), BLOCKED), give)


@inlined
def drive(
    footing: Footing | None,
    motion: np.ndarray,
    ball: int,
    time: float,
    moment: float,
    here: Point,
    change: Vec3,
) -> None:
    """The turning part changes a ball's velocity by ``change`` [m/s]."""
    if footing is None:
        kick(motion, ball, time, change)
        return
    footing.marks[ball, ROLLING] = 0
    impart(footing, motion, ball, time, moment, here, change)
    touch(footing, ball, moment)


@jit
def touch(footing: Footing, ball: int, moment: float) -> None:
    """Note that the turning part, or what it presses, has touched a ball."""
    footing.marks[ball, DRIVEN] = max(footing.marks[ball, DRIVEN], 1)
    footing.memory[ball, TOUCHED] = moment


@jit
def is_pressed(footing: Footing, ball: int, moment: float) -> bool:
    """True when the turning part pushes a ball that gets nowhere: what lies still in its way must give way."""
    return (
        footing.marks[ball, DRIVEN] == PRESSED and moment - footing.memory[ball, TOUCHED] < TOUCHING
    )


@jit
def let_go(footing: Footing, ball: int, push: Vec3) -> None:
    """Take away the feet on balls that a push presses: those must give way or press back."""
    foot = 0
    while foot < footing.marks[ball, FEET]:
        if (
            footing.rows[ball, foot] <= ON_BALL
            and dot(foot_normal(footing, ball, foot), push) < 0.0
        ):
            drop_foot(footing, ball, foot)
        else:
            foot += 1
