"""Periodic sides: balls that leave a box on one side come in on the other.

A ball that crosses a side has no event there: positions are taken modulo the side lengths. Images
of a ball are its positions in the boxes beside. Two balls meet as their nearest images do. Balls
are put back into the box whenever all paths are copied into the neighbour filter anew.

Notation:
    L: side length of the box along x or y [m]; 0 where there are walls
    r: reach, the sum of two radii [m]
    v, V: speed of a ball along that direction, and the largest speed of any ball [m/s]

Only the nearest images of two balls can meet next. Any other images are L/2 or more apart along x
or y, and need (L/2 - r) / (v + V) to meet. A prediction looks no farther ahead than that
(``horizon``). V is kept up to date as paths change. Of two balls, the ball whose path changed last
has searched for the other ball with a V that holds for both.
"""

from typing import NamedTuple

import numpy as np

from sim_core.numerics.jit import inlined, jit
from sim_core.numerics.roots import NEVER
from sim_core.numerics.vec3 import Vec3

SLACK = 1.0 - 1e-6  # share of the horizon, for rounding
# share of a side: longer paths widen boxes and meet more images, and shorter paths are sorted more
SHORT = 0.125
FAR = 1e30


class PeriodicSides(NamedTuple):
    """The sides of a box that is periodic along x, y or both and whose middle is the origin.

    x, y: side length of the box along each direction [m], 0 where there are walls.
    per_x, per_y: inverses of the sides [1/m], 0 where there are walls.
    fastest: largest speed of any ball along each direction [m/s], (2,).
    low, high: extent of the boxes of all balls' paths along each direction [m], (2,), where there
        are many balls (loop/spatial_blocks.py).
    """

    x: float
    y: float
    per_x: float
    per_y: float
    fastest: np.ndarray
    low: np.ndarray
    high: np.ndarray


def new_periodic_sides(sides: np.ndarray) -> PeriodicSides | None:
    """Return the sides (3,) [m] as compiled code needs them; None if no side is periodic."""
    if not sides.any():
        return None
    x, y = (float(side) for side in sides[:2])
    per_x, per_y = (1.0 / side if side > 0.0 else 0.0 for side in (x, y))
    return PeriodicSides(x, y, per_x, per_y, np.zeros(2), np.full(2, FAR), np.full(2, -FAR))


@inlined
def nearest_image(sides: PeriodicSides | None, apart: Vec3) -> Vec3:
    """Return the shortest difference [m] between the images of two points.

    ``apart``: difference of the two points inside the box [m].
    """
    if sides is None:
        return apart
    return Vec3(
        apart.x - sides.x * np.rint(apart.x * sides.per_x),
        apart.y - sides.y * np.rint(apart.y * sides.per_y),
        apart.z,
    )


@jit
def put_back(sides: PeriodicSides | None, motion: np.ndarray, time: float) -> None:
    """Move each ball by whole sides so that it is inside the box at ``time`` [s].

    ``motion``: base positions and velocities of the balls, (n, 6).
    """
    if sides is None:
        return
    for ball in range(len(motion)):
        x, y = motion[ball, 0], motion[ball, 1]
        motion[ball, 0] = x - sides.x * np.rint((x + motion[ball, 3] * time) * sides.per_x)
        motion[ball, 1] = y - sides.y * np.rint((y + motion[ball, 4] * time) * sides.per_y)


@inlined
def note_speed(sides: PeriodicSides | None, motion: np.ndarray, ball: int) -> None:
    """Raise the noted largest speed to the speed of a ball with a new path, if that is larger."""
    if sides is None:
        return
    for axis in range(2):
        sides.fastest[axis] = max(sides.fastest[axis], abs(motion[ball, 3 + axis]))


@inlined
def note_all_speeds(sides: PeriodicSides | None, motion: np.ndarray) -> None:
    """Set the noted largest speed to the present largest speed of the balls."""
    if sides is None:
        return
    sides.fastest[:] = 0.0
    for ball in range(len(motion)):
        note_speed(sides, motion, ball)


@inlined
def top_speed(sides: PeriodicSides | None) -> float:
    """Return the noted largest speed of any ball [m/s], or 0 without periodic sides.

    Gravity along a periodic direction raises this speed without end.
    """
    if sides is None:
        return 0.0
    return float(max(sides.fastest[0], sides.fastest[1]))


@inlined
def horizon(sides: PeriodicSides | None, motion: np.ndarray, ball: int, reach: float) -> float:
    """Return for how long [s] the ball can meet only the present nearest images of other balls."""
    if sides is None:
        return NEVER
    x = sides.fastest[0] + abs(motion[ball, 3])
    y = sides.fastest[1] + abs(motion[ball, 4])
    time = NEVER
    if sides.x > 0.0 and x > 0.0:
        time = SLACK * (0.5 * sides.x - reach) / x
    if sides.y > 0.0 and y > 0.0:
        time = min(time, SLACK * (0.5 * sides.y - reach) / y)
    return time


@inlined
def time_in_box(sides: PeriodicSides | None) -> float:
    """Return for how long [s] paths may be followed so that they reach few boxes beside."""
    if sides is None:
        return NEVER
    time = NEVER
    if sides.x * sides.fastest[0] > 0.0:
        time = SHORT * sides.x / sides.fastest[0]
    if sides.y * sides.fastest[1] > 0.0:
        time = min(time, SHORT * sides.y / sides.fastest[1])
    return time


@inlined
def forget_extent(sides: PeriodicSides | None) -> None:
    """Forget the extent of the boxes around paths, so that only paths noted from now on count."""
    if sides is None:
        return
    sides.low[:] = FAR
    sides.high[:] = -FAR


@inlined
def note_extent(sides: PeriodicSides | None, axis: int, low: np.float32, high: np.float32) -> None:
    """Widen the noted extent of the boxes around paths so that it holds ``low`` to ``high`` [m]."""
    if sides is None:
        return
    if axis < 2:
        sides.low[axis] = min(sides.low[axis], low)
        sides.high[axis] = max(sides.high[axis], high)


@inlined
def images(
    sides: PeriodicSides | None, motion: np.ndarray, ball: int, start: float, end: float
) -> tuple[int, int, int, int]:
    """Return which of the ball's images have paths that get into the boxes around other paths.

    Returns: the first and the last image along x, and the first and the last image along y, as
    multiples of the side.

    Args:
        start: start of the path [s].
        end: end of the path [s].
    """
    if sides is None:
        return 0, 0, 0, 0
    x, u = motion[ball, 0], motion[ball, 3]
    y, v = motion[ball, 1], motion[ball, 4]
    a, b = x + u * start, x + u * end
    c, d = y + v * start, y + v * end
    return (
        int(np.ceil((sides.low[0] - max(a, b)) * sides.per_x)),
        int(np.floor((sides.high[0] - min(a, b)) * sides.per_x)),
        int(np.ceil((sides.low[1] - max(c, d)) * sides.per_y)),
        int(np.floor((sides.high[1] - min(c, d)) * sides.per_y)),
    )
