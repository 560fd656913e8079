"""Collision of two balls of which at least one is in contact mode: it slides, rolls or lies still.

A fast hit is an ordinary collision. A surface behind a ball that is hit reacts in the next event.

A slow hit is slower than Restitution.elastic_below. For slow hits a ball that lies still acts as a
still surface: friction holds it. This neglects an energy per mass below elastic_below²/2. A slow
hit between two moving balls is a single constrained impact: the velocity of a ball on supports
changes only by the projection P(d) of an impulse along the unit vector d onto the directions that
the supports leave free. The inverse mass of such a ball along d is therefore |P(d)|² in place of 1,
and an elastic hit keeps the energy of the two balls together. For balls of unequal mass the inverse
masses and velocity changes are weighted as in effects/ball_sizes.py. Slow hits between moving balls
have no friction.

Source: B. Brogliato, Nonsmooth Mechanics (2016), section 5.2.
"""

import math

import numpy as np

from sim_core.contact.jamming import count_slow_hit
from sim_core.contact.landing_and_lift_off import impart, touch_down
from sim_core.contact.pushed_by_part import drop_pressed_balls, is_pressed, note_touch
from sim_core.contact.supports import BLOCKED, SHORTEST_HOP, response
from sim_core.effects.ball_sizes import least_share_by_mass, reach_of_pair, share_by_mass
from sim_core.effects.contact_mode import ASLEEP, BOUNCES, ON_BALL, ContactState
from sim_core.effects.friction import OF_BALLS, FrictionState
from sim_core.effects.restitution import BALLS, RestitutionState, restitution_law
from sim_core.impulses.collision import pair_velocity_change
from sim_core.impulses.friction import add_pair_friction, add_surface_friction
from sim_core.motion import BallEvent, BallState, state_under
from sim_core.numerics.jit import jit
from sim_core.numerics.vec3 import Vec3, dot, scaled, sub, vec3_at

# m/s. Balls in touch that part more slowly stay in touch. Slow hits part two balls twice as fast,
# because rounding would make two balls with e = 0 meet again for ever.
PARTING = 1e-9


@jit
def place(contact: ContactState, motion: np.ndarray, ball: int, time: float) -> BallState:
    """Return a ball's position [m] and velocity [m/s] at ``time`` since the time window's start."""
    return state_under(motion, ball, time, vec3_at(contact.acceleration, ball))


@jit
def meet(
    contact: ContactState,
    motion: np.ndarray,
    one: BallEvent,
    two: BallEvent,
    restitution: RestitutionState | None,
) -> bool:
    """Change the paths of two balls that collide, of which at least one is in contact mode.

    Returns: True if a ball that lay still has been moved, so that its neighbours must be woken.
    """
    sizes = contact.sizes
    first = place(contact, motion, one.ball, one.time)
    second = place(contact, motion, two.ball, two.time)
    apart, closing = sub(second.position, first.position), sub(second.velocity, first.velocity)
    distance = math.sqrt(dot(apart, apart))
    approach = -dot(apart, closing) / distance
    if approach < -PARTING:
        return False
    approach = max(approach, 0.0)  # balls that are pressed together have no approach speed
    still_one = contact.mode[one.ball] >= ASLEEP
    still_two = contact.mode[two.ball] >= ASLEEP
    slow = approach < contact.elastic_below
    pressed = is_pressed(contact, one) or is_pressed(contact, two)
    scale = 1.0 / distance
    normal = Vec3(scale * apart.x, scale * apart.y, scale * apart.z)
    back = scaled(-1.0, normal)
    if slow and (still_one or still_two) and not pressed:
        e = _of_balls(restitution, approach)
        rebound = (1.0 + e) * approach
        if still_one:
            _land_on_ball(contact, motion, two, one.ball, second, normal, rebound)
        else:
            _land_on_ball(contact, motion, one, two.ball, first, back, rebound)
    elif not slow:
        change = pair_velocity_change(apart, closing, restitution)
        change = add_pair_friction(
            contact.friction_state, sizes, one.ball, two.ball, one.time, apart, closing, change
        )
        opposite = scaled(-1.0, change)
        impart(contact, motion, one, first, share_by_mass(sizes, one.ball, two.ball, change))
        impart(contact, motion, two, second, share_by_mass(sizes, two.ball, one.ball, opposite))
    else:
        if pressed:
            drop_pressed_balls(contact, one.ball, back)
            drop_pressed_balls(contact, two.ball, normal)
        give_one, give_two = response(contact, one.ball, back), response(contact, two.ball, normal)
        give_one = share_by_mass(sizes, one.ball, two.ball, give_one)
        give_two = share_by_mass(sizes, two.ball, one.ball, give_two)
        blocked = BLOCKED * least_share_by_mass(sizes, one.ball, two.ball)
        inverse_mass = max(dot(give_two, normal) - dot(give_one, normal), blocked)
        press = _press(contact.friction_state, contact, one.ball, two.ball, normal)
        push = (approach + max(approach, SHORTEST_HOP * press, 2.0 * PARTING)) / inverse_mass
        impart(contact, motion, one, first, scaled(push, give_one))
        impart(contact, motion, two, second, scaled(push, give_two))
    if pressed:
        note_touch(contact, one)
        note_touch(contact, two)
    count_slow_hit(contact, motion, one, first.position, slow)
    count_slow_hit(contact, motion, two, second.position, slow)
    return (still_one or still_two) and (pressed or not slow)


@jit
def _land_on_ball(
    contact: ContactState,
    motion: np.ndarray,
    event: BallEvent,
    other: int,
    at: BallState,
    normal: Vec3,
    rebound: float,
) -> None:
    """Let a ball land on, or bounce off, another ball that lies still and acts as a surface.

    Args:
        contact: state of contact mode.
        motion: base position and velocity of each ball, shape (n, 6).
        event: the ball that hits, and the time. Nothing happens if this ball lies still too.
        other: number of the ball that lies still.
        at: position and velocity of the ball that hits.
        normal: unit vector from the other ball to the ball that hits.
        rebound: change of the normal velocity [m/s] if the ball bounces.
    """
    ball = event.ball
    if contact.mode[ball] >= ASLEEP:
        return
    sizes, obstacle = contact.sizes, ON_BALL - other
    bend = reach_of_pair(sizes, contact.reach, ball, other)
    if touch_down(contact, motion, event, obstacle, bend, at, normal) == BOUNCES:
        change = add_surface_friction(
            contact.friction_state,
            sizes,
            ball,
            event.time,
            normal,
            at.velocity,
            scaled(rebound, normal),
            OF_BALLS,
        )
        impart(contact, motion, event, at, change)


@jit
def _of_balls(restitution: RestitutionState | None, speed: float) -> float:
    """Return the coefficient of restitution [-] of two balls that meet at a ``speed`` [m/s].

    It is 1 in a scene without restitution. In contact mode hits slower than elastic_below lose
    speed too.
    """
    if restitution is None:
        return 1.0
    return restitution_law(restitution.points, BALLS, speed)


@jit
def _press(
    friction_state: FrictionState | None, contact: ContactState, one: int, two: int, normal: Vec3
) -> float:
    """Return the acceleration [m/s²] that presses two balls together along ``normal``.

    ``normal`` is the unit vector from ball ``one`` to ball ``two``. With friction the result is at
    most twice gravity: only balls that slip press harder, and their slip soon ends.
    """
    accelerations = contact.acceleration
    press = -dot(sub(vec3_at(accelerations, two), vec3_at(accelerations, one)), normal)
    if friction_state is None:
        return press
    return min(press, 2.0 * math.sqrt(dot(contact.gravity, contact.gravity)))
