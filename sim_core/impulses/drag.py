"""Slow balls down by air drag, with one impulse in the middle of each short piece of a flight.

If an event comes before the end of a piece, the ball's velocity is corrected.

A ball gets no impulse at the moment when it leaves an obstacle. The next bounce would take such an
impulse back in the opposite direction, and so each bounce would lose energy. A ball that bounces a
thousand times on its way up with the sonotrode would lose all of it. A ball in contact mode gets no
impulse either, because it is slow: at 1.7 m/s a rolling steel ball of 3 mm loses as much to the air
as it loses by default to rolling (Rest.resistance).
"""

import math

import numpy as np

from sim_core.effects.contact_mode import ContactState, ball_acceleration, is_flying
from sim_core.effects.drag import DragState, remaining_speed
from sim_core.effects.gravity import Gravity
from sim_core.motion import change_velocity, state_under
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.roots import NEVER
from sim_core.numerics.vec3 import Vec3, dot, scaled

ON_TIME = 1.999  # half pieces: an impulse that rounding makes early is on time


@inlined
def time_to_next_drag(
    drag: DragState | None, contact: ContactState | None, ball: int, time: float
) -> float:
    """Return the time [s] until the ball's next impulse by the air.

    It is NEVER without drag, and for a ball that is not in flight.
    """
    if drag is None or not is_flying(contact, ball):
        return NEVER
    return float(max(drag.acted_until[ball] + drag.half - time, 0.0))


@inlined
def _change(
    drag: DragState,
    contact: ContactState | None,
    motion: np.ndarray,
    ball: int,
    time: float,
    gravity: Gravity | None,
    span: float,
) -> Vec3:
    """Return the velocity change [m/s] of a ball at ``time`` [s] by ``span`` [s] of air drag."""
    velocity = state_under(motion, ball, time, ball_acceleration(contact, ball, gravity)).velocity
    speed = math.sqrt(dot(velocity, velocity))
    return scaled(remaining_speed(drag, ball, speed, span) - 1.0, velocity)


@inlined
def apply_drag_until(
    drag: DragState | None,
    contact: ContactState | None,
    motion: np.ndarray,
    ball: int,
    time: float,
    gravity: Gravity | None,
) -> None:
    """Correct a ball's velocity at an event so that the air has acted exactly until ``time`` [s].

    Before this call the air may have acted for too short or for too long a time.
    """
    if drag is None:
        return
    if is_flying(contact, ball):
        span = time - drag.acted_until[ball]
        change = _change(drag, contact, motion, ball, time, gravity, span)
        change_velocity(motion, ball, time, change)
    drag.acted_until[ball] = time


@inlined
def apply_drag_piece(
    drag: DragState | None,
    contact: ContactState | None,
    motion: np.ndarray,
    ball: int,
    time: float,
    gravity: Gravity | None,
) -> bool:
    """Change a ball's velocity by the air drag of one whole piece of its flight.

    Returns: False, with nothing changed, if the ball is not in flight in the middle of a piece.
    """
    if drag is None:
        return False
    span = time + drag.half - drag.acted_until[ball]
    if span < ON_TIME * drag.half or not is_flying(contact, ball):
        return False
    change = _change(drag, contact, motion, ball, time, gravity, span)
    change_velocity(motion, ball, time, change)
    drag.acted_until[ball] = time + drag.half
    return True


@jit
def apply_drag_to_all(
    drag: DragState | None, contact: ContactState | None, velocities: np.ndarray, time: float
) -> None:
    """Correct the velocities of all balls in flight so that the air has acted until ``time`` [s].

    ``velocities``: velocities of the balls [m/s], shape (n, 3), changed in place.
    """
    if drag is None:
        return
    for ball in range(len(velocities)):
        if not is_flying(contact, ball):
            continue
        x, y, z = velocities[ball, 0], velocities[ball, 1], velocities[ball, 2]
        speed = math.sqrt(x * x + y * y + z * z)
        share = remaining_speed(drag, ball, speed, time - drag.acted_until[ball])
        for axis in range(3):
            velocities[ball, axis] *= share
