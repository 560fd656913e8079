"""What a push does to a ball, in flight or on its feet."""

import numpy as np

from sim_core.contact.support_changes import settle
from sim_core.effects.contact_mode import FLYING, MODE, ContactState, onto_cone
from sim_core.motion import BallState, change_velocity, state_under
from sim_core.numerics.jit import jit
from sim_core.numerics.vec3 import Vec3, add_scaled

BLOCKED = 0.01  # of an inverse mass: a push on balls that give way by less is no greater for it
# s: balls pressed together without any speed would meet again at once; they part for so long, which lifts them 50 nm
SHORTEST_HOP = 1e-4


@jit
def acceleration_of(contact: ContactState, ball: int) -> Vec3:
    """A ball's acceleration [m/s²]."""
    return Vec3(
        contact.acceleration[ball, 0], contact.acceleration[ball, 1], contact.acceleration[ball, 2]
    )


@jit
def place(contact: ContactState, motion: np.ndarray, ball: int, time: float) -> BallState:
    """Where a ball is [m], and its velocity [m/s], at a time of the window's clock."""
    return state_under(motion, ball, time, acceleration_of(contact, ball))


@jit
def response(contact: ContactState, ball: int, push: Vec3) -> Vec3:
    """Velocity change of a ball for a unit push per mass."""
    if contact.marks[ball, MODE] == FLYING:
        return push
    return onto_cone(contact, ball, push)


@jit
def impart(
    contact: ContactState,
    motion: np.ndarray,
    ball: int,
    time: float,
    time_since_start: float,
    at: BallState,
    change: Vec3,
) -> None:
    """Change a ball's velocity by ``change`` [m/s]; one in contact mode keeps of it what its feet leave."""
    if contact.marks[ball, MODE] == FLYING:
        change_velocity(motion, ball, time, change)
    else:
        settle(
            contact,
            motion,
            ball,
            time,
            time_since_start,
            BallState(at.position, add_scaled(at.velocity, 1.0, change)),
        )
