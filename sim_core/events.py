"""The event loop, compiled: take the next event, let it change velocities, predict anew for the balls it touched.

One prediction site; an event whose partner has been hit since is not an event, and only its pair is looked for
again: the ball's own path, and so its wall contact, still stands.
"""

import math
from typing import NamedTuple

import numpy as np

from sim_core import stopwatch
from sim_core._compile import inlined, jit
from sim_core.calendar import (
    EVENTS,
    HITS,
    OBSTACLE,
    PARTNER,
    PARTNER_HITS,
    SEARCH_ON,
    Calendar,
    forget,
    reschedule,
    set_calendar_back,
)
from sim_core.detect.ball_footing import end_of_path
from sim_core.detect.ball_mesh import Scratch, first_contact_from
from sim_core.detect.ball_part import first_part_contact
from sim_core.detect.ball_triangle import away_from_capsule, face_normal, nearer_neighbour
from sim_core.effects.gravity import Gravity, acceleration
from sim_core.effects.rest import ASLEEP, MODE, STILL, Footing, own_pull, static_law
from sim_core.effects.restitution import Restitution
from sim_core.effects.turn import Turning, carry, from_part, seen_from_part, slip
from sim_core.effects.vibration import Wave, surface_velocity
from sim_core.flight import drift, kick, point_at, point_under, set_back
from sim_core.grounded import first_meeting, hide, hide_all, lies_still, wake_if_it_moves
from sim_core.impacts import ImpactPage, note_impact
from sim_core.neighbours import Crowd, follow, set_crowd
from sim_core.resolve.ball_ball import pair_kick
from sim_core.resolve.ball_surface import surface_kick
from sim_core.resolve.footing import BOUNCES, ROLLS, deflect, land, set_out, step
from sim_core.resolve.leaning import hold, meet
from sim_core.roots import NEVER
from sim_core.stopwatch import Stopwatch, lap
from sim_core.surfaces.ground import Ground
from sim_core.surfaces.locate import triangle_at
from sim_core.surfaces.obstacles import CAPSULE, WAVING_FACE
from sim_core.surfaces.part import PartTree
from sim_core.vec3 import Vec3, dot, sub

# status
DONE = 0
PAGE_FULL = 1
STORM = 2
TOO_FAST = 3

PIECE = 0.01  # s: longest arc searched at once; its chord is off by g PIECE²/8 = 0.12 mm, so boxes stay tight
JAM_EVENTS = 5_000  # of one ball in one window: with contact mode it is held still then, and each time as many later
STORM_EVENTS = 200_000  # of one ball in one window (20 ms): ten million a second is no gas but a jam

# columns of Loop.tally
WALLS, BALLS, SONOTRODE, SEARCHES, STALE = 0, 1, 2, 3, 4

# what to predict
ALL, PAIRS, WALL = 0, 1, 2


class Shot(NamedTuple):
    """The balls for the loop: ``motion`` (n, 6) float64 in the free-fall frame, and the ``crowd`` made of it."""

    motion: np.ndarray
    crowd: Crowd


class Clock(NamedTuple):
    """``now`` (2,): time on the window's clock [s], and windows gone by; ``window`` [s]; ``stop`` [s] and ``origin``
    [s]

    on the scene's clock: where to stop, and what impact times count from.
    """

    now: np.ndarray
    window: float
    stop: float
    origin: float


class Loop(NamedTuple):
    """Everything the event loop works on; ``tally`` (5,) int64, see WALLS and below; ``watch`` only to measure."""

    shot: Shot
    ground: Ground
    calendar: Calendar
    scratch: Scratch
    gravity: Gravity | None
    restitution: Restitution | None
    wave: Wave | None
    turning: Turning | None
    clock: Clock
    page: ImpactPage
    tally: np.ndarray
    watch: Stopwatch | None
    footing: Footing | None


@inlined
def _hit_surface(loop: Loop, ball: int, obstacle: int, time: float) -> None:
    """The ball meets the obstacle now: change its velocity, count the impact, write it down if it is on a recorded
    surface.
    """
    shot, ground, clock, page = loop.shot, loop.ground, loop.clock, loop.page
    tree = ground.tree
    here = point_under(shot.motion, ball, time, own_pull(loop.footing, ball, loop.gravity))
    moment = clock.now[1] * clock.window + time
    lay_still = lies_still(loop.footing, ball)
    kind = tree.kinds[obstacle]
    side = 0
    touched = here.position  # or where the ball's centre is seen in the face's plane
    if kind == CAPSULE:
        away = away_from_capsule(tree.numbers, obstacle, here.position)
        side = nearer_neighbour(tree.numbers, obstacle, away)
        touched = sub(here.position, away)
        here = set_out(loop.footing, shot.motion, ball, time, here, away, tree.radius)
    else:
        away = face_normal(tree.numbers, obstacle)
    relative = here.velocity
    landed = BOUNCES
    law = loop.restitution
    if kind == WAVING_FACE:
        relative = sub(relative, surface_velocity(loop.wave, time))
    else:
        landed = land(loop.footing, tree, shot.motion, ball, obstacle, time, moment, here, away)
        law = static_law(loop.footing, loop.restitution)
    triangle = tree.triangles[obstacle, side]
    tag = ground.tags[triangle]
    if landed == BOUNCES:
        change = surface_kick(away, relative, law, tag)
        deflect(loop.footing, shot.motion, ball, time, moment, here, change)
    follow(shot.crowd, shot.motion, ball, time)
    hide(loop.footing, shot.crowd, ball)
    if lay_still:
        wake_if_it_moves(loop.footing, loop.calendar, shot.motion, ball, time, shot.crowd.reach)
    if landed == ROLLS:
        return
    if kind == WAVING_FACE:
        loop.tally[SONOTRODE] += 1
    else:
        loop.tally[WALLS] += 1
    speed = -dot(away, relative) / math.sqrt(dot(away, away))
    if page.record[tag] and speed > 0.0:
        when = clock.now[1] * clock.window + time - clock.origin
        note_impact(page, when, ball, triangle_at(ground.locator, triangle, touched), here.position, relative, speed)


@inlined
def _hit_part(
    turning: Turning | None, part: PartTree | None, loop: Loop, ball: int, obstacle: int, time: float
) -> bool:
    """The same for an obstacle of the turning part, seen and written down in the part's frame; False if it is none."""
    if turning is None or part is None:
        return False
    row = obstacle - len(loop.ground.tree.kinds)
    if row < 0:
        return False
    shot, clock, page, tree = loop.shot, loop.clock, loop.page, part.tree
    here = point_at(shot.motion, ball, time, loop.gravity)
    seen = seen_from_part(turning, here.position, here.velocity, acceleration(loop.gravity), time)
    side = 0
    if tree.kinds[row] == CAPSULE:
        away = away_from_capsule(tree.numbers, row, seen.position)
        side = nearer_neighbour(tree.numbers, row, away)
    else:
        normal = face_normal(tree.numbers, row)
        away = Vec3(tree.radius * normal.x, tree.radius * normal.y, tree.radius * normal.z)
    relative = slip(turning, seen, away, time)
    loop.tally[WALLS] += 1
    triangle = tree.triangles[row, side]
    tag = loop.ground.tags[triangle]
    kick(shot.motion, ball, time, from_part(turning, surface_kick(away, relative, loop.restitution, tag), time))
    follow(shot.crowd, shot.motion, ball, time)
    speed = -dot(away, relative) / math.sqrt(dot(away, away))
    if page.record[tag] and speed > 0.0:
        when = clock.now[1] * clock.window + time - clock.origin
        touched = triangle_at(loop.ground.locator, triangle, sub(seen.position, away))
        note_impact(page, when, ball, touched, seen.position, relative, speed)
    return True


@jit
def _speed_squared(motion: np.ndarray, ball: int) -> float:
    return motion[ball, 3] ** 2 + motion[ball, 4] ** 2 + motion[ball, 5] ** 2


@inlined
def _collide(loop: Loop, one: int, two: int, time: float) -> None:
    """Two balls meet now."""
    motion = loop.shot.motion
    _kick_both(loop.footing, loop, one, two, time)
    follow(loop.shot.crowd, motion, one, time)
    follow(loop.shot.crowd, motion, two, time)
    hide(loop.footing, loop.shot.crowd, one)
    hide(loop.footing, loop.shot.crowd, two)


@inlined
def _kick_both(footing: Footing | None, loop: Loop, one: int, two: int, time: float) -> None:
    motion = loop.shot.motion
    if footing is not None:
        moment = loop.clock.now[1] * loop.clock.window + time
        if meet(footing, motion, one, two, time, moment, loop.restitution, loop.ground.tree.radius):
            reach = loop.shot.crowd.reach
            wake_if_it_moves(footing, loop.calendar, motion, one, time, reach)
            wake_if_it_moves(footing, loop.calendar, motion, two, time, reach)
        return
    apart = sub(drift(motion, two, time), drift(motion, one, time))
    closing = Vec3(motion[two, 3] - motion[one, 3], motion[two, 4] - motion[one, 4], motion[two, 5] - motion[one, 5])
    change = pair_kick(apart, closing, loop.restitution)
    kick(motion, one, time, change)
    kick(motion, two, time, Vec3(-change.x, -change.y, -change.z))


@inlined
def _step(footing: Footing | None, loop: Loop, ball: int, what: int, time: float) -> bool:
    """A ball in contact mode comes to a border or a stop, or is woken; False if it is none of these."""
    if footing is None:
        return False
    motion = loop.shot.motion
    lay_still = lies_still(footing, ball)
    here = point_under(motion, ball, time, own_pull(footing, ball, loop.gravity))
    if not step(footing, motion, ball, what, time, loop.clock.now[1] * loop.clock.window + time, here):
        return False
    follow(loop.shot.crowd, motion, ball, time)
    hide(footing, loop.shot.crowd, ball)
    if lay_still:
        wake_if_it_moves(footing, loop.calendar, motion, ball, time, loop.shot.crowd.reach)
    return True


@inlined
def _gives_up(footing: Footing | None, loop: Loop, ball: int, time: float) -> bool:
    """True when a ball in a jam that contact mode cannot resolve is held still for it."""
    if footing is None:
        return False
    if loop.calendar.marks[ball, EVENTS] % JAM_EVENTS != 0 or footing.marks[ball, MODE] >= ASLEEP:
        return False
    here = point_under(loop.shot.motion, ball, time, own_pull(footing, ball, loop.gravity))
    hold(footing, loop.shot.motion, ball, time, loop.clock.now[1] * loop.clock.window + time, here.position)
    follow(loop.shot.crowd, loop.shot.motion, ball, time)
    hide(footing, loop.shot.crowd, ball)
    return True


@inlined
def _predict(loop: Loop, ball: int, time: float, what: int) -> None:
    """Find the ball's next events from ``time`` on and put the earlier on the calendar."""
    shot, calendar = loop.shot, loop.calendar
    marks = calendar.marks
    if what != WALL:
        before = NEVER_BEFORE if what == ALL or marks[ball, OBSTACLE] < 0 else calendar.wall_time[ball]
        meeting, partner = first_meeting(loop.footing, shot.crowd, shot.motion, ball, time, before)
        calendar.pair_time[ball] = meeting
        marks[ball, PARTNER] = partner
        if partner >= 0:
            marks[ball, PARTNER_HITS] = marks[partner, HITS]
        lap(loop.watch, stopwatch.PAIRS)
    if what != PAIRS or (marks[ball, OBSTACLE] < 0 and calendar.wall_time[ball] <= time):
        # no further than the ball is known to get: until its meeting, or one piece
        length = min(PIECE, calendar.pair_time[ball] - time) if marks[ball, PARTNER] >= 0 else PIECE
        tree, seam = loop.ground.tree, loop.ground.seam
        pull = own_pull(loop.footing, ball, loop.gravity)
        here = point_under(shot.motion, ball, time, pull)
        length, end = end_of_path(loop.footing, tree, seam, loop.wave, here, pull, ball, length)
        delay, obstacle = first_contact_from(
            loop.footing, ball, tree, loop.scratch, here, pull, loop.wave, seam, time, length
        )
        delay, obstacle = first_part_contact(
            loop.ground.part,
            loop.turning,
            loop.scratch,
            here,
            loop.gravity,
            seam,
            time,
            delay if obstacle >= 0 else length,
            obstacle,
            len(tree.kinds),
        )
        if obstacle < 0:
            delay, obstacle = (NEVER if end == STILL else length), end
        calendar.wall_time[ball] = time + delay
        marks[ball, OBSTACLE] = obstacle
        loop.tally[SEARCHES] += 1
        lap(loop.watch, stopwatch.WALLS)
    reschedule(calendar, ball)
    lap(loop.watch, stopwatch.SCHEDULE)


NEVER_BEFORE = 1e300  # finite, so that differences with it stay numbers


@jit
def advance(loop: Loop) -> tuple[int, int]:
    """Play events until ``clock.stop``; returns (status, ball): DONE, or why it had to pause and at which ball."""
    shot, calendar, clock, page, tally = loop.shot, loop.calendar, loop.clock, loop.page, loop.tally
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
            clock.now[1] += 1.0
            continue
        if page.filled[0] == len(page.numbers):
            return PAGE_FULL, -1
        clock.now[0] = time
        marks[ball, EVENTS] += 1
        if marks[ball, EVENTS] > STORM_EVENTS:
            return STORM, ball
        lap(loop.watch, stopwatch.NEXT)
        second = -1
        what = ALL
        obstacle = marks[ball, OBSTACLE]
        if _gives_up(loop.footing, loop, ball, time):
            marks[ball, HITS] += 1
        elif calendar.pair_time[ball] <= calendar.wall_time[ball]:
            other = marks[ball, PARTNER]
            if other < 0:
                what = PAIRS
            elif marks[other, HITS] == marks[ball, PARTNER_HITS]:
                _collide(loop, ball, other, time)
                marks[ball, HITS] += 1
                marks[other, HITS] += 1
                second = other
                tally[BALLS] += 1
            else:
                what = PAIRS
                tally[STALE] += 1
        elif obstacle >= 0:
            if not _hit_part(loop.turning, loop.ground.part, loop, ball, obstacle, time):
                _hit_surface(loop, ball, obstacle, time)
            marks[ball, HITS] += 1
            if not _speed_squared(shot.motion, ball) <= shot.crowd.fastest**2:
                forget(calendar, ball, time)
                return TOO_FAST, ball
        elif obstacle == SEARCH_ON:
            what = WALL
        elif _step(loop.footing, loop, ball, obstacle, time):
            marks[ball, HITS] += 1
        lap(loop.watch, stopwatch.RESOLVE)
        todo = ball
        while todo >= 0:
            _predict(loop, todo, time, what)
            todo = second if todo == ball else -1
