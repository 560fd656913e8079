"""What an event does: a ball meets a surface, the turning part or another ball, or takes a step in contact mode."""

import math

from sim_core.contact.ball_on_ball import meet
from sim_core.contact.jamming import hold
from sim_core.contact.pushed_by_part import drive, taken_from_part
from sim_core.contact.support_changes import BOUNCES, ROLLS, deflect, land, set_out, step
from sim_core.detect.ball_cylinder import normal_at
from sim_core.detect.ball_triangle import away_from_capsule, face_normal, nearer_neighbour
from sim_core.effects.contact_mode import (
    ASLEEP,
    DRIVEN,
    JAMMED,
    MODE,
    RECHECK,
    WAKE_PENDING,
    ContactState,
    ball_acceleration,
    static_law,
)
from sim_core.effects.friction import FrictionState
from sim_core.effects.part_rotation import (
    RotationState,
    relative_flight,
    slip_velocity,
    to_room_frame,
)
from sim_core.effects.random_phase import wave_of_ball
from sim_core.effects.sonotrodes import wave_of_face
from sim_core.effects.vibration import surface_velocity
from sim_core.geometry.ball_sizes import share_by_mass
from sim_core.geometry.obstacles import CAPSULE, VIBRATING_FACE
from sim_core.geometry.triangle_lookup import find_triangle
from sim_core.geometry.turning_part import PartTree
from sim_core.impulses.collision import (
    leave_cylinder_wall,
    pair_velocity_change,
    surface_velocity_change,
)
from sim_core.impulses.drag import apply_drag_piece, apply_drag_until, is_flying
from sim_core.impulses.friction import add_pair_friction, add_surface_friction
from sim_core.loop.contact_neighbours import count_neighbours, hide, lies_still, wake_if_it_moves
from sim_core.loop.event_queue import EVENTS
from sim_core.loop.impact_log import note_impact
from sim_core.loop.neighbours import follow, reach_of
from sim_core.loop.state import SONOTRODE, WALLS, SimulationState
from sim_core.motion import change_velocity, free_fall_position, state_under
from sim_core.numerics.jit import inlined
from sim_core.numerics.vec3 import Flight, Vec3, dot, sub

JAM_EVENTS = 5_000  # of one ball in one window: with contact mode it is held still then, and each time as many later


@inlined
def hit_surface(state: SimulationState, ball: int, obstacle: int, time: float) -> None:
    """The ball meets the obstacle now: change its velocity, count the impact, write it down if it is on a recorded
    surface.
    """
    obstacles, clock, buffer = state.obstacles, state.clock, state.buffer
    tree = obstacles.tree
    apply_drag_until(state.drag, state.contact, state.motion, ball, time, state.gravity)
    here = state_under(
        state.motion, ball, time, ball_acceleration(state.contact, ball, state.gravity)
    )
    time_since_start = clock.now[1] * clock.window + time
    lay_still = lies_still(state.contact, ball)
    kind = tree.kinds[obstacle]
    side = 0
    touched = here.position  # or where the ball's centre is seen in the face's plane
    if kind == CAPSULE:
        away = away_from_capsule(tree.numbers, obstacle, here.position)
        side = nearer_neighbour(tree.numbers, obstacle, away)
        touched = sub(here.position, away)
        here = set_out(state.contact, state.motion, ball, time, here, away, tree.radius)
    else:
        away = normal_at(obstacles.cylinder, tree.numbers, obstacle, kind, here.position)
    relative = here.velocity
    landed = BOUNCES
    law = state.restitution
    if kind == VIBRATING_FACE:
        wave = wave_of_face(
            state.waves, wave_of_ball(state.random_phase, state.wave, ball), obstacle
        )
        relative = sub(relative, surface_velocity(wave, time))
    else:
        landed = land(
            state.contact, tree, state.motion, ball, obstacle, time, time_since_start, here, away
        )
        law = static_law(state.contact, state.restitution)
    triangle = tree.triangles[obstacle, side]
    tag = obstacles.tags[triangle]
    if landed == BOUNCES:
        change = surface_velocity_change(away, relative, law, tag)
        change = add_surface_friction(state.friction_state, ball, time, away, relative, change, tag)
        change = leave_cylinder_wall(obstacles.cylinder, kind, away, relative, change)
        deflect(state.contact, state.motion, ball, time, time_since_start, here, change)
    follow(state.neighbours, state.motion, ball, time)
    hide(state.contact, state.neighbours, ball)
    if lay_still:
        wake_if_it_moves(
            state.contact,
            state.queue,
            state.motion,
            ball,
            time,
            time_since_start,
            reach_of(state.neighbours),
        )
    if landed == ROLLS:
        return
    if kind == VIBRATING_FACE:
        state.tally[SONOTRODE] += 1
    else:
        state.tally[WALLS] += 1
    speed = -dot(away, relative) / math.sqrt(dot(away, away))
    if buffer.record[tag] and speed > 0.0:
        when = clock.now[1] * clock.window + time - clock.origin
        note_impact(
            buffer,
            when,
            ball,
            find_triangle(obstacles.lookup, triangle, touched),
            here.position,
            relative,
            speed,
        )


@inlined
def hit_part(
    rotation: RotationState | None,
    part: PartTree | None,
    state: SimulationState,
    ball: int,
    obstacle: int,
    time: float,
) -> bool:
    """The same for an obstacle of the turning part, seen and written down in the part's frame; False if it is none."""
    if rotation is None or part is None:
        return False
    row = obstacle - len(state.obstacles.tree.kinds)
    if row < 0:
        return False
    clock, buffer, tree = state.clock, state.buffer, part.tree
    apply_drag_until(state.drag, state.contact, state.motion, ball, time, state.gravity)
    acceleration = ball_acceleration(state.contact, ball, state.gravity)
    here = state_under(state.motion, ball, time, acceleration)
    time_since_start = clock.now[1] * clock.window + time
    lay_still = lies_still(state.contact, ball)
    flight = Flight(here.position, here.velocity, acceleration)
    seen = relative_flight(rotation, flight, time)
    side = 0
    if tree.kinds[row] == CAPSULE:
        away = away_from_capsule(tree.numbers, row, seen.position)
        side = nearer_neighbour(tree.numbers, row, away)
    else:
        normal = face_normal(tree.numbers, row)
        away = Vec3(tree.radius * normal.x, tree.radius * normal.y, tree.radius * normal.z)
    relative = slip_velocity(rotation, seen, away, time)
    state.tally[WALLS] += 1
    triangle = tree.triangles[row, side]
    tag = state.obstacles.tags[triangle]
    change = to_room_frame(
        rotation, surface_velocity_change(away, relative, state.restitution, tag), time
    )
    speed = -dot(away, relative) / math.sqrt(dot(away, away))
    change = taken_from_part(state.contact, rotation, ball, time, away, speed, change)
    change = _rub_part(state.friction_state, rotation, ball, time, away, relative, change, tag)
    drive(state.contact, state.motion, ball, time, time_since_start, here, change)
    follow(state.neighbours, state.motion, ball, time)
    hide(state.contact, state.neighbours, ball)
    if lay_still:
        wake_if_it_moves(
            state.contact,
            state.queue,
            state.motion,
            ball,
            time,
            time_since_start,
            reach_of(state.neighbours),
        )
    if buffer.record[tag] and speed > 0.0:
        when = clock.now[1] * clock.window + time - clock.origin
        touched = find_triangle(state.obstacles.lookup, triangle, sub(seen.position, away))
        note_impact(buffer, when, ball, touched, seen.position, relative, speed)
    return True


@inlined
def _rub_part(
    friction_state: FrictionState | None,
    rotation: RotationState,
    ball: int,
    time: float,
    away: Vec3,
    relative: Vec3,
    change: Vec3,
    tag: int,
) -> Vec3:
    """rub_surface for ``away`` and ``relative`` in the part's frame; spins are those of the room."""
    if friction_state is None:
        return change
    there, slip = to_room_frame(rotation, away, time), to_room_frame(rotation, relative, time)
    return add_surface_friction(friction_state, ball, time, there, slip, change, tag)


@inlined
def collide(state: SimulationState, one: int, two: int, time: float) -> None:
    """Two balls meet now."""
    motion = state.motion
    for ball in (one, two):
        apply_drag_until(state.drag, state.contact, motion, ball, time, state.gravity)
    _kick_both(state.contact, state, one, two, time)
    follow(state.neighbours, motion, one, time)
    follow(state.neighbours, motion, two, time)
    hide(state.contact, state.neighbours, one)
    hide(state.contact, state.neighbours, two)


@inlined
def _kick_both(
    contact: ContactState | None, state: SimulationState, one: int, two: int, time: float
) -> None:
    motion = state.motion
    if contact is not None:
        time_since_start = state.clock.now[1] * state.clock.window + time
        reach = reach_of(state.neighbours)
        jammed = contact.marks[one, MODE] == JAMMED, contact.marks[two, MODE] == JAMMED
        if meet(
            contact,
            motion,
            one,
            two,
            time,
            time_since_start,
            state.restitution,
            state.obstacles.tree.radius,
        ):
            wake_if_it_moves(contact, state.queue, motion, one, time, time_since_start, reach)
            wake_if_it_moves(contact, state.queue, motion, two, time, time_since_start, reach)
        if contact.marks[one, MODE] == JAMMED and not jammed[0]:
            count_neighbours(contact, motion, one, time, reach)
        if contact.marks[two, MODE] == JAMMED and not jammed[1]:
            count_neighbours(contact, motion, two, time, reach)
        return
    apart = sub(free_fall_position(motion, two, time), free_fall_position(motion, one, time))
    closing = Vec3(
        motion[two, 3] - motion[one, 3],
        motion[two, 4] - motion[one, 4],
        motion[two, 5] - motion[one, 5],
    )
    change = pair_velocity_change(apart, closing, state.restitution)
    change = add_pair_friction(state.friction_state, one, two, time, apart, closing, change)
    change_velocity(motion, one, time, share_by_mass(state.sizes, one, two, change))
    change_velocity(
        motion,
        two,
        time,
        share_by_mass(state.sizes, two, one, Vec3(-change.x, -change.y, -change.z)),
    )


@inlined
def take_step(
    contact: ContactState | None, state: SimulationState, ball: int, what: int, time: float
) -> bool:
    """A ball in contact mode comes to a border or a stop, or is woken; False if it is none of these."""
    if contact is None:
        return False
    motion = state.motion
    lay_still = lies_still(contact, ball)
    if not is_flying(contact, ball):
        apply_drag_until(state.drag, contact, motion, ball, time, state.gravity)
    here = state_under(motion, ball, time, ball_acceleration(contact, ball, state.gravity))
    time_since_start = state.clock.now[1] * state.clock.window + time
    if what == RECHECK:
        if count_neighbours(contact, motion, ball, time, reach_of(state.neighbours)):
            contact.marks[ball, WAKE_PENDING] = 1
        return False
    if not step(contact, motion, ball, what, time, time_since_start, here):
        return False
    follow(state.neighbours, motion, ball, time)
    hide(contact, state.neighbours, ball)
    if lay_still:
        wake_if_it_moves(
            contact, state.queue, motion, ball, time, time_since_start, reach_of(state.neighbours)
        )
    return True


@inlined
def fly_on(state: SimulationState, ball: int, time: float) -> bool:
    """The ball flies on; True when the air has changed its path."""
    motion = state.motion
    if not apply_drag_piece(state.drag, state.contact, motion, ball, time, state.gravity):
        return False
    follow(state.neighbours, motion, ball, time)
    return True


@inlined
def gives_up(contact: ContactState | None, state: SimulationState, ball: int, time: float) -> bool:
    """True when a ball in a jam that contact mode cannot resolve is held still for it."""
    if contact is None:
        return False
    if state.queue.marks[ball, EVENTS] % JAM_EVENTS != 0 or contact.marks[ball, MODE] >= ASLEEP:
        return False
    if contact.marks[ball, DRIVEN] != 0:  # the part would go through it
        return False
    here = state_under(state.motion, ball, time, ball_acceleration(contact, ball, state.gravity))
    time_since_start = state.clock.now[1] * state.clock.window + time
    hold(
        contact,
        state.motion,
        ball,
        time,
        time_since_start,
        here.position,
        state.obstacles.tree.radius,
    )
    count_neighbours(contact, state.motion, ball, time, reach_of(state.neighbours))
    follow(state.neighbours, state.motion, ball, time)
    hide(contact, state.neighbours, ball)
    return True
