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
    match_time: times of the tournament [s], (2 m,). m is the next power of two. match_time[m + i]
        is the earlier of ball i's wall time and meeting time, padded with NEVER, and
        match_time[j] the earlier of match_time[2 j] and match_time[2 j + 1], of match j.
    winners: the balls that these times are of, (2 m,) int32. winners[1] is the ball with the next
        event.
    """

    wall_time: np.ndarray
    obstacle: np.ndarray
    path_number: np.ndarray
    events: np.ndarray
    meetings: Meetings | None
    match_time: np.ndarray
    winners: np.ndarray


def new_event_queue(balls: int, pairs: bool = True) -> EventQueue:
    """Return a queue in which every ball is due at once to search for its next event.

    ``pairs``: True if balls can meet each other.
    """
    leaves = 1
    while leaves < balls:
        leaves *= 2
    match_time = np.full(2 * leaves, NEVER)
    match_time[leaves : leaves + balls] = 0.0
    winners = np.zeros(2 * leaves, dtype=np.int32)
    winners[leaves:] = np.arange(leaves)
    matches = np.arange(leaves // 2, leaves)  # the first round
    while len(matches) and matches[0]:
        winner = 2 * matches + (match_time[2 * matches] > match_time[2 * matches + 1])
        match_time[matches], winners[matches] = match_time[winner], winners[winner]
        matches = np.arange(matches[0] // 2, matches[0])
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
        match_time=match_time,
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

    The earlier event wins a match, and in a tie the ball with the lower number. The winner is
    selected without a branch, because a branch would be guessed wrong every other time.
    """
    times, winners = queue.match_time, queue.winners
    match = len(times) // 2 + ball
    time, winner = min(meeting_time(queue.meetings, ball), queue.wall_time[ball]), np.int32(ball)
    times[match] = time
    while match > 1:
        other_time, other = times[match ^ 1], winners[match ^ 1]
        loses = (other_time < time) | ((other_time == time) & (other < winner))
        time = other_time if loses else time
        winner = other if loses else winner
        match //= 2
        times[match], winners[match] = time, winner


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
        queue.events[ball] = 0
    for match in range(len(queue.match_time)):
        queue.match_time[match] -= window
