"""The mesh as the centre of a ball sees it: every surface moved out by the ball's radius, once, not at each query.

A ball touching a triangle is its centre lying on the triangle's Minkowski sum with the ball: the face moved by r
along its normal, and a capsule of radius r about each edge. Only edges that are convex towards the shot can be
touched first; on a cylinder's inside there are none. A capsule's round ends are the corners.

        ______ moved face ______                     convex edge: the capsule (  closes the gap
       /                        \\   capsule          concave edge: the moved faces cross, none is needed
      |   triangle   ___________ )  about the edge
"""

from typing import NamedTuple

import numpy as np

from sim_core.errors import SceneError
from sim_core.geometry.flat_faces import LONE, Flats, edge_partners
from sim_core.geometry.mesh import TriangleMesh, towards_shot
from sim_core.geometry.rectangle_cover import cover
from sim_core.geometry.sonotrode_border import Rim, carry_on, find_rim, require_room_at_joints

NUMBERS = 20  # kept of each obstacle
TRIANGLE = [0, 1, 2, 2]  # the corners of a face that has but three

FACE = 0
CAPSULE = 1
WAVING_FACE = 2  # a face of the vibrating sonotrode
ROUND = 3  # the round side of an upright cylinder, seen from inside

# Faces reach this far over their borders [m], so that rounding leaves no crack between neighbours. It moves
# contact at a convex edge by SEAM²/2r = 3e-14 m for a 3 mm ball. Smaller than 1e-12 would be rounding itself.
SEAM = 1e-8
SEAM_PER_RADIUS = 1e-5  # the same for balls so small that SEAM would show
# Seams [-]: how far a face reaches past its corners at most, where the seams of two borders cross; at a needle's tip
# they cross far outside. Six almost flat edges that meet in a convex corner need two of it.
PAST_CORNERS = 3.0


class Bore(NamedTuple):
    """The axis ``x``, ``y`` [m] of the upright cylinder that the shot is in."""

    x: float
    y: float


class Obstacles(NamedTuple):
    """What the centre of a ball can hit, one row each. k = faces + capsules.

    ``numbers`` (k, 20) float64 [m]: a face holds its unit normal towards the shot (0:3), the moved plane's offset
    (3), and four inward in-plane border normals with their offsets (4:20), a triangle's fourth zero; a capsule its
    start (0:3), unit direction (3:6), length (6), and the first neighbour's normal minus the second's (7:10);
    a round side how far from the axis the centre gets (3).
    ``kinds`` (k,) uint8; ``triangles`` (k, 2) int32: the mesh triangles to book a hit on, a capsule's two neighbours
    or a face twice.
    ``low``, ``high`` (k, 3) float64 [m]: bounding boxes.
    """

    numbers: np.ndarray
    kinds: np.ndarray
    triangles: np.ndarray
    low: np.ndarray
    high: np.ndarray


def seam(radius: float) -> float:
    """Overlap of neighbouring faces [m] for balls of this radius [m]."""
    return min(SEAM, SEAM_PER_RADIUS * radius)


def build_obstacles(
    mesh: TriangleMesh, radius: float, waving: np.ndarray, swing: float | np.ndarray, flats: Flats
) -> Obstacles:
    """Obstacles for balls of one radius [m]; coordinates are taken relative to the mesh's middle.

    ``waving`` (m,) bool marks triangles that vibrate by ``swing`` [m] zero-to-peak, or each by its own (m,): their
    boxes hold the whole swing. A flat's faces are fewer than its triangles and are booked on its seed; see locate.py
    for which was hit.
    """
    corners = mesh.corners - mesh.middle
    normals, doubled = towards_shot(corners)
    solid = doubled > 0.0  # a triangle without area has no face; its neighbours' edges remain
    swing = np.broadcast_to(swing, waving.shape)
    require_room_at_joints(mesh, normals, radius, waving, swing)
    rim = find_rim(mesh.triangles, corners, normals, radius, waving, swing)
    faces = _faces(corners, normals, doubled, flats, radius, waving, swing, rim)
    capsules = _capsules(mesh, corners, normals, solid, radius, waving, flats)
    return Obstacles(*(np.concatenate(pair) for pair in zip(faces, capsules, strict=True)))


def _faces(
    corners: np.ndarray,
    normals: np.ndarray,
    doubled: np.ndarray,
    flats: Flats,
    radius: float,
    waving: np.ndarray,
    swing: np.ndarray,
    rim: Rim,
) -> Obstacles:
    lone = [np.flatnonzero((doubled > 0.0) & (flats.flat == LONE))]
    pieces = [corners[lone[0]][:, TRIANGLE]]
    members = np.argsort(flats.flat, kind="stable")
    first = np.searchsorted(flats.flat[members], np.arange(len(flats.seed) + 1))
    for k, outline in enumerate(flats.rims):
        own = members[first[k] : first[k + 1]]
        few = _few_faces(corners, outline, flats.frames[k], 0.5 * doubled[own].sum())
        pieces.append(corners[own][:, TRIANGLE] if few is None or len(few) > len(own) else few)
        lone.append(np.full(len(pieces[-1]), flats.seed[k]))
    triangle, corner = np.concatenate(lone), np.concatenate(pieces)
    normal = normals[triangle]
    numbers = np.zeros((len(triangle), NUMBERS))
    numbers[:, 0:3] = normal
    numbers[:, 3] = np.einsum("ij,ij->i", normal, corners[triangle].mean(axis=1)) + radius
    _share_plane(numbers, waving[triangle])
    for k in range(4):
        start, along = corner[:, k], corner[:, (k + 1) % 4] - corner[:, k]
        inward = np.cross(along, normal)  # the winding is clockwise seen from the shot
        length = np.linalg.norm(inward, axis=1)
        inward[length > 0.0] /= length[length > 0.0, None]
        numbers[:, 4 + 4 * k : 7 + 4 * k] = inward
        numbers[:, 7 + 4 * k] = np.einsum("ij,ij->i", inward, start)
    beyond = carry_on(numbers, triangle, waving[triangle], flats, rim)
    moved = corner + radius * normal[:, None]
    grow = seam(radius) + (np.where(waving[triangle], swing[triangle], 0.0) + 2.0 * beyond)[:, None]
    kinds = np.where(waving[triangle], WAVING_FACE, FACE).astype(np.uint8)
    return Obstacles(
        numbers,
        kinds,
        np.stack([triangle, triangle], axis=1).astype(np.int32),
        moved.min(axis=1) - grow,
        moved.max(axis=1) + grow,
    )


def _few_faces(
    corners: np.ndarray, outline: np.ndarray, frame: np.ndarray, area: float
) -> np.ndarray | None:
    """Corners (k, 4, 3) [m] of the faces that cover a flat of this area [m²]; None if its outline is not understood."""
    origin, axes = frame[0], frame[1:]
    ends = np.stack(
        [corners[outline // 3, outline % 3], corners[outline // 3, (outline % 3 + 1) % 3]], axis=1
    )
    faces = cover((ends - origin) @ axes.T, area)
    if faces is None:
        return None
    pieces = origin + faces[:, ::-1] @ axes
    sides = np.linalg.norm(pieces - np.roll(pieces, -1, axis=1), axis=2) > 0.0
    return np.asarray(
        pieces[sides.sum(axis=1) >= 3]
    )  # one that rounding made a point or a line would have no borders


def _share_plane(numbers: np.ndarray, waving: np.ndarray) -> None:
    """Give waving faces that lie in one plane but for rounding that very plane, so that it is solved once for all."""
    rows = np.flatnonzero(waving)
    while len(rows):
        first = numbers[rows[0], 0:4]
        size = max(1.0, np.abs(numbers[rows, 3]).max())
        same = (np.abs(numbers[rows, 0:4] - first) <= 1e-13 * size).all(axis=1)
        numbers[rows[same], 0:4] = first
        rows = rows[~same]


def _capsules(
    mesh: TriangleMesh,
    corners: np.ndarray,
    normals: np.ndarray,
    solid: np.ndarray,
    radius: float,
    waving: np.ndarray,
    flats: Flats,
) -> Obstacles:
    two = edge_partners(mesh.triangles)
    one = np.flatnonzero(np.arange(len(two)) < two)  # each edge once, as two directed edges 3 t + k
    two = two[one]
    swap = (
        flats.flat[one // 3] > flats.flat[two // 3]
    )  # all edges between two flats have them in one order
    one, two = np.where(swap, two, one), np.where(swap, one, two)
    t_one, k_one, t_two, k_two = one // 3, one % 3, two // 3, two % 3
    start = corners[t_one, k_one]
    along = corners[t_one, (k_one + 1) % 3] - start
    length = np.linalg.norm(along, axis=1)
    far_corner = corners[t_two, (k_two + 2) % 3]
    # convex towards the shot: the neighbour falls away behind this face's plane
    bend = np.linalg.norm(np.cross(normals[t_one], normals[t_two]), axis=1)
    behind = np.einsum("ij,ij->i", normals[t_one], far_corner - start) < 0.0
    folded = np.einsum("ij,ij->i", normals[t_one], normals[t_two]) < 0.0
    flat = (bend < 2.0 * seam(radius) / radius) & ~folded
    convex = (behind & ~flat) | ~solid[t_one] | ~solid[t_two]
    # where many flat edges meet, the moved faces part further than they reach: there a capsule's end is the corner
    turn = np.where(flat & behind & ~waving[t_one] & ~waving[t_two], bend, 0.0)
    tips = np.stack([mesh.triangles[t_one, k_one], mesh.triangles[t_two, k_two]])
    around = np.bincount(
        tips.ravel(), np.tile(turn, 2)
    )  # of each corner: four times how far its faces part, or more
    convex |= (turn > 0.0) & (around[tips] > 4.0 * PAST_CORNERS * seam(radius) / radius).any(axis=0)
    rim = convex & (waving[t_one] | waving[t_two])
    if rim.any():
        edge = np.flatnonzero(rim)[0]
        raise SceneError(
            f"the vibrating surface has a free rim at the edge of triangles {t_one[edge]} and {t_two[edge]}: "
            "a moving edge is not supported yet; let the sonotrode fill the chamber's floor from wall to wall, flat"
        )
    keep = np.flatnonzero(convex & (length > 0.0))
    chosen, finish = _straight_runs(mesh.triangles, corners, flats, one[keep], two[keep])
    keep = keep[chosen]
    along = finish - start[keep]
    length = np.linalg.norm(along, axis=1)
    numbers = np.zeros((len(keep), NUMBERS))
    numbers[:, 0:3] = start[keep]
    numbers[:, 3:6] = along / length[:, None]
    numbers[:, 6] = length
    numbers[:, 7:10] = normals[t_one[keep]] - normals[t_two[keep]]
    ends = np.stack([start[keep], finish], axis=1)
    return Obstacles(
        numbers,
        np.full(len(keep), CAPSULE, dtype=np.uint8),
        np.stack(
            [np.where(solid[t_one], t_one, t_two), np.where(solid[t_two], t_two, t_one)], axis=1
        )[keep].astype(np.int32),
        ends.min(axis=1) - radius,
        ends.max(axis=1) + radius,
    )


def _straight_runs(
    triangles: np.ndarray, corners: np.ndarray, flats: Flats, one: np.ndarray, two: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Edges between the same two flats lie on one line: a run of them is one obstacle.

    ``one``, ``two`` (n,): the two sides of each edge. Returns which edges begin an obstacle (k,), and where each of
    those obstacles ends (k, 3) [m].
    """
    head = triangles.reshape(-1)[one]
    tail = triangles[one // 3, (one % 3 + 1) % 3]
    sides = flats.flat[np.stack([one // 3, two // 3])]
    follower = dict(
        zip(zip(head.tolist(), *sides.tolist(), strict=True), range(len(one)), strict=True)
    )
    in_run = (sides != LONE).all(axis=0)
    chosen, finish = [], []
    begun_by = {(int(tail[i]), int(sides[0, i]), int(sides[1, i])) for i in np.flatnonzero(in_run)}
    for i in range(len(one)):
        first, second = int(sides[0, i]), int(sides[1, i])
        if in_run[i] and (int(head[i]), first, second) in begun_by:
            continue  # goes on where another edge of the run ends
        last = i
        while in_run[i] and (int(tail[last]), first, second) in follower:
            last = follower[int(tail[last]), first, second]
        chosen.append(i)
        finish.append(corners[one[last] // 3, (one[last] % 3 + 1) % 3])
    return np.array(chosen, dtype=np.int64), np.array(finish).reshape(-1, 3)
