"""Time at which a ball on a parabola touches a still triangle: its face, or an edge's capsule.

The ball is represented by its centre. geometry/obstacles.py describes the obstacles that the centre
meets. ``numbers`` and ``row`` select an obstacle: ``numbers[row]`` of ObstacleTable.
"""

import numpy as np

from sim_core.geometry.obstacles import MAX_CORNER_OVERLAPS
from sim_core.numerics.jit import jit
from sim_core.numerics.roots import NEVER, first_approach
from sim_core.numerics.vec3 import (
    Flight,
    Vec3,
    add_scaled,
    cross,
    dot,
    position_after,
    sub,
    velocity_after,
)

# A gap this small [m] to a capsule is contact. It is a thousandth of the smallest error that would
# count as an early contact, and a hundred times rounding.
CONTACT = 1e-13
# Most contacts take 3 to 6 steps. A grazing touch converges by a factor of four a step, and a ball
# that slides over an edge needs 300.
MAX_STEPS = 1000
ROUNDING = 1e-15  # m: rounding of a point in a face's plane
HALF = 0.5  # share of the radius: a deeper overlap means the far side of a one-sided face


@jit
def within_borders(numbers: np.ndarray, row: int, at: Vec3, face_overlap: float) -> bool:
    """Return True if a point in a face's plane is at most ``face_overlap`` [m] outside the face."""
    over = False
    for k in range(4, 20, 4):
        inside = _inside_border(numbers, row, k, at)
        if inside < -face_overlap:
            return False
        over |= inside < 0.0
    return not over or _near_corners(numbers, row, at, MAX_CORNER_OVERLAPS * face_overlap)


@jit
def _inward(numbers: np.ndarray, row: int, border: int) -> Vec3:
    return Vec3(numbers[row, border], numbers[row, border + 1], numbers[row, border + 2])


@jit
def _inside_border(numbers: np.ndarray, row: int, border: int, at: Vec3) -> float:
    """Return the distance [m] of a point from the border of a face, negative outside the face.

    ``border``: first column of the border in ``numbers``.
    """
    return float(dot(_inward(numbers, row, border), at) - numbers[row, border + 3])


@jit
def _near_corners(numbers: np.ndarray, row: int, at: Vec3, reach: float) -> bool:
    """Return False if a point lies more than ``reach`` [m] beyond a corner of a face.

    A face is widened by an overlap over each border. At a corner as sharp as a needle's tip the
    widened borders cross far beyond the corner.
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
    """Return the unit normal of a face, towards the balls."""
    return Vec3(numbers[row, 0], numbers[row, 1], numbers[row, 2])


@jit
def face_delay(
    numbers: np.ndarray, row: int, ball: Flight, radius: float, face_overlap: float
) -> float:
    """Return the time [s] until a ball touches a still face on the balls' side of it, or NEVER."""
    normal = face_normal(numbers, row)
    gap = dot(normal, ball.position) - numbers[row, 3]
    rate, bend = dot(normal, ball.velocity), 0.5 * dot(normal, ball.acceleration)
    delay = first_approach(gap, rate, bend, HALF * radius)
    if delay == NEVER:
        return NEVER
    at = position_after(ball, delay)
    return delay if within_borders(numbers, row, at, face_overlap) else NEVER


@jit
def away_from_capsule(numbers: np.ndarray, row: int, at: Vec3) -> Vec3:
    """Return the vector [m] from the nearest point of an edge to the point ``at``."""
    start = Vec3(numbers[row, 0], numbers[row, 1], numbers[row, 2])
    direction = Vec3(numbers[row, 3], numbers[row, 4], numbers[row, 5])
    offset = sub(at, start)
    reach = min(max(dot(offset, direction), 0.0), numbers[row, 6])
    return add_scaled(offset, -reach, direction)


@jit
def nearer_neighbour(numbers: np.ndarray, row: int, away: Vec3) -> int:
    """Return which of the two triangles at an edge, 0 or 1, a ball at the edge faces more.

    This choice shares the impacts on an edge fairly between its two triangles.
    """
    lean = Vec3(numbers[row, 7], numbers[row, 8], numbers[row, 9])
    return 0 if dot(lean, away) >= 0.0 else 1


@jit
def capsule_delay(
    numbers: np.ndarray, row: int, ball: Flight, radius: float, limit: float
) -> float:
    """Return the time [s] until a ball touches an edge, or NEVER if not within ``limit`` [s].

    The ball's centre then meets the edge's capsule: the points one radius from the edge.

    The distance to a convex body is never below the distance to the plane that touches the body at
    the nearest point. Along the flight the plane distance is a quadratic in time. Each step goes to
    the time at which this quadratic becomes 0, and takes the touching plane anew there. Each stop
    lies before the contact, so that no contact is missed.
    """
    delay = 0.0
    for _ in range(MAX_STEPS):
        at = position_after(ball, delay)
        velocity = velocity_after(ball, delay)
        away = away_from_capsule(numbers, row, at)
        distance = np.sqrt(dot(away, away))
        if distance == 0.0:
            return NEVER
        gap = distance - radius
        rate = dot(away, velocity) / distance
        if gap <= CONTACT and rate < 0.0 and gap > -HALF * radius:
            return delay
        bend = 0.5 * dot(away, ball.acceleration) / distance
        if -HALF * radius < gap <= CONTACT and rate * rate <= 4.0 * bend * min(gap, -CONTACT):
            # The ball touches and does not come free: go on until it could be deeper than now.
            gap = CONTACT
        step = first_approach(gap, rate, bend, HALF * radius)
        if delay + step > limit:
            return NEVER
        if delay + step == delay:
            return delay
        delay += step
    return delay
