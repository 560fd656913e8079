"""The obstacles of a part that turns, in a tree of their own, and whether it can turn at all where it is."""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from sim_core.effects.part_rotation import Axle
from sim_core.errors import SceneError
from sim_core.geometry.bvh import Tree, build_tree
from sim_core.geometry.flat_faces import edge_partners
from sim_core.geometry.mesh import TriangleMesh
from sim_core.geometry.obstacles import Obstacles
from sim_core.numerics.jit import jit
from sim_core.numerics.vec3 import Vec3, along, dot, sub

# Of a radius: how far the joint between part and chamber may gape while the part turns. A ball's centre stays a
# radius off the wall, so that of a slit no wider it sees nothing.
OPENING = 0.9
ROUNDINGS = 16.0
TOUCH = 1e-9  # m: a corner's path this near a triangle's border touches and does not cross


class PartTree(NamedTuple):
    """The part's obstacles; coordinates relative to the mesh's middle, where the part is at angle 0.

    ``low``, ``high``: least and largest distance [m] along the axis, from its point, at which a ball's centre can
    touch the part; ``reach`` [m], the same across the axis.
    """

    tree: Tree
    low: float
    high: float
    reach: float


def part_of(obstacles: Obstacles, mesh: TriangleMesh, axle: Axle, radius: float) -> np.ndarray:
    """Which obstacles (k,) turn with the part.

    Raises SceneError where the part cannot turn, see require_free_axle, or meets the chamber in an edge that balls of
    this radius [m] can touch.
    """
    require_free_axle(mesh, axle, radius)
    sides = (mesh.tags == axle.tag)[obstacles.triangles]
    mixed = np.flatnonzero(sides[:, 0] != sides[:, 1])
    if len(mixed):
        one, two = obstacles.triangles[mixed[0]]
        raise SceneError(
            f"the turning part meets the chamber in an edge that balls can touch, of triangles {one} and {two}: that "
            "is not supported; the joint must be a corner that recedes from the shot, as where a shaft goes through "
            "a ceiling"
        )
    return np.asarray(sides[:, 0])


@lru_cache(maxsize=32)  # asked at every replica's start
def require_free_axle(mesh: TriangleMesh, axle: Axle, radius: float) -> None:
    """Raises SceneError if the part cannot turn in its chamber.

    The line where part and chamber are one surface must stay where it is but for OPENING of a ball's radius [m]: a
    circle about the axis, as where a round shaft goes through a wall. Elsewhere no corner of the part may pass through
    a triangle of the chamber as it turns, nor one of the chamber through the part. What is not seen is two edges that
    cross with no corner of either passing through the other side.
    """
    turning = mesh.tags == axle.tag
    joint = _joint(mesh, turning)
    _require_round_joint(mesh, joint, axle, radius)
    _require_free_corners(mesh, turning, mesh.vertices[joint[:, 2:]], axle, radius)


def part_tree(obstacles: Obstacles, mesh: TriangleMesh, axle: Axle, radius: float) -> PartTree:
    """The tree of the part's own obstacles of balls of this radius [m]."""
    corners = mesh.corners[mesh.tags == axle.tag].reshape(-1, 3)
    height, across = _about(corners, axle)
    margin = 1.001 * radius  # and what faces overlap
    # balls are seen from the part as far off as the room and the axis go: float32 rounds that, not the part's size
    furthest = (
        np.abs(mesh.vertices - mesh.middle).max()
        + 2.0 * np.abs(np.array(axle.point) - mesh.middle).max()
    )
    pad = ROUNDINGS * np.finfo(np.float32).eps * furthest
    return PartTree(
        build_tree(obstacles._replace(low=obstacles.low - pad, high=obstacles.high + pad), radius),
        float(height.min()) - margin,
        float(height.max()) + margin,
        float(np.linalg.norm(across, axis=1).max()) + margin,
    )


def chosen(obstacles: Obstacles, rows: np.ndarray) -> Obstacles:
    """Some of the obstacles."""
    return Obstacles(*(np.ascontiguousarray(column[rows]) for column in obstacles))


def _about(points: np.ndarray, axle: Axle) -> tuple[np.ndarray, np.ndarray]:
    """Distances along the axis (...) [m] and what is left across it (..., 2) [m] of points (..., 3)."""
    axis = np.array(axle.axis)
    side = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    side /= np.linalg.norm(side)
    offset = points - np.array(axle.point)
    return offset @ axis, np.stack([offset @ side, offset @ np.cross(axis, side)], axis=-1)


def _stacked(points: np.ndarray, axle: Axle) -> np.ndarray:
    """Points (..., 3) [m] in the axle's own axes: two across, then along."""
    height, across = _about(points, axle)
    return np.ascontiguousarray(np.concatenate([across, height[..., None]], axis=-1))


def _joint(mesh: TriangleMesh, turning: np.ndarray) -> np.ndarray:
    """The edges (n, 4) between part and chamber: triangle of the part, of the chamber, and both vertices."""
    partner = edge_partners(mesh.triangles)
    edges = np.flatnonzero(np.repeat(turning, 3) & ~turning[partner // 3])
    ends = mesh.triangles.reshape(-1)[edges], mesh.triangles[edges // 3, (edges % 3 + 1) % 3]
    return np.stack([edges // 3, partner[edges] // 3, *ends], axis=1)


def _require_round_joint(mesh: TriangleMesh, joint: np.ndarray, axle: Axle, radius: float) -> None:
    if len(joint) == 0:
        return
    line = _connected(joint[:, 2:])
    height, across = _about(mesh.vertices[joint[:, 2:]], axle)
    way = across[:, 1] - across[:, 0]
    length = np.maximum(np.einsum("ij,ij->i", way, way), 1e-300)
    share = np.clip(-np.einsum("ij,ij->i", across[:, 0], way) / length, 0.0, 1.0)
    nearest = np.linalg.norm(across[:, 0] + share[:, None] * way, axis=1)
    furthest = np.linalg.norm(across, axis=2).max(axis=1)
    for k in range(int(line.max()) + 1):
        own = line == k
        gape = max(furthest[own].max() - nearest[own].min(), np.ptp(height[own]))
        gape = min(gape, axle.swing * furthest[own].max())
        if gape > OPENING * radius:
            one, two = joint[own][0, :2]
            raise SceneError(
                f"the turning part is joined to the chamber, at triangles {one} and {two}, along a line that is not "
                f"round about its axis: turning would open a gap of {1e3 * gape:.3g} mm, and balls of "
                f"{2e3 * radius:.3g} mm allow {1e3 * OPENING * radius:.3g}; let it go through the wall with a round "
                "shaft about its axis, or end clear of the wall"
            )


def _connected(ends: np.ndarray) -> np.ndarray:
    """Which line (n,), counted from 0, each edge belongs to; ``ends`` (n, 2): its vertices."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    _, flat = np.unique(ends, return_inverse=True)
    pairs = flat.reshape(-1, 2)
    size = int(pairs.max()) + 1
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(size, size))
    return np.asarray(connected_components(graph, directed=False)[1][pairs[:, 0]])


def _require_free_corners(
    mesh: TriangleMesh, turning: np.ndarray, joint: np.ndarray, axle: Axle, radius: float
) -> None:
    """``joint`` (n, 2, 3) [m]: beside these edges a corner may pass through what it is joined to."""
    part, room = np.unique(mesh.triangles[turning]), np.unique(mesh.triangles[~turning])
    line = _stacked(joint, axle)
    for corners, triangles in (
        (np.setdiff1d(part, room), ~turning),
        (np.setdiff1d(room, part), turning),
    ):
        place = np.zeros(2, dtype=np.int64)
        if _passes_through(
            _stacked(mesh.vertices[corners], axle),
            _stacked(mesh.corners[triangles], axle),
            line,
            axle.swing,
            OPENING * radius,
            place,
        ):
            at = np.round(mesh.vertices[corners[place[0]]], 6).tolist()
            raise SceneError(
                f"the part cannot turn: on its way the corner at {at} m passes through triangle "
                f"{np.flatnonzero(triangles)[place[1]]}; move the axis, or make room about the part"
            )


@jit
def _passes_through(
    corners: np.ndarray,
    triangles: np.ndarray,
    joint: np.ndarray,
    swing: float,
    beside: float,
    place: np.ndarray,
) -> bool:
    """True when a corner's circle about the axis, as far as it swings, crosses a triangle; ``place``: which two.

    Crossings ``beside`` [m] the joint or nearer do not count.
    """
    for t in range(len(triangles)):
        a, b, c = triangles[t, 0, 2], triangles[t, 1, 2], triangles[t, 2, 2]
        low, high = min(a, b, c) + TOUCH, max(a, b, c) - TOUCH
        for i in range(len(corners)):
            if low < corners[i, 2] < high and _crosses(
                triangles, t, corners, i, joint, swing, beside
            ):
                place[0], place[1] = i, t
                return True
    return False


@jit
def _crosses(
    triangles: np.ndarray,
    t: int,
    corners: np.ndarray,
    i: int,
    joint: np.ndarray,
    swing: float,
    beside: float,
) -> bool:
    """True when corner i turned by at most ``swing`` [rad] crosses triangle t, away from the joint."""
    height = corners[i, 2]
    found = 0  # the triangle's cut at the corner's height is a segment
    x0, y0, x1, y1 = 0.0, 0.0, 0.0, 0.0
    for k in range(3):
        n = (k + 1) % 3
        a, b = triangles[t, k, 2], triangles[t, n, 2]
        if (a < height) != (b < height):
            share = (height - a) / (b - a)
            x = triangles[t, k, 0] + share * (triangles[t, n, 0] - triangles[t, k, 0])
            y = triangles[t, k, 1] + share * (triangles[t, n, 1] - triangles[t, k, 1])
            if found == 0:
                x0, y0 = x, y
            else:
                x1, y1 = x, y
            found += 1
    dx, dy = x1 - x0, y1 - y0
    length = math.sqrt(dx * dx + dy * dy)
    if found != 2 or length == 0.0:
        return False
    dx, dy = dx / length, dy / length
    cx, cy = corners[i, 0], corners[i, 1]
    middle = -(x0 * dx + y0 * dy)
    side = abs(x0 * dy - y0 * dx)  # of the segment's line from the axis
    radius = math.sqrt(cx * cx + cy * cy)
    if side >= radius - TOUCH:
        return False
    half = math.sqrt(radius * radius - side * side)
    for s in (middle - half, middle + half):
        if TOUCH < s < length - TOUCH:
            x, y = x0 + s * dx, y0 + s * dy
            angle = math.atan2(cx * y - cy * x, cx * x + cy * y)
            if abs(angle) < swing and not _near(joint, x, y, height, beside):
                return True
    return False


@jit
def _near(joint: np.ndarray, x: float, y: float, z: float, reach: float) -> bool:
    """True when a point lies within ``reach`` [m] of one of the edges (n, 2, 3)."""
    at = Vec3(x, y, z)
    for k in range(len(joint)):
        start = Vec3(joint[k, 0, 0], joint[k, 0, 1], joint[k, 0, 2])
        way = sub(Vec3(joint[k, 1, 0], joint[k, 1, 1], joint[k, 1, 2]), start)
        offset = sub(at, start)
        square = dot(way, way)
        share = min(max(dot(offset, way) / square, 0.0), 1.0) if square > 0.0 else 0.0
        away = along(offset, -share, way)
        if dot(away, away) <= reach * reach:
            return True
    return False
