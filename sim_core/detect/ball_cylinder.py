"""Time at which a ball in an upright cylinder touches the wall.

In a cylinder of radius R the centre of a ball of radius r stays within R - r of the axis.

Seen from above, a ball in flight goes straight: its centre is at p + v s after the time s. The gap
G(s) = (R - r)² - |p + v s|² is a quadratic in s and never rises again once it falls. A ball outside
that moves further out is therefore in contact now, however far out it is.

A ball in contact mode may have an acceleration a across the axis. Then G is of fourth order, and

    G(s) >= G + G' s - (v² + p a) s² - |a| V s³        V: largest speed on the way

The search goes to the time at which the quadratic with s³ <= T s² becomes 0, where T is the
time that is left. Each stop lies before the contact, so that no contact is missed.
"""

import math

import numpy as np

from sim_core.detect.ball_ball import STANDING
from sim_core.detect.ball_triangle import CONTACT, MAX_STEPS, face_normal
from sim_core.effects.contact_mode import ContactState
from sim_core.geometry.analytic import CylinderAxis
from sim_core.geometry.obstacles import CYLINDER_WALL
from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.roots import NEVER, first_approach
from sim_core.numerics.vec3 import Flight, Vec3, position_after, velocity_after


@jit
def is_cylinder_wall(cylinder: CylinderAxis | None, kind: int) -> bool:
    """Return True if an obstacle of this ``kind`` is a cylinder wall. A mesh has no such wall."""
    if cylinder is None:
        return False
    return kind == CYLINDER_WALL


@jit
def cylinder_delay(
    cylinder: CylinderAxis | None, numbers: np.ndarray, row: int, ball: Flight
) -> float:
    """Return the time [s] until a ball touches the cylinder wall from inside, or NEVER."""
    if cylinder is None:
        return math.inf
    x, y = ball.position.x - cylinder.x, ball.position.y - cylinder.y
    vx, vy = ball.velocity.x, ball.velocity.y
    reach = numbers[row, 3]
    gap, rate = reach * reach - (x * x + y * y), -2.0 * (x * vx + y * vy)
    return first_approach(gap, rate, -(vx * vx + vy * vy), math.inf)


@inlined
def wall_delay(
    cylinder: CylinderAxis | None,
    contact: ContactState | None,
    numbers: np.ndarray,
    row: int,
    ball: Flight,
    limit: float,
) -> float:
    """Return the time [s] until a ball touches the cylinder wall, in flight or in contact mode.

    The result is NEVER if a ball in contact mode does not touch the wall within ``limit`` [s].
    """
    if contact is None:
        return cylinder_delay(cylinder, numbers, row, ball)
    return accelerated_cylinder_delay(cylinder, numbers, row, ball, limit)


@jit
def accelerated_cylinder_delay(
    cylinder: CylinderAxis | None, numbers: np.ndarray, row: int, ball: Flight, limit: float
) -> float:
    """Return the time [s] until a ball with an acceleration across the axis touches the wall.

    The result is NEVER if it does not within ``limit`` [s].
    """
    if cylinder is None:
        return math.inf
    reach = numbers[row, 3]
    ax, ay = ball.acceleration.x, ball.acceleration.y
    pull, delay = math.sqrt(ax * ax + ay * ay), 0.0
    for _ in range(MAX_STEPS):
        at, velocity = position_after(ball, delay), velocity_after(ball, delay)
        x, y, vx, vy = at.x - cylinder.x, at.y - cylinder.y, velocity.x, velocity.y
        gap, rate = reach * reach - (x * x + y * y), -2.0 * (x * vx + y * vy)
        bend = -(vx * vx + vy * vy + (x * ax + y * ay))
        left = limit - delay
        fastest = math.sqrt(vx * vx + vy * vy) + pull * left
        worst = bend - pull * fastest * left
        if gap <= 2.0 * reach * CONTACT:
            if rate < -2.0 * reach * STANDING:
                return delay
            # The ball does not approach: go on until it could be as near as now.
            gap, rate = 0.0, max(rate, 0.0)
        if left <= 0.0:
            return NEVER
        if gap == 0.0 and bend > 0.0:  # the acceleration takes the ball off the wall
            step = min(0.5 * bend / (pull * fastest), left)
        else:
            step = first_approach(gap, rate, worst, math.inf)
        if delay + step > limit:
            return NEVER
        if delay + step == delay:
            return delay
        delay += step
    return delay


@jit
def normal_at(
    cylinder: CylinderAxis | None, numbers: np.ndarray, row: int, kind: int, at: Vec3
) -> Vec3:
    """Return the unit normal, towards the balls, of obstacle ``row``.

    On a cylinder wall it is the normal at the point nearest to the ball's centre ``at``.
    """
    if cylinder is None:
        return face_normal(numbers, row)
    if kind != CYLINDER_WALL:
        return face_normal(numbers, row)
    x, y = cylinder.x - at.x, cylinder.y - at.y
    distance = math.sqrt(x * x + y * y)
    return Vec3(x / distance, y / distance, 0.0)
