"""Two balls meet, and at least one is not in free flight.

A fast hit is the ordinary one: what a surface behind the ball does to it is the next event. To a slow one (below
Restitution.elastic_below) a ball that lies still is a still surface: friction holds it, and what would be handed on
is below elastic_below²/2 of energy per mass. Between balls on the move a slow hit is a single constrained impact: a
ball that stands on feet takes from an impulse along d only what they leave of it, P(d), so its share of the inverse
mass is |P(d)|² in place of 1, and elastic means elastic for the two together (Brogliato, Nonsmooth Mechanics (2016),
section 5.2). Slow hits between moving balls do not rub.
"""

import math

import numpy as np

from sim_core.contact.constrained_impulse import (
    BLOCKED,
    SHORTEST_HOP,
    acceleration_of,
    impart,
    place,
    response,
)
from sim_core.contact.jamming import watch
from sim_core.contact.pushed_by_part import is_pressed, let_go, touch
from sim_core.contact.support_changes import BOUNCES, touch_down
from sim_core.effects.contact_mode import ASLEEP, MODE, ON_BALL, ContactState
from sim_core.effects.friction import OF_BALLS, FrictionState
from sim_core.effects.restitution import Restitution, restitution_law
from sim_core.impulses.collision import pair_velocity_change
from sim_core.impulses.friction import add_pair_friction, add_surface_friction
from sim_core.motion import BallState
from sim_core.numerics.jit import jit
from sim_core.numerics.vec3 import Vec3, dot, scaled, sub

# m/s: balls in touch that part by less are in touch for good. Slow hits part them twice as fast: two that went on as
# one (e = 0) would meet for ever by rounding
PARTING = 1e-9


@jit
def meet(
    contact: ContactState,
    motion: np.ndarray,
    one: int,
    two: int,
    time: float,
    time_since_start: float,
    restitution: Restitution | None,
    radius: float,
) -> bool:
    """Two balls meet now; True when one that lay still is moved, so that what leans on it must be woken."""
    first, second = place(contact, motion, one, time), place(contact, motion, two, time)
    apart, closing = sub(second.position, first.position), sub(second.velocity, first.velocity)
    distance = math.sqrt(dot(apart, apart))
    into = -dot(apart, closing) / distance
    if into < -PARTING:
        return False
    into = max(into, 0.0)  # pressed together without any speed
    still_one, still_two = contact.marks[one, MODE] >= ASLEEP, contact.marks[two, MODE] >= ASLEEP
    slow = into < contact.slow
    pressed = is_pressed(contact, one, time_since_start) or is_pressed(
        contact, two, time_since_start
    )
    scale = 1.0 / distance
    normal = Vec3(scale * apart.x, scale * apart.y, scale * apart.z)
    if slow and still_one and not pressed:
        _land_on(
            contact,
            motion,
            two,
            one,
            time,
            time_since_start,
            second,
            normal,
            into,
            restitution,
            radius,
        )
    elif slow and still_two and not pressed:
        _land_on(
            contact,
            motion,
            one,
            two,
            time,
            time_since_start,
            first,
            scaled(-1.0, normal),
            into,
            restitution,
            radius,
        )
    elif not slow:
        change = pair_velocity_change(apart, closing, restitution)
        change = add_pair_friction(contact.friction_state, one, two, time, apart, closing, change)
        impart(contact, motion, one, time, time_since_start, first, change)
        impart(contact, motion, two, time, time_since_start, second, scaled(-1.0, change))
    else:
        if pressed:
            let_go(contact, one, scaled(-1.0, normal))
            let_go(contact, two, normal)
        give_one, give_two = (
            response(contact, one, scaled(-1.0, normal)),
            response(contact, two, normal),
        )
        total = max(dot(give_two, normal) - dot(give_one, normal), BLOCKED)
        press = _press(contact.friction_state, contact, one, two, normal)
        push = (into + max(into, SHORTEST_HOP * press, 2.0 * PARTING)) / total
        impart(contact, motion, one, time, time_since_start, first, scaled(push, give_one))
        impart(contact, motion, two, time, time_since_start, second, scaled(push, give_two))
    if pressed:
        touch(contact, one, time_since_start)
        touch(contact, two, time_since_start)
    watch(contact, motion, one, time, time_since_start, first.position, slow, radius)
    watch(contact, motion, two, time, time_since_start, second.position, slow, radius)
    return (still_one or still_two) and (pressed or not slow)


@jit
def _land_on(
    contact: ContactState,
    motion: np.ndarray,
    ball: int,
    other: int,
    time: float,
    time_since_start: float,
    here: BallState,
    normal: Vec3,
    into: float,
    restitution: Restitution | None,
    radius: float,
) -> None:
    """A ball meets one that lies still: a surface like others."""
    if contact.marks[ball, MODE] >= ASLEEP:
        return
    landed = touch_down(
        contact, motion, ball, ON_BALL - other, 2.0 * radius, time, time_since_start, here, normal
    )
    if landed == BOUNCES:
        e = 1.0 if restitution is None else _law(restitution, into)
        change = scaled((1.0 + e) * into, normal)
        change = add_surface_friction(
            contact.friction_state, ball, time, normal, here.velocity, change, OF_BALLS
        )
        impart(contact, motion, ball, time, time_since_start, here, change)


@jit
def _law(restitution: Restitution, speed: float) -> float:
    return restitution_law(speed, restitution.balls[0], restitution.balls[1])


@jit
def _press(
    friction_state: FrictionState | None, contact: ContactState, one: int, two: int, normal: Vec3
) -> float:
    """How hard two balls are pressed together [m/s²]; by a slip that ends soon no harder than by two weights."""
    press = -dot(sub(acceleration_of(contact, two), acceleration_of(contact, one)), normal)
    if friction_state is None:
        return press
    return min(press, 2.0 * math.sqrt(dot(contact.gravity, contact.gravity)))
