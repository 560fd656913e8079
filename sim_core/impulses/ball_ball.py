"""Two equal balls collide: momentum is kept, the normal relative speed is reversed and multiplied by e.

For unequal ones see sizes.by_mass.
"""

import math

from sim_core.effects.restitution import Restitution, ball_restitution
from sim_core.numerics.jit import jit
from sim_core.numerics.vec3 import Vec3, dot


@jit
def pair_kick(apart: Vec3, closing: Vec3, restitution: Restitution | None) -> Vec3:
    """Velocity change [m/s] of the first ball, and minus that of the second.

    ``apart`` [m], ``closing`` [m/s]: second minus first. Zero when they separate. Dividing by |apart|² keeps the
    energy of an elastic collision to rounding, where a rounded unit normal would drift.
    """
    rate = dot(apart, closing)
    if rate >= 0.0:
        return Vec3(0.0, 0.0, 0.0)
    square = dot(apart, apart)
    e = ball_restitution(restitution, -rate / math.sqrt(square))
    share = 0.5 * (1.0 + e) * rate / square
    return Vec3(share * apart.x, share * apart.y, share * apart.z)
