"""Obstacles for the centre of a ball: every surface of the mesh moved out by the ball's radius.

A ball touching a triangle has its centre on the triangle's Minkowski sum with the ball: the face
moved by r along its normal, and a capsule of radius r about each edge. Only edges that are convex
towards the shot can be touched first. The inside of a cylinder has no such edge. The round ends of
the capsules cover the corners.

        ______ moved face ______                  convex edge: the capsule ( closes the gap
       /                        \\   capsule       concave edge: the moved faces cross,
      |   triangle   ___________ )  about         no capsule is needed
                                    the edge
"""

from typing import NamedTuple

import numpy as np

from sim_core.errors import SceneError
from sim_core.geometry.flat_faces import LONE, SurfaceTriangles, cover_with_quadrangles
from sim_core.geometry.sonotrode_border import SonotrodeBorder, find_border, require_room_at_joints
from sim_core.numerics.jit import jit

NUMBERS = 20  # numbers of each obstacle, see ObstacleTable
TRIANGLE = [0, 1, 2, 2]  # the four corners of a face that has only three

FACE = 0
CAPSULE = 1
VIBRATING_FACE = 2  # face of a sonotrode
CYLINDER_WALL = 3  # wall of an upright cylinder, hit from inside

# Faces reach this far over their borders [m], so that rounding leaves no crack between neighbours.
# This moves contact at a convex edge by FACE_OVERLAP²/2r = 3e-14 m for a 3 mm ball. An overlap
# below 1e-12 would be of the size of rounding.
FACE_OVERLAP = 1e-8
FACE_OVERLAP_PER_RADIUS = 1e-5  # the overlap for balls so small that FACE_OVERLAP would show
# Largest distance of a face's tip past its corner, in overlaps. The overlaps of two borders cross
# at the tip, and at a needle's tip they would cross far outside. Six almost flat edges that meet in
# a convex corner need two overlaps.
MAX_CORNER_OVERLAPS = 3.0


class ObstacleTable(NamedTuple):
    """The k obstacles (faces and capsules) that the centre of a ball can hit, one row each."""

    # Geometry [m], shape (k, 20).
    # A face holds its unit normal towards the shot (0:3), the offset of its moved plane (3), and
    # four inward in-plane border normals with their offsets (4:20). The fourth border of a triangle
    # is zero.
    # A capsule holds its start (0:3), unit direction (3:6), length (6), and the normal of its first
    # neighbour minus the normal of its second neighbour (7:10).
    # A cylinder wall holds the largest distance of the centre from the axis (3).
    numbers: np.ndarray
    kinds: np.ndarray  # FACE, CAPSULE, VIBRATING_FACE or CYLINDER_WALL, shape (k,) uint8
    # mesh triangles on which an impact is recorded, shape (k, 2) int32: a capsule's two neighbours,
    # or the triangle of a face twice
    triangles: np.ndarray
    low: np.ndarray  # lowest corner of the bounding box [m], shape (k, 3)
    high: np.ndarray  # highest corner of the bounding box [m], shape (k, 3)


@jit
def same_plane(numbers: np.ndarray, row: int, other: int) -> bool:
    """Return True if two faces have bit for bit the same plane, as on a flat sonotrode."""
    return bool(
        numbers[row, 0] == numbers[other, 0]
        and numbers[row, 1] == numbers[other, 1]
        and numbers[row, 2] == numbers[other, 2]
        and numbers[row, 3] == numbers[other, 3]
    )


def face_overlap_of(radius: float) -> float:
    """Return by how much neighbouring faces overlap [m], for balls of this radius [m]."""
    return min(FACE_OVERLAP, FACE_OVERLAP_PER_RADIUS * radius)


def build_obstacle_table(surface: SurfaceTriangles, radius: float) -> ObstacleTable:
    """Build the obstacles for balls of one radius [m], relative to the mesh's middle.

    The boxes of vibrating faces hold the whole vibration. A flat face has fewer faces here than
    triangles. Impacts on it are recorded on its seed, the triangle that gives its plane, and
    triangle_lookup.py later finds the triangle that was hit.
    """
    require_room_at_joints(surface, radius)
    border = find_border(surface, radius)
    faces = _faces(surface, radius, border)
    capsules = _capsules(surface, radius, border)
    return ObstacleTable(*(np.concatenate(pair) for pair in zip(faces, capsules, strict=True)))


def _faces(surface: SurfaceTriangles, radius: float, border: SonotrodeBorder) -> ObstacleTable:
    """Return the faces among the obstacles for balls of one radius [m].

    There is one face for each triangle with an area outside flat faces, a few for each flat face,
    and one for each wall that goes on beneath a vibrating face.
    """
    corners, flat_faces = surface.corners, surface.flat_faces
    of_triangle = flat_faces.of_triangle
    lone = np.flatnonzero((surface.doubled > 0.0) & (of_triangle == LONE))
    of_flat, face = _flat_pieces(surface)
    pieces = [corners[lone][:, TRIANGLE], of_flat]
    each = [lone, flat_faces.seed[face]]
    pieces.append(border.walls)
    each.append(border.above)
    triangle, corner = np.concatenate(each), np.concatenate(pieces)
    normal, vibrating = surface.normals[triangle], surface.vibrating[triangle]
    numbers = np.zeros((len(triangle), NUMBERS))
    numbers[:, 0:3] = normal
    numbers[:, 3] = np.einsum("ij,ij->i", normal, corners[triangle].mean(axis=1)) + radius
    _share_plane(numbers, vibrating)
    for k in range(4):
        start, edge = corner[:, k], corner[:, (k + 1) % 4] - corner[:, k]
        inward = np.cross(edge, normal)  # the winding is clockwise seen from the shot
        length = np.linalg.norm(inward, axis=1)
        inward[length > 0.0] /= length[length > 0.0, None]
        numbers[:, 4 + 4 * k : 7 + 4 * k] = inward
        numbers[:, 7 + 4 * k] = np.einsum("ij,ij->i", inward, start)
    numbers[vibrating, 7:20:4] -= border.overhang
    moved = corner + radius * normal[:, None]
    amplitude = np.where(vibrating, surface.amplitude[triangle] + border.overhang, 0.0)
    grow = face_overlap_of(radius) + amplitude[:, None]
    return ObstacleTable(
        numbers,
        np.where(vibrating, VIBRATING_FACE, FACE).astype(np.uint8),
        np.stack([triangle, triangle], axis=1).astype(np.int32),
        moved.min(axis=1) - grow,
        moved.max(axis=1) + grow,
    )


def _flat_pieces(surface: SurfaceTriangles) -> tuple[np.ndarray, np.ndarray]:
    """Return the pieces (q, 4, 3) [m] that stand for the flat faces, and the flat face of each.

    They are a few quadrangles, or the flat face's own triangles if an outline cannot be covered, or
    if their boxes are smaller.
    """
    corners, flat = surface.corners, surface.flat_faces
    count = len(flat.outlines)
    if not count:
        return np.zeros((0, 4, 3)), np.zeros(0, dtype=np.int64)
    members = np.flatnonzero(flat.of_triangle != LONE)
    of_member = flat.of_triangle[members]
    areas = 0.5 * np.bincount(of_member, surface.doubled[members], count)
    border, of_edge = (
        np.concatenate(flat.outlines),
        np.repeat(np.arange(count), [len(one) for one in flat.outlines]),
    )
    ends = np.stack([corners[border // 3, (border % 3 + k) % 3] for k in (0, 1)], axis=1)
    origin, axes = flat.frames[:, None, 0], flat.frames[:, 1:]
    in_plane = (ends - origin[of_edge]) @ axes[of_edge].swapaxes(1, 2)
    few = cover_with_quadrangles(in_plane, of_edge, areas)
    place = origin[few.outline] + few.corners[:, ::-1] @ axes[few.outline]
    sides = np.linalg.norm(place - np.roll(place, -1, axis=1), axis=2) > 0.0
    # a piece that rounding made a point or a line would have no borders
    sound = sides.sum(axis=1) >= 3
    place, of_place = place[sound], few.outline[sound]
    triangles = corners[members][:, TRIANGLE]
    boxes = [
        np.bincount(face, _box_areas(one), count)
        for face, one in ((of_place, place), (of_member, triangles))
    ]
    by_few = few.covered & (boxes[0] <= boxes[1])
    kept, own = by_few[of_place], ~by_few[of_member]
    pieces = np.concatenate([place[kept], triangles[own]])
    face = np.concatenate([of_place[kept], of_member[own]])
    in_order = np.argsort(face, kind="stable")
    return pieces[in_order], face[in_order]


def _box_areas(pieces: np.ndarray) -> np.ndarray:
    """Return half the surface area [m²] of the box round each of some pieces (k, 4, 3) [m], (k,).

    It is a measure of how often flights enter the box.
    """
    x, y, z = np.ptp(pieces, axis=1).T
    return np.asarray(x * y + y * z + z * x)


def _share_plane(numbers: np.ndarray, vibrating: np.ndarray) -> None:
    """Set the planes of vibrating faces equal where they differ only by rounding, in place.

    The event loop then looks for the hit on a shared plane only once. The first four columns of
    ``numbers`` are the plane of each face.
    """
    rows = np.flatnonzero(vibrating)
    while len(rows):
        first = numbers[rows[0], 0:4]
        size = max(1.0, np.abs(numbers[rows, 3]).max())
        same = (np.abs(numbers[rows, 0:4] - first) <= 1e-13 * size).all(axis=1)
        numbers[rows[same], 0:4] = first
        rows = rows[~same]


def _capsules(surface: SurfaceTriangles, radius: float, border: SonotrodeBorder) -> ObstacleTable:
    """Return the capsules among the obstacles for balls of one radius [m].

    There is a capsule for each convex edge, or straight run of edges between two flat faces. Each
    edge that goes on beneath a vibrating face has a capsule too.
    """
    mesh, corners, normals = surface.mesh, surface.corners, surface.normals
    of_triangle, vibrating = surface.flat_faces.of_triangle, surface.vibrating
    # a triangle without area has no face; the edges of its neighbours have one
    solid = surface.doubled > 0.0
    two = mesh.partners
    # each edge once, as two directed edges 3 t + k; all edges between two flat faces in one order
    one = np.flatnonzero(np.arange(len(two)) < two)
    two = two[one]
    swap = of_triangle[one // 3] > of_triangle[two // 3]
    one, two = np.where(swap, two, one), np.where(swap, one, two)
    t_one, k_one, t_two, k_two = one // 3, one % 3, two // 3, two % 3
    start, end = corners[t_one, k_one], corners[t_one, (k_one + 1) % 3]
    length = np.linalg.norm(end - start, axis=1)
    far_corner = corners[t_two, (k_two + 2) % 3]
    # the edge is convex towards the shot if the neighbour falls away behind this face's plane
    bend = np.linalg.norm(np.cross(normals[t_one], normals[t_two]), axis=1)
    behind = np.einsum("ij,ij->i", normals[t_one], far_corner - start) < 0.0
    folded = np.einsum("ij,ij->i", normals[t_one], normals[t_two]) < 0.0
    flat = (bend < 2.0 * face_overlap_of(radius) / radius) & ~folded
    convex = (behind & ~flat) | ~solid[t_one] | ~solid[t_two]
    # The moved faces part by more than they overlap where many flat edges meet. The end of a
    # capsule then covers the corner. ``around`` is at least four times the gap between the faces.
    turn = np.where(flat & behind & ~vibrating[t_one] & ~vibrating[t_two], bend, 0.0)
    tips = np.stack([mesh.triangles[t_one, k_one], mesh.triangles[t_two, k_two]])
    around = np.bincount(tips.ravel(), np.tile(turn, 2))
    most = 4.0 * MAX_CORNER_OVERLAPS * face_overlap_of(radius) / radius
    convex |= (turn > 0.0) & (around[tips] > most).any(axis=0)
    free = np.flatnonzero(convex & (vibrating[t_one] | vibrating[t_two]))
    if len(free):
        raise SceneError(
            f"the vibrating surface has a free rim at the edge of triangles {t_one[free[0]]} "
            f"and {t_two[free[0]]}: a moving edge is not supported yet; let the sonotrode fill the "
            "chamber's floor from wall to wall, flat"
        )
    keep = np.flatnonzero(convex & (length > 0.0))
    first, finish = _straight_runs(mesh.triangles, corners, of_triangle, one[keep], two[keep])
    keep = keep[first]
    one_side, other_side = border.sides.T
    sides = [np.where(solid[t_one], t_one, t_two), np.where(solid[t_two], t_two, t_one)]
    ends = np.concatenate([np.stack([start[keep], finish], axis=1), border.edges])
    lean = [normals[t_one[keep]] - normals[t_two[keep]], normals[one_side] - normals[other_side]]
    edge = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(edge, axis=1)
    numbers = np.zeros((len(ends), NUMBERS))
    numbers[:, 0:3] = ends[:, 0]
    numbers[:, 3:6] = edge / length[:, None]
    numbers[:, 6] = length
    numbers[:, 7:10] = np.concatenate(lean)
    return ObstacleTable(
        numbers,
        np.full(len(ends), CAPSULE, dtype=np.uint8),
        np.concatenate([np.stack(sides, axis=1)[keep], border.sides]).astype(np.int32),
        ends.min(axis=1) - radius,
        ends.max(axis=1) + radius,
    )


def _straight_runs(
    triangles: np.ndarray,
    corners: np.ndarray,
    of_triangle: np.ndarray,
    one: np.ndarray,
    two: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Join edges between the same two flat faces, which lie on one line, to runs.

    An edge has two sides, one in each of its triangles. Side k of triangle t has the number
    3 t + k, and lies between corner k and the next corner.

    Args:
        triangles: vertex indices, shape (m, 3).
        corners: corner positions [m], shape (m, 3, 3).
        of_triangle: flat face of each triangle, shape (m,).
        one: number of the first side of each edge, shape (n,).
        two: number of the second side of each edge, shape (n,).

    Returns:
        The first edge of each run, shape (k,), and the end of each run [m], shape (k, 3).
    """
    head = triangles.reshape(-1)[one].tolist()
    tail = triangles[one // 3, (one % 3 + 1) % 3].tolist()
    sides = of_triangle[np.stack([one // 3, two // 3])]
    in_run = (sides != LONE).all(axis=0)
    pairs = list(zip(*sides.tolist(), strict=True))
    follower = {(head[i], pairs[i]): i for i in range(len(one))}
    begun = {(tail[i], pairs[i]) for i in np.flatnonzero(in_run)}
    first, finish = [], []
    for i, pair in enumerate(pairs):
        if in_run[i] and (head[i], pair) in begun:
            continue  # the edge continues another edge of the run
        last = i
        while in_run[i] and (tail[last], pair) in follower:
            last = follower[tail[last], pair]
        first.append(i)
        finish.append(corners[one[last] // 3, (one[last] % 3 + 1) % 3])
    return np.array(first, dtype=np.int64), np.array(finish).reshape(-1, 3)
