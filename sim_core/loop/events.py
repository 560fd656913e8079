"""The compiled event loop: find the next event, move, resolve, log, predict.

All predictions are made in _predict. A ball's meeting with a partner is stale if the partner's path
has changed since the meeting was found. A stale meeting is dropped and only the search among balls
is repeated, because the ball's own path, and with it its wall contact, still stands.
"""

import math

import numpy as np

from sim_core.contact.landing_and_lift_off import LIES_STILL
from sim_core.contact.path_end import end_of_path
from sim_core.contact.riding import shift_contact
from sim_core.detect.ball_mesh import first_contact
from sim_core.detect.ball_turning_part import first_part_contact
from sim_core.effects.ball_sizes import face_overlap_of_ball, radius_of_ball
from sim_core.effects.contact_mode import ball_acceleration, is_flying, is_still
from sim_core.effects.drag import shift_drag
from sim_core.effects.friction import shift_spins
from sim_core.effects.part_rotation import shift_rotation, time_of_one_turn
from sim_core.effects.random_phase import update_phase, wave_of_ball
from sim_core.effects.sonotrodes import shift_phases
from sim_core.effects.vibration import Wave
from sim_core.impulses.drag import apply_drag_piece, apply_drag_until, time_to_next_drag
from sim_core.loop.contact_neighbours import first_meeting, hide, hide_all, wake_if_it_moves
from sim_core.loop.event_handlers import (
    collide,
    end_contact_path,
    gives_up,
    hit_part,
    hit_surface,
    hold_jammed_ball,
)
from sim_core.loop.event_queue import SEARCH_ON, Meetings, forget_events, reschedule, shift_queue
from sim_core.loop.impact_log import (
    Collision,
    CollisionBuffer,
    is_full,
    log_collision,
    log_impact,
    no_impact,
)
from sim_core.loop.neighbours import (
    NeighbourFilter,
    follow,
    refresh_neighbours,
    shift_sorting,
    sort_is_due,
    speed_limit,
)
from sim_core.loop.state import SEARCHES, STALE, SimulationState
from sim_core.loop.stays import note_hit, note_meeting
from sim_core.motion import BallEvent, shift_motion, state_under
from sim_core.numerics import profiler
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.periodic_sides import nearest_image, put_back, top_speed
from sim_core.numerics.profiler import add_time
from sim_core.numerics.roots import NEVER
from sim_core.numerics.vec3 import Flight, add_scaled, sub

# status of advance(), the reason why it has stopped
DONE = 0  # the clock has come to clock.stop
BUFFER_FULL = 1  # the buffers of impacts and collisions must be emptied
TOO_MANY_EVENTS = 2  # one ball has too many events in one window: it is jammed
TOO_FAST = 3  # a ball is faster than the neighbour filter allows for, or than MAX_SPEED
HAS_LEFT = 4  # a ball is outside the chamber's bounding box

# s. Longest arc searched at once. Its chord is off by g PIECE²/8 = 0.12 mm, so boxes stay tight.
PIECE = 0.01
# Events of one ball a second, counted over a window: so many are not a gas but a jam. A row of
# balls that is pressed flat between two walls, in a dense layer, has a tenth as many for a while.
EVENT_LIMIT = 1e8

# kinds of event
HOLD = 0  # a ball in a jam that contact mode cannot resolve is held still
MEETING = 1  # two balls meet
STALE_MEETING = 2  # the partner of the meeting has another path by now
SURFACE = 3  # a ball meets a surface
PIECE_ENDS = 4  # nothing happens: the search goes on from here
PATH_ENDS = 5  # a path in contact ends, or nothing is known of the ball yet

# kinds of prediction
ALL, PAIRS, WALL = 0, 1, 2

NEVER_BEFORE = 1e300  # finite, so that differences with it stay numbers


@jit
def advance(state: SimulationState) -> tuple[int, int]:
    """Simulate until ``clock.stop``, or until an event stops the loop.

    Returns: the reason for the stop (DONE, BUFFER_FULL, TOO_MANY_EVENTS, TOO_FAST or HAS_LEFT), and
        the number of the ball that caused it, -1 for no single ball.
    """
    queue, clock, buffer = state.queue, state.clock, state.buffer
    event_limit = EVENT_LIMIT * clock.window
    add_time(state.profiler, -1)
    while True:
        # 1 next event
        left = clock.stop - clock.now[1] * clock.window
        ball = int(np.int64(queue.winners[1]))  # one integer type, so that functions compile once
        time = queue.match_time[1]
        if time >= min(left, clock.window):
            if left <= clock.window:
                clock.now[0] = left
                return DONE, -1
            _begin_window(state)
            if top_speed(state.sides) > speed_limit(state.neighbours):
                return TOO_FAST, -1
            continue
        if sort_is_due(state.neighbours, time):
            _sort_neighbours(state, time)
            continue
        if buffer.filled[0] == len(buffer.time) or is_full(state.collision_buffer):
            return BUFFER_FULL, -1
        clock.now[0] = time
        queue.events[ball] += 1
        if queue.events[ball] > event_limit:
            return TOO_MANY_EVENTS, ball
        event = BallEvent(ball, time, clock.now[1] * clock.window + time)
        kind, partner = _kind_of_event(queue.meetings, state, ball)
        add_time(state.profiler, profiler.NEXT)
        # 2 move
        was_still = is_still(state.contact, ball)
        _move(state, event, kind, partner)
        # 3 resolve
        path_changes, impact = True, no_impact()
        if kind == HOLD:
            hold_jammed_ball(state.contact, state, event)
        elif kind == MEETING:
            _log_meeting(state.collision_buffer, state, event, partner)
            collide(state.contact, state, event, partner)
            note_meeting(state.stays, ball, partner)
        elif kind == SURFACE:
            if queue.obstacle[ball] < len(state.obstacles.tree.kinds):
                impact = hit_surface(state, event)
            else:
                impact = hit_part(state.rotation, state.obstacles.part, state, event)
        elif kind == PIECE_ENDS:
            if _has_left(state, ball, time):
                return HAS_LEFT, ball
            drag = state.drag
            path_changes = apply_drag_piece(
                drag, state.contact, state.motion, ball, time, state.gravity
            )
        elif kind == PATH_ENDS:
            path_changes = end_contact_path(state.contact, state, event)
        else:
            path_changes = False
            state.counts[STALE] += partner >= 0
        if path_changes:
            _note_path(state, ball, time)
            if kind == MEETING:
                _note_path(state, partner, time)
            elif was_still:
                wake_if_it_moves(state.contact, queue, state.motion, event)
        # 4 log
        recorded = buffer.record[impact.tag]
        held = note_hit(state.stays, state.sizes, state.contact, event, impact, recorded)
        if not held or buffer.record_held[0]:
            log_impact(buffer, event, clock.origin, impact, state.obstacles.lookup)
        if kind == SURFACE and not (
            _speed_squared(state, ball) <= speed_limit(state.neighbours) ** 2
        ):
            forget_events(queue, ball, time)
            return TOO_FAST, ball
        add_time(state.profiler, profiler.RESOLVE)
        # 5 predict
        what = ALL
        if kind == STALE_MEETING:
            what = PAIRS
        elif kind == PIECE_ENDS and not path_changes:
            what = WALL
        todo, second = ball, partner if kind == MEETING else -1
        while todo >= 0:
            _predict(state, todo, time, what)
            todo = second if todo == ball else -1


@inlined
def _begin_window(state: SimulationState) -> None:
    """Begin the next time window: rewrite all times and paths so that they count from its start."""
    window = state.clock.window
    shift_motion(state.motion, window, state.gravity, state.contact)
    shift_sorting(state.neighbours)
    _sort_neighbours(state, 0.0)
    shift_queue(state.queue, window)
    shift_rotation(state.rotation, window)
    shift_phases(state.waves)
    shift_contact(state.contact, window)
    shift_spins(state.friction_state, window)
    shift_drag(state.drag, window)
    state.clock.now[1] += 1.0


@jit
def _sort_neighbours(state: SimulationState, time: float) -> None:
    """Copy all paths into the neighbour filter anew. If there are many balls, sort them first."""
    put_back(state.sides, state.motion, time)
    refresh_neighbours(state.neighbours, state.motion, time)
    hide_all(state.contact, state.neighbours)


@inlined
def _kind_of_event(meetings: Meetings | None, state: SimulationState, ball: int) -> tuple[int, int]:
    """Return the kind of the ball's next event, and the ball that it meets, -1 for none."""
    queue = state.queue
    if gives_up(state.contact, queue, ball):
        return HOLD, -1
    if meetings is not None and meetings.time[ball] <= queue.wall_time[ball]:
        partner = int(np.int64(meetings.partner[ball]))
        fresh = partner >= 0 and queue.path_number[partner] == meetings.partner_path[ball]
        return (MEETING if fresh else STALE_MEETING), partner
    if queue.obstacle[ball] >= 0:
        return SURFACE, -1
    return (PIECE_ENDS, -1) if queue.obstacle[ball] == SEARCH_ON else (PATH_ENDS, -1)


@inlined
def _move(state: SimulationState, event: BallEvent, kind: int, partner: int) -> None:
    """Apply the air drag up to the time of an event to the balls whose event it is.

    Nothing else has to be moved, because paths are functions of time.
    """
    in_contact = kind == PATH_ENDS and not is_flying(state.contact, event.ball)
    moves = kind in (MEETING, SURFACE) or in_contact
    ball = event.ball if moves else -1
    while ball >= 0:
        apply_drag_until(state.drag, state.contact, state.motion, ball, event.time, state.gravity)
        ball = partner if kind == MEETING and ball != partner else -1


@inlined
def _log_meeting(
    buffer: CollisionBuffer | None, state: SimulationState, event: BallEvent, partner: int
) -> None:
    """Log a collision of balls before it changes their paths, if collisions are logged."""
    if buffer is None:
        return
    ball, motion, gravity = event.ball, state.motion, state.gravity
    here = state_under(motion, ball, event.time, ball_acceleration(state.contact, ball, gravity))
    there = state_under(
        motion, partner, event.time, ball_acceleration(state.contact, partner, gravity)
    )
    apart = nearest_image(state.sides, sub(there.position, here.position))
    radius = radius_of_ball(state.sizes, 0.5, ball)
    share = radius / (radius + radius_of_ball(state.sizes, 0.5, partner))
    closing = sub(there.velocity, here.velocity)
    touched = add_scaled(here.position, share, apart)
    collision = Collision(ball, partner, touched, apart, closing)
    log_collision(buffer, event.time_since_start - state.clock.origin, collision)


@inlined
def _note_path(state: SimulationState, ball: int, time: float) -> None:
    """Tell the neighbour filter and the queue that a ball has another path from ``time`` [s] on."""
    follow(state.neighbours, state.motion, ball, time)
    hide(state.contact, state.neighbours, ball)
    state.queue.path_number[ball] += 1


@inlined
def _speed_squared(state: SimulationState, ball: int) -> float:
    motion = state.motion
    return float(motion[ball, 3] ** 2 + motion[ball, 4] ** 2 + motion[ball, 5] ** 2)


@inlined
def _has_left(state: SimulationState, ball: int, time: float) -> bool:
    """Return True if a ball is outside the chamber's bounding box at ``time`` [s].

    A ball that has left meets no more surfaces. It is enough to check a ball that met no surface on
    a whole piece of its path.
    """
    acceleration = ball_acceleration(state.contact, ball, state.gravity)
    here = state_under(state.motion, ball, time, acceleration).position
    low, high = state.obstacles.bounds
    return not (
        low[0] <= here.x <= high[0] and low[1] <= here.y <= high[1] and low[2] <= here.z <= high[2]
    )


@inlined
def _predict(state: SimulationState, ball: int, time: float, what: int) -> None:
    """Find the ball's next events from ``time`` [s] on and enter the earlier event in the queue.

    ``what``: PAIRS for its meeting with a ball, WALL for the end of its own path, or ALL for both.
    """
    queue = state.queue
    if what != WALL:
        _predict_meeting(state.neighbours, queue.meetings, state, ball, time, what)
        add_time(state.profiler, profiler.PAIRS)
    if what != PAIRS or (queue.obstacle[ball] < 0 and queue.wall_time[ball] <= time):
        _predict_wall(state, ball, time)
        state.counts[SEARCHES] += 1
        add_time(state.profiler, profiler.WALLS)
    reschedule(queue, ball)
    add_time(state.profiler, profiler.SCHEDULE)


@inlined
def _predict_meeting(
    neighbours: NeighbourFilter | None,
    meetings: Meetings | None,
    state: SimulationState,
    ball: int,
    time: float,
    what: int,
) -> None:
    """Find the next meeting of a ball with another ball, and write it into ``meetings``.

    Nothing is done in a scene whose balls fly through each other. ``what``: ALL if the end of the
    ball's own path is not known yet, or PAIRS.
    """
    if neighbours is None or meetings is None:
        return
    queue = state.queue
    before = NEVER_BEFORE if what == ALL or queue.obstacle[ball] < 0 else queue.wall_time[ball]
    meeting, partner = first_meeting(state.contact, neighbours, state.motion, ball, time, before)
    meetings.time[ball] = meeting
    meetings.partner[ball] = partner
    if partner >= 0:
        meetings.partner_path[ball] = queue.path_number[partner]


@inlined
def _until_meeting(meetings: Meetings | None, ball: int, time: float) -> float:
    """Return how long [s] to search for a wall: until the ball's known meeting, at most PIECE."""
    if meetings is None:
        return PIECE
    return min(PIECE, meetings.time[ball] - time) if meetings.partner[ball] >= 0 else PIECE


@inlined
def _predict_wall(state: SimulationState, ball: int, time: float) -> None:
    """Find the next event of a ball besides meetings with other balls, and write it into the queue.

    It is the obstacle that the ball meets next, or the end of the piece of its path for which the
    search was made. ``time``: present time [s].
    """
    queue, clock, obstacles = state.queue, state.clock, state.obstacles
    face_overlap = face_overlap_of_ball(state.sizes, obstacles.face_overlap, ball)
    event = BallEvent(ball, time, clock.now[1] * clock.window + time)
    acceleration = ball_acceleration(state.contact, ball, state.gravity)
    here = state_under(state.motion, ball, time, acceleration)
    flight = Flight(here.position, here.velocity, acceleration)
    length = _until_meeting(queue.meetings, ball, time)
    length = min(length, time_to_next_drag(state.drag, state.contact, ball, time))
    length = update_phase(state.random_phase, flight, ball, length)
    wave = wave_of_ball(state.random_phase, state.wave, ball)
    length, end = end_of_path(state.contact, obstacles.tree, face_overlap, event, flight, length)
    look = length  # duration of the search for objects that move towards the ball
    if end == LIES_STILL:
        # An object that does not touch the ball in one oscillation, or one turn of the part, never
        # will.
        length = _oscillation_time(wave)
        look = time_of_one_turn(state.rotation, length)
    delay, obstacle = first_contact(
        state.contact,
        state.sizes,
        obstacles.cylinder,
        ball,
        obstacles.tree,
        state.scratch,
        flight,
        wave,
        state.waves,
        state.profiles,
        face_overlap,
        time,
        length,
    )
    delay, obstacle = first_part_contact(
        obstacles.part,
        state.rotation,
        state.sizes,
        ball,
        state.scratch,
        flight,
        face_overlap,
        time,
        delay if obstacle >= 0 else look,
        obstacle,
        len(obstacles.tree.kinds),
    )
    if obstacle < 0 and delay >= look:  # and not a search that gave up before
        delay, obstacle = (NEVER if end == LIES_STILL else length), end
    queue.wall_time[ball] = time + delay
    queue.obstacle[ball] = obstacle


@jit
def _oscillation_time(wave: Wave | None) -> float:
    """Return a little more than a period [s] of the slowest sonotrode, or 0 without a sonotrode."""
    if wave is None:
        return 0.0
    return 2.02 * math.pi / wave.omega
