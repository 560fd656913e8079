"""When a ball on a parabola touches a face of the vibrating sonotrode, exactly."""

import math

import numpy as np

from sim_core.detect.ball_triangle import HALF, face_normal, within_borders
from sim_core.effects.sonotrodes import Waves, move_alike
from sim_core.effects.vibration import Wave
from sim_core.geometry.bvh import Tree
from sim_core.geometry.obstacles import WAVING_FACE
from sim_core.motion import Point
from sim_core.numerics.jit import jit
from sim_core.numerics.roots import NEVER, WaveGap, first_wave_approach, next_wave_approach
from sim_core.numerics.vec3 import Vec3, along, dot


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
    acceleration: Vec3,
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
    return first_wave_approach(
        _gap(numbers, row, ball, acceleration, wave, time), limit, HALF * radius
    )


@jit
def _gap(
    numbers: np.ndarray, row: int, ball: Point, acceleration: Vec3, wave: Wave, time: float
) -> WaveGap:
    """The gap between the centre and the face's moving plane."""
    normal = face_normal(numbers, row)
    lift = dot(normal, wave.axis)
    theta = wave.omega * time + wave.phase
    if lift < 0.0:
        theta += math.pi
    return WaveGap(
        dot(normal, ball.position) - numbers[row, 3],
        dot(normal, ball.velocity),
        0.5 * dot(normal, acceleration),
        abs(lift) * wave.swing,
        wave.omega,
        theta,
    )


@jit
def within_waving_borders(
    numbers: np.ndarray,
    row: int,
    ball: Point,
    acceleration: Vec3,
    seam: float,
    wave: Wave | None,
    time: float,
    delay: float,
) -> bool:
    """True when the centre meets the face's plane, ``delay`` [s] from now, inside its borders as they are then."""
    if wave is None:
        return False
    at = along(along(ball.position, delay, ball.velocity), 0.5 * delay * delay, acceleration)
    shift = wave.swing * math.sin(wave.omega * (time + delay) + wave.phase)
    return within_borders(numbers, row, along(at, -shift, wave.axis), seam)


@jit
def meets_later(
    tree: Tree,
    waves: Waves | None,
    radius: float,
    row: int,
    ball: Point,
    acceleration: Vec3,
    seam: float,
    wave: Wave | None,
    time: float,
    delay: float,
    limit: float,
) -> tuple[float, int]:
    """Delay [s] and face of a contact within ``limit`` [s] after the plane of face ``row``, which moves as ``wave``
    says, was met where it has no face; (NEVER, -1) if there is none.

    Beside the sonotrode, over a pit, a ball is free to be below its plane, and may come down on it afterwards.
    """
    if wave is None:
        return NEVER, -1
    gap = _gap(tree.numbers, row, ball, acceleration, wave, time)
    while True:
        delay = next_wave_approach(gap, delay, limit, HALF * radius)
        if delay >= limit:
            return NEVER, -1
        for face in range(len(tree.kinds)):
            if (
                tree.kinds[face] == WAVING_FACE
                and same_plane(tree.numbers, row, face)
                and move_alike(waves, row, face)
                and within_waving_borders(
                    tree.numbers, face, ball, acceleration, seam, wave, time, delay
                )
            ):
                return delay, face
