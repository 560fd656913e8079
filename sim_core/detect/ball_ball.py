"""When two balls meet. In the free-fall frame both fly straight, with gravity or without."""

import numpy as np

from sim_core._compile import jit
from sim_core.roots import NEVER
from sim_core.vec3 import Vec3, dot


@jit
def meeting_delay(apart: Vec3, closing: Vec3, reach: float) -> float:
    """Time [s] until |apart + closing s| = reach, approaching; 0 when they overlap and approach; NEVER otherwise.

    ``apart`` [m] and ``closing`` [m/s]: relative position and velocity; ``reach`` [m]: sum of the radii.
    """
    rate = dot(apart, closing)
    if rate >= 0.0:
        return NEVER
    excess = dot(apart, apart) - reach * reach
    if excess <= 0.0:
        return 0.0
    disc = rate * rate - dot(closing, closing) * excess
    if disc <= 0.0:
        return NEVER
    return excess / (np.sqrt(disc) - rate)
