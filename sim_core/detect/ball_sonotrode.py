"""When a ball on a parabola touches a face of the vibrating sonotrode, exactly."""

import math

import numpy as np

from sim_core._compile import jit
from sim_core.detect.ball_triangle import HALF, face_normal, within_borders
from sim_core.effects.vibration import Wave
from sim_core.flight import Point
from sim_core.roots import NEVER, WaveGap, first_wave_approach
from sim_core.vec3 import Vec3, along, dot


@jit
def same_plane(numbers: np.ndarray, row: int, other: int) -> bool:
    """True when two faces hold the same plane, bit for bit (build_obstacles gives a flat sonotrode one plane)."""
    return (
        numbers[row, 0] == numbers[other, 0]
        and numbers[row, 1] == numbers[other, 1]
        and numbers[row, 2] == numbers[other, 2]
        and numbers[row, 3] == numbers[other, 3]
    )


@jit
def waving_plane_delay(
    numbers: np.ndarray,
    row: int,
    ball: Point,
    fall: Vec3,
    radius: float,
    wave: Wave | None,
    time: float,
    limit: float,
) -> float:
    """Time [s] until the centre meets the moving plane of a face within ``limit`` [s], or NEVER.

    ``time`` [s] is now, on the window's clock.
    """
    if wave is None:
        return NEVER
    normal = face_normal(numbers, row)
    lift = dot(normal, wave.axis)
    theta = wave.omega * time + wave.phase
    if lift < 0.0:
        theta += math.pi
    gap = WaveGap(
        dot(normal, ball.position) - numbers[row, 3],
        dot(normal, ball.velocity),
        0.5 * dot(normal, fall),
        abs(lift) * wave.swing,
        wave.omega,
        theta,
    )
    return first_wave_approach(gap, limit, HALF * radius)


@jit
def within_waving_borders(
    numbers: np.ndarray,
    row: int,
    ball: Point,
    fall: Vec3,
    seam: float,
    wave: Wave | None,
    time: float,
    delay: float,
) -> bool:
    """True when the centre meets the face's plane, ``delay`` [s] from now, inside its borders as they are then."""
    if wave is None:
        return False
    at = along(along(ball.position, delay, ball.velocity), 0.5 * delay * delay, fall)
    shift = wave.swing * math.sin(wave.omega * (time + delay) + wave.phase)
    return within_borders(numbers, row, along(at, -shift, wave.axis), seam)
