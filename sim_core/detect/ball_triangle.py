"""When a ball on a parabola touches a still triangle: its moved face, or the capsule about a convex edge.

The ball is its centre; see surfaces/obstacles.py for what it meets.
"""

import numpy as np

from sim_core.geometry.obstacles import PAST_CORNERS
from sim_core.motion import Point
from sim_core.numerics.jit import jit
from sim_core.numerics.roots import NEVER, first_approach
from sim_core.numerics.vec3 import Vec3, along, cross, dot, sub

CONTACT = 1e-13  # m: a gap this small is contact with a capsule; a thousandth of what would count as early, 100 x rounding
STEPS = 1000  # 3 to 6 are used; a grazing touch converges by a factor of four a step, a ball sliding over an edge needs 300
ROUNDING = 1e-15  # m: of a place in a face's plane
HALF = 0.5  # of a radius: an overlap deeper than this is the far side of a one-sided face


@jit
def within_borders(numbers: np.ndarray, row: int, at: Vec3, seam: float) -> bool:
    """True when a point in the face's plane lies inside its borders, or at most ``seam`` [m] over one."""
    over = False
    for k in range(4, 20, 4):
        inside = _inside_border(numbers, row, k, at)
        if inside < -seam:
            return False
        over |= inside < 0.0
    return not over or _near_corners(numbers, row, at, PAST_CORNERS * seam)


@jit
def _inward(numbers: np.ndarray, row: int, border: int) -> Vec3:
    return Vec3(numbers[row, border], numbers[row, border + 1], numbers[row, border + 2])


@jit
def _inside_border(numbers: np.ndarray, row: int, border: int, at: Vec3) -> float:
    return dot(_inward(numbers, row, border), at) - numbers[row, border + 3]


@jit
def _near_corners(numbers: np.ndarray, row: int, at: Vec3, reach: float) -> bool:
    """True when a point over a border is at most ``reach`` [m] past a corner, if it is past the ends of both borders.

    The seams of two borders cross far beyond a corner as sharp as a needle's tip.
    """
    for border in range(4, 20, 4):
        over = _inside_border(numbers, row, border, at)
        if over < 0.0:
            one = _inward(numbers, row, border)
            for other in range(4, 20, 4):
                if other != border:
                    two = _inward(numbers, row, other)
                    inside = _inside_border(numbers, row, other, at)
                    turn = cross(one, two)
                    past = min(over * dot(one, two) - inside, inside * dot(one, two) - over)
                    if past > reach * np.sqrt(dot(turn, turn)) + ROUNDING:
                        return False
    return True


@jit
def face_normal(numbers: np.ndarray, row: int) -> Vec3:
    """Unit normal towards the shot."""
    return Vec3(numbers[row, 0], numbers[row, 1], numbers[row, 2])


@jit
def face_delay(
    numbers: np.ndarray, row: int, ball: Point, acceleration: Vec3, radius: float, seam: float
) -> float:
    """Time [s] until the centre meets the moved face from its shot side; NEVER if it does not."""
    normal = face_normal(numbers, row)
    gap = dot(normal, ball.position) - numbers[row, 3]
    delay = first_approach(
        gap, dot(normal, ball.velocity), 0.5 * dot(normal, acceleration), HALF * radius
    )
    if delay == NEVER:
        return NEVER
    at = along(along(ball.position, delay, ball.velocity), 0.5 * delay * delay, acceleration)
    return delay if within_borders(numbers, row, at, seam) else NEVER


@jit
def away_from_capsule(numbers: np.ndarray, row: int, at: Vec3) -> Vec3:
    """Vector [m] to a point from the nearest point of the capsule's segment."""
    start = Vec3(numbers[row, 0], numbers[row, 1], numbers[row, 2])
    direction = Vec3(numbers[row, 3], numbers[row, 4], numbers[row, 5])
    offset = sub(at, start)
    reach = min(max(dot(offset, direction), 0.0), numbers[row, 6])
    return along(offset, -reach, direction)


@jit
def nearer_neighbour(numbers: np.ndarray, row: int, away: Vec3) -> int:
    """0 or 1: which of a capsule's two triangles faces the ball more; so a dent on an edge is shared fairly."""
    lean = Vec3(numbers[row, 7], numbers[row, 8], numbers[row, 9])
    return 0 if dot(lean, away) >= 0.0 else 1


@jit
def capsule_delay(
    numbers: np.ndarray, row: int, ball: Point, acceleration: Vec3, radius: float, limit: float
) -> float:
    """Time [s] until the centre meets the capsule; NEVER if it does not within ``limit`` [s].

    The distance to a convex body is never below the distance to the plane that touches it at the nearest point.
    Along the flight that plane distance is a quadratic in time: go to where it closes, take the plane there,
    repeat. Each stop lies before the true contact, so nothing is stepped over.
    """
    delay = 0.0
    for _ in range(STEPS):
        at = along(along(ball.position, delay, ball.velocity), 0.5 * delay * delay, acceleration)
        velocity = along(ball.velocity, delay, acceleration)
        away = away_from_capsule(numbers, row, at)
        distance = np.sqrt(dot(away, away))
        if distance == 0.0:
            return NEVER
        gap = distance - radius
        rate = dot(away, velocity) / distance
        if gap <= CONTACT and rate < 0.0 and gap > -HALF * radius:
            return delay
        bend = 0.5 * dot(away, acceleration) / distance
        if -HALF * radius < gap <= CONTACT and rate * rate <= 4.0 * bend * min(gap, -CONTACT):
            gap = CONTACT  # touching, and not getting free: on until it could be deeper than now
        step = first_approach(gap, rate, bend, HALF * radius)
        if delay + step > limit:
            return NEVER
        if delay + step == delay:
            return delay
        delay += step
    return delay
