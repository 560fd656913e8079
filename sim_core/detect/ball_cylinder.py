"""Time at which a ball in an upright cylinder touches the wall.

Seen from above, the ball flies straight: its centre is at p + v s after the time s. In a cylinder
of radius R the centre of a ball of radius r stays within R - r of the axis. The gap
(R - r)² - |p + v s|² is a quadratic in s and never rises again once it falls. A ball outside that
moves further out is therefore in contact now, however far out it is.
"""

import math

import numpy as np

from sim_core.detect.ball_triangle import face_normal
from sim_core.geometry.analytic import CylinderAxis
from sim_core.geometry.obstacles import CYLINDER_WALL
from sim_core.numerics.jit import jit
from sim_core.numerics.roots import first_approach
from sim_core.numerics.vec3 import Flight, Vec3


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
