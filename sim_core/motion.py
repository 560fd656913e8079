"""Motion between events, in the free-fall frame.

Notation:
    x(t) = base + velocity t + ½ a t²: position of a ball [m]; ``motion`` holds base (0:3) [m] and
        velocity (3:6) [m/s] of each ball, shape (n, 6)
    t: time on the window's clock [s], one clock for all balls
    a: acceleration [m/s²], equal to gravity unless the ball is in contact mode

The difference between two balls is a straight line in this frame. Pairs need no clock of their own,
and the numbers of a ball change only at its events. The clock's zero moves on every window, so that
t and its rounding stay small.
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
    """A ball, and the time of its event.

    Args:
        time: time on the window's clock [s].
        time_since_start: time since the start of the scene [s].
    """

    ball: int
    time: float
    time_since_start: float


class BallState(NamedTuple):
    """Position of a ball's centre [m] and velocity [m/s] at some time."""

    position: Vec3
    velocity: Vec3


@jit
def free_fall_position(motion: np.ndarray, ball: int, time: float) -> Vec3:
    """Position in the free-fall frame [m]: x(t) - ½ a t²."""
    return Vec3(
        motion[ball, 0] + motion[ball, 3] * time,
        motion[ball, 1] + motion[ball, 4] * time,
        motion[ball, 2] + motion[ball, 5] * time,
    )


@inlined
def state_under(motion: np.ndarray, ball: int, time: float, acceleration: Vec3) -> BallState:
    """State of a ball under its own acceleration [m/s²] at a time of the window."""
    position = add_scaled(free_fall_position(motion, ball, time), 0.5 * time * time, acceleration)
    velocity = add_scaled(
        Vec3(motion[ball, 3], motion[ball, 4], motion[ball, 5]), time, acceleration
    )
    return BallState(position, velocity)


@inlined
def change_velocity(motion: np.ndarray, ball: int, time: float, change: Vec3) -> None:
    """Change a ball's velocity by ``change`` [m/s] at ``time``, with its position kept."""
    here = free_fall_position(motion, ball, time)
    for axis, (now, add) in enumerate(((here.x, change.x), (here.y, change.y), (here.z, change.z))):
        velocity = motion[ball, 3 + axis] + add
        motion[ball, axis] = now - velocity * time
        motion[ball, 3 + axis] = velocity


@inlined
def set_path(
    motion: np.ndarray, ball: int, time: float, here: BallState, acceleration: Vec3
) -> None:
    """Give a ball the path through ``here`` at ``time`` under its own acceleration [m/s²]."""
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
    """Move the clock's zero of the motion forward by ``window`` [s]."""
    for ball in range(len(motion)):
        acceleration = ball_acceleration(contact, ball, gravity)
        for axis, a in enumerate((acceleration.x, acceleration.y, acceleration.z)):
            motion[ball, axis] += window * (motion[ball, 3 + axis] + 0.5 * a * window)
            motion[ball, 3 + axis] += a * window
