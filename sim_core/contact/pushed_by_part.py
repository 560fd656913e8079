"""Pushes by the turning part: on the balls that it touches, and on still balls in their way.

A slow hit, slower than Restitution.elastic_below, moves a ball only where its supports leave it
free, as between two balls in ball_on_ball.py.
"""

import math

import numpy as np

from sim_core.contact.landing_and_lift_off import deflect
from sim_core.contact.supports import BLOCKED, SHORTEST_HOP, drop_support, response, support_normal
from sim_core.effects.contact_mode import ON_BALL, PRESSED, TOUCHED, ContactState
from sim_core.effects.part_rotation import RotationState, to_room_frame
from sim_core.motion import BallEvent, BallState
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.vec3 import Vec3, dot, scaled

# s. A ball that lies on a turning part is touched more often: its hops at 10 mm/s last 2 ms.
TOUCHING = 1e-2


@inlined
def constrained_change(
    contact: ContactState | None,
    rotation: RotationState,
    event: BallEvent,
    away: Vec3,
    approach: float,
    change: Vec3,
) -> Vec3:
    """Return the velocity change [m/s] of a ball that the turning part hits, without friction.

    A hit slower than ContactState.elastic_below moves the ball only where its supports leave it
    free. For a faster hit the result is ``change``.

    ``change``: velocity change [m/s] of a free ball.
    ``away``: vector from the touched point to the ball, in the part's frame.
    ``approach``: speed [m/s] of the hit along the normal.
    """
    if contact is None:
        return change
    if approach >= contact.elastic_below:
        return change
    unit = scaled(1.0 / math.sqrt(dot(away, away)), away)
    return _constrained(contact, event.ball, to_room_frame(rotation, unit, event.time), approach)


@jit
def _constrained(contact: ContactState, ball: int, normal: Vec3, approach: float) -> Vec3:
    drop_pressed_balls(contact, ball, normal)
    give = response(contact, ball, normal)
    # A ball that lies on the part hops, but not too often.
    lift = SHORTEST_HOP * math.sqrt(dot(contact.gravity, contact.gravity))
    return scaled((approach + max(approach, lift)) / max(dot(give, normal), BLOCKED), give)


@inlined
def push_ball(
    contact: ContactState | None, motion: np.ndarray, event: BallEvent, at: BallState, change: Vec3
) -> None:
    """Add ``change`` [m/s] to the velocity of a ball hit by the turning part, and note the time."""
    deflect(contact, motion, event, at, change)
    note_touch(contact, event)


@jit
def note_touch(contact: ContactState | None, event: BallEvent) -> None:
    """Note that the turning part, or a ball that the part presses, touches the event's ball now."""
    if contact is None:
        return
    hits, ball = contact.slow_hits, event.ball
    hits.part_contact[ball] = max(hits.part_contact[ball], TOUCHED)
    hits.touched_at[ball] = event.time_since_start


@jit
def is_pressed(contact: ContactState, event: BallEvent) -> bool:
    """Return True if the turning part presses a ball that cannot give way to it.

    The balls around this ball must then move.
    """
    hits, ball = contact.slow_hits, event.ball
    recent = event.time_since_start - hits.touched_at[ball] < TOUCHING
    return bool(hits.part_contact[ball] == PRESSED and recent)


@jit
def drop_pressed_balls(contact: ContactState, ball: int, push: Vec3) -> None:
    """Remove those supports of a ball that are other balls into which it is pushed.

    Those balls must give way or press back. ``push``: direction in which the ball is pushed.
    """
    supports = contact.supports
    for support in range(supports.number[ball] - 1, -1, -1):
        on_ball = supports.obstacles[ball, support] <= ON_BALL
        if on_ball and dot(support_normal(supports, ball, support), push) < 0.0:
            drop_support(supports, ball, support)
