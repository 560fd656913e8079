"""Who meets whom when some balls are in contact mode: those fly no straight lines in the free-fall frame.

The filter of neighbours.py does not see them; they are looked at one by one, exactly.
"""

import numpy as np

from sim_core.contact.constrained_impulse import acceleration_of, place
from sim_core.detect.ball_ball import accelerated_pair_delay
from sim_core.effects.contact_mode import (
    ASLEEP,
    FLYING,
    JAMMED,
    MODE,
    NEIGHBOUR_SUM,
    NEIGHBOURS_HOLDING_JAM,
    ON_BALL,
    STAYS_UNTIL,
    SUPPORTS,
    WAKE_PENDING,
    WAKES,
    ContactState,
    drop_support,
    stands_on_ball,
)
from sim_core.loop.event_queue import EventQueue, call_up, look_again
from sim_core.loop.neighbours import NeighbourFilter, next_meeting
from sim_core.loop.spatial_blocks import slot_of
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.roots import NEVER
from sim_core.numerics.vec3 import Flight, dot, sub

LEANING = 2e-5  # m: a ball held still is this near to what holds it, or nearer: hops at 10 mm/s are 5 um high


@inlined
def hide(contact: ContactState | None, neighbours: NeighbourFilter | None, ball: int) -> None:
    """Take a ball in contact mode out of the filter's sight."""
    if contact is None or neighbours is None:
        return
    if contact.marks[ball, MODE] != FLYING:
        neighbours.lanes[0, slot_of(neighbours.blocks, ball)] = np.float32(np.nan)


@jit
def hide_all(contact: ContactState | None, neighbours: NeighbourFilter | None) -> None:
    """The same for all of them, at a window's start."""
    if contact is None or neighbours is None:
        return
    for k in range(contact.contact_count[0]):
        hide(contact, neighbours, contact.contact_list[k])


@inlined
def first_meeting(
    contact: ContactState | None,
    neighbours: NeighbourFilter,
    motion: np.ndarray,
    ball: int,
    time: float,
    before: float,
) -> tuple[float, int]:
    """next_meeting among all balls, whether in flight or in contact."""
    if contact is None:
        return next_meeting(neighbours, motion, ball, time, before)
    meeting, partner = NEVER, -1
    if contact.marks[ball, MODE] == FLYING:
        meeting, partner = next_meeting(neighbours, motion, ball, time, before)
        if contact.contact_count[0] == 0:
            return meeting, partner
    return _with_grounded(contact, motion, ball, time, before, meeting, partner, neighbours.reach)


@jit
def _with_grounded(
    contact: ContactState,
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
    here = place(contact, motion, ball, time)
    flying = contact.marks[ball, MODE] == FLYING
    still = contact.marks[ball, MODE] >= ASLEEP
    own = acceleration_of(contact, ball)
    for k in range(contact.contact_count[0] if flying else len(motion)):
        other = contact.contact_list[k] if flying else k
        if other == ball or (still and contact.marks[other, MODE] >= ASLEEP):
            continue
        if stands_on_ball(contact, ball, other) or stands_on_ball(contact, other, ball):
            continue
        there = place(contact, motion, other, time)
        apart, closing = sub(there.position, here.position), sub(there.velocity, here.velocity)
        pull = sub(acceleration_of(contact, other), own)
        delay = accelerated_pair_delay(Flight(apart, closing, pull), reach, best)
        if delay < best or (delay == best and partner >= 0 and other < partner):
            best = delay
            partner = other
    if partner < 0:
        return meeting, partner
    return time + best, partner


@inlined
def lies_still(contact: ContactState | None, ball: int) -> bool:
    """True for a ball that sleeps or is jammed."""
    if contact is None:
        return False
    return contact.marks[ball, MODE] >= ASLEEP


@inlined
def wake_if_it_moves(
    contact: ContactState | None,
    queue: EventQueue,
    motion: np.ndarray,
    ball: int,
    time: float,
    time_since_start: float,
    reach: float,
) -> None:
    """What leans on a ball that lay still is woken when it no longer does."""
    if contact is None:
        return
    if contact.marks[ball, MODE] < ASLEEP:
        wake_neighbours(contact, queue, motion, ball, time, time_since_start, reach)


@jit
def wake_neighbours(
    contact: ContactState,
    queue: EventQueue,
    motion: np.ndarray,
    ball: int,
    time: float,
    time_since_start: float,
    reach: float,
) -> None:
    """Call up the balls that stand on one that has begun to move, and those held still beside it.

    Marked besides: what meets one of them at this very time has its events predicted anew, and the call must not be
    lost with the old ones.
    """
    here = place(contact, motion, ball, time).position
    for k in range(contact.contact_count[0]):
        other = contact.contact_list[k]
        leans = stands_on_ball(contact, other, ball)
        if not leans and other != ball and contact.marks[other, MODE] == JAMMED:
            apart = sub(place(contact, motion, other, time).position, here)
            leans = dot(apart, apart) < (reach + LEANING) ** 2
        if leans:
            contact.marks[other, WAKE_PENDING] = 1
            if contact.memory[other, STAYS_UNTIL] > time_since_start:
                _step_off(contact, other, ball)  # until then they are a pair like others
                look_again(queue, other, time)
            else:
                call_up(queue, other, time, WAKES)


@jit
def _step_off(contact: ContactState, ball: int, other: int) -> None:
    support = 0
    while support < contact.marks[ball, SUPPORTS]:
        if contact.rows[ball, support] == ON_BALL - other:
            drop_support(contact, ball, support)
        else:
            support += 1


@jit
def count_neighbours(
    contact: ContactState, motion: np.ndarray, ball: int, time: float, reach: float
) -> bool:
    """Note which balls are about a jammed one, if any of them moves: it may not be held any more once one has gone.

    True when they are not those noted before.
    """
    here = place(contact, motion, ball, time).position
    count, numbers, moves = 0, 0, False
    for other in range(len(motion)):
        apart = sub(place(contact, motion, other, time).position, here)
        if other != ball and dot(apart, apart) < (reach + LEANING) ** 2:
            count += 1
            numbers += other
            moves |= contact.marks[other, MODE] < ASLEEP
    others = (
        count != contact.marks[ball, NEIGHBOURS_HOLDING_JAM]
        or numbers != contact.memory[ball, NEIGHBOUR_SUM]
    )
    contact.marks[ball, NEIGHBOURS_HOLDING_JAM] = count if moves else 0
    contact.memory[ball, NEIGHBOUR_SUM] = numbers
    return others
