"""Who can meet whom: all balls, sixteen at a time through a float32 filter, then exactly.

In the free-fall frame two balls' paths are straight lines, so how near they come does not depend on the time asked:
with b the difference of their bases and w that of their velocities the miss distance² is b² - (b w)² / w², and they
still approach while b w + t w² < 0. The filter keeps every pair whose paths could come within reach, rounding
included; what it lets through is decided in float64, so results do not depend on it.
"""

from typing import NamedTuple

import numpy as np

from sim_core._compile import jit
from sim_core.detect.ball_ball import meeting_delay
from sim_core.flight import drift
from sim_core.roots import NEVER
from sim_core.simd import LANES, balls_near, lowest_bit
from sim_core.vec3 import Vec3, sub

FAR_SHARE = np.float32(1.0 - 1e-6)  # of distance²: float32 loses 2e-7 of it in the miss distance
ROUNDINGS = 16.0 * float(np.finfo(np.float32).eps)  # of the largest number in a sum of three products, and to spare


class Margins(NamedTuple):
    """What float32 may lose.

    ``reach`` [m] of the filter; ``closing`` [m²/s], below which b w + t w² may be negative but for rounding. Good for
    speeds up to ``fastest`` [m/s].
    """

    reach: float
    closing: float
    fastest: float


def margins(reach: float, extent: float, fastest: float, window: float) -> Margins:
    """Margins for balls of this ``reach`` [m] (the sum of two radii) in a room of this extent [m]."""
    furthest = extent + fastest * window  # a base lies up to a window's flight outside the room
    return Margins(reach + ROUNDINGS * furthest, ROUNDINGS * furthest * fastest, fastest)


def new_lanes(motion: np.ndarray) -> np.ndarray:
    """Float32 copy (6, n) of motion (n, 6), one row a quantity, padded with NaN, which meets no one, to whole LANES."""
    balls = len(motion)
    lanes = np.full((6, -(-balls // LANES) * LANES), np.nan, dtype=np.float32)
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
    margins: Margins,
) -> tuple[float, int]:
    """Time [s] and partner of the ball's first meeting after ``time`` and before ``before``; (NEVER, -1) if none.

    ``reach`` [m]: sum of the radii.
    """
    for k in range(6):
        probe[k] = lanes[k, ball]
    probe[6] = np.float32(time)
    probe[7] = FAR_SHARE
    probe[8] = np.float32(-margins.reach * margins.reach)
    probe[9] = np.float32(margins.closing)
    here = drift(motion, ball, time)
    velocity = Vec3(motion[ball, 3], motion[ball, 4], motion[ball, 5])
    best = before - time
    partner = -1
    for first in range(0, len(motion), LANES):
        near = balls_near(lanes, first, probe)
        while near != 0:
            other = first + lowest_bit(near)
            near &= near - 1
            closing = sub(Vec3(motion[other, 3], motion[other, 4], motion[other, 5]), velocity)
            delay = meeting_delay(sub(drift(motion, other, time), here), closing, reach)
            if delay < best:
                best = delay
                partner = other
    if partner < 0:
        return NEVER, -1
    return time + best, partner
