"""Motion of the balls between events, in a frame that falls freely with gravity.

Notation:
    x(t) = base + velocity t + ½ a t²: position of a ball [m]; ``motion`` holds base (0:3) [m] and
        velocity (3:6) [m/s] of each ball, shape (n, 6)
    t: time since the start of the present time window [s]. A window lasts about ``WINDOW``. At
        its start the clock, one clock for all balls, begins anew at 0.
    a: acceleration [m/s²], equal to gravity unless the ball is in contact mode

In this frame every ball in flight moves along a straight line. The numbers of a ball change only at
its events. Time windows keep t and its rounding small.
"""

from typing import NamedTuple

import numpy as np

from sim_core.effects.contact_mode import ContactState, ball_acceleration
from sim_core.effects.gravity import Gravity
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.vec3 import Vec3, add_scaled

# s: rounding of t is 3e-18 s, and a ball at 20 m/s moves 0.4 m. A longer window loses digits, and a
# shorter window costs more changes of the clock.
WINDOW = 0.02


class BallEvent(NamedTuple):
    """Number of a ball that collides or changes its path, and the time at which it does.

    Args:
        ball: number of the ball.
        time: time since the start of the present time window [s].
        time_since_start: time since the start of the scene [s].
    """

    ball: int
    time: float
    time_since_start: float


class BallState(NamedTuple):
    """Position of a ball's centre [m] and its velocity [m/s] at one time."""

    position: Vec3
    velocity: Vec3


@jit
def free_fall_position(motion: np.ndarray, ball: int, time: float) -> Vec3:
    """Return a ball's position [m] at ``time`` [s] in the free-fall frame, without ½ a t²."""
    return Vec3(
        motion[ball, 0] + motion[ball, 3] * time,
        motion[ball, 1] + motion[ball, 4] * time,
        motion[ball, 2] + motion[ball, 5] * time,
    )


@inlined
def state_under(motion: np.ndarray, ball: int, time: float, acceleration: Vec3) -> BallState:
    """Return a ball's position and velocity at ``time`` [s], under its ``acceleration`` [m/s²]."""
    position = add_scaled(free_fall_position(motion, ball, time), 0.5 * time * time, acceleration)
    velocity = add_scaled(
        Vec3(motion[ball, 3], motion[ball, 4], motion[ball, 5]), time, acceleration
    )
    return BallState(position, velocity)


@inlined
def change_velocity(motion: np.ndarray, ball: int, time: float, change: Vec3) -> None:
    """Add ``change`` [m/s] to a ball's velocity at ``time`` [s]. Its position at ``time`` stays."""
    here = free_fall_position(motion, ball, time)
    for axis, (now, add) in enumerate(((here.x, change.x), (here.y, change.y), (here.z, change.z))):
        velocity = motion[ball, 3 + axis] + add
        motion[ball, axis] = now - velocity * time
        motion[ball, 3 + axis] = velocity


@inlined
def set_path(
    motion: np.ndarray, ball: int, time: float, here: BallState, acceleration: Vec3
) -> None:
    """Set a ball's row of ``motion`` to the parabola with a given state at ``time`` [s].

    Args:
        motion: base position and velocity of each ball, shape (n, 6).
        ball: number of the ball.
        time: time since the start of the present time window [s].
        here: position and velocity of the ball at ``time``.
        acceleration: acceleration of the ball from then on [m/s²].
    """
    for axis in range(3):
        velocity = here.velocity[axis] - acceleration[axis] * time
        motion[ball, axis] = (
            here.position[axis] - (velocity + 0.5 * acceleration[axis] * time) * time
        )
        motion[ball, 3 + axis] = velocity


@jit
def shift_motion(
    motion: np.ndarray, window: float, gravity: Gravity | None, contact: ContactState | None = None
) -> None:
    """Rewrite every ball's row of ``motion`` for a clock that starts ``window`` [s] later.

    The paths of the balls stay the same.
    """
    for ball in range(len(motion)):
        acceleration = ball_acceleration(contact, ball, gravity)
        for axis, a in enumerate((acceleration.x, acceleration.y, acceleration.z)):
            motion[ball, axis] += window * (motion[ball, 3 + axis] + 0.5 * a * window)
            motion[ball, 3 + axis] += a * window
