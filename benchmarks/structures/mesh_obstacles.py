"""What every structure over a mesh starts from.

These are the obstacles for one radius of ball, and the exact test of one obstacle.
"""

from typing import Any, NamedTuple

import numpy as np

from benchmarks.structures.compiled import jit, search
from sim_core import Gravity, TriangleMesh
from sim_core.detect.ball_triangle import capsule_delay, face_delay
from sim_core.geometry.flat_faces import LONE, FlatFaces, surface_triangles
from sim_core.geometry.obstacles import CAPSULE, build_obstacle_table, face_overlap_of
from sim_core.motion import BallState
from sim_core.numerics.roots import NEVER
from sim_core.numerics.vec3 import Flight, Vec3

PIECE = 0.01  # s: arcs are searched in pieces of at most this, as the product does
TINY = 1e-30  # stands for a chord component of zero, whose inverse would be infinite
FALL = Vec3(*Gravity())


class Shell(NamedTuple):
    """Obstacles of a still mesh about its middle: every triangle is one, those of a flat too.

    ``numbers``, ``kinds``: see Obstacles. Each lies within ``grow`` (k,) [m] of the triangle
    ``points`` (k, 3 corners, 3) [m]; a capsule's is a segment.
    """

    numbers: np.ndarray
    kinds: np.ndarray
    points: np.ndarray
    grow: np.ndarray
    radius: float
    seam: float
    mesh: TriangleMesh
    corners: (
        np.ndarray
    )  # of the mesh itself (m, 3, 3) [m] about its middle, for those who ignore the obstacles


class Rows(NamedTuple):
    """Obstacles in a structure's own order, with neighbours near each other in memory.

    ``names`` are their rows in the shell.
    """

    numbers: np.ndarray
    kinds: np.ndarray
    names: np.ndarray
    radius: float
    seam: float


class Chord(NamedTuple):
    """The straight line under an arc: ``origin`` [m] and ``velocity`` [m/s].

    The arc lies up to ``bulge`` [m] away from it.
    """

    origin: Vec3
    velocity: Vec3
    bulge: Vec3


def build_shell(mesh: TriangleMesh, radius: float) -> Shell:
    """The mesh for balls of this radius [m], nothing vibrating."""
    surface = surface_triangles(mesh)
    none = np.zeros(0, np.int32)
    alone = FlatFaces(np.full(len(mesh.triangles), LONE, np.int32), none, np.zeros((0, 3, 3)), [])
    obstacles = build_obstacle_table(surface._replace(flat_faces=alone), radius)
    corners = mesh.corners - mesh.middle
    numbers, round_ = obstacles.numbers, obstacles.kinds == CAPSULE
    points = corners[obstacles.triangles[:, 0]] + radius * numbers[:, None, 0:3]
    start = numbers[round_, 0:3]
    points[round_] = start[:, None]
    points[round_, 1] += numbers[round_, 6:7] * numbers[round_, 3:6]
    grow = np.where(round_, radius, face_overlap_of(radius))
    return Shell(
        numbers, obstacles.kinds, points, grow, radius, face_overlap_of(radius), mesh, corners
    )


def sort_rows(shell: Shell, order: np.ndarray) -> Rows:
    """The shell's obstacles in this order."""
    names = order.astype(np.int32)
    return Rows(shell.numbers[order], shell.kinds[order], names, shell.radius, shell.seam)


def gaps(shell: Shell, obstacles: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Signed distances [m] of centres ``at`` (n, 3) from obstacles (n,).

    They are measured from the planes of faces and from the rounded surfaces of capsules.
    """
    numbers = shell.numbers[obstacles]
    plane = np.einsum("ij,ij->i", numbers[:, 0:3], at) - numbers[:, 3]
    offset = at - numbers[:, 0:3]  # a capsule's first three numbers are its start
    along = np.clip(np.einsum("ij,ij->i", offset, numbers[:, 3:6]), 0.0, numbers[:, 6])
    away = np.linalg.norm(offset - along[:, None] * numbers[:, 3:6], axis=1)
    return np.where(shell.kinds[obstacles] == CAPSULE, away - shell.radius, plane)


def padding(shell: Shell) -> float:
    """Added to float32 boxes [m], so that they are never smaller than the float64 ones."""
    return float(16.0 * np.finfo(np.float32).eps * (np.abs(shell.points).max() + shell.radius))


@jit
def delay_to(rows, row, ball, fall, limit):  # type: ignore[no-untyped-def]
    """Time [s] until the ball meets one obstacle; NEVER if it does not, or not within ``limit``."""
    flight = Flight(ball.position, ball.velocity, fall)
    if rows.kinds[row] == CAPSULE:
        return capsule_delay(rows.numbers, row, flight, rows.radius, limit)
    return face_delay(rows.numbers, row, flight, rows.radius, rows.seam)


@jit
def nearer(rows, row, ball, fall, best, found):  # type: ignore[no-untyped-def]
    """The first contact known and its row, after a look at this obstacle.

    Ties go to the lowest name.
    """
    delay = delay_to(rows, row, ball, fall, best)
    if delay < best or (delay == best and (found < 0 or rows.names[row] < rows.names[found])):
        return delay, row
    return best, found


@jit
def answer(rows, best, found):  # type: ignore[no-untyped-def]
    """What a search returns: the delay and the obstacle's name, or (NEVER, -1)."""
    return (best, int(rows.names[found])) if found >= 0 else (NEVER, -1)


@jit
def chord_of(ball, fall, length):  # type: ignore[no-untyped-def]
    """The chord of the ball's next ``length`` [s]."""
    half, bulge = 0.5 * length, -0.125 * length * length
    velocity = Vec3(
        ball.velocity.x + half * fall.x,
        ball.velocity.y + half * fall.y,
        ball.velocity.z + half * fall.z,
    )
    return Chord(ball.position, velocity, Vec3(bulge * fall.x, bulge * fall.y, bulge * fall.z))


@jit
def within_slab(origin, velocity, bulge, low, high, enter, leave):  # type: ignore[no-untyped-def]
    """Narrows the time [s] that a flight spends in a box to the time between two of its faces."""
    inverse = 1.0 / (velocity if abs(velocity) > TINY else TINY)
    one = (low - origin - max(bulge, 0.0)) * inverse
    two = (high - origin - min(bulge, 0.0)) * inverse
    return max(enter, min(one, two)), min(leave, max(one, two))


def ask(structure: Any, flights: np.ndarray, delays: np.ndarray, obstacles: np.ndarray) -> None:
    """When and what these flights (n, 6) meet first, into the last two (n,)."""
    _ask(structure, flights, FALL, delays, obstacles)


@jit
def _ask(structure, flights, fall, delays, obstacles):  # type: ignore[no-untyped-def]
    """The loop that every structure is timed in: whole flights, piece by piece."""
    for i in range(len(flights)):
        x, y, z = flights[i, 0], flights[i, 1], flights[i, 2]
        u, v, w = flights[i, 3], flights[i, 4], flights[i, 5]
        flown = 0.0
        while True:
            ball = BallState(
                Vec3(
                    x + flown * (u + 0.5 * flown * fall.x),
                    y + flown * (v + 0.5 * flown * fall.y),
                    z + flown * (w + 0.5 * flown * fall.z),
                ),
                Vec3(u + flown * fall.x, v + flown * fall.y, w + flown * fall.z),
            )
            delay, obstacle = search(structure, ball, fall, PIECE)
            if obstacle >= 0 or flown > 1.0:
                break
            flown += PIECE
        delays[i] = flown + delay
        obstacles[i] = obstacle
