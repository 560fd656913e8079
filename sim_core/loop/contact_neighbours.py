"""Who meets whom when some balls are in contact mode: those fly no straight lines in the free-fall frame.

The filter of neighbours.py does not see them; they are looked at one by one, exactly.
"""

import numpy as np

from sim_core.contact.constrained_impulse import place, pull
from sim_core.detect.ball_ball import pulled_meeting_delay
from sim_core.effects.contact_mode import (
    ASLEEP,
    CALLED,
    FEET,
    FLYING,
    JAMMED,
    MODE,
    ON_BALL,
    PROPPED_BY,
    PROPS,
    STAYS_UNTIL,
    WAKES,
    Footing,
    drop_foot,
    stands_on_ball,
)
from sim_core.loop.event_queue import Calendar, call_up, look_again
from sim_core.loop.neighbours import Crowd, next_meeting
from sim_core.loop.spatial_blocks import slot_of
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.roots import NEVER
from sim_core.numerics.vec3 import dot, sub

LEANING = 2e-5  # m: a ball held still is this near to what holds it, or nearer: hops at 10 mm/s are 5 um high


@inlined
def hide(footing: Footing | None, crowd: Crowd | None, ball: int) -> None:
    """Take a ball in contact mode out of the filter's sight."""
    if footing is None or crowd is None:
        return
    if footing.marks[ball, MODE] != FLYING:
        crowd.lanes[0, slot_of(crowd.blocks, ball)] = np.float32(np.nan)


@jit
def hide_all(footing: Footing | None, crowd: Crowd | None) -> None:
    """The same for all of them, at a window's start."""
    if footing is None or crowd is None:
        return
    for k in range(footing.held[0]):
        hide(footing, crowd, footing.roster[k])


@inlined
def first_meeting(
    footing: Footing | None, crowd: Crowd, motion: np.ndarray, ball: int, time: float, before: float
) -> tuple[float, int]:
    """next_meeting among all balls, whether in flight or in contact."""
    if footing is None:
        return next_meeting(crowd, motion, ball, time, before)
    meeting, partner = NEVER, -1
    if footing.marks[ball, MODE] == FLYING:
        meeting, partner = next_meeting(crowd, motion, ball, time, before)
        if footing.held[0] == 0:
            return meeting, partner
    return _with_grounded(footing, motion, ball, time, before, meeting, partner, crowd.reach)


@jit
def _with_grounded(
    footing: Footing,
    motion: np.ndarray,
    ball: int,
    time: float,
    before: float,
    meeting: float,
    partner: int,
    reach: float,
) -> tuple[float, int]:
    """The earlier of a meeting found among the balls in flight and those with balls in contact; for a ball in contact
    itself those with all balls.
    """
    best = min(meeting, before) - time
    here = place(footing, motion, ball, time)
    flying = footing.marks[ball, MODE] == FLYING
    still = footing.marks[ball, MODE] >= ASLEEP
    own = pull(footing, ball)
    for k in range(footing.held[0] if flying else len(motion)):
        other = footing.roster[k] if flying else k
        if other == ball or (still and footing.marks[other, MODE] >= ASLEEP):
            continue
        if stands_on_ball(footing, ball, other) or stands_on_ball(footing, other, ball):
            continue
        there = place(footing, motion, other, time)
        apart, closing = sub(there.position, here.position), sub(there.velocity, here.velocity)
        delay = pulled_meeting_delay(apart, closing, sub(pull(footing, other), own), reach, best)
        if delay < best or (delay == best and partner >= 0 and other < partner):
            best = delay
            partner = other
    if partner < 0:
        return meeting, partner
    return time + best, partner


@inlined
def lies_still(footing: Footing | None, ball: int) -> bool:
    """True for a ball that sleeps or is jammed."""
    if footing is None:
        return False
    return footing.marks[ball, MODE] >= ASLEEP


@inlined
def wake_if_it_moves(
    footing: Footing | None,
    calendar: Calendar,
    motion: np.ndarray,
    ball: int,
    time: float,
    moment: float,
    reach: float,
) -> None:
    """What leans on a ball that lay still is woken when it no longer does."""
    if footing is None:
        return
    if footing.marks[ball, MODE] < ASLEEP:
        wake_neighbours(footing, calendar, motion, ball, time, moment, reach)


@jit
def wake_neighbours(
    footing: Footing,
    calendar: Calendar,
    motion: np.ndarray,
    ball: int,
    time: float,
    moment: float,
    reach: float,
) -> None:
    """Call up the balls that stand on one that has begun to move, and those held still beside it.

    Marked besides: what meets one of them at this very time has its events predicted anew, and the call must not be
    lost with the old ones.
    """
    here = place(footing, motion, ball, time).position
    for k in range(footing.held[0]):
        other = footing.roster[k]
        leans = stands_on_ball(footing, other, ball)
        if not leans and other != ball and footing.marks[other, MODE] == JAMMED:
            apart = sub(place(footing, motion, other, time).position, here)
            leans = dot(apart, apart) < (reach + LEANING) ** 2
        if leans:
            footing.marks[other, CALLED] = 1
            if footing.memory[other, STAYS_UNTIL] > moment:
                _step_off(footing, other, ball)  # until then they are a pair like others
                look_again(calendar, other, time)
            else:
                call_up(calendar, other, time, WAKES)


@jit
def _step_off(footing: Footing, ball: int, other: int) -> None:
    foot = 0
    while foot < footing.marks[ball, FEET]:
        if footing.rows[ball, foot] == ON_BALL - other:
            drop_foot(footing, ball, foot)
        else:
            foot += 1


@jit
def count_props(footing: Footing, motion: np.ndarray, ball: int, time: float, reach: float) -> bool:
    """Note which balls are about a jammed one, if any of them moves: it may not be held any more once one has gone.

    True when they are not those noted before.
    """
    here = place(footing, motion, ball, time).position
    count, numbers, moves = 0, 0, False
    for other in range(len(motion)):
        apart = sub(place(footing, motion, other, time).position, here)
        if other != ball and dot(apart, apart) < (reach + LEANING) ** 2:
            count += 1
            numbers += other
            moves |= footing.marks[other, MODE] < ASLEEP
    others = count != footing.marks[ball, PROPS] or numbers != footing.memory[ball, PROPPED_BY]
    footing.marks[ball, PROPS] = count if moves else 0
    footing.memory[ball, PROPPED_BY] = numbers
    return others
