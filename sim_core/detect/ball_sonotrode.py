"""Exact time at which a ball on a parabola touches a face of a vibrating sonotrode."""

import math

import numpy as np

from sim_core.detect.ball_bent_face import BentGap, first_bent_approach, next_bent_approach
from sim_core.detect.ball_triangle import HALF, face_normal, within_borders
from sim_core.effects.amplitude_profile import FaceProfiles, wave_at
from sim_core.effects.sonotrodes import SonotrodeWaves, same_sonotrode
from sim_core.effects.vibration import Wave
from sim_core.geometry.bvh import Tree
from sim_core.geometry.obstacles import VIBRATING_FACE, same_plane
from sim_core.numerics.jit import jit
from sim_core.numerics.roots import NEVER, WaveGap, first_wave_approach, next_wave_approach
from sim_core.numerics.vec3 import Flight, Vec3, add_scaled, dot, position_after


@jit
def vibrating_plane_delay(
    numbers: np.ndarray,
    row: int,
    ball: Flight,
    radius: float,
    wave: Wave | None,
    profiles: FaceProfiles | None,
    time: float,
    limit: float,
) -> float:
    """Return the time [s] until a ball touches the plane of a vibrating face.

    A contact with the plane beside the face counts too. The result is NEVER if there is no contact
    within ``limit`` [s], or no vibration.
    ``time``: time since the start of the present time window [s].
    ``profiles``: amplitude over the faces; None if all are rigid.
    """
    if wave is None:
        return NEVER
    gap = _plane_gap(numbers, row, ball, wave, time)
    if profiles is None:
        return first_wave_approach(gap, limit, HALF * radius)
    bent = BentGap(gap, profiles, row, wave.axis, ball)
    return first_bent_approach(bent, 0.0, limit, HALF * radius)


@jit
def _next_approach(
    profiles: FaceProfiles | None,
    gap: WaveGap,
    row: int,
    axis: Vec3,
    ball: Flight,
    span: tuple[float, float],
    depth: float,
) -> float:
    """Return the next time at which a ball that met a plane comes down on it again, or NEVER.

    ``span``: time at which the ball met the plane, and end of the search [s].
    """
    if profiles is None:
        return next_wave_approach(gap, span[0], span[1], depth)
    return next_bent_approach(BentGap(gap, profiles, row, axis, ball), span[0], span[1], depth)


@jit
def _plane_gap(numbers: np.ndarray, row: int, ball: Flight, wave: Wave, time: float) -> WaveGap:
    """Return the gap between a ball and the plane of a vibrating face, as a function of time."""
    normal = face_normal(numbers, row)
    lift = dot(normal, wave.axis)
    theta = wave.omega * time + wave.phase
    if lift < 0.0:
        theta += math.pi
    return WaveGap(
        dot(normal, ball.position) - numbers[row, 3],
        dot(normal, ball.velocity),
        0.5 * dot(normal, ball.acceleration),
        abs(lift) * wave.amplitude,
        wave.omega,
        theta,
    )


@jit
def within_moved_borders(
    numbers: np.ndarray,
    row: int,
    ball: Flight,
    face_overlap: float,
    wave: Wave | None,
    profiles: FaceProfiles | None,
    time: float,
    delay: float,
) -> bool:
    """Return True if a ball lies over a vibrating face, not beside it, after ``delay`` [s]."""
    if wave is None:
        return False
    position = position_after(ball, delay)
    here = wave_at(profiles, wave, row, position)
    shift = here.amplitude * math.sin(here.omega * (time + delay) + here.phase)
    at = add_scaled(position, -shift, here.axis)
    return within_borders(numbers, row, at, face_overlap)


@jit
def find_later_contact(
    tree: Tree,
    waves: SonotrodeWaves | None,
    wave: Wave | None,
    profiles: FaceProfiles | None,
    row: int,
    ball: Flight,
    radius: float,
    face_overlap: float,
    time: float,
    delay: float,
    limit: float,
) -> tuple[float, int]:
    """Find when a ball that met a vibrating plane beside the plane's faces hits one of the faces.

    Beside the sonotrode, over a pit, a ball can be below the plane. It may then come down on the
    plane later.

    Args:
        tree: tree of the obstacles.
        waves: waves of several sonotrodes.
        wave: wave of the face.
        profiles: amplitude over the faces; None if all are rigid.
        row: number of a face in the plane.
        ball: the ball's flight from ``time`` on.
        radius: radius of the ball [m].
        face_overlap: overlap of neighbouring faces [m].
        time: time since the start of the present time window [s].
        delay: delay of the first meeting with the plane, beside its faces [s].
        limit: end of the search [s].

    Returns:
        Delay [s] and face of the contact, or (NEVER, -1) if there is none.
    """
    if wave is None:
        return NEVER, -1
    gap = _plane_gap(tree.numbers, row, ball, wave, time)
    while True:
        span = (delay, limit)
        delay = _next_approach(profiles, gap, row, wave.axis, ball, span, HALF * radius)
        if delay >= limit:
            return NEVER, -1
        for face in range(len(tree.kinds)):
            if (
                tree.kinds[face] == VIBRATING_FACE
                and same_plane(tree.numbers, row, face)
                and same_sonotrode(waves, row, face)
                and within_moved_borders(
                    tree.numbers, face, ball, face_overlap, wave, profiles, time, delay
                )
            ):
                return delay, face
