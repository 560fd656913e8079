"""Time at which two balls touch.

In the free-fall frame both balls fly straight, with gravity or without it, unless a ball is in
contact mode.
"""

import numpy as np

from sim_core.detect.ball_triangle import CONTACT, HALF, MAX_STEPS
from sim_core.numerics.jit import jit
from sim_core.numerics.roots import NEVER, first_approach
from sim_core.numerics.vec3 import Flight, Vec3, dot, position_after, velocity_after

STANDING = 1e-12  # m/s: rounding of a normal velocity that was removed


@jit
def pair_delay(apart: Vec3, closing: Vec3, reach: float) -> float:
    """Return the time [s] until two balls that fly straight touch.

    Args:
        apart: relative position [m].
        closing: relative velocity [m/s].
        reach: sum of the radii [m].

    Returns:
        Time s [s] at which |apart + closing s| = reach and the balls approach. It is 0 for balls
        that overlap and approach, and NEVER for balls that do not meet.
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
    return float(excess / (np.sqrt(disc) - rate))


@jit
def accelerated_pair_delay(relative: Flight, reach: float, limit: float) -> float:
    """Return the time [s] until two balls touch, of which at least one is in contact mode.

    The search goes forward in steps that end before the contact, as in capsule_delay.

    Args:
        relative: position, velocity and acceleration of the second ball relative to the first.
        reach: distance of the centres at which the balls touch [m].
        limit: duration of the search [s].

    Returns: NEVER if the balls do not touch within ``limit``.
    """
    delay = 0.0
    for _ in range(MAX_STEPS):
        at = position_after(relative, delay)
        velocity = velocity_after(relative, delay)
        distance = np.sqrt(dot(at, at))
        gap = distance - reach
        rate = dot(at, velocity) / distance
        if gap <= CONTACT and rate < -STANDING:
            return delay
        if gap <= CONTACT:
            # The balls do not approach: go on until they could be as near as now, or meet at once
            # if pressed together.
            gap, rate = 0.0, max(rate, 0.0)
        bend = 0.5 * dot(at, relative.acceleration) / distance
        step = first_approach(gap, rate, bend, HALF * reach)
        if not delay + step < limit:
            return NEVER
        if delay + step == delay:
            return delay
        delay += step
    return delay
