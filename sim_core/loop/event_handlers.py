"""What an event does: a ball meets a surface, the turning part or another ball, or takes a step in contact mode."""

import math

from sim_core.contact.ball_on_ball import meet
from sim_core.contact.jamming import hold
from sim_core.contact.pushed_by_part import drive, taken_from_part
from sim_core.contact.support_changes import BOUNCES, ROLLS, deflect, land, set_out, step
from sim_core.detect.ball_cylinder import facing
from sim_core.detect.ball_triangle import away_from_capsule, face_normal, nearer_neighbour
from sim_core.effects.contact_mode import (
    ASLEEP,
    CALLED,
    DRIVEN,
    JAMMED,
    LOOKS,
    MODE,
    Footing,
    own_pull,
    static_law,
)
from sim_core.effects.friction import Grip
from sim_core.effects.part_rotation import Turning, from_part, seen_from_part, slip
from sim_core.effects.random_phase import own_wave
from sim_core.effects.sonotrodes import face_wave
from sim_core.effects.vibration import surface_velocity
from sim_core.geometry.ball_sizes import by_mass
from sim_core.geometry.obstacles import CAPSULE, WAVING_FACE
from sim_core.geometry.triangle_lookup import triangle_at
from sim_core.geometry.turning_part import PartTree
from sim_core.impulses.ball_ball import pair_kick
from sim_core.impulses.ball_cylinder import hop
from sim_core.impulses.ball_surface import surface_kick
from sim_core.impulses.drag import catch_up, flies, goes_on
from sim_core.impulses.friction import rub_pair, rub_surface
from sim_core.loop.contact_neighbours import count_props, hide, lies_still, wake_if_it_moves
from sim_core.loop.event_queue import EVENTS
from sim_core.loop.impact_log import note_impact
from sim_core.loop.neighbours import follow, reach_of
from sim_core.loop.state import SONOTRODE, WALLS, Loop
from sim_core.motion import drift, kick, point_under
from sim_core.numerics.jit import inlined
from sim_core.numerics.vec3 import Vec3, dot, sub

JAM_EVENTS = 5_000  # of one ball in one window: with contact mode it is held still then, and each time as many later


@inlined
def hit_surface(loop: Loop, ball: int, obstacle: int, time: float) -> None:
    """The ball meets the obstacle now: change its velocity, count the impact, write it down if it is on a recorded
    surface.
    """
    shot, ground, clock, page = loop.shot, loop.ground, loop.clock, loop.page
    tree = ground.tree
    catch_up(loop.air, loop.footing, shot.motion, ball, time, loop.gravity)
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
        away = facing(ground.bore, tree.numbers, obstacle, kind, here.position)
    relative = here.velocity
    landed = BOUNCES
    law = loop.restitution
    if kind == WAVING_FACE:
        wave = face_wave(loop.waves, own_wave(loop.phases, loop.wave, ball), obstacle)
        relative = sub(relative, surface_velocity(wave, time))
    else:
        landed = land(loop.footing, tree, shot.motion, ball, obstacle, time, moment, here, away)
        law = static_law(loop.footing, loop.restitution)
    triangle = tree.triangles[obstacle, side]
    tag = ground.tags[triangle]
    if landed == BOUNCES:
        change = surface_kick(away, relative, law, tag)
        change = rub_surface(loop.grip, ball, time, away, relative, change, tag)
        change = hop(ground.bore, kind, away, relative, change)
        deflect(loop.footing, shot.motion, ball, time, moment, here, change)
    follow(shot.crowd, shot.motion, ball, time)
    hide(loop.footing, shot.crowd, ball)
    if lay_still:
        wake_if_it_moves(
            loop.footing, loop.calendar, shot.motion, ball, time, moment, reach_of(shot.crowd)
        )
    if landed == ROLLS:
        return
    if kind == WAVING_FACE:
        loop.tally[SONOTRODE] += 1
    else:
        loop.tally[WALLS] += 1
    speed = -dot(away, relative) / math.sqrt(dot(away, away))
    if page.record[tag] and speed > 0.0:
        when = clock.now[1] * clock.window + time - clock.origin
        note_impact(
            page,
            when,
            ball,
            triangle_at(ground.locator, triangle, touched),
            here.position,
            relative,
            speed,
        )


@inlined
def hit_part(
    turning: Turning | None,
    part: PartTree | None,
    loop: Loop,
    ball: int,
    obstacle: int,
    time: float,
) -> bool:
    """The same for an obstacle of the turning part, seen and written down in the part's frame; False if it is none."""
    if turning is None or part is None:
        return False
    row = obstacle - len(loop.ground.tree.kinds)
    if row < 0:
        return False
    shot, clock, page, tree = loop.shot, loop.clock, loop.page, part.tree
    catch_up(loop.air, loop.footing, shot.motion, ball, time, loop.gravity)
    pull = own_pull(loop.footing, ball, loop.gravity)
    here = point_under(shot.motion, ball, time, pull)
    moment = clock.now[1] * clock.window + time
    lay_still = lies_still(loop.footing, ball)
    seen = seen_from_part(turning, here.position, here.velocity, pull, time)
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
    change = from_part(turning, surface_kick(away, relative, loop.restitution, tag), time)
    speed = -dot(away, relative) / math.sqrt(dot(away, away))
    change = taken_from_part(loop.footing, turning, ball, time, away, speed, change)
    change = _rub_part(loop.grip, turning, ball, time, away, relative, change, tag)
    drive(loop.footing, shot.motion, ball, time, moment, here, change)
    follow(shot.crowd, shot.motion, ball, time)
    hide(loop.footing, shot.crowd, ball)
    if lay_still:
        wake_if_it_moves(
            loop.footing, loop.calendar, shot.motion, ball, time, moment, reach_of(shot.crowd)
        )
    if page.record[tag] and speed > 0.0:
        when = clock.now[1] * clock.window + time - clock.origin
        touched = triangle_at(loop.ground.locator, triangle, sub(seen.position, away))
        note_impact(page, when, ball, touched, seen.position, relative, speed)
    return True


@inlined
def _rub_part(
    grip: Grip | None,
    turning: Turning,
    ball: int,
    time: float,
    away: Vec3,
    relative: Vec3,
    change: Vec3,
    tag: int,
) -> Vec3:
    """rub_surface for ``away`` and ``relative`` in the part's frame; spins are those of the room."""
    if grip is None:
        return change
    there, slip = from_part(turning, away, time), from_part(turning, relative, time)
    return rub_surface(grip, ball, time, there, slip, change, tag)


@inlined
def collide(loop: Loop, one: int, two: int, time: float) -> None:
    """Two balls meet now."""
    motion = loop.shot.motion
    for ball in (one, two):
        catch_up(loop.air, loop.footing, motion, ball, time, loop.gravity)
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
        reach = reach_of(loop.shot.crowd)
        jammed = footing.marks[one, MODE] == JAMMED, footing.marks[two, MODE] == JAMMED
        if meet(footing, motion, one, two, time, moment, loop.restitution, loop.ground.tree.radius):
            wake_if_it_moves(footing, loop.calendar, motion, one, time, moment, reach)
            wake_if_it_moves(footing, loop.calendar, motion, two, time, moment, reach)
        if footing.marks[one, MODE] == JAMMED and not jammed[0]:
            count_props(footing, motion, one, time, reach)
        if footing.marks[two, MODE] == JAMMED and not jammed[1]:
            count_props(footing, motion, two, time, reach)
        return
    apart = sub(drift(motion, two, time), drift(motion, one, time))
    closing = Vec3(
        motion[two, 3] - motion[one, 3],
        motion[two, 4] - motion[one, 4],
        motion[two, 5] - motion[one, 5],
    )
    change = pair_kick(apart, closing, loop.restitution)
    change = rub_pair(loop.grip, one, two, time, apart, closing, change)
    kick(motion, one, time, by_mass(loop.sizes, one, two, change))
    kick(motion, two, time, by_mass(loop.sizes, two, one, Vec3(-change.x, -change.y, -change.z)))


@inlined
def take_step(footing: Footing | None, loop: Loop, ball: int, what: int, time: float) -> bool:
    """A ball in contact mode comes to a border or a stop, or is woken; False if it is none of these."""
    if footing is None:
        return False
    motion = loop.shot.motion
    lay_still = lies_still(footing, ball)
    if not flies(footing, ball):
        catch_up(loop.air, footing, motion, ball, time, loop.gravity)
    here = point_under(motion, ball, time, own_pull(footing, ball, loop.gravity))
    moment = loop.clock.now[1] * loop.clock.window + time
    if what == LOOKS:
        if count_props(footing, motion, ball, time, reach_of(loop.shot.crowd)):
            footing.marks[ball, CALLED] = 1
        return False
    if not step(footing, motion, ball, what, time, moment, here):
        return False
    follow(loop.shot.crowd, motion, ball, time)
    hide(footing, loop.shot.crowd, ball)
    if lay_still:
        wake_if_it_moves(
            footing, loop.calendar, motion, ball, time, moment, reach_of(loop.shot.crowd)
        )
    return True


@inlined
def fly_on(loop: Loop, ball: int, time: float) -> bool:
    """The ball flies on; True when the air has changed its path."""
    motion = loop.shot.motion
    if not goes_on(loop.air, loop.footing, motion, ball, time, loop.gravity):
        return False
    follow(loop.shot.crowd, motion, ball, time)
    return True


@inlined
def gives_up(footing: Footing | None, loop: Loop, ball: int, time: float) -> bool:
    """True when a ball in a jam that contact mode cannot resolve is held still for it."""
    if footing is None:
        return False
    if loop.calendar.marks[ball, EVENTS] % JAM_EVENTS != 0 or footing.marks[ball, MODE] >= ASLEEP:
        return False
    if footing.marks[ball, DRIVEN] != 0:  # the part would go through it
        return False
    here = point_under(loop.shot.motion, ball, time, own_pull(footing, ball, loop.gravity))
    moment = loop.clock.now[1] * loop.clock.window + time
    hold(footing, loop.shot.motion, ball, time, moment, here.position, loop.ground.tree.radius)
    count_props(footing, loop.shot.motion, ball, time, reach_of(loop.shot.crowd))
    follow(loop.shot.crowd, loop.shot.motion, ball, time)
    hide(footing, loop.shot.crowd, ball)
    return True
