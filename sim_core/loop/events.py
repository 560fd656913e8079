"""The event loop, compiled: take the next event, let it change velocities, predict anew for the balls it touched.

One prediction site; an event whose partner has been hit since is not an event, and only its pair is looked for
again: the ball's own path, and so its wall contact, still stands.
"""

import numpy as np

from sim_core.contact.path_end import end_of_path
from sim_core.detect.ball_mesh import first_contact
from sim_core.detect.ball_turning_part import first_part_contact
from sim_core.effects.contact_mode import STILL, ball_acceleration
from sim_core.effects.drag import shift_drag
from sim_core.effects.friction import shift_spins
from sim_core.effects.part_rotation import shift_rotation, time_of_one_turn
from sim_core.effects.random_phase import update_phase, wave_of_ball
from sim_core.effects.sonotrodes import shift_phases
from sim_core.geometry.ball_sizes import face_overlap_of_ball
from sim_core.impulses.drag import time_to_next_drag
from sim_core.loop.contact_neighbours import first_meeting, hide_all
from sim_core.loop.event_handlers import collide, fly_on, gives_up, hit_part, hit_surface, take_step
from sim_core.loop.event_queue import (
    EVENTS,
    HITS,
    OBSTACLE,
    PARTNER,
    PARTNER_HITS,
    SEARCH_ON,
    forget,
    meeting_time,
    reschedule,
    shift_queue,
)
from sim_core.loop.neighbours import NeighbourFilter, refresh_neighbours, speed_limit
from sim_core.loop.state import BALLS, SEARCHES, STALE, SimulationState
from sim_core.motion import shift_motion, state_under
from sim_core.numerics import profiler
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.profiler import add_time
from sim_core.numerics.roots import NEVER
from sim_core.numerics.vec3 import Flight

# status
DONE = 0
BUFFER_FULL = 1
TOO_MANY_EVENTS = 2
TOO_FAST = 3

PIECE = 0.01  # s: longest arc searched at once; its chord is off by g PIECE²/8 = 0.12 mm, so boxes stay tight
EVENT_LIMIT = 200_000  # of one ball in one window (20 ms): ten million a second is no gas but a jam

# what to predict
ALL, PAIRS, WALL = 0, 1, 2


@jit
def _speed_squared(motion: np.ndarray, ball: int) -> float:
    return motion[ball, 3] ** 2 + motion[ball, 4] ** 2 + motion[ball, 5] ** 2


@inlined
def _predict_meeting(
    neighbours: NeighbourFilter | None,
    pair_time: np.ndarray | None,
    state: SimulationState,
    ball: int,
    time: float,
    what: int,
) -> None:
    """Find the ball it meets next, if balls meet."""
    if neighbours is None or pair_time is None:
        return
    queue = state.queue
    marks = queue.marks
    before = NEVER_BEFORE if what == ALL or marks[ball, OBSTACLE] < 0 else queue.wall_time[ball]
    meeting, partner = first_meeting(state.contact, neighbours, state.motion, ball, time, before)
    pair_time[ball] = meeting
    marks[ball, PARTNER] = partner
    if partner >= 0:
        marks[ball, PARTNER_HITS] = marks[partner, HITS]


@inlined
def _until_meeting(
    pair_time: np.ndarray | None, marks: np.ndarray, ball: int, time: float
) -> float:
    """How far [s] a wall is looked for: no further than the ball is known to get, until its meeting, or one piece."""
    if pair_time is None:
        return PIECE
    return min(PIECE, pair_time[ball] - time) if marks[ball, PARTNER] >= 0 else PIECE


@inlined
def _meet(
    neighbours: NeighbourFilter | None, state: SimulationState, ball: int, time: float
) -> tuple[int, int]:
    """The ball meets its partner, if that one has not been hit since: what to predict, and for whom besides (or -1)."""
    if neighbours is None:
        return PAIRS, -1
    marks = state.queue.marks
    other = marks[ball, PARTNER]
    if other < 0:
        return PAIRS, -1
    if marks[other, HITS] != marks[ball, PARTNER_HITS]:
        state.tally[STALE] += 1
        return PAIRS, -1
    collide(state, ball, other, time)
    marks[ball, HITS] += 1
    marks[other, HITS] += 1
    state.tally[BALLS] += 1
    return ALL, other


@inlined
def _predict(state: SimulationState, ball: int, time: float, what: int) -> None:
    """Find the ball's next events from ``time`` on and put the earlier on the calendar."""
    queue = state.queue
    marks = queue.marks
    if what != WALL:
        _predict_meeting(state.neighbours, queue.pair_time, state, ball, time, what)
        add_time(state.profiler, profiler.PAIRS)
    if what != PAIRS or (marks[ball, OBSTACLE] < 0 and queue.wall_time[ball] <= time):
        length = _until_meeting(queue.pair_time, marks, ball, time)
        obstacles, tree = state.obstacles, state.obstacles.tree
        face_overlap = face_overlap_of_ball(state.sizes, obstacles.face_overlap, ball)
        acceleration = ball_acceleration(state.contact, ball, state.gravity)
        here = state_under(state.motion, ball, time, acceleration)
        flight = Flight(here.position, here.velocity, acceleration)
        length = min(length, time_to_next_drag(state.drag, state.contact, ball, time))
        length = update_phase(state.random_phase, flight, ball, length)
        wave = wave_of_ball(state.random_phase, state.wave, ball)
        time_since_start = state.clock.now[1] * state.clock.window + time
        length, end = end_of_path(
            state.contact,
            tree,
            face_overlap,
            wave,
            here,
            acceleration,
            ball,
            time,
            time_since_start,
            length,
        )
        look = time_of_one_turn(state.rotation, length) if end == STILL else length
        delay, obstacle = first_contact(
            state.contact,
            state.sizes,
            obstacles.cylinder,
            ball,
            tree,
            state.scratch,
            flight,
            wave,
            state.waves,
            face_overlap,
            time,
            length,
        )
        delay, obstacle = first_part_contact(
            obstacles.part,
            state.rotation,
            state.scratch,
            flight,
            face_overlap,
            time,
            delay if obstacle >= 0 else look,
            obstacle,
            len(tree.kinds),
        )
        if obstacle < 0 and delay >= look:  # and not a search that gave up before
            delay, obstacle = (NEVER if end == STILL else length), end
        queue.wall_time[ball] = time + delay
        marks[ball, OBSTACLE] = obstacle
        state.tally[SEARCHES] += 1
        add_time(state.profiler, profiler.WALLS)
    reschedule(queue, ball)
    add_time(state.profiler, profiler.SCHEDULE)


NEVER_BEFORE = 1e300  # finite, so that differences with it stay numbers


@jit
def advance(state: SimulationState) -> tuple[int, int]:
    """Play events until ``clock.stop``; returns (status, ball): DONE, or why it had to pause and at which ball."""
    queue, clock, buffer = state.queue, state.clock, state.buffer
    marks = queue.marks
    add_time(state.profiler, -1)
    while True:
        left = clock.stop - clock.now[1] * clock.window
        ball = queue.winners[1]
        time = queue.next_time[ball]
        if time >= min(left, clock.window):
            if left <= clock.window:
                clock.now[0] = left
                return DONE, -1
            shift_motion(state.motion, clock.window, state.gravity, state.contact)
            refresh_neighbours(state.neighbours, state.motion)
            hide_all(state.contact, state.neighbours)
            shift_queue(queue, clock.window)
            shift_rotation(state.rotation, clock.window)
            shift_phases(state.waves)
            shift_spins(state.friction_state, clock.window)
            shift_drag(state.drag, clock.window)
            clock.now[1] += 1.0
            continue
        if buffer.filled[0] == len(buffer.numbers):
            return BUFFER_FULL, -1
        clock.now[0] = time
        marks[ball, EVENTS] += 1
        if marks[ball, EVENTS] > EVENT_LIMIT:
            return TOO_MANY_EVENTS, ball
        add_time(state.profiler, profiler.NEXT)
        second = -1
        what = ALL
        obstacle = marks[ball, OBSTACLE]
        if gives_up(state.contact, state, ball, time):
            marks[ball, HITS] += 1
        elif meeting_time(queue.pair_time, ball) <= queue.wall_time[ball]:
            what, second = _meet(state.neighbours, state, ball, time)
        elif obstacle >= 0:
            if not hit_part(state.rotation, state.obstacles.part, state, ball, obstacle, time):
                hit_surface(state, ball, obstacle, time)
            marks[ball, HITS] += 1
            if not _speed_squared(state.motion, ball) <= speed_limit(state.neighbours) ** 2:
                forget(queue, ball, time)
                return TOO_FAST, ball
        elif obstacle == SEARCH_ON:
            what = WALL
            if fly_on(state, ball, time):
                what = ALL
                marks[ball, HITS] += 1
        elif take_step(state.contact, state, ball, obstacle, time):
            marks[ball, HITS] += 1
        add_time(state.profiler, profiler.RESOLVE)
        todo = ball
        while todo >= 0:
            _predict(state, todo, time, what)
            todo = second if todo == ball else -1
