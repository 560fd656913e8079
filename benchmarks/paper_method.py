"""The wall query of the paper this project starts from.

Every triangle is a plane, the ball is a point, and only faces are tested. Badreddine et al., "CAD
based simulation of ultrasonic shot peening", section 3.1, equations 3 and 4: solve the quadratic
for each plane and keep the smallest positive root whose point lies in the triangle. It is compiled
as our own query is.
"""

import math
import time

import numba
import numpy as np

from sim_core import Gravity, TriangleMesh


@numba.njit(error_model="numpy")
def _nearest(corners, normals, position, velocity, g):  # type: ignore[no-untyped-def]
    best = math.inf
    for t in range(len(corners)):
        nx, ny, nz = normals[t, 0], normals[t, 1], normals[t, 2]
        a = -0.5 * g * nz
        b = velocity[0] * nx + velocity[1] * ny + velocity[2] * nz
        c = (
            (position[0] - corners[t, 0, 0]) * nx
            + (position[1] - corners[t, 0, 1]) * ny
            + (position[2] - corners[t, 0, 2]) * nz
        )
        s = math.inf
        if a == 0.0:
            if b != 0.0 and -c / b > 0.0:
                s = -c / b
        else:
            disc = b * b - 4.0 * a * c
            if disc <= 0.0:
                continue
            root = math.sqrt(disc)
            one, two = (-b - root) / (2.0 * a), (-b + root) / (2.0 * a)
            if one > 0.0:
                s = one
            if two > 0.0 and two < s:
                s = two
        if s >= best:
            continue
        x, y = position[0] + velocity[0] * s, position[1] + velocity[1] * s
        z = position[2] + velocity[2] * s - 0.5 * g * s * s
        inside = True
        for k in range(3):
            px, py, pz = corners[t, k, 0], corners[t, k, 1], corners[t, k, 2]
            j = (k + 1) % 3
            ex, ey, ez = corners[t, j, 0] - px, corners[t, j, 1] - py, corners[t, j, 2] - pz
            wx, wy, wz = x - px, y - py, z - pz
            side = nx * (ey * wz - ez * wy) + ny * (ez * wx - ex * wz) + nz * (ex * wy - ey * wx)
            if side < 0.0:
                inside = False
                break
        if inside:
            best = s
    return best


@numba.njit(error_model="numpy")
def _all(corners, normals, positions, velocities, g):  # type: ignore[no-untyped-def]
    total = 0.0
    for i in range(len(positions)):
        s = _nearest(corners, normals, positions[i], velocities[i], g)
        if s < math.inf:
            total += s
    return total


def planes(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners (m, 3, 3) [m] and unit normals (m, 3): all there is to build."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return corners, normals / np.linalg.norm(normals, axis=1)[:, None]


def ask(
    corners: np.ndarray, normals: np.ndarray, positions: np.ndarray, velocities: np.ndarray
) -> float:
    """Sum of the contact times [s] of these flights (n, 3)."""
    return float(_all(corners, normals, positions, velocities, -Gravity().z))


def query_ns(mesh: TriangleMesh, positions: np.ndarray, velocities: np.ndarray) -> float:
    """CPU time of one query [ns], the mean over these flights (n, 3)."""
    surfaces = planes(mesh.corners)
    ask(*surfaces, positions[:1], velocities[:1])
    start = time.process_time()
    ask(*surfaces, positions, velocities)
    return (time.process_time() - start) / len(positions) * 1e9
