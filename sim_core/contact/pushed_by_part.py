"""The turning part moves what it touches, slow or not, and that moves what lies still in its way.

A slow hit is a single constrained impact, as that of two balls in leaning.py.
"""

import math

import numpy as np

from sim_core.contact.constrained_impulse import BLOCKED, SHORTEST_HOP, impart, response
from sim_core.effects.contact_mode import (
    DRIVEN,
    ON_BALL,
    ROLLING,
    SUPPORTS,
    TOUCHED,
    ContactState,
    drop_support,
    support_normal,
)
from sim_core.effects.part_rotation import RotationState, to_room_frame
from sim_core.motion import BallState, change_velocity
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.vec3 import Vec3, dot, scaled

TOUCHING = (
    1e-2  # s: what lies on a turning part is touched by it more often, in hops of 10 mm/s each 2 ms
)
PRESSED = 2  # of DRIVEN


@inlined
def taken_from_part(
    contact: ContactState | None,
    rotation: RotationState,
    ball: int,
    time: float,
    away: Vec3,
    into: float,
    change: Vec3,
) -> Vec3:
    """The velocity change [m/s] of a ball that the turning part hits at ``into`` [m/s], without friction.

    ``change`` [m/s]: what a free ball would take; ``away`` points to it from where it is touched, in the part's frame.
    """
    if contact is None:
        return change
    if into >= contact.slow:
        return change
    return _constrained(
        contact,
        ball,
        to_room_frame(rotation, scaled(1.0 / math.sqrt(dot(away, away)), away), time),
        into,
    )


@jit
def _constrained(contact: ContactState, ball: int, normal: Vec3, into: float) -> Vec3:
    let_go(contact, ball, normal)
    give = response(contact, ball, normal)
    lift = SHORTEST_HOP * math.sqrt(
        dot(contact.gravity, contact.gravity)
    )  # what lies on it hops, not too often
    return scaled((into + max(into, lift)) / max(dot(give, normal), BLOCKED), give)


@inlined
def drive(
    contact: ContactState | None,
    motion: np.ndarray,
    ball: int,
    time: float,
    time_since_start: float,
    here: BallState,
    change: Vec3,
) -> None:
    """The turning part changes a ball's velocity by ``change`` [m/s]."""
    if contact is None:
        change_velocity(motion, ball, time, change)
        return
    contact.marks[ball, ROLLING] = 0
    impart(contact, motion, ball, time, time_since_start, here, change)
    touch(contact, ball, time_since_start)


@jit
def touch(contact: ContactState, ball: int, time_since_start: float) -> None:
    """Note that the turning part, or what it presses, has touched a ball."""
    contact.marks[ball, DRIVEN] = max(contact.marks[ball, DRIVEN], 1)
    contact.memory[ball, TOUCHED] = time_since_start


@jit
def is_pressed(contact: ContactState, ball: int, time_since_start: float) -> bool:
    """True when the turning part pushes a ball that gets nowhere: what lies still in its way must give way."""
    return (
        contact.marks[ball, DRIVEN] == PRESSED
        and time_since_start - contact.memory[ball, TOUCHED] < TOUCHING
    )


@jit
def let_go(contact: ContactState, ball: int, push: Vec3) -> None:
    """Take away the feet on balls that a push presses: those must give way or press back."""
    support = 0
    while support < contact.marks[ball, SUPPORTS]:
        if (
            contact.rows[ball, support] <= ON_BALL
            and dot(support_normal(contact, ball, support), push) < 0.0
        ):
            drop_support(contact, ball, support)
        else:
            support += 1
