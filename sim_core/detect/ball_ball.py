"""When two balls meet. In the free-fall frame both fly straight, with gravity or without, unless one is in contact."""

import numpy as np

from sim_core.detect.ball_triangle import CONTACT, HALF, STEPS
from sim_core.numerics.jit import jit
from sim_core.numerics.roots import NEVER, first_approach
from sim_core.numerics.vec3 import Vec3, along, dot

STANDING = 1e-12  # m/s: what rounding leaves of a normal velocity that was taken away


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


@jit
def accelerated_meeting_delay(
    apart: Vec3, closing: Vec3, acceleration: Vec3, reach: float, limit: float
) -> float:
    """The same under a relative acceleration ``acceleration`` [m/s²], within ``limit`` [s]; by the steps of capsule_delay."""
    delay = 0.0
    for _ in range(STEPS):
        at = along(along(apart, delay, closing), 0.5 * delay * delay, acceleration)
        velocity = along(closing, delay, acceleration)
        distance = np.sqrt(dot(at, at))
        gap = distance - reach
        rate = dot(at, velocity) / distance
        if gap <= CONTACT and rate < -STANDING:
            return delay
        if (
            gap <= CONTACT
        ):  # not approaching: on until it could be as near as now, at once if pressed together
            gap, rate = 0.0, max(rate, 0.0)
        step = first_approach(gap, rate, 0.5 * dot(at, acceleration) / distance, HALF * reach)
        if not delay + step < limit:
            return NEVER
        if delay + step == delay:
            return delay
        delay += step
    return delay
