"""Handlers of events: a ball meets a surface or another ball, or its path in contact ends.

Every hit on a surface, still, vibrating or turning, is resolved in _resolve_contact. New effects of
the contact between a ball and a surface belong in effects/surface/surface_effects.py.
"""

import math

import numpy as np

from sim_core.contact.ball_on_ball import meet
from sim_core.contact.cylinder_wall import hop_at_wall, land_on_surface
from sim_core.contact.jamming import hold_still
from sim_core.contact.landing_and_lift_off import (
    RECHECK,
    RIDE_ENDS,
    deflect,
    end_path,
    moved_off_edge,
)
from sim_core.contact.pushed_by_part import constrained_change, push_ball
from sim_core.contact.riding import go_on_riding, is_of_plane, stick
from sim_core.detect.ball_cylinder import normal_at
from sim_core.detect.ball_sonotrode import within_moved_borders
from sim_core.detect.ball_triangle import away_from_capsule, face_normal, nearer_neighbour
from sim_core.effects.amplitude_profile import bent_normal, wave_at
from sim_core.effects.ball_sizes import face_overlap_of_ball, radius_of_ball, share_by_mass
from sim_core.effects.contact_mode import (
    ASLEEP,
    BOUNCES,
    JAMMED,
    ROLLS,
    UNTOUCHED,
    ContactState,
    Ride,
    ball_acceleration,
    rides,
    still_surface_restitution,
    vibrating_restitution,
)
from sim_core.effects.flexure import FlexureState
from sim_core.effects.part_rotation import (
    RotationState,
    relative_flight,
    slip_velocity,
    to_room_frame,
)
from sim_core.effects.random_phase import wave_of_ball
from sim_core.effects.restitution import RestitutionState
from sim_core.effects.roughness import MOST_HITS, RoughnessState, touched_facet
from sim_core.effects.sonotrodes import wave_of_face
from sim_core.effects.surface.surface_effects import apply_surface_effects
from sim_core.effects.vibration import surface_velocity
from sim_core.geometry.obstacles import CAPSULE, VIBRATING_FACE
from sim_core.geometry.triangle_lookup import find_triangle
from sim_core.geometry.turning_part import PartTree
from sim_core.impulses.collision import (
    leave_cylinder_wall,
    pair_velocity_change,
    surface_velocity_change,
)
from sim_core.impulses.friction import add_pair_friction, add_surface_friction
from sim_core.loop.contact_neighbours import count_neighbours, wake_if_it_moves
from sim_core.loop.event_queue import EventQueue
from sim_core.loop.impact_log import Impact, no_impact
from sim_core.loop.state import BALLS, SONOTRODE, WALLS, SimulationState
from sim_core.motion import BallEvent, BallState, change_velocity, free_fall_position, state_under
from sim_core.numerics.jit import inlined
from sim_core.numerics.periodic_sides import nearest_image
from sim_core.numerics.vec3 import Flight, Touch, Vec3, add_scaled, dot, sub

# Number of events of one ball in one window after which contact mode holds it still. The ball is
# held again after as many further events.
JAM_EVENTS = 5_000


@inlined
def _resolve_contact(
    rotation: RotationState | None,
    state: SimulationState,
    event: BallEvent,
    mean: Touch,
    touch: Touch,
    law: RestitutionState | None,
    approach: float,
) -> Vec3:
    """Return the velocity change [m/s] of a ball that bounces off a surface, in the room's frame.

    Args:
        rotation: rotation of the part, if the surface belongs to a turning part.
        mean: the contact with the mean plane, in the frame of the surface.
        touch: the contact with the touched facet of a rough surface; the same as ``mean`` on a
            smooth one.
        law: restitution law of the surface.
        approach: speed along the normal of ``touch`` before the hit [m/s].
    """
    change = surface_velocity_change(touch, law, state.flexure, event.ball)
    change = _in_room(rotation, change, event.time)
    change = _constrained(rotation, state, event, touch, approach, change)
    change = hop_at_wall(
        state.obstacles.cylinder, state.contact, event.ball, touch, approach, change
    )
    away = _in_room(rotation, touch.away, event.time)
    relative = _in_room(rotation, touch.relative, event.time)
    change = add_surface_friction(
        state.friction_state, state.sizes, event.ball, event.time, away, relative, change, touch.tag
    )
    in_room = Touch(away, relative, touch.tag, touch.kind, touch.triangle)
    change = apply_surface_effects(
        state.surface_effects, event.ball, event.time_since_start, in_room, change
    )
    away = _in_room(rotation, mean.away, event.time)
    mean = Touch(away, relative, mean.tag, mean.kind, mean.triangle)
    change = _until_it_leaves(state.roughness, state, event, mean, law, change)
    return leave_cylinder_wall(state.obstacles.cylinder, mean.kind, away, relative, change)


@inlined
def _until_it_leaves(
    roughness: RoughnessState | None,
    state: SimulationState,
    event: BallEvent,
    mean: Touch,
    law: RestitutionState | None,
    change: Vec3,
) -> Vec3:
    """Return ``change`` [m/s] and the changes by further facets that a ball hits before it leaves.

    ``mean``: the contact with the mean plane, in the room's frame.
    """
    if roughness is None:
        return change
    for hits in range(1, MOST_HITS + 1):
        velocity = add_scaled(mean.relative, 1.0, change)
        if dot(mean.away, velocity) > 0.0:
            return change
        touch = Touch(mean.away, velocity, mean.tag, mean.kind, mean.triangle)
        if hits < MOST_HITS:
            touch = touched_facet(roughness, event.ball, touch)
        push = surface_velocity_change(touch, law, state.flexure, event.ball)
        push = add_surface_friction(
            state.friction_state,
            state.sizes,
            event.ball,
            event.time,
            touch.away,
            velocity,
            push,
            touch.tag,
        )
        change = add_scaled(change, 1.0, push)
    return change


@inlined
def _in_room(rotation: RotationState | None, vector: Vec3, time: float) -> Vec3:
    """Return a vector of a surface's frame in the room's frame, at ``time`` [s].

    ``rotation``: rotation of the part; None for a surface that does not turn.
    """
    if rotation is None:
        return vector
    return to_room_frame(rotation, vector, time)


@inlined
def _constrained(
    rotation: RotationState | None,
    state: SimulationState,
    event: BallEvent,
    touch: Touch,
    approach: float,
    change: Vec3,
) -> Vec3:
    if rotation is None:
        return change
    return constrained_change(state.contact, rotation, event, touch.away, approach, change)


@inlined
def _here(state: SimulationState, event: BallEvent) -> BallState:
    acceleration = ball_acceleration(state.contact, event.ball, state.gravity)
    return state_under(state.motion, event.ball, event.time, acceleration)


@inlined
def _hit_triangle(
    flexure: FlexureState | None, state: SimulationState, tag: int, triangle: int, touched: Vec3
) -> int:
    """Return the triangle that is hit, where a part may be thin there; else ``triangle``.

    ``triangle``: any triangle of the flat face that is hit, at ``touched`` [m].
    """
    if flexure is None:
        return triangle
    if not flexure.bends[tag]:
        return triangle
    return find_triangle(state.obstacles.lookup, triangle, touched)


@inlined
def hit_surface(state: SimulationState, event: BallEvent) -> Impact:
    """Resolve a hit on a still or vibrating surface: change the velocity and count the hit.

    Returns: the impact for the log. Its normal speed is 0 if the ball only rolls on.
    """
    obstacles, ball = state.obstacles, event.ball
    tree, obstacle = obstacles.tree, int(np.int64(state.queue.obstacle[ball]))
    here = _here(state, event)
    kind = tree.kinds[obstacle]
    side = 0
    touched = here.position  # the touched point, or the ball's centre projected on the face's plane
    if kind == CAPSULE:
        away = away_from_capsule(tree.numbers, obstacle, here.position)
        side = nearer_neighbour(tree.numbers, obstacle, away)
        touched = sub(here.position, away)
        here = moved_off_edge(state.contact, state.motion, event, here, away)
    else:
        away = normal_at(obstacles.cylinder, tree.numbers, obstacle, kind, here.position)
    relative = here.velocity
    landed = BOUNCES
    law = state.restitution
    if kind == VIBRATING_FACE:
        wave = wave_of_face(
            state.waves, wave_of_ball(state.random_phase, state.wave, ball), obstacle
        )
        away = bent_normal(state.profiles, wave, obstacle, here.position, event.time, away)
        wave = wave_at(state.profiles, wave, obstacle, here.position)
        relative = sub(relative, surface_velocity(wave, event.time))
        landed = stick(state.contact, tree, state.motion, event, obstacle, here)
        law = vibrating_restitution(state.contact, state.restitution)
    else:
        landed = land_on_surface(
            state.contact, obstacles.cylinder, tree, state.motion, event, obstacle, here, away
        )
        law = still_surface_restitution(state.contact, state.restitution)
    triangle = int(np.int64(tree.triangles[obstacle, side]))
    tag = int(np.int64(obstacles.tags[triangle]))
    hit = _hit_triangle(state.flexure, state, tag, triangle, touched)
    mean = Touch(away, relative, tag, kind, hit)
    touch = mean if landed != BOUNCES else touched_facet(state.roughness, ball, mean)
    approach = -dot(touch.away, relative) / math.sqrt(dot(touch.away, touch.away))
    if landed == BOUNCES:
        change = _resolve_contact(None, state, event, mean, touch, law, approach)
        deflect(state.contact, state.motion, event, here, change)
    if landed == ROLLS:
        return no_impact()
    state.counts[SONOTRODE if kind == VIBRATING_FACE else WALLS] += 1
    return Impact(tag, triangle, touched, here.position, relative, approach, away)


@inlined
def hit_part(
    rotation: RotationState | None, part: PartTree | None, state: SimulationState, event: BallEvent
) -> Impact:
    """Resolve a hit on the turning part: change the ball's velocity and count the hit.

    Returns: the impact for the log, in the part's frame.
    """
    if rotation is None or part is None:
        return no_impact()
    tree = part.tree
    row = state.queue.obstacle[event.ball] - len(state.obstacles.tree.kinds)
    here = _here(state, event)
    acceleration = ball_acceleration(state.contact, event.ball, state.gravity)
    seen = relative_flight(rotation, Flight(here.position, here.velocity, acceleration), event.time)
    side = 0
    if tree.kinds[row] == CAPSULE:
        away = away_from_capsule(tree.numbers, row, seen.position)
        side = nearer_neighbour(tree.numbers, row, away)
    else:
        normal = face_normal(tree.numbers, row)
        radius = radius_of_ball(state.sizes, tree.radius, event.ball)
        away = Vec3(radius * normal.x, radius * normal.y, radius * normal.z)
    relative = slip_velocity(rotation, seen, away, event.time)
    triangle = int(np.int64(tree.triangles[row, side]))
    tag = int(np.int64(state.obstacles.tags[triangle]))
    touched = sub(seen.position, away)
    hit = _hit_triangle(state.flexure, state, tag, triangle, touched)
    mean = Touch(away, relative, tag, tree.kinds[row], hit)
    touch = touched_facet(state.roughness, event.ball, mean)
    approach = -dot(touch.away, relative) / math.sqrt(dot(touch.away, touch.away))
    change = _resolve_contact(rotation, state, event, mean, touch, state.restitution, approach)
    push_ball(state.contact, state.motion, event, here, change)
    state.counts[WALLS] += 1
    return Impact(tag, triangle, touched, seen.position, relative, approach, away)


@inlined
def collide(
    contact: ContactState | None, state: SimulationState, one: BallEvent, partner: int
) -> None:
    """Resolve the meeting of two balls: change their velocities and count the collision."""
    motion, queue, time = state.motion, state.queue, one.time
    two = BallEvent(partner, time, one.time_since_start)
    state.counts[BALLS] += 1
    if contact is not None:
        jammed_one = contact.mode[one.ball] == JAMMED
        jammed_two = contact.mode[two.ball] == JAMMED
        if meet(contact, motion, one, two, state.restitution):
            wake_if_it_moves(contact, queue, motion, one)
            wake_if_it_moves(contact, queue, motion, two)
        if contact.mode[one.ball] == JAMMED and not jammed_one:
            count_neighbours(contact, motion, one)
        if contact.mode[two.ball] == JAMMED and not jammed_two:
            count_neighbours(contact, motion, two)
        return
    apart = sub(
        free_fall_position(motion, two.ball, time), free_fall_position(motion, one.ball, time)
    )
    apart = nearest_image(state.sides, apart)
    closing = Vec3(
        motion[two.ball, 3] - motion[one.ball, 3],
        motion[two.ball, 4] - motion[one.ball, 4],
        motion[two.ball, 5] - motion[one.ball, 5],
    )
    change = pair_velocity_change(apart, closing, state.restitution)
    change = add_pair_friction(
        state.friction_state, state.sizes, one.ball, two.ball, time, apart, closing, change
    )
    back = Vec3(-change.x, -change.y, -change.z)
    change_velocity(motion, one.ball, time, share_by_mass(state.sizes, one.ball, two.ball, change))
    change_velocity(motion, two.ball, time, share_by_mass(state.sizes, two.ball, one.ball, back))


@inlined
def end_contact_path(
    contact: ContactState | None, state: SimulationState, event: BallEvent
) -> bool:
    """Resolve the end of a path of a ball that rolls or rests: a border, a stop or a wake-up.

    Returns: False if the ball's path goes on unchanged.
    """
    if contact is None:
        return False
    reason = int(np.int64(state.queue.obstacle[event.ball]))
    if reason == RIDE_ENDS:
        here = _here(state, event)
        face = _face_under(contact.ride, state, event, here)
        go_on_riding(contact.ride, contact, state.motion, event, here, face)
        return True
    if reason == RECHECK:
        if count_neighbours(contact, state.motion, event):
            contact.wake_pending[event.ball] = 1
        return False
    return end_path(contact, state.motion, event, reason, _here(state, event))


@inlined
def _face_under(ride: Ride | None, state: SimulationState, event: BallEvent, at: BallState) -> int:
    """Return the number of the face under a ball that rides on a sonotrode.

    It is -1 if the ball is beside all faces in the sonotrode's plane.
    """
    if ride is None:
        return -1
    tree = state.obstacles.tree
    overlap = face_overlap_of_ball(state.sizes, state.obstacles.face_overlap, event.ball)
    flight, last = Flight(at.position, at.velocity, at.velocity), ride.face[event.ball]
    for k in range(-1, len(tree.kinds)):
        row = int(np.int64(last)) if k < 0 else k  # most likely the ball is still on the same face
        if is_of_plane(ride, tree, last, row):
            wave = wave_of_face(ride.waves, ride.wave, row)
            if within_moved_borders(
                tree.numbers, row, flight, overlap, wave, None, event.time, 0.0
            ):
                return row
    return -1


@inlined
def gives_up(contact: ContactState | None, queue: EventQueue, ball: int) -> bool:
    """Return True if a ball has so many events in a time window that it must be held still."""
    if contact is None:
        return False
    if queue.events[ball] % JAM_EVENTS != 0 or contact.mode[ball] >= ASLEEP:
        return False
    if rides(contact.ride, ball):
        return False
    # otherwise the part would go through the ball
    return bool(contact.slow_hits.part_contact[ball] == UNTOUCHED)


@inlined
def hold_jammed_ball(
    contact: ContactState | None, state: SimulationState, event: BallEvent
) -> None:
    """Hold a ball for which ``gives_up`` is True still at its present position."""
    if contact is None:
        return
    hold_still(contact, state.motion, event, _here(state, event).position)
    count_neighbours(contact, state.motion, event)
