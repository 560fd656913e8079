"""The next event of every ball, and the earliest event, found by a knock-out tournament."""

from typing import NamedTuple

import numpy as np

from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.roots import NEVER

# values in place of the obstacle that a ball meets next (contact/landing_and_lift_off.py has more)
SEARCH_ON = -1  # no obstacle until wall_time: search on from there
UNKNOWN = -2  # nothing has been predicted for this ball yet


class Meetings(NamedTuple):
    """The next meeting of each of n balls with another ball.

    A window is a span of simulated time. The clock restarts from 0 at the start of each window.

    time: time of the meeting [s since the window's start], (n,), NEVER for none.
    partner: the other ball, (n,) int32, -1 for none.
    partner_path: number of changes that the partner's path had had when the meeting was predicted,
        (n,) int32. The meeting is stale, and will not happen, once that number has grown.
    """

    time: np.ndarray
    partner: np.ndarray
    partner_path: np.ndarray


class EventQueue(NamedTuple):
    """The next events of n balls. The clock restarts from 0 at the start of each window of time.

    wall_time: time at which the ball meets an obstacle or its path ends [s since the window's
        start], (n,).
    obstacle: number of the obstacle; or SEARCH_ON, UNKNOWN or the negative number of a reason why
        the path of a rolling or resting ball ends, (n,) int32.
    path_number: number of changes of the ball's path, (n,) int32.
    events: number of events of the ball in this window, (n,) int32.
    meetings: None if balls do not collide with one another.
    next_time: the earlier of wall time and meeting time [s], (m,), padded with NEVER. m is the next
        power of two.
    winners: balls that win the tournament's matches, (2 m,) int32. winners[1] is the ball with the
        next event.
    """

    wall_time: np.ndarray
    obstacle: np.ndarray
    path_number: np.ndarray
    events: np.ndarray
    meetings: Meetings | None
    next_time: np.ndarray
    winners: np.ndarray


def new_event_queue(balls: int, pairs: bool = True) -> EventQueue:
    """Return a queue in which every ball is due at once to search for its next event.

    ``pairs``: True if balls can meet each other.
    """
    leaves = 1
    while leaves < balls:
        leaves *= 2
    next_time = np.full(leaves, NEVER)
    next_time[:balls] = 0.0
    winners = np.zeros(2 * leaves, dtype=np.int32)
    winners[leaves:] = np.arange(leaves)
    for match in range(leaves - 1, 0, -1):
        one, two = winners[2 * match], winners[2 * match + 1]
        winners[match] = one if next_time[one] <= next_time[two] else two
    meetings = None
    if pairs:
        nobody = np.full(balls, -1, dtype=np.int32)
        meetings = Meetings(np.full(balls, NEVER), nobody, np.zeros(balls, dtype=np.int32))
    return EventQueue(
        wall_time=np.zeros(balls),
        obstacle=np.full(balls, UNKNOWN, dtype=np.int32),
        path_number=np.zeros(balls, dtype=np.int32),
        events=np.zeros(balls, dtype=np.int32),
        meetings=meetings,
        next_time=next_time,
        winners=winners,
    )


@inlined
def meeting_time(meetings: Meetings | None, ball: int) -> float:
    """Return the time of the ball's next meeting with a ball [s], or NEVER if balls do not meet."""
    if meetings is None:
        return NEVER
    return float(meetings.time[ball])


@inlined
def _forget_meeting(meetings: Meetings | None, ball: int) -> None:
    if meetings is None:
        return
    meetings.time[ball] = NEVER
    meetings.partner[ball] = -1


@jit
def _shift_meetings(meetings: Meetings | None, window: float) -> None:
    if meetings is None:
        return
    for ball in range(len(meetings.time)):
        meetings.time[ball] -= window


@inlined
def reschedule(queue: EventQueue, ball: int) -> None:
    """Note the earlier of the ball's two predicted events, and replay its tournament matches.

    The earlier event wins a match, and in a tie the ball with the lower number.
    """
    queue.next_time[ball] = min(meeting_time(queue.meetings, ball), queue.wall_time[ball])
    match = (len(queue.next_time) + ball) // 2
    while match >= 1:
        one = queue.winners[2 * match]
        two = queue.winners[2 * match + 1]
        queue.winners[match] = one if queue.next_time[one] <= queue.next_time[two] else two
        match //= 2


@jit
def forget_events(queue: EventQueue, ball: int, time: float) -> None:
    """Drop the predictions for the ball. It searches again at ``time`` [s], which is now."""
    schedule_now(queue, ball, time, UNKNOWN)


@jit
def schedule_now(queue: EventQueue, ball: int, time: float, what: int) -> None:
    """Make an event of kind ``what`` the ball's next event, at ``time`` [s], which is now.

    ``what``: number of an obstacle, or another value that EventQueue.obstacle can have.
    """
    _forget_meeting(queue.meetings, ball)
    queue.wall_time[ball] = time
    queue.obstacle[ball] = what
    reschedule(queue, ball)


@jit
def search_wall_again(queue: EventQueue, ball: int, time: float) -> None:
    """Let the ball search again, now, for the end of its own path. Its predicted meeting stays."""
    queue.wall_time[ball] = time
    queue.obstacle[ball] = SEARCH_ON
    reschedule(queue, ball)


@jit
def shift_queue(queue: EventQueue, window: float) -> None:
    """Subtract the window's length [s] from all times, and set the counts of events to 0.

    This is done when a new window begins. The order of events stays.
    """
    _shift_meetings(queue.meetings, window)
    for ball in range(len(queue.wall_time)):
        queue.wall_time[ball] -= window
        queue.next_time[ball] -= window
        queue.events[ball] = 0
