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
    ContactState,
)
from sim_core.motion import BallState
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
    contact: ContactState,
    motion: np.ndarray,
    ball: int,
    time: float,
    time_since_start: float,
    position: Vec3,
    radius: float,
) -> None:
    """Hold a ball still where it is; one that was held there before is left alone for longer."""
    nothing = Vec3(0.0, 0.0, 0.0)
    if _has_gone(contact, ball, HELD_AT, position, radius):
        _mark(contact, ball, HELD_AT, position)
        contact.marks[ball, HOLDS] = 0
    else:
        contact.marks[ball, HOLDS] = min(contact.marks[ball, HOLDS] + 1, MOST_HOLDS)
    move_on(
        contact, motion, ball, time, time_since_start, BallState(position, nothing), nothing, JAMMED
    )
    holds = contact.marks[ball, HOLDS]
    contact.memory[ball, STAYS_UNTIL] = time_since_start + WAIT * (2.0**holds - 1.0)


@jit
def watch(
    contact: ContactState,
    motion: np.ndarray,
    ball: int,
    time: float,
    time_since_start: float,
    position: Vec3,
    slow: bool,
    radius: float,
) -> None:
    """Count a ball's small hops, and hold it still when they lead nowhere."""
    marks = contact.marks
    marks[ball, ROLLING] = 0
    if _has_gone(contact, ball, HOPS, position, radius) or (not slow and marks[ball, DRIVEN] == 0):
        _mark(contact, ball, HOPS, position)
        marks[ball, SLOW_HITS] = 0
        marks[ball, DRIVEN] = 0
        contact.memory[ball, COUNTS_SINCE] = time_since_start
        return
    marks[ball, SLOW_HITS] += 1
    if marks[ball, SLOW_HITS] < JAM_HITS:
        return
    if marks[ball, DRIVEN] != 0:
        if time_since_start - contact.memory[ball, COUNTS_SINCE] < PRESS:
            marks[ball, DRIVEN] = PRESSED
        else:
            marks[ball, DRIVEN] = (
                1 if time_since_start - contact.memory[ball, TOUCHED] < TOUCHING else 0
            )
        marks[ball, SLOW_HITS] = 0
        contact.memory[ball, COUNTS_SINCE] = time_since_start
        return
    if marks[ball, MODE] >= ASLEEP:
        return
    velocity = place(contact, motion, ball, time).velocity
    if dot(velocity, velocity) < contact.slow * contact.slow:
        marks[ball, SLOW_HITS] = 0
        hold(contact, motion, ball, time, time_since_start, position, radius)


@jit
def _has_gone(contact: ContactState, ball: int, mark: int, position: Vec3, radius: float) -> bool:
    """True when a ball is further than HELD from the place in those columns of its memory."""
    memory = contact.memory
    gone = sub(position, Vec3(memory[ball, mark], memory[ball, mark + 1], memory[ball, mark + 2]))
    return dot(gone, gone) > (HELD * radius) ** 2


@jit
def _mark(contact: ContactState, ball: int, mark: int, position: Vec3) -> None:
    for axis in range(3):
        contact.memory[ball, mark + axis] = position[axis]
