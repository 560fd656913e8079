"""Tree of the obstacles of a turning part, and the check that the part can turn in its chamber."""

import math
from typing import NamedTuple

import numpy as np

from sim_core.effects.part_rotation import RotationAxis
from sim_core.errors import SceneError
from sim_core.geometry.bvh import Tree, build_tree, join_trees
from sim_core.geometry.mesh import TriangleMesh, connected_components
from sim_core.geometry.obstacles import ObstacleTable
from sim_core.numerics.computed_once import computed_once
from sim_core.numerics.jit import jit
from sim_core.numerics.vec3 import Vec3, add_scaled, dot, sub

# Share of a radius: largest opening of the joint between part and chamber while the part turns. A
# ball's centre stays a radius off the wall, so that a slit no wider than this does not matter.
MAX_OPENING = 0.9
ROUNDINGS = 16.0
# m: a corner's path this near a triangle's border touches the triangle and does not cross it
TOUCH = 1e-9


class PartTree(NamedTuple):
    """Obstacles of the turning part at angle 0, relative to the mesh's middle."""

    tree: Tree  # the obstacles
    roots: np.ndarray  # nodes where the obstacles for each ball radius begin, shape (k,) int64
    # least distance along the axis, from its point, at which a ball's centre can touch [m]
    low: float
    # largest distance along the axis, from its point, at which a ball's centre can touch [m]
    high: float
    reach: float  # largest distance across the axis at which a ball's centre can touch [m]


def part_rows(
    table: ObstacleTable, radius: float, mesh: TriangleMesh, axis: RotationAxis
) -> np.ndarray:
    """Tell which obstacles turn with the part, for balls of this radius [m].

    Returns: True for each such obstacle, shape (k,) bool.

    Raises:
        SceneError: for a part that cannot turn in its chamber, and for a part that meets the
            chamber in an edge that balls can touch.
    """
    require_free_axis(mesh, axis, radius)
    sides = axis.turns(mesh.tags)[table.triangles]
    mixed = np.flatnonzero(sides[:, 0] != sides[:, 1])
    if len(mixed):
        one, two = table.triangles[mixed[0]]
        raise SceneError(
            "the turning part meets the chamber in an edge that balls can touch, of triangles "
            f"{one} and {two}: that is not supported; the joint must be a corner that recedes "
            "from the shot, as where a shaft goes through a ceiling"
        )
    return np.asarray(sides[:, 0])


@computed_once(32)  # called at every replica's start
def require_free_axis(mesh: TriangleMesh, axis: RotationAxis, radius: float) -> None:
    """Raise SceneError if the part cannot turn in its chamber, for balls of this radius [m].

    With balls of several sizes the smallest radius decides.

    The line along which part and chamber are joined must stay in place up to MAX_OPENING of the
    radius. It is then a circle about the axis, as where a round shaft goes through a wall.
    Elsewhere no corner of the part may pass through a triangle of the chamber as it turns, and no
    corner of the chamber through the part. Two edges that cross are not noticed if no
    corner of one body passes through the other body.
    """
    turning = axis.turns(mesh.tags)
    joint = _joint(mesh, turning)
    _require_round_joint(mesh, joint, axis, radius)
    _require_free_corners(mesh, turning, mesh.vertices[joint[:, 2:]], axis, radius)


def build_part_tree(
    tables: list[ObstacleTable], radii: tuple[float, ...], mesh: TriangleMesh, axis: RotationAxis
) -> PartTree:
    """Build the tree of the part's own obstacles, which each radius has for itself.

    Args:
        tables: obstacles of the part for balls of each radius.
        radii: radii of the balls [m], ascending.
        mesh: mesh of the chamber.
        axis: axis of the part.
    """
    place = _in_axis_frame(mesh.corners[axis.turns(mesh.tags)].reshape(-1, 3), axis)
    height, across = place[:, 2], np.linalg.norm(place[:, :2], axis=1)
    margin = 1.001 * radii[-1]  # the largest radius and the overlap of faces
    # Boxes are padded for float32 rounding at the size of chamber and axis, not of the part,
    # because the part may be that far from a ball.
    furthest = (
        np.abs(mesh.vertices - mesh.middle).max()
        + 2.0 * np.abs(np.array(axis.point) - mesh.middle).max()
    )
    pad = ROUNDINGS * np.finfo(np.float32).eps * furthest
    padded = [one._replace(low=one.low - pad, high=one.high + pad) for one in tables]
    tree, roots = join_trees([build_tree(*pair) for pair in zip(padded, radii, strict=True)])
    low, high, reach = float(height.min()), float(height.max()), float(across.max())
    return PartTree(tree, roots, low - margin, high + margin, reach + margin)


def select_rows(table: ObstacleTable, rows: np.ndarray) -> ObstacleTable:
    """Return a table of only those obstacles that ``rows`` selects, a mask (k,) bool."""
    return ObstacleTable(*(np.ascontiguousarray(column[rows]) for column in table))


def _in_axis_frame(points: np.ndarray, axis: RotationAxis) -> np.ndarray:
    """Return points (..., 3) [m] in the axis' frame: two coordinates across it, then one along."""
    along = np.array(axis.axis)
    side = np.cross(along, np.eye(3)[np.abs(along).argmin()])
    side /= np.linalg.norm(side)
    offset = points - np.array(axis.point)
    columns = [offset @ side, offset @ np.cross(along, side), offset @ along]
    return np.ascontiguousarray(np.stack(columns, axis=-1))


def _joint(mesh: TriangleMesh, turning: np.ndarray) -> np.ndarray:
    """Return the edges between part and chamber, shape (n, 4).

    Each edge has the triangle of the part, the triangle of the chamber, and its two vertices.
    ``turning``: True for triangles of the part, shape (m,) bool.
    """
    partner = mesh.partners
    edges = np.flatnonzero(np.repeat(turning, 3) & ~turning[partner // 3])
    ends = mesh.triangles.reshape(-1)[edges], mesh.triangles[edges // 3, (edges % 3 + 1) % 3]
    return np.stack([edges // 3, partner[edges] // 3, *ends], axis=1)


def _require_round_joint(
    mesh: TriangleMesh, joint: np.ndarray, axis: RotationAxis, radius: float
) -> None:
    """Raise SceneError if the joint of part and chamber would open too far as the part turns."""
    if len(joint) == 0:
        return
    line = connected_components(joint[:, 2:], len(mesh.vertices))[joint[:, 2]]
    place = _in_axis_frame(mesh.vertices[joint[:, 2:]], axis)
    across, height = place[..., :2], place[..., 2]
    edge = across[:, 1] - across[:, 0]
    square = np.maximum(np.einsum("ij,ij->i", edge, edge), 1e-300)
    share = np.clip(-np.einsum("ij,ij->i", across[:, 0], edge) / square, 0.0, 1.0)
    nearest = np.linalg.norm(across[:, 0] + share[:, None] * edge, axis=1)
    furthest = np.linalg.norm(across, axis=2).max(axis=1)
    for own in (line == k for k in np.unique(line)):
        gap = max(furthest[own].max() - nearest[own].min(), np.ptp(height[own]))
        gap = min(gap, axis.amplitude * furthest[own].max())
        if gap > MAX_OPENING * radius:
            one, two = joint[own][0, :2]
            raise SceneError(
                f"the turning part is joined to the chamber, at triangles {one} and {two}, along a "
                "line that is not round about its axis: turning would open a gap of "
                f"{1e3 * gap:.3g} mm, and balls of {2e3 * radius:.3g} mm allow "
                f"{1e3 * MAX_OPENING * radius:.3g}; let it go through the wall with a round shaft "
                "about its axis, or end clear of the wall"
            )


class _Sweep(NamedTuple):
    """How far the part turns, and beside which edges corners may pass through triangles."""

    joint: np.ndarray  # edges in the frame of the axis [m], shape (n, 2, 3)
    amplitude: float  # largest angle to each side [rad]
    beside: float  # distance from the joint within which crossings do not count [m]


def _require_free_corners(
    mesh: TriangleMesh, turning: np.ndarray, joint: np.ndarray, axis: RotationAxis, radius: float
) -> None:
    """Raise SceneError if a corner of part or chamber passes through the other as the part turns.

    Args:
        mesh: mesh of the chamber.
        turning: True for triangles that turn, shape (m,) bool.
        joint: edges of the joint [m], (n, 2, 3). Beside them a corner may pass through the other
            body.
        axis: axis of the part.
        radius: radius of the balls [m].
    """
    part, chamber = np.unique(mesh.triangles[turning]), np.unique(mesh.triangles[~turning])
    sweep = _Sweep(_in_axis_frame(joint, axis), axis.amplitude, MAX_OPENING * radius)
    for own, other, still in ((part, chamber, ~turning), (chamber, part, turning)):
        corners, place = np.setdiff1d(own, other), np.zeros(2, dtype=np.int64)
        vertices = _in_axis_frame(mesh.vertices[corners], axis)
        triangles = _in_axis_frame(mesh.corners[still], axis)
        if _passes_through(vertices, triangles, sweep, place):
            at = np.round(mesh.vertices[corners[place[0]]], 6).tolist()
            raise SceneError(
                f"the part cannot turn: on its way the corner at {at} m passes through triangle "
                f"{np.flatnonzero(still)[place[1]]}; move the axis, or make room about the part"
            )


@jit
def _passes_through(
    corners: np.ndarray, triangles: np.ndarray, sweep: _Sweep, place: np.ndarray
) -> bool:
    """Return True if the arc of any corner about the axis crosses any triangle.

    ``place``: output array (2,) for the indices of this corner and this triangle.
    """
    for t in range(len(triangles)):
        a, b, c = triangles[t, 0, 2], triangles[t, 1, 2], triangles[t, 2, 2]
        low, high = min(a, b, c) + TOUCH, max(a, b, c) - TOUCH
        for i in range(len(corners)):
            if low < corners[i, 2] < high and _crosses(triangles, t, corners, i, sweep):
                place[0], place[1] = i, t
                return True
    return False


@jit
def _crosses(triangles: np.ndarray, t: int, corners: np.ndarray, i: int, sweep: _Sweep) -> bool:
    """Return True if the arc of corner i about the axis crosses triangle t away from the joint."""
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
    side = abs(x0 * dy - y0 * dx)  # distance of the segment's line from the axis, times its length
    radius = math.sqrt(cx * cx + cy * cy)
    if side >= radius - TOUCH:
        return False
    half = math.sqrt(radius * radius - side * side)
    for s in (middle - half, middle + half):
        if TOUCH < s < length - TOUCH:
            x, y = x0 + s * dx, y0 + s * dy
            angle = math.atan2(cx * y - cy * x, cx * x + cy * y)
            if abs(angle) < sweep.amplitude and not _near(sweep, Vec3(x, y, height)):
                return True
    return False


@jit
def _near(sweep: _Sweep, at: Vec3) -> bool:
    """Return True if a point is so near the joint that a crossing there does not count."""
    joint = sweep.joint
    for k in range(len(joint)):
        start = Vec3(joint[k, 0, 0], joint[k, 0, 1], joint[k, 0, 2])
        edge = sub(Vec3(joint[k, 1, 0], joint[k, 1, 1], joint[k, 1, 2]), start)
        offset = sub(at, start)
        square = dot(edge, edge)
        share = min(max(dot(offset, edge) / square, 0.0), 1.0) if square > 0.0 else 0.0
        away = add_scaled(offset, -share, edge)
        if dot(away, away) <= sweep.beside * sweep.beside:
            return True
    return False
