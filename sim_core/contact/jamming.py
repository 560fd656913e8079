"""A ball whose small hops lead nowhere is held where it is; at one place again and again for longer each time."""

import numpy as np

from sim_core.contact.constrained_impulse import place
from sim_core.contact.pushed_by_part import PRESSED, TOUCHING
from sim_core.contact.support_changes import move_on
from sim_core.effects.contact_mode import (
    ASLEEP,
    COUNTS_SINCE,
    DRIVEN,
    HELD_AT,
    HOLDS,
    HOPS,
    JAMMED,
    MODE,
    ROLLING,
    SLOW_HITS,
    STAYS_UNTIL,
    TOUCHED,
    Footing,
)
from sim_core.motion import Point
from sim_core.numerics.jit import jit
from sim_core.numerics.vec3 import Vec3, dot, sub

JAM_HITS = (
    64  # slow hits in a row within HELD: a ball sliding off another is further along after a few
)
HELD = 0.01  # of a radius
PRESS = 1e-4  # s: so many in so short a time are no hops under weight (SHORTEST_HOP): a turning part closes the gap
WAIT = 1e-3  # s: what is held a second time at one place is not called up for so long, and each time twice as long
MOST_HOLDS = 40  # after which that is for ever


@jit
def hold(
    footing: Footing,
    motion: np.ndarray,
    ball: int,
    time: float,
    moment: float,
    position: Vec3,
    radius: float,
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
def watch(
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
    velocity = place(footing, motion, ball, time).velocity
    if dot(velocity, velocity) < footing.slow * footing.slow:
        marks[ball, SLOW_HITS] = 0
        hold(footing, motion, ball, time, moment, position, radius)


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
