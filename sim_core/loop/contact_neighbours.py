"""Find meetings with balls that roll or rest, and wake neighbours of a ball that begins to move.

Balls in contact (they roll or rest on a surface or on balls) do not fly along straight lines in the
free-fall frame. The filter of neighbours.py leaves them out, and they are examined here
individually and exactly.
"""

import numpy as np

from sim_core.contact.ball_on_ball import place
from sim_core.contact.landing_and_lift_off import WAKES
from sim_core.contact.supports import drop_support, stands_on_ball
from sim_core.detect.ball_ball import accelerated_pair_delay
from sim_core.effects.ball_sizes import reach_of_pair
from sim_core.effects.contact_mode import ASLEEP, FLYING, JAMMED, ON_BALL, ContactState
from sim_core.loop.event_queue import EventQueue, schedule_now, search_wall_again
from sim_core.loop.neighbours import NeighbourFilter, next_meeting
from sim_core.loop.spatial_blocks import column_of
from sim_core.motion import BallEvent
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.roots import NEVER
from sim_core.numerics.vec3 import Flight, Vec3, dot, sub, vec3_at

# m. Largest gap between a ball that is held still and the objects that hold it. Hops at 10 mm/s are
# 5 um high.
MAX_JAM_GAP = 2e-5


@inlined
def hide(contact: ContactState | None, neighbours: NeighbourFilter | None, ball: int) -> None:
    """Hide a ball that rolls or rests from the filter, in which a position NaN meets no ball."""
    if contact is None or neighbours is None:
        return
    if contact.mode[ball] != FLYING:
        neighbours.paths[0, column_of(neighbours.blocks, ball)] = np.float32(np.nan)


@jit
def hide_all(contact: ContactState | None, neighbours: NeighbourFilter | None) -> None:
    """Hide all balls that roll or rest from the filter, after all paths were copied into it."""
    if contact is None or neighbours is None:
        return
    for k in range(contact.contact_list.length[0]):
        hide(contact, neighbours, contact.contact_list.balls[k])


@inlined
def first_meeting(
    contact: ContactState | None,
    neighbours: NeighbourFilter,
    motion: np.ndarray,
    ball: int,
    time: float,
    before: float,
) -> tuple[float, int]:
    """Find the ball's first meeting with another ball after ``time`` and before ``before`` [s].

    Returns: the time of the meeting [s] and the partner, the number of the other ball, which may
    fly, roll or rest. Without a meeting the partner is -1, and the time is the time up to which
    there is certainly no meeting.
    """
    if contact is None:
        return next_meeting(neighbours, motion, ball, time, before)
    meeting, partner = NEVER, -1
    if contact.mode[ball] == FLYING:
        meeting, partner = next_meeting(neighbours, motion, ball, time, before)
        if contact.contact_list.length[0] == 0:
            return meeting, partner
    return _with_contact(contact, motion, ball, time, before, meeting, partner)


@jit
def _with_contact(
    contact: ContactState,
    motion: np.ndarray,
    ball: int,
    time: float,
    before: float,
    meeting: float,
    partner: int,
) -> tuple[float, int]:
    """Return the earlier of a known meeting and the first meeting with a ball in contact.

    ``meeting``, ``partner``: time [s] and other ball, -1 for none, of the first meeting with a
    flying ball. For a ball that rolls or rests itself, the result is the first meeting with any
    ball.
    """
    best = min(meeting, before) - time
    here = place(contact, motion, ball, time)
    flying, still = contact.mode[ball] == FLYING, contact.mode[ball] >= ASLEEP
    own = vec3_at(contact.acceleration, ball)
    in_contact = contact.contact_list
    for k in range(in_contact.length[0] if flying else len(motion)):
        other = int(np.int64(in_contact.balls[k])) if flying else k
        if other == ball or (still and contact.mode[other] >= ASLEEP):
            continue
        supports = contact.supports
        if stands_on_ball(supports, ball, other) or stands_on_ball(supports, other, ball):
            continue
        there = place(contact, motion, other, time)
        apart, closing = sub(there.position, here.position), sub(there.velocity, here.velocity)
        relative = sub(vec3_at(contact.acceleration, other), own)
        reach = reach_of_pair(contact.sizes, contact.reach, ball, other)
        delay = accelerated_pair_delay(Flight(apart, closing, relative), reach, best)
        if delay < best or (delay == best and partner >= 0 and other < partner):
            best = delay
            partner = other
    if partner < 0:
        return meeting, partner
    return time + best, partner


@inlined
def wake_if_it_moves(
    contact: ContactState | None, queue: EventQueue, motion: np.ndarray, event: BallEvent
) -> None:
    """Wake the neighbours of a ball that lay still, if it has begun to move."""
    if contact is None:
        return
    if contact.mode[event.ball] < ASLEEP:
        wake_neighbours(contact, queue, motion, event)


@jit
def wake_neighbours(
    contact: ContactState, queue: EventQueue, motion: np.ndarray, event: BallEvent
) -> None:
    """Wake the balls that stand on a ball that has begun to move, and balls held still beside it.

    The woken balls are marked as well. A woken ball may be met at this very time, and its events
    are then predicted again. The mark keeps the wake-up from being lost with the old events.
    """
    ball, time = event.ball, event.time
    here = place(contact, motion, ball, time).position
    for k in range(contact.contact_list.length[0]):
        other = int(np.int64(contact.contact_list.balls[k]))
        leans = stands_on_ball(contact.supports, other, ball)
        if not leans and other != ball and contact.mode[other] == JAMMED:
            leans = _is_near(contact, motion, other, ball, time, here)
        if leans:
            contact.wake_pending[other] = 1
            if contact.stays_until[other] > event.time_since_start:
                # until then the two balls are an ordinary pair
                _drop_supports_on(contact, other, ball)
                search_wall_again(queue, other, time)
            else:
                schedule_now(queue, other, time, WAKES)


@jit
def _is_near(
    contact: ContactState, motion: np.ndarray, ball: int, other: int, time: float, position: Vec3
) -> bool:
    """Return True if a ball is near enough to the ball ``other`` to hold it still.

    ``position``: position of the other ball [m].
    """
    apart = sub(place(contact, motion, ball, time).position, position)
    reach = reach_of_pair(contact.sizes, contact.reach, ball, other)
    return dot(apart, apart) < (reach + MAX_JAM_GAP) ** 2


@jit
def _drop_supports_on(contact: ContactState, ball: int, other: int) -> None:
    supports = contact.supports
    for support in range(supports.number[ball] - 1, -1, -1):
        if supports.obstacles[ball, support] == ON_BALL - other:
            drop_support(supports, ball, support)


@jit
def count_neighbours(contact: ContactState, motion: np.ndarray, event: BallEvent) -> bool:
    """Note which balls are around a jammed ball: their count, and the sum of their numbers.

    The count is noted as 0 if none of these balls moves. Once a ball around it has gone, the jammed
    ball may be free.

    Returns: True if count or sum differ from what was noted before.
    """
    ball, jams = event.ball, contact.jams
    here = place(contact, motion, ball, event.time).position
    count, numbers, moves = 0, 0, False
    for other in range(len(motion)):
        if other != ball and _is_near(contact, motion, other, ball, event.time, here):
            count += 1
            numbers += other
            moves |= contact.mode[other] < ASLEEP
    changed = count != jams.neighbour_count[ball] or numbers != jams.neighbour_sum[ball]
    jams.neighbour_count[ball] = count if moves else 0
    jams.neighbour_sum[ball] = numbers
    return bool(changed)
