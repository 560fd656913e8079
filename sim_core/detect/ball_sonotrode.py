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
def waving_face_delay(
    numbers: np.ndarray,
    row: int,
    ball: Point,
    fall: Vec3,
    radius: float,
    seam: float,
    wave: Wave | None,
    time: float,
    limit: float,
) -> float:
    """Time [s] until the centre meets the moving face within ``limit`` [s]; ``time`` [s] is now, on the window's clock."""
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
    delay = first_wave_approach(gap, limit, HALF * radius)
    if delay == NEVER:
        return NEVER
    at = along(along(ball.position, delay, ball.velocity), 0.5 * delay * delay, fall)
    shift = wave.swing * math.sin(wave.omega * (time + delay) + wave.phase)
    return delay if within_borders(numbers, row, along(at, -shift, wave.axis), seam) else NEVER
