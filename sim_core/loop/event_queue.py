"""The next event of every ball, and whose comes first: a knock-out tournament over the balls."""

from typing import NamedTuple

import numpy as np

from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.roots import NEVER

# columns of Calendar.marks
HITS = 0  # how often the ball's path has changed: a stored meeting is stale once the partner's number has moved on
OBSTACLE = 1  # obstacle it meets next, or one of the two below
SEARCH_ON = -1  # none up to wall_time: search on from there
UNKNOWN = -2  # nothing has been predicted for this ball yet
EVENTS = 2  # events in this window
PARTNER = 3  # ball it meets next, -1 none; this column and the next only where balls collide with one another
PARTNER_HITS = 4  # the partner's HITS when that was found


class EventQueue(NamedTuple):
    """``pair_time``, ``wall_time`` (n,) [s on the window's clock]; ``marks`` (n, 5) int32;

    ``next_time`` (m,) [s], the earlier of the two, m the next power of two, padded with NEVER; ``winners`` (2 m,)
    int32: winners[1] is the ball whose event is next. Where balls do not collide with one another there is no
    ``pair_time``, and ``marks`` is (n, 3).
    """

    pair_time: np.ndarray | None
    wall_time: np.ndarray
    marks: np.ndarray
    next_time: np.ndarray
    winners: np.ndarray


def new_event_queue(balls: int, pairs: bool = True) -> EventQueue:
    """A calendar in which every ball is due at once to look for its next event."""
    seats = 1
    while seats < balls:
        seats *= 2
    marks = np.zeros((balls, 5 if pairs else 3), dtype=np.int32)
    marks[:, PARTNER : PARTNER + 1] = -1
    marks[:, OBSTACLE] = UNKNOWN
    next_time = np.full(seats, NEVER)
    next_time[:balls] = 0.0
    winners = np.zeros(2 * seats, dtype=np.int32)
    winners[seats:] = np.arange(seats)
    for match in range(seats - 1, 0, -1):
        one, two = winners[2 * match], winners[2 * match + 1]
        winners[match] = one if next_time[one] <= next_time[two] else two
    return EventQueue(
        np.full(balls, NEVER) if pairs else None, np.zeros(balls), marks, next_time, winners
    )


@inlined
def meeting_time(pair_time: np.ndarray | None, ball: int) -> float:
    """When the ball meets another [s]; NEVER where balls do not."""
    if pair_time is None:
        return NEVER
    return pair_time[ball]


@inlined
def _forget_meeting(pair_time: np.ndarray | None, marks: np.ndarray, ball: int) -> None:
    if pair_time is None:
        return
    pair_time[ball] = NEVER
    marks[ball, PARTNER] = -1


@jit
def _set_meetings_back(pair_time: np.ndarray | None, window: float) -> None:
    if pair_time is None:
        return
    for ball in range(len(pair_time)):
        pair_time[ball] -= window


@inlined
def reschedule(queue: EventQueue, ball: int) -> None:
    """Put the ball's earlier event on the calendar and replay its matches; ties go to the lower ball."""
    queue.next_time[ball] = min(meeting_time(queue.pair_time, ball), queue.wall_time[ball])
    match = (len(queue.next_time) + ball) // 2
    while match >= 1:
        one = queue.winners[2 * match]
        two = queue.winners[2 * match + 1]
        queue.winners[match] = one if queue.next_time[one] <= queue.next_time[two] else two
        match //= 2


@jit
def forget(queue: EventQueue, ball: int, time: float) -> None:
    """Drop what was predicted for the ball: it is due now to look again."""
    call_up(queue, ball, time, UNKNOWN)


@jit
def call_up(queue: EventQueue, ball: int, time: float, what: int) -> None:
    """Make an event of kind ``what`` (see OBSTACLE) the ball's next, now."""
    _forget_meeting(queue.pair_time, queue.marks, ball)
    queue.wall_time[ball] = time
    queue.marks[ball, OBSTACLE] = what
    reschedule(queue, ball)


@jit
def look_again(queue: EventQueue, ball: int, time: float) -> None:
    """Have the ball look again, now, for how its own path ends; its meeting stands."""
    queue.wall_time[ball] = time
    queue.marks[ball, OBSTACLE] = SEARCH_ON
    reschedule(queue, ball)


@jit
def shift_queue(queue: EventQueue, window: float) -> None:
    """Move the clock's zero forward by ``window`` [s]; the order of events stays."""
    _set_meetings_back(queue.pair_time, window)
    for ball in range(len(queue.wall_time)):
        queue.wall_time[ball] -= window
        queue.next_time[ball] -= window
        queue.marks[ball, EVENTS] = 0
