"""Landing of balls on surfaces, and choice of the supports that a moving ball keeps.

A support is a surface, or a ball that lies still, on which a ball stands. The time at which a
rolling ball leaves its support is computed in path_end.py.

Notation: b: ball. n: unit normal of a surface, towards the ball. v: velocity of the ball [m/s].
The approach speed is -n v. A still surface captures a ball if the approach speed is below
ContactState.capture and gravity or the ball's own acceleration presses the ball on the surface, or
if the ball has a support already.
"""

import math

import numpy as np

from sim_core.contact.riding import settle_on_face
from sim_core.contact.rolling_friction import braked, reset_spin, stopped_if_creeping
from sim_core.contact.supports import (
    ROUNDING,
    add_support,
    drop_support,
    drop_supports_along,
    forget_left_support,
    onto_cone,
    set_mode,
    support_normal,
)
from sim_core.effects.ball_sizes import radius_of_ball
from sim_core.effects.contact_mode import (
    ASLEEP,
    BOUNCES,
    CAUGHT,
    FLYING,
    JAMMED,
    ON_BALL,
    ROLLS,
    ContactState,
    rides,
)
from sim_core.geometry.bvh import Tree
from sim_core.geometry.obstacles import CAPSULE
from sim_core.motion import BallEvent, BallState, change_velocity, set_path
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.vec3 import Vec3, add_scaled, cross, dot, set_vec3, vec3_at

# reasons for the end of a path in contact, used in place of an obstacle's number (event_queue.py
# uses -1 and -2)
PATH_GOES_ON = -1
BRAKE_ENDS = -3  # the ball stops, or its resistance gets a new direction
WAKES = -4
LIES_STILL = -5
RECHECK = -6  # a jammed ball checks the balls around it
RIDE_ENDS = -7  # the parabola of a ball that moves with a vibrating face ends
LEAVES_SUPPORT = -10  # LEAVES_SUPPORT minus k: the ball leaves support number k

# Cosine. Faces that meet at a smaller angle approximate a smooth surface.
ONE_SURFACE = math.cos(math.radians(25.0))
# A hit that is at most this multiple of the speed given by a facet's turn is a landing on the next
# facet.
FACET_HOP = 1.05
# Share of capture: largest speed at which a ball falls back from its plane onto a round support.
COMES_DOWN = 0.5
# A ball wedged between its supports and an edge has no way out if it would have to move more than
# 1/sqrt(NO_WAY_OUT) = ten times its depth.
NO_WAY_OUT = 0.01
# Share of capture: a ball keeps a support from which it moves more slowly against gravity.
DETACH_TOLERANCE = 0.01
NO_SUPPORT = -1
LAST_LEFT = -2


@jit
def settle(contact: ContactState, motion: np.ndarray, event: BallEvent, at: BallState) -> None:
    """Set a ball's new path from the state ``at``, along the supports that still hold the ball.

    A support that the ball hits faster than ContactState.capture is dropped. The search for
    contacts then finds this support at once, as a wall. A support that is another ball is dropped
    when that ball has begun to move: from then on the two balls can collide as any pair can.
    """
    ball, supports = event.ball, contact.supports
    contact.wake_pending[ball] = 0
    if settle_on_face(contact.ride, contact, motion, event, at):
        return
    for support in range(supports.number[ball] - 1, -1, -1):
        other = ON_BALL - supports.obstacles[ball, support]
        if other >= 0 and contact.mode[other] < ASLEEP:
            drop_support(supports, ball, support)
    velocity = stopped_if_creeping(
        contact.friction_state, contact, ball, at.velocity, DETACH_TOLERANCE * contact.capture
    )
    support = 0
    while support < supports.number[ball]:
        normal = support_normal(supports, ball, support)
        departure = dot(normal, velocity)
        if departure < -contact.capture or departure > DETACH_TOLERANCE * contact.capture:
            drop_support(supports, ball, support)
        else:
            if departure > 0.0:
                velocity = add_scaled(velocity, -departure, normal)
            support += 1
    velocity = onto_cone(supports, ball, velocity)
    speed = math.sqrt(dot(velocity, velocity))
    drop_supports_along(supports, ball, velocity, ROUNDING * (1.0 + speed))
    acceleration = onto_cone(supports, ball, contact.gravity)
    mode = FLYING
    if supports.number[ball] > 0:
        velocity, acceleration, mode = braked(
            contact.friction_state, contact, event, velocity, acceleration
        )
    move_on(contact, motion, event, BallState(at.position, velocity), acceleration, mode)


@jit
def move_on(
    contact: ContactState,
    motion: np.ndarray,
    event: BallEvent,
    at: BallState,
    acceleration: Vec3,
    mode: int,
) -> None:
    """Set the path, acceleration, mode and spin with which a ball goes on after an event.

    Args:
        contact: state of contact mode.
        motion: base position and velocity of each ball, shape (n, 6).
        event: the ball and the present time.
        at: position and velocity of the ball now.
        acceleration: acceleration of the ball from now on [m/s²].
        mode: FLYING, SLIDING, ASLEEP (lies still) or JAMMED (is held still).
    """
    ball = event.ball
    if mode >= ASLEEP and contact.mode[ball] < ASLEEP:
        contact.still_since[ball] = event.time_since_start
    if mode != JAMMED:
        contact.stays_until[ball] = 0.0
        contact.jams.neighbour_count[ball] = 0
    set_mode(contact, ball, mode)
    reset_spin(contact.friction_state, ball, event.time, mode)
    set_vec3(contact.acceleration, ball, acceleration)
    set_path(motion, ball, event.time, at, acceleration)


@jit
def impart(
    contact: ContactState, motion: np.ndarray, event: BallEvent, at: BallState, change: Vec3
) -> None:
    """Add ``change`` [m/s] to the velocity of a ball in flight or on supports.

    A ball on supports keeps only the part of its new velocity that the supports leave free.
    """
    if contact.mode[event.ball] == FLYING:
        change_velocity(motion, event.ball, event.time, change)
    else:
        settle(contact, motion, event, BallState(at.position, add_scaled(at.velocity, 1.0, change)))


@inlined
def deflect(
    contact: ContactState | None, motion: np.ndarray, event: BallEvent, at: BallState, change: Vec3
) -> None:
    """Add ``change`` [m/s] to a ball's velocity after a hit on a surface.

    ``contact`` is None in a scene without contact mode.
    """
    if contact is None:
        change_velocity(motion, event.ball, event.time, change)
        return
    forget_left_support(contact, event.ball)
    impart(contact, motion, event, at, change)


@inlined
def moved_off_edge(
    contact: ContactState | None, motion: np.ndarray, event: BallEvent, at: BallState, away: Vec3
) -> BallState:
    """Put a ball that overlaps an edge back to one radius from it, and return its new state.

    Rounding lets a ball overlap an edge by up to 1e-13 m, which would add up in thousands of small
    hops. The ball is moved along the planes of its supports. ``away``: vector from the edge to the
    ball.
    """
    if contact is None:
        return at
    ball = event.ball
    distance = math.sqrt(dot(away, away))
    radius = radius_of_ball(contact.sizes, contact.radius, ball)
    if distance >= radius:
        return at
    free = onto_cone(contact.supports, ball, away)
    share = dot(free, free) / (distance * distance)  # share of a step along ``free`` that leads out
    if share < NO_WAY_OUT:
        return at
    step = (radius - distance) / (distance * share)
    there = BallState(add_scaled(at.position, step, free), at.velocity)
    set_path(motion, ball, event.time, there, vec3_at(contact.acceleration, ball))
    return there


@inlined
def land(
    contact: ContactState | None,
    tree: Tree,
    motion: np.ndarray,
    event: BallEvent,
    obstacle: int,
    at: BallState,
    away: Vec3,
) -> int:
    """Let a ball land on a still surface if it can, and return BOUNCES, ROLLS or CAUGHT.

    BOUNCES means that the ball does not stay on the surface, and its path is as before. CAUGHT
    means that the ball now stands on the surface. ROLLS means that it goes on as if this surface
    and its last support were the same surface.

    Args:
        contact: state of contact mode. Without it every ball bounces.
        tree: tree of the obstacles.
        motion: base position and velocity of each ball, shape (n, 6).
        event: the ball and the present time.
        obstacle: number of the obstacle that is hit.
        at: position and velocity of the ball.
        away: any vector along the normal, from the surface to the ball.
    """
    if contact is None:
        return BOUNCES
    scale = 1.0 / math.sqrt(dot(away, away))
    normal = Vec3(scale * away.x, scale * away.y, scale * away.z)
    bend = math.inf
    if tree.kinds[obstacle] == CAPSULE:
        bend = radius_of_ball(contact.sizes, tree.radius, event.ball)
    return touch_down(contact, motion, event, obstacle, bend, at, normal)


@jit
def touch_down(
    contact: ContactState,
    motion: np.ndarray,
    event: BallEvent,
    obstacle: int,
    bend: float,
    at: BallState,
    normal: Vec3,
) -> int:
    """Let a ball land on any still object if it can, and return BOUNCES, ROLLS or CAUGHT.

    The three results are explained in ``land``.

    Args:
        contact: state of contact mode.
        motion: base position and velocity of each ball, shape (n, 6).
        event: the ball and the present time.
        obstacle: number of the obstacle, or ON_BALL minus the number of a ball that lies still.
        bend: radius [m] of the path of the ball's centre round the object; infinite on a plane.
        at: position and velocity of the ball.
        normal: unit normal of the object, towards the ball.
    """
    ball, supports, velocity = event.ball, contact.supports, at.velocity
    speed = math.sqrt(dot(velocity, velocity))
    approach = max(0.0, -dot(normal, velocity))
    presses = dot(normal, contact.gravity) < 0.0
    reach = math.inf
    if bend < math.inf:  # a ball on a round object comes down again more slowly than capture
        weight = math.sqrt(dot(contact.gravity, contact.gravity))
        reach = (
            COMES_DOWN
            * bend
            * contact.capture
            / max(speed, math.sqrt(weight * bend), contact.capture)
        )
    if rides(contact.ride, ball):
        return BOUNCES
    neighbour, last = _smooth_neighbour(contact, ball, normal)
    forget_left_support(contact, ball)
    if neighbour != NO_SUPPORT and presses:
        crease = cross(last, normal)
        sine = math.sqrt(dot(crease, crease))
        if approach <= FACET_HOP * speed * sine + contact.capture:
            stays = neighbour >= 0 and _lies_in_valley(contact, last, normal, velocity)
            if neighbour >= 0 and not stays:
                drop_support(supports, ball, neighbour)
            flat = add_scaled(velocity, approach, normal)
            size = math.sqrt(dot(flat, flat))
            # the velocity is turned into the new face's plane, not slowed
            if not stays and size > 0.5 * speed:
                velocity = Vec3(flat.x * speed / size, flat.y * speed / size, flat.z * speed / size)
            add_support(supports, ball, obstacle, normal, at.position, reach)
            settle(contact, motion, event, BallState(at.position, velocity))
            return ROLLS
    acceleration = vec3_at(contact.acceleration, ball)
    supported = supports.number[ball] > 0  # a ball between two surfaces would bounce without end
    if approach < contact.capture and (presses or supported or dot(normal, acceleration) < 0.0):
        add_support(supports, ball, obstacle, normal, at.position, reach)
        settle(contact, motion, event, at)
        return CAUGHT
    return BOUNCES


@jit
def _smooth_neighbour(contact: ContactState, ball: int, normal: Vec3) -> tuple[int, Vec3]:
    """Find the support of a ball whose normal is nearest to ``normal``, at most 25° from it.

    The support that the ball has just left counts too.

    Returns: the support's number and its unit normal. The number is LAST_LEFT for the support just
    left. It is NO_SUPPORT if no normal is near enough, and the normal has no meaning then.
    """
    found, best, last = NO_SUPPORT, ONE_SURFACE, normal
    for support in range(contact.supports.number[ball]):
        other = support_normal(contact.supports, ball, support)
        if dot(normal, other) > best:
            found, best, last = support, dot(normal, other), other
    # zero, and so never the best, if no support was just left
    left = vec3_at(contact.left_normal, ball)
    if dot(normal, left) > best:
        found, last = LAST_LEFT, left
    return found, last


@jit
def _lies_in_valley(contact: ContactState, one: Vec3, two: Vec3, velocity: Vec3) -> bool:
    """Return True if a ball hardly moves across the bottom of a valley between two faces.

    In a valley both faces run down to their common edge. Such a ball stays on both faces. ``one``,
    ``two``: unit normals of the faces.
    """
    gravity = contact.gravity
    down_one = add_scaled(gravity, -dot(gravity, one), one)
    down_two = add_scaled(gravity, -dot(gravity, two), two)
    crease = cross(one, two)
    sine = math.sqrt(dot(crease, crease))
    if dot(two, down_one) >= 0.0 or dot(one, down_two) >= 0.0 or sine == 0.0:
        return False
    across = add_scaled(velocity, -dot(velocity, crease) / (sine * sine), crease)
    return dot(across, across) < contact.capture * contact.capture


@jit
def end_path(
    contact: ContactState, motion: np.ndarray, event: BallEvent, reason: int, at: BallState
) -> bool:
    """Set the new path of a ball that stands on supports, at the end of its present path.

    Args:
        contact: state of contact mode.
        motion: base position and velocity of each ball, shape (n, 6).
        event: the ball and the present time.
        reason: why the path ends: BRAKE_ENDS, WAKES, or LEAVES_SUPPORT minus a support's number.
        at: position and velocity of the ball.

    Returns: False, with nothing changed, if ``reason`` is none of these.
    """
    ball = event.ball
    if reason <= LEAVES_SUPPORT:
        support = LEAVES_SUPPORT - reason
        set_vec3(contact.left_normal, ball, support_normal(contact.supports, ball, support))
        drop_support(contact.supports, ball, support)
        settle(contact, motion, event, at)
        return True
    if reason == BRAKE_ENDS:
        velocity, acceleration = at.velocity, vec3_at(contact.acceleration, ball)
        # The resistance has used up the remaining speed: the ball did not merely get a new
        # direction.
        if dot(velocity, velocity) <= 1e-18 * max(1.0, dot(acceleration, acceleration)):
            velocity = Vec3(0.0, 0.0, 0.0)
        settle(contact, motion, event, BallState(at.position, velocity))
        return True
    if reason == WAKES:
        settle(contact, motion, event, at)
        return True
    return False
