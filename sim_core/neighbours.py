"""Who can meet whom: all balls, eight at a time through a float32 filter, then exactly.

The filter keeps every pair whose straight paths could come within reach, rounding included; what it lets through is
decided in float64, so results do not depend on it.
"""

import numpy as np

from sim_core._compile import jit
from sim_core.detect.ball_ball import meeting_delay
from sim_core.flight import drift
from sim_core.roots import NEVER
from sim_core.simd import LANES, balls_near, lowest_bit
from sim_core.vec3 import Vec3, sub

FAR_SHARE = np.float32(1.0 - 1e-6)  # of distance²: float32 loses 2e-7 of it in the miss distance


def reach_margin(extent: float, fastest: float, window: float) -> float:
    """Added to the filter's reach [m]: sixteen roundings of the largest float32 coordinate (about 1e-6 m in a
    chamber).
    """
    return float(16.0 * np.finfo(np.float32).eps * (extent + fastest * window))


def new_lanes(motion: np.ndarray) -> np.ndarray:
    """Float32 copy (6, n) of motion (n, 6), one row a quantity, padded to whole groups of LANES."""
    balls = len(motion)
    lanes = np.zeros((6, -(-balls // LANES) * LANES), dtype=np.float32)
    lanes[:, :balls] = motion.T
    return lanes


@jit
def next_meeting(
    motion: np.ndarray,
    lanes: np.ndarray,
    probe: np.ndarray,
    ball: int,
    time: float,
    before: float,
    reach: float,
    wide_reach: float,
) -> tuple[float, int]:
    """Time [s] and partner of the ball's first meeting after ``time`` and before ``before``; (NEVER, -1) if none.

    ``reach`` [m]: sum of the radii; ``wide_reach`` [m]: the same with the filter's margin.
    """
    here = drift(motion, ball, time)
    velocity = Vec3(motion[ball, 3], motion[ball, 4], motion[ball, 5])
    for axis in range(3):
        probe[axis] = np.float32(here[axis])
        probe[3 + axis] = np.float32(velocity[axis])
    probe[6] = np.float32(time)
    probe[7] = np.float32(wide_reach * wide_reach)
    probe[8] = FAR_SHARE
    best = before - time
    partner = -1
    for first in range(0, len(motion), LANES):
        near = balls_near(lanes, first, probe)
        while near != 0:
            other = first + lowest_bit(near)
            near &= near - 1
            if other == ball or other >= len(motion):
                continue
            closing = sub(Vec3(motion[other, 3], motion[other, 4], motion[other, 5]), velocity)
            delay = meeting_delay(sub(drift(motion, other, time), here), closing, reach)
            if delay < best:
                best = delay
                partner = other
    if partner < 0:
        return NEVER, -1
    return time + best, partner
