"""Invariants of a simulation, checked by other means than the code under test.

Containment is checked by counting ray crossings (not by contact times), overlap by plain distances,
energy and momentum by their sums.
"""

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sim_core.balls import Balls
from sim_core.effects.gravity import Gravity
from sim_core.effects.part_rotation import (
    PartRotation,
    angle_at,
    checked_axis,
    new_rotation_state,
    rotate_points,
)
from sim_core.effects.vibration import Vibration
from sim_core.geometry.analytic import AnalyticCavity, periods_of
from sim_core.geometry.mesh import TriangleMesh
from sim_core.numerics.computed_once import computed_once
from sim_core.numerics.jit import jit
from sim_core.numerics.vec3 import Vec3, cross, dot, sub
from sim_core.scene.frames import Frames, energies

if TYPE_CHECKING:
    from scipy.spatial import KDTree

Room = TriangleMesh | AnalyticCavity
# Directions that no designer's edge is parallel to, so that a ray rarely passes through an edge or
# corner. If it does, the next direction is tried.
RAYS = np.array([[0.3671, 0.2113, 0.9058], [-0.5317, 0.7411, 0.4098], [0.6119, -0.4733, -0.6337]])
LIFT = 1e-3  # share of a radius: height above a plane to which a point beneath it is lifted
BENEATH = 1e-9  # m: depth beneath the lowest place of a face that counts as rounding
BORDER = 1e-12  # share of the mesh's size squared: a ray that passes an edge by less is undecided
IN_CELL, IN_CELLS = 8, 16  # intended triangles in a cell, and largest number of cells of a triangle


class _Projection(NamedTuple):
    """The triangles of a mesh, projected along one of the directions RAYS."""

    corners: np.ndarray  # corner positions with the ray as third axis [m], shape (m, 3, 3)
    boxes: np.ndarray  # low and high of the first axis and of the second [m], shape (m, 4)
    cells: "_Cells"  # cells of a grid over the boxes
    axes: np.ndarray  # axes of the projection, shape (3, 3), one a row
    border: float  # a doubled area smaller than this is undecided [m²]


class _Cells(NamedTuple):
    """A grid of s by s cells across the ray, and the triangles whose boxes meet each cell.

    Cell (i, j) has the members from first[i s + j] up to first[i s + j + 1].
    """

    low: np.ndarray  # corner of the grid [m], shape (2,)
    size: np.ndarray  # sides of a cell [m], shape (2,)
    side: int  # s
    first: np.ndarray  # shape (s² + 1,) int64
    members: np.ndarray  # numbers of triangles, int32


def _cells_of(boxes: np.ndarray, side: int) -> _Cells:
    """Return a grid of ``side``² cells over boxes (m, 4) [m], with the boxes in each cell.

    A grid in which boxes meet more than IN_CELLS cells on average is made coarser.
    """
    low, high = boxes[:, ::2].min(axis=0), boxes[:, 1::2].max(axis=0)
    while True:
        size: np.ndarray = np.maximum((high - low) / side, np.finfo(float).tiny)
        start, end = (
            np.minimum((boxes[:, k::2] - low) / size, side - 1).astype(np.int64) for k in (0, 1)
        )
        wide, tall = (end - start + 1).T
        if side == 1 or (wide * tall).sum() <= IN_CELLS * len(boxes):
            break
        side = (side + 1) // 2
    owner = np.repeat(np.arange(len(boxes), dtype=np.int32), wide * tall)
    number = np.arange(len(owner)) - np.repeat(np.cumsum(wide * tall) - wide * tall, wide * tall)
    across, up = np.divmod(number, tall[owner])
    cell = (start[owner, 0] + across) * side + start[owner, 1] + up
    first = np.concatenate([[0], np.cumsum(np.bincount(cell, minlength=side * side))])
    return _Cells(low, size, side, first, owner[np.argsort(cell, kind="stable")])


@computed_once(32)
def _projection(mesh: TriangleMesh, k: int) -> _Projection:
    return _project(mesh.corners, mesh, k)


def _project(triangles: np.ndarray, mesh: TriangleMesh, k: int) -> _Projection:
    """Return the triangles (m, 3, 3) [m] projected along direction RAYS[k], in cells.

    The mesh gives the scale of rounding.
    """
    ray = RAYS[k] / np.linalg.norm(RAYS[k])
    side = np.cross(ray, [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    axes = np.stack([side, np.cross(ray, side), ray])
    corners = np.ascontiguousarray(triangles @ axes.T)
    low, high = corners.min(axis=1), corners.max(axis=1)
    boxes = np.stack([low[:, 0], high[:, 0], low[:, 1], high[:, 1]], axis=1)
    border = BORDER * float(np.ptp(mesh.vertices, axis=0).max()) ** 2
    cells = _cells_of(boxes, max(1, math.isqrt(len(triangles) // IN_CELL)))
    return _Projection(corners, boxes, cells, axes, border)


@jit
def _crossings(projection: _Projection, u: float, v: float, w: float) -> int:
    """Return how many triangles a ray from (u, v, w) along axis 3 crosses; -1 if that is undecided.

    It is undecided if the ray passes through an edge up to rounding.
    """
    crossed = 0
    corners, boxes, cells = projection.corners, projection.boxes, projection.cells
    i, j = _cell(cells, 0, u), _cell(cells, 1, v)
    for at in range(cells.first[i * cells.side + j], cells.first[i * cells.side + j + 1]):
        t = cells.members[at]
        if u < boxes[t, 0] or u > boxes[t, 1] or v < boxes[t, 2] or v > boxes[t, 3]:
            continue
        au, av = corners[t, 0, 0] - u, corners[t, 0, 1] - v
        bu, bv = corners[t, 1, 0] - u, corners[t, 1, 1] - v
        cu, cv = corners[t, 2, 0] - u, corners[t, 2, 1] - v
        # twice the areas seen along the ray
        a, b, c = bu * cv - bv * cu, cu * av - cv * au, au * bv - av * bu
        if min(abs(a), abs(b), abs(c)) <= projection.border:
            return -1
        if (a > 0.0) == (b > 0.0) == (c > 0.0):
            above = a * corners[t, 0, 2] + b * corners[t, 1, 2] + c * corners[t, 2, 2]
            if above / (a + b + c) > w:
                crossed += 1
    return crossed


@jit
def _cell(cells: _Cells, axis: int, x: float) -> int:
    """Return the index of the cell along ``axis`` that is nearest to the coordinate ``x`` [m]."""
    steps = (x - cells.low[axis]) / cells.size[axis]
    return int(min(max(steps, 0.0), float(cells.side - 1)))


@jit
def _mark_near(projection: _Projection, points: np.ndarray, reach: float, near: np.ndarray) -> None:
    corners, boxes, cells = projection.corners, projection.boxes, projection.cells
    for n in range(len(points)):
        u, v, w = points[n, 0], points[n, 1], points[n, 2]
        for i in range(_cell(cells, 0, u - reach), _cell(cells, 0, u + reach) + 1):
            row = i * cells.side
            first = cells.first[row + _cell(cells, 1, v - reach)]
            for at in range(first, cells.first[row + _cell(cells, 1, v + reach) + 1]):
                t = cells.members[at]
                a, b, c = corners[t, 0, 2], corners[t, 1, 2], corners[t, 2, 2]
                if (
                    boxes[t, 0] - reach <= u <= boxes[t, 1] + reach
                    and boxes[t, 2] - reach <= v <= boxes[t, 3] + reach
                    and min(a, b, c) - reach <= w <= max(a, b, c) + reach
                ):
                    near[t] = True


def triangles_near(mesh: TriangleMesh, points: np.ndarray, reach: float) -> np.ndarray:
    """Return the numbers of all triangles within ``reach`` [m] of any of the points (n, 3).

    The numbers of some triangles farther away may be among them.
    """
    return _near(_projection(mesh, 0), mesh, points, reach)


def _near(
    projection: _Projection, mesh: TriangleMesh, points: np.ndarray, reach: float
) -> np.ndarray:
    """Return the numbers of the triangles of a projection of the mesh as `triangles_near` does."""
    near = np.zeros(len(mesh.triangles), dtype=np.bool_)
    wide = reach * (1.0 + 1e-9) + 1e-12 * float(np.abs(mesh.bounds).max())  # widened for rounding
    _mark_near(projection, np.ascontiguousarray(points @ projection.axes.T), wide, near)
    return np.flatnonzero(near)


def _crossed(projection: _Projection, points: np.ndarray) -> np.ndarray:
    """Return how many triangles the ray from each point (n, 3) [m] crosses, (n,); -1: undecided."""
    crossed = np.zeros(len(points), dtype=np.int64)
    _count(projection, np.ascontiguousarray(points @ projection.axes.T), crossed)
    return crossed


@jit
def _count(projection: _Projection, points: np.ndarray, crossed: np.ndarray) -> None:
    for i in range(len(points)):
        crossed[i] = _crossings(projection, points[i, 0], points[i, 1], points[i, 2])


def contained(
    mesh: TriangleMesh, points: np.ndarray, corners: np.ndarray | None = None
) -> np.ndarray:
    """Tell which points are inside the mesh, by the parity of crossings along a ray.

    Args:
        mesh: the surface.
        points: positions [m], shape (n, 3).
        corners: present corners of the triangles [m], shape (m, 3, 3), if these differ from the
            mesh.

    Returns:
        True for each point inside, shape (n,) bool.
    """
    if corners is not None:
        return TurnedSurface(mesh, corners).encloses(points)
    points = np.asarray(points, dtype=np.float64)
    inside = np.zeros(len(points), dtype=np.bool_)
    undecided = np.arange(len(points))
    for k in range(len(RAYS)):
        crossed = _crossed(_projection(mesh, k), points[undecided])
        inside[undecided] = crossed % 2 == 1
        undecided = undecided[crossed < 0]
        if len(undecided) == 0:
            break
    return inside


def beneath_mean_plane(
    mesh: TriangleMesh,
    vibrations: tuple[Vibration, ...],
    points: np.ndarray,
    radii: np.ndarray,
    corners: np.ndarray | None = None,
) -> np.ndarray:
    """Tell which ball centres may be beneath a vibrating face's mean plane, where it is at rest.

    A ball gets there only if the face's amplitude is larger than the ball's radius. Its centre is
    then beneath the mean plane by at most the amplitude minus the radius, and would be inside the
    mesh if it were lifted above the plane.

    Args:
        mesh: the surface.
        vibrations: vibrations of its faces.
        points: ball centres [m], shape (n, 3).
        radii: radii of the balls [m], shape (n,).
        corners: present corners of the triangles [m], shape (m, 3, 3), if these differ from the
            mesh.

    Returns:
        True for each such centre, shape (n,) bool.
    """
    inside = np.zeros(len(points), dtype=np.bool_)
    for one in vibrations:
        room = one.amplitude - radii
        if (room <= 0.0).all():
            continue
        face = mesh.corners[mesh.tags == one.tag]
        up = one.peak / one.amplitude
        outward = np.cross(face[:, 1] - face[:, 0], face[:, 2] - face[:, 0]).sum(axis=0)
        up = up if outward @ up <= 0.0 else -up
        depth = (face @ up).max() - points @ up
        here = np.flatnonzero((depth >= 0.0) & (depth <= room + BENEATH))
        lifted = points[here] + (depth[here] + LIFT * radii[here])[:, None] * up
        inside[here] |= contained(mesh, lifted, corners)
    return inside


class TurnedSurface:
    """The surface of a mesh whose part has turned, for questions about many points."""

    def __init__(self, mesh: TriangleMesh, corners: np.ndarray) -> None:
        """Project the present corners of the triangles [m], (m, 3, 3), along two directions."""
        self.mesh, self.corners = mesh, corners
        self.projections = [_project(corners, mesh, k) for k in range(2)]

    def near(self, points: np.ndarray, reach: float) -> np.ndarray:
        """Return the numbers of all triangles near any of the points, as `triangles_near` does."""
        return _near(self.projections[0], self.mesh, points, reach)

    def encloses(self, points: np.ndarray) -> np.ndarray:
        """Return True for points (n, 3) [m] that the triangles enclose.

        Where two rays do not agree, as one passes through a slit between the part and a wall, the
        solid angle decides, which takes all triangles for each point.
        """
        crossed = np.array([_crossed(one, points) for one in self.projections])
        odd = crossed % 2 == 1
        unclear = (crossed < 0).any(axis=0) | (odd[0] != odd[1])
        inside = odd[0].copy()
        inside[unclear] = enclosed(self.corners, points[unclear])
        return np.asarray(inside)


def enclosed(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return True for points (n, 3) [m] enclosed by triangles (m, 3, 3), by their solid angle."""
    angle = np.zeros(len(points))
    _solid_angles(
        np.ascontiguousarray(corners), np.ascontiguousarray(points, dtype=np.float64), angle
    )
    return np.asarray(angle > 2.0 * math.pi)


@jit
def _solid_angles(corners: np.ndarray, points: np.ndarray, angle: np.ndarray) -> None:
    """Add the solid angle [sr] of all triangles, seen from each point, to ``angle`` (n,).

    Source: van Oosterom & Strackee, IEEE Trans. Biomed. Eng. 30 (1983) 125.
    """
    for i in range(len(points)):
        at = Vec3(points[i, 0], points[i, 1], points[i, 2])
        for t in range(len(corners)):
            a = sub(Vec3(corners[t, 0, 0], corners[t, 0, 1], corners[t, 0, 2]), at)
            b = sub(Vec3(corners[t, 1, 0], corners[t, 1, 1], corners[t, 1, 2]), at)
            c = sub(Vec3(corners[t, 2, 0], corners[t, 2, 1], corners[t, 2, 2]), at)
            p, q, r = math.sqrt(dot(a, a)), math.sqrt(dot(b, b)), math.sqrt(dot(c, c))
            below = p * q * r + dot(a, b) * r + dot(b, c) * p + dot(c, a) * q
            angle[i] += 2.0 * math.atan2(dot(a, cross(b, c)), below)


def turned_corners(
    mesh: TriangleMesh, turn: PartRotation, angle: float | None = None
) -> np.ndarray:
    """Return the corners (m, 3, 3) [m] of the mesh with the part turned by ``angle`` [rad].

    Without ``angle`` the part is turned by its angle at the start.
    """
    rotation = new_rotation_state(turn, mesh.middle)
    assert rotation is not None
    angle = angle_at(rotation, 0.0) if angle is None else angle
    axis = checked_axis(turn)
    assert axis is not None
    corners = mesh.corners.copy()
    own = axis.turns(mesh.tags)
    point, direction = np.array(axis.point), np.array(axis.axis)
    corners[own] = rotate_points(corners[own], point, direction, angle)
    return corners


@jit
def _distance_squared(corners: np.ndarray, t: int, px: float, py: float, pz: float) -> float:
    """Return the squared distance [m²] of the point (px, py, pz) from triangle number t.

    Source: C. Ericson, Real-Time Collision Detection (2005), section 5.1.5.
    """
    ax, ay, az = corners[t, 0, 0], corners[t, 0, 1], corners[t, 0, 2]
    bx, by, bz = corners[t, 1, 0] - ax, corners[t, 1, 1] - ay, corners[t, 1, 2] - az
    cx, cy, cz = corners[t, 2, 0] - ax, corners[t, 2, 1] - ay, corners[t, 2, 2] - az
    x, y, z = px - ax, py - ay, pz - az
    bb, bc = bx * bx + by * by + bz * bz, bx * cx + by * cy + bz * cz
    cc = cx * cx + cy * cy + cz * cz
    xb, xc = x * bx + y * by + z * bz, x * cx + y * cy + z * cz
    det = bb * cc - bc * bc
    v, w = -1.0, -1.0
    if det > 0.0:
        v, w = (cc * xb - bc * xc) / det, (bb * xc - bc * xb) / det
    if v >= 0.0 and w >= 0.0 and v + w <= 1.0:
        dx, dy, dz = x - v * bx - w * cx, y - v * by - w * cy, z - v * bz - w * cz
        return float(dx * dx + dy * dy + dz * dz)
    nearest = math.inf
    for side in range(3):  # the point is outside the face: take the closest of the three borders
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
    corners: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    points: np.ndarray,
    reach: float,
    gap: np.ndarray,
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


def clearance(corners: np.ndarray, points: np.ndarray, reach: float) -> np.ndarray:
    """Return distances (n,) [m] of points (n, 3) from the nearest triangle, capped at ``reach``."""
    points = np.ascontiguousarray(points, dtype=np.float64)
    gap = np.zeros(len(points))
    _clear(corners, corners.min(axis=1), corners.max(axis=1), points, reach, gap)
    return gap


def closest_pair(balls: Balls, room: Room | None = None) -> tuple[float, int, int]:
    """Return the smallest distance [m] of two ball centres, and the numbers of the two balls.

    For a single ball the result is (inf, -1, -1).

    Args:
        balls: any balls.
        room: the cavity, which matters if it is periodic.
    """
    if len(balls) < 2:
        return math.inf, -1, -1
    tree = _pair_tree(balls, room)
    distance, partner = tree.query(tree.data, k=2)
    one = int(distance[:, 1].argmin())
    two = int(partner[one, 1])  # if balls share a place, the first neighbour may be either ball
    return float(distance[one, 1]), one, two if two != one else int(partner[one, 0])


def narrowest_gap(balls: Balls, room: Room | None = None) -> tuple[float, int, int]:
    """Return the smallest gap [m] between two balls, negative if they overlap, and the two balls.

    The result is (inf, -1, -1) for a single ball, and for balls of several sizes if no two are
    nearer than the largest diameter. The room matters if it is periodic.
    """
    if np.ndim(balls.diameter) == 0:
        distance, one, two = closest_pair(balls, room)
        return distance - float(balls.diameter), one, two
    pairs = _pair_tree(balls, room).query_pairs(2.0 * balls.radius, output_type="ndarray")
    if len(pairs) == 0:
        return math.inf, -1, -1
    apart = balls.positions[pairs[:, 0]] - balls.positions[pairs[:, 1]]
    sides = np.zeros(3) if room is None else periods_of(room)
    apart -= sides * np.rint(apart / np.where(sides > 0.0, sides, np.inf))
    gap = np.linalg.norm(apart, axis=1) - 0.5 * balls.diameters[pairs].sum(axis=1)
    worst = int(gap.argmin())
    return float(gap[worst]), int(pairs[worst, 0]), int(pairs[worst, 1])


def _pair_tree(balls: Balls, room: Room | None) -> "KDTree":
    """Return a search tree of the balls' centres, with images if the room is periodic."""
    from scipy.spatial import KDTree

    if not isinstance(room, AnalyticCavity) or not room.periods.any():
        return KDTree(balls.positions)
    places, sides = balls.positions - room.bounds[0], room.periods
    for axis in room.periodic:  # below the side, because rounding would put points on it
        within = np.mod(places[:, axis], sides[axis])
        places[:, axis] = np.minimum(within, np.nextafter(sides[axis], 0.0))
    return KDTree(places, boxsize=sides)


def energy(balls: Balls, gravity: Gravity | None = None) -> float:
    """Return the kinetic energy, spins included, plus the potential energy of all balls [J].

    The potential energy is 0 at the origin.
    """
    spins = None if balls.spins is None else balls.spins[None]
    now = Frames(np.zeros(1), balls.positions[None], balls.velocities[None], spins)
    return float(energies(now, balls, gravity).total[0])


def momentum(balls: Balls) -> np.ndarray:
    """Return the total momentum of all balls [kg m/s], shape (3,)."""
    return np.asarray(balls.masses @ balls.velocities)
