"""What must never break, checked by other means than the code under test.

Containment by counting ray crossings (not by contact times), overlap by plain distances, energy and momentum by
their sums.
"""

import math

import numpy as np

from sim_core._compile import jit
from sim_core.balls import Balls
from sim_core.effects.gravity import Gravity
from sim_core.surfaces.mesh import TriangleMesh

# A ray direction no designer's edge is parallel to, so that a ray through an edge or corner is a coincidence; where it
# happens all the same (a crossing within 1e-9 of a border), the next direction is asked.
RAYS = np.array([[0.3671, 0.2113, 0.9058], [-0.5317, 0.7411, 0.4098], [0.6119, -0.4733, -0.6337]])
BORDER = 1e-9


@jit
def _crossings(corners: np.ndarray, point: np.ndarray, ray: np.ndarray) -> int:
    """Triangles a ray from the point crosses; -1 when one is crossed too near its border to tell.

    Möller & Trumbore, J. Graphics Tools 2 (1997) 21.
    """
    crossed = 0
    for t in range(len(corners)):
        ax, ay, az = corners[t, 0, 0], corners[t, 0, 1], corners[t, 0, 2]
        e1x, e1y, e1z = corners[t, 1, 0] - ax, corners[t, 1, 1] - ay, corners[t, 1, 2] - az
        e2x, e2y, e2z = corners[t, 2, 0] - ax, corners[t, 2, 1] - ay, corners[t, 2, 2] - az
        px, py, pz = ray[1] * e2z - ray[2] * e2y, ray[2] * e2x - ray[0] * e2z, ray[0] * e2y - ray[1] * e2x
        det = e1x * px + e1y * py + e1z * pz
        if det == 0.0:
            continue
        tx, ty, tz = point[0] - ax, point[1] - ay, point[2] - az
        u = (tx * px + ty * py + tz * pz) / det
        qx, qy, qz = ty * e1z - tz * e1y, tz * e1x - tx * e1z, tx * e1y - ty * e1x
        v = (ray[0] * qx + ray[1] * qy + ray[2] * qz) / det
        if u < -BORDER or v < -BORDER or u + v > 1.0 + BORDER:
            continue
        if (e2x * qx + e2y * qy + e2z * qz) / det <= 0.0:
            continue
        if u < BORDER or v < BORDER or u + v > 1.0 - BORDER:
            return -1
        crossed += 1
    return crossed


@jit
def _contains(corners: np.ndarray, points: np.ndarray, rays: np.ndarray, inside: np.ndarray) -> None:
    for i in range(len(points)):
        for k in range(len(rays)):
            crossed = _crossings(corners, points[i], rays[k])
            if crossed >= 0:
                break
        inside[i] = crossed % 2 == 1


def contained(mesh: TriangleMesh, points: np.ndarray) -> np.ndarray:
    """Which points (n, 3) [m] lie inside the mesh, shape (n,) bool, by ray parity."""
    points = np.ascontiguousarray(points, dtype=np.float64)
    inside = np.zeros(len(points), dtype=np.bool_)
    _contains(mesh.corners, points, RAYS, inside)
    return inside


@jit
def _distance_squared(corners: np.ndarray, t: int, px: float, py: float, pz: float) -> float:
    """Squared distance from a point to a triangle: Ericson, Real-Time Collision Detection (2005), section 5.1.5."""
    ax, ay, az = corners[t, 0, 0], corners[t, 0, 1], corners[t, 0, 2]
    bx, by, bz = corners[t, 1, 0] - ax, corners[t, 1, 1] - ay, corners[t, 1, 2] - az
    cx, cy, cz = corners[t, 2, 0] - ax, corners[t, 2, 1] - ay, corners[t, 2, 2] - az
    x, y, z = px - ax, py - ay, pz - az
    bb, bc, cc = bx * bx + by * by + bz * bz, bx * cx + by * cy + bz * cz, cx * cx + cy * cy + cz * cz
    xb, xc = x * bx + y * by + z * bz, x * cx + y * cy + z * cz
    det = bb * cc - bc * bc
    v, w = -1.0, -1.0
    if det > 0.0:
        v, w = (cc * xb - bc * xc) / det, (bb * xc - bc * xb) / det
    if v >= 0.0 and w >= 0.0 and v + w <= 1.0:
        dx, dy, dz = x - v * bx - w * cx, y - v * by - w * cy, z - v * bz - w * cz
        return dx * dx + dy * dy + dz * dz
    nearest = math.inf
    for side in range(3):  # outside the face: the nearest of the three borders
        if side == 0:
            ox, oy, oz, ex, ey, ez = x, y, z, bx, by, bz
        elif side == 1:
            ox, oy, oz, ex, ey, ez = x, y, z, cx, cy, cz
        else:
            ox, oy, oz, ex, ey, ez = x - bx, y - by, z - bz, cx - bx, cy - by, cz - bz
        length = ex * ex + ey * ey + ez * ez
        s = 0.0
        if length > 0.0:
            s = min(max((ox * ex + oy * ey + oz * ez) / length, 0.0), 1.0)
        dx, dy, dz = ox - s * ex, oy - s * ey, oz - s * ez
        nearest = min(nearest, dx * dx + dy * dy + dz * dz)
    return nearest


@jit
def _clear(
    corners: np.ndarray, low: np.ndarray, high: np.ndarray, points: np.ndarray, reach: float, gap: np.ndarray
) -> None:
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        nearest = reach * reach
        for t in range(len(corners)):
            if (
                low[t, 0] - reach < x < high[t, 0] + reach
                and low[t, 1] - reach < y < high[t, 1] + reach
                and low[t, 2] - reach < z < high[t, 2] + reach
            ):
                nearest = min(nearest, _distance_squared(corners, t, x, y, z))
        gap[i] = math.sqrt(nearest)


def clearance(mesh: TriangleMesh, points: np.ndarray, reach: float) -> np.ndarray:
    """Distance (n,) [m] from points (n, 3) [m] to the nearest triangle, at most ``reach`` [m]."""
    points = np.ascontiguousarray(points, dtype=np.float64)
    gap = np.zeros(len(points))
    corners = mesh.corners
    _clear(corners, corners.min(axis=1), corners.max(axis=1), points, reach, gap)
    return gap


def closest_pair(balls: Balls) -> tuple[float, int, int]:
    """Smallest centre distance [m] among the balls, and which two; (inf, -1, -1) for a single ball."""
    if len(balls) < 2:
        return math.inf, -1, -1
    from scipy.spatial import KDTree

    distance, partner = KDTree(balls.positions).query(balls.positions, k=2)
    one = int(distance[:, 1].argmin())
    return float(distance[one, 1]), one, int(partner[one, 1])


def energy(balls: Balls, gravity: Gravity | None = None) -> float:
    """Kinetic plus potential energy [J], potential zero at the origin."""
    total = 0.5 * float(np.einsum("ij,ij->", balls.velocities, balls.velocities))
    if gravity is not None:
        total -= float(np.sum(balls.positions @ np.array([gravity.x, gravity.y, gravity.z])))
    return balls.ball_mass * total


def momentum(balls: Balls) -> np.ndarray:
    """Total momentum [kg m/s], shape (3,)."""
    return np.asarray(balls.ball_mass * balls.velocities.sum(axis=0))
