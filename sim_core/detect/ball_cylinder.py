"""When a ball inside an upright cylinder touches its side: seen from above it flies straight, whatever gravity does.

The ball is its centre, which stays within R - r of the axis: (R - r)² - |p + v s|² is a quadratic in s, and falls for
ever once it falls, so that a ball that is out and going further out is in contact now, however far out.
"""

import math

import numpy as np

from sim_core.detect.ball_triangle import face_normal
from sim_core.geometry.obstacles import ROUND, Bore
from sim_core.motion import Point
from sim_core.numerics.jit import jit
from sim_core.numerics.roots import first_approach
from sim_core.numerics.vec3 import Vec3


@jit
def is_round(bore: Bore | None, kind: int) -> bool:
    """True for the row of the round side; a mesh has none."""
    if bore is None:
        return False
    return kind == ROUND


@jit
def bore_delay(bore: Bore | None, numbers: np.ndarray, row: int, ball: Point) -> float:
    """Time [s] until the centre meets the round side from inside; NEVER if it does not."""
    if bore is None:
        return math.inf
    x, y = ball.position.x - bore.x, ball.position.y - bore.y
    vx, vy = ball.velocity.x, ball.velocity.y
    reach = numbers[row, 3]
    return first_approach(
        reach * reach - (x * x + y * y), -2.0 * (x * vx + y * vy), -(vx * vx + vy * vy), math.inf
    )


@jit
def facing(bore: Bore | None, numbers: np.ndarray, row: int, kind: int, at: Vec3) -> Vec3:
    """Unit normal towards the shot of a face, or of the round side where the centre is ``at``."""
    if bore is None:
        return face_normal(numbers, row)
    if kind != ROUND:
        return face_normal(numbers, row)
    x, y = bore.x - at.x, bore.y - at.y
    distance = math.sqrt(x * x + y * y)
    return Vec3(x / distance, y / distance, 0.0)
