"""The event loop, compiled: take the next event, let it change velocities, predict anew for the balls it touched.

One prediction site; an event whose partner has been hit since is not an event, and only its pair is looked for
again: the ball's own path, and so its wall contact, still stands.
"""

import numpy as np

from sim_core.contact.path_end import end_of_path
from sim_core.detect.ball_mesh import first_contact_from
from sim_core.detect.ball_turning_part import first_part_contact
from sim_core.effects.contact_mode import STILL, own_pull
from sim_core.effects.drag import set_air_back
from sim_core.effects.friction import carry_spins
from sim_core.effects.part_rotation import carry, one_turn
from sim_core.effects.random_phase import arrival, own_wave
from sim_core.effects.sonotrodes import carry_phases
from sim_core.geometry.ball_sizes import own_seam
from sim_core.impulses.drag import piece_left
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
    set_calendar_back,
)
from sim_core.loop.neighbours import Crowd, set_crowd, speed_limit
from sim_core.loop.state import BALLS, SEARCHES, STALE, Loop
from sim_core.motion import point_under, set_back
from sim_core.numerics import profiler
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.profiler import lap
from sim_core.numerics.roots import NEVER

# status
DONE = 0
PAGE_FULL = 1
STORM = 2
TOO_FAST = 3

PIECE = 0.01  # s: longest arc searched at once; its chord is off by g PIECE²/8 = 0.12 mm, so boxes stay tight
STORM_EVENTS = (
    200_000  # of one ball in one window (20 ms): ten million a second is no gas but a jam
)

# what to predict
ALL, PAIRS, WALL = 0, 1, 2


@jit
def _speed_squared(motion: np.ndarray, ball: int) -> float:
    return motion[ball, 3] ** 2 + motion[ball, 4] ** 2 + motion[ball, 5] ** 2


@inlined
def _predict_meeting(
    crowd: Crowd | None, pair_time: np.ndarray | None, loop: Loop, ball: int, time: float, what: int
) -> None:
    """Find the ball it meets next, if balls meet."""
    if crowd is None or pair_time is None:
        return
    calendar = loop.calendar
    marks = calendar.marks
    before = NEVER_BEFORE if what == ALL or marks[ball, OBSTACLE] < 0 else calendar.wall_time[ball]
    meeting, partner = first_meeting(loop.footing, crowd, loop.shot.motion, ball, time, before)
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
def _meet(crowd: Crowd | None, loop: Loop, ball: int, time: float) -> tuple[int, int]:
    """The ball meets its partner, if that one has not been hit since: what to predict, and for whom besides (or -1)."""
    if crowd is None:
        return PAIRS, -1
    marks = loop.calendar.marks
    other = marks[ball, PARTNER]
    if other < 0:
        return PAIRS, -1
    if marks[other, HITS] != marks[ball, PARTNER_HITS]:
        loop.tally[STALE] += 1
        return PAIRS, -1
    collide(loop, ball, other, time)
    marks[ball, HITS] += 1
    marks[other, HITS] += 1
    loop.tally[BALLS] += 1
    return ALL, other


@inlined
def _predict(loop: Loop, ball: int, time: float, what: int) -> None:
    """Find the ball's next events from ``time`` on and put the earlier on the calendar."""
    shot, calendar = loop.shot, loop.calendar
    marks = calendar.marks
    if what != WALL:
        _predict_meeting(shot.crowd, calendar.pair_time, loop, ball, time, what)
        lap(loop.watch, profiler.PAIRS)
    if what != PAIRS or (marks[ball, OBSTACLE] < 0 and calendar.wall_time[ball] <= time):
        length = _until_meeting(calendar.pair_time, marks, ball, time)
        tree, seam = loop.ground.tree, own_seam(loop.sizes, loop.ground.seam, ball)
        pull = own_pull(loop.footing, ball, loop.gravity)
        here = point_under(shot.motion, ball, time, pull)
        length = min(length, piece_left(loop.air, loop.footing, ball, time))
        length = arrival(loop.phases, here.position, here.velocity, pull, ball, length)
        wave = own_wave(loop.phases, loop.wave, ball)
        moment = loop.clock.now[1] * loop.clock.window + time
        length, end = end_of_path(
            loop.footing, tree, seam, wave, here, pull, ball, time, moment, length
        )
        look = one_turn(loop.turning, length) if end == STILL else length
        delay, obstacle = first_contact_from(
            loop.footing,
            loop.sizes,
            loop.ground.bore,
            ball,
            tree,
            loop.scratch,
            here,
            pull,
            wave,
            loop.waves,
            seam,
            time,
            length,
        )
        delay, obstacle = first_part_contact(
            loop.ground.part,
            loop.turning,
            loop.scratch,
            here,
            pull,
            seam,
            time,
            delay if obstacle >= 0 else look,
            obstacle,
            len(tree.kinds),
        )
        if obstacle < 0 and delay >= look:  # and not a search that gave up before
            delay, obstacle = (NEVER if end == STILL else length), end
        calendar.wall_time[ball] = time + delay
        marks[ball, OBSTACLE] = obstacle
        loop.tally[SEARCHES] += 1
        lap(loop.watch, profiler.WALLS)
    reschedule(calendar, ball)
    lap(loop.watch, profiler.SCHEDULE)


NEVER_BEFORE = 1e300  # finite, so that differences with it stay numbers


@jit
def advance(loop: Loop) -> tuple[int, int]:
    """Play events until ``clock.stop``; returns (status, ball): DONE, or why it had to pause and at which ball."""
    shot, calendar, clock, page = loop.shot, loop.calendar, loop.clock, loop.page
    marks = calendar.marks
    lap(loop.watch, -1)
    while True:
        left = clock.stop - clock.now[1] * clock.window
        ball = calendar.winners[1]
        time = calendar.next_time[ball]
        if time >= min(left, clock.window):
            if left <= clock.window:
                clock.now[0] = left
                return DONE, -1
            set_back(shot.motion, clock.window, loop.gravity, loop.footing)
            set_crowd(shot.crowd, shot.motion)
            hide_all(loop.footing, shot.crowd)
            set_calendar_back(calendar, clock.window)
            carry(loop.turning, clock.window)
            carry_phases(loop.waves)
            carry_spins(loop.grip, clock.window)
            set_air_back(loop.air, clock.window)
            clock.now[1] += 1.0
            continue
        if page.filled[0] == len(page.numbers):
            return PAGE_FULL, -1
        clock.now[0] = time
        marks[ball, EVENTS] += 1
        if marks[ball, EVENTS] > STORM_EVENTS:
            return STORM, ball
        lap(loop.watch, profiler.NEXT)
        second = -1
        what = ALL
        obstacle = marks[ball, OBSTACLE]
        if gives_up(loop.footing, loop, ball, time):
            marks[ball, HITS] += 1
        elif meeting_time(calendar.pair_time, ball) <= calendar.wall_time[ball]:
            what, second = _meet(shot.crowd, loop, ball, time)
        elif obstacle >= 0:
            if not hit_part(loop.turning, loop.ground.part, loop, ball, obstacle, time):
                hit_surface(loop, ball, obstacle, time)
            marks[ball, HITS] += 1
            if not _speed_squared(shot.motion, ball) <= speed_limit(shot.crowd) ** 2:
                forget(calendar, ball, time)
                return TOO_FAST, ball
        elif obstacle == SEARCH_ON:
            what = WALL
            if fly_on(loop, ball, time):
                what = ALL
                marks[ball, HITS] += 1
        elif take_step(loop.footing, loop, ball, obstacle, time):
            marks[ball, HITS] += 1
        lap(loop.watch, profiler.RESOLVE)
        todo = ball
        while todo >= 0:
            _predict(loop, todo, time, what)
            todo = second if todo == ball else -1
