"""A ball hits a surface: the normal velocity relative to it is reversed and multiplied by e, the tangential kept."""

import math

from sim_core.effects.restitution import Restitution, surface_restitution
from sim_core.numerics.jit import jit
from sim_core.numerics.vec3 import Vec3, dot


@jit
def surface_kick(away: Vec3, relative: Vec3, restitution: Restitution | None, tag: int) -> Vec3:
    """Velocity change [m/s] of the ball; zero when it separates.

    ``away``: any vector along the normal, from the surface to the ball; ``relative`` [m/s]: the ball's velocity
    minus the surface's.
    """
    rate = dot(away, relative)
    if rate >= 0.0:
        return Vec3(0.0, 0.0, 0.0)
    square = dot(away, away)
    e = surface_restitution(restitution, tag, -rate / math.sqrt(square))
    share = -(1.0 + e) * rate / square
    return Vec3(share * away.x, share * away.y, share * away.z)
