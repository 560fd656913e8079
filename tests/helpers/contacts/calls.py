"""The contact searches under test, each called for many cases at once.

Flights (n, 9): position [m], velocity [m/s] and acceleration [m/s²] of a ball's centre. All return
delays (n,) [s], infinite where there is no contact.
"""

import numpy as np

from sim_core import Gravity
from sim_core.detect.ball_ball import pair_delay
from sim_core.detect.ball_mesh import Scratch, first_contact, new_scratch
from sim_core.detect.ball_sonotrode import vibrating_plane_delay
from sim_core.detect.ball_triangle import capsule_delay, face_delay
from sim_core.effects.amplitude_profile import FaceProfiles
from sim_core.effects.vibration import Wave
from sim_core.geometry.bvh import Tree
from sim_core.geometry.obstacle_set import ObstacleSet
from sim_core.numerics.jit import jit
from sim_core.numerics.vec3 import Flight, Vec3


def faces(
    numbers: np.ndarray, rows: np.ndarray, flights: np.ndarray, radius: float, face_overlap: float
) -> np.ndarray:
    """Contact of each flight with the face in its row of ``numbers``."""
    found = np.empty(len(rows))
    _faces(numbers, rows, flights, radius, face_overlap, found)
    return found


def capsules(
    numbers: np.ndarray, rows: np.ndarray, flights: np.ndarray, radius: float, limit: float
) -> np.ndarray:
    """Contact of each flight with the capsule in its row of ``numbers`` within ``limit`` [s]."""
    found = np.empty(len(rows))
    _capsules(numbers, rows, flights, radius, limit, found)
    return found


def meetings(apart: np.ndarray, closing: np.ndarray, reach: np.ndarray) -> np.ndarray:
    """Meeting of each two balls: relative position and velocity (n, 3), sum of the radii (n,)."""
    found = np.empty(len(reach))
    _meetings(apart, closing, reach, found)
    return found


def vibrating_planes(
    planes: np.ndarray,
    waves: np.ndarray,
    flights: np.ndarray,
    times: np.ndarray,
    radius: float,
    limits: np.ndarray,
    profiles: FaceProfiles | None = None,
) -> np.ndarray:
    """Contact of each flight with its vibrating plane: ``planes`` (n, 20) as obstacles hold them,
    ``waves`` (n, 6) amplitude, omega, phase and axis, ``times`` (n,) now, ``limits`` (n,) [s].
    """
    found = np.empty(len(times))
    _vibrating_planes(planes, waves, profiles, flights, times, radius, limits, found)
    return found


def contacts(
    surfaces: ObstacleSet,
    flights: np.ndarray,
    gravity: Gravity | None,
    wave: Wave | None,
    time: float,
    lengths: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """First contact of each flight (n, 6; relative to the mesh's centre) with a whole mesh: delays,
    and mesh triangles (-1: none).
    """
    found, obstacles = np.empty(len(lengths)), np.empty(len(lengths), dtype=np.int64)
    fall = np.zeros(3) if gravity is None else np.array(gravity)
    parabolas = np.column_stack([flights, np.tile(fall, (len(flights), 1))])
    overlap, scratch = surfaces.face_overlap, new_scratch()
    _contacts(surfaces.tree, scratch, parabolas, wave, overlap, time, lengths, found, obstacles)
    return found, np.where(obstacles >= 0, surfaces.tree.triangles[obstacles, 0], -1)


@jit
def _ball(flights: np.ndarray, i: int) -> Flight:
    return Flight(
        Vec3(flights[i, 0], flights[i, 1], flights[i, 2]),
        Vec3(flights[i, 3], flights[i, 4], flights[i, 5]),
        Vec3(flights[i, 6], flights[i, 7], flights[i, 8]),
    )


@jit
def _faces(
    numbers: np.ndarray,
    rows: np.ndarray,
    flights: np.ndarray,
    radius: float,
    face_overlap: float,
    found: np.ndarray,
) -> None:
    for i in range(len(rows)):
        found[i] = face_delay(numbers, rows[i], _ball(flights, i), radius, face_overlap)


@jit
def _capsules(
    numbers: np.ndarray,
    rows: np.ndarray,
    flights: np.ndarray,
    radius: float,
    limit: float,
    found: np.ndarray,
) -> None:
    for i in range(len(rows)):
        found[i] = capsule_delay(numbers, rows[i], _ball(flights, i), radius, limit)


@jit
def _meetings(apart: np.ndarray, closing: np.ndarray, reach: np.ndarray, found: np.ndarray) -> None:
    for i in range(len(reach)):
        found[i] = pair_delay(
            Vec3(apart[i, 0], apart[i, 1], apart[i, 2]),
            Vec3(closing[i, 0], closing[i, 1], closing[i, 2]),
            reach[i],
        )


@jit
def _vibrating_planes(
    planes: np.ndarray,
    waves: np.ndarray,
    profiles: FaceProfiles | None,
    flights: np.ndarray,
    times: np.ndarray,
    radius: float,
    limits: np.ndarray,
    found: np.ndarray,
) -> None:
    for i in range(len(times)):
        wave = Wave(
            waves[i, 0], waves[i, 1], waves[i, 2], Vec3(waves[i, 3], waves[i, 4], waves[i, 5])
        )
        found[i] = vibrating_plane_delay(
            planes, i, _ball(flights, i), radius, wave, profiles, times[i], limits[i]
        )


@jit
def _contacts(
    tree: Tree,
    scratch: Scratch,
    flights: np.ndarray,
    wave: Wave | None,
    face_overlap: float,
    time: float,
    lengths: np.ndarray,
    found: np.ndarray,
    obstacles: np.ndarray,
) -> None:
    for i in range(len(lengths)):
        ball = _ball(flights, i)
        found[i], obstacles[i] = first_contact(
            None,
            None,
            None,
            -1,
            tree,
            scratch,
            ball,
            wave,
            None,
            None,
            face_overlap,
            time,
            lengths[i],
        )
