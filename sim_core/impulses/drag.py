"""The air's kicks: in the middle of each piece of a flight, and what is owed or was too much when something happens.

A ball is not kicked on leaving what it has hit: where it bounces a thousand times on its way up with the sonotrode, a
kick that is given back at the next bounce, the other way up, would take from each bounce and leave none.
A ball in contact mode is left alone, as it is slow: 3 mm steel that rolls at 1.7 m/s loses to the air what it loses by
default to rolling (Rest.resistance).
"""

import math

import numpy as np

from sim_core.effects.contact_mode import FLYING, MODE, ContactState, ball_acceleration
from sim_core.effects.drag import UNTIL, Air, slowing
from sim_core.effects.gravity import Gravity
from sim_core.motion import kick, point_under
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.roots import NEVER
from sim_core.numerics.vec3 import Vec3, dot

EARLY = 1.999  # half pieces: a kick that rounding makes early is on time


@inlined
def flies(contact: ContactState | None, ball: int) -> bool:
    """True for a ball that is not in contact mode."""
    if contact is None:
        return True
    return contact.marks[ball, MODE] == FLYING


@inlined
def piece_left(air: Air | None, contact: ContactState | None, ball: int, time: float) -> float:
    """For how long [s] the ball's path is good as far as the air goes."""
    if air is None or not flies(contact, ball):
        return NEVER
    return max(air.balls[ball, UNTIL] + air.half - time, 0.0)


@inlined
def _change(
    air: Air,
    contact: ContactState | None,
    motion: np.ndarray,
    ball: int,
    time: float,
    gravity: Gravity | None,
    span: float,
) -> Vec3:
    """Of the velocity [m/s], by so many seconds of air."""
    velocity = point_under(motion, ball, time, ball_acceleration(contact, ball, gravity)).velocity
    lost = slowing(air, ball, math.sqrt(dot(velocity, velocity)), span) - 1.0
    return Vec3(lost * velocity.x, lost * velocity.y, lost * velocity.z)


@inlined
def catch_up(
    air: Air | None,
    contact: ContactState | None,
    motion: np.ndarray,
    ball: int,
    time: float,
    gravity: Gravity | None,
) -> None:
    """Make the ball's velocity what the air has made of it by now."""
    if air is None:
        return
    if flies(contact, ball):
        span = time - air.balls[ball, UNTIL]
        kick(motion, ball, time, _change(air, contact, motion, ball, time, gravity, span))
    air.balls[ball, UNTIL] = time


@inlined
def goes_on(
    air: Air | None,
    contact: ContactState | None,
    motion: np.ndarray,
    ball: int,
    time: float,
    gravity: Gravity | None,
) -> bool:
    """The ball flies on: True if it is in the middle of a piece, and its path now another."""
    if air is None:
        return False
    span = time + air.half - air.balls[ball, UNTIL]
    if span < EARLY * air.half or not flies(contact, ball):
        return False
    kick(motion, ball, time, _change(air, contact, motion, ball, time, gravity, span))
    air.balls[ball, UNTIL] = time + air.half
    return True


@jit
def catch_all_up(
    air: Air | None, contact: ContactState | None, velocities: np.ndarray, time: float
) -> None:
    """Make velocities (n, 3) [m/s] in flight what the air has made of them by ``time``, no half piece ahead."""
    if air is None:
        return
    for ball in range(len(velocities)):
        if not flies(contact, ball):
            continue
        x, y, z = velocities[ball, 0], velocities[ball, 1], velocities[ball, 2]
        share = slowing(air, ball, math.sqrt(x * x + y * y + z * z), time - air.balls[ball, UNTIL])
        for axis in range(3):
            velocities[ball, axis] *= share
