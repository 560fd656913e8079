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
from sim_core.surfaces.mesh import TriangleMesh

FACE = 0
CAPSULE = 1
WAVING_FACE = 2  # a face of the vibrating sonotrode

# Faces reach this far over their borders [m], so that rounding leaves no crack between neighbours. It moves
# contact at a convex edge by SEAM²/2r = 3e-14 m for a 3 mm ball. Smaller than 1e-12 would be rounding itself.
SEAM = 1e-8
SEAM_PER_RADIUS = 1e-5  # the same for balls so small that SEAM would show


class Obstacles(NamedTuple):
    """What the centre of a ball can hit, one row each. k = faces + capsules.

    ``numbers`` (k, 16) float64 [m]: a face holds its unit normal towards the shot (0:3), the moved plane's offset
    (3), and three inward in-plane border normals with their offsets (4:16); a capsule its start (0:3), unit
    direction (3:6), length (6), and the first neighbour's normal minus the second's (7:10). ``kinds`` (k,) uint8;
    ``triangles`` (k, 2) int32: the mesh triangles to book a hit on, a capsule's two neighbours or a face twice.
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
    mesh: TriangleMesh, centre: np.ndarray, radius: float, waving: np.ndarray, swing: float
) -> Obstacles:
    """Obstacles for balls of one radius [m]; coordinates are taken relative to ``centre`` (3,) [m].

    ``waving`` (m,) bool marks triangles that vibrate by ``swing`` [m] zero-to-peak: their boxes hold the whole
    swing.
    """
    corners = mesh.corners - centre
    towards_shot = -np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    doubled = np.linalg.norm(towards_shot, axis=1)
    solid = np.flatnonzero(doubled > 0.0)  # a triangle without area has no face; its neighbours' edges remain
    normals = np.zeros_like(towards_shot)
    normals[solid] = towards_shot[solid] / doubled[solid, None]
    faces = _faces(corners, normals, solid, radius, waving, swing)
    capsules = _capsules(mesh, corners, normals, doubled > 0.0, radius, waving)
    return Obstacles(*(np.concatenate(pair) for pair in zip(faces, capsules, strict=True)))


def _faces(
    corners: np.ndarray,
    normals: np.ndarray,
    solid: np.ndarray,
    radius: float,
    waving: np.ndarray,
    swing: float,
) -> Obstacles:
    corner, normal = corners[solid], normals[solid]
    numbers = np.zeros((len(solid), 16))
    numbers[:, 0:3] = normal
    numbers[:, 3] = np.einsum("ij,ij->i", normal, corner.mean(axis=1)) + radius
    _share_plane(numbers, waving[solid])
    for k in range(3):
        start, along = corner[:, k], corner[:, (k + 1) % 3] - corner[:, k]
        inward = np.cross(along, normal)  # the winding is clockwise seen from the shot
        inward /= np.linalg.norm(inward, axis=1)[:, None]
        numbers[:, 4 + 4 * k : 7 + 4 * k] = inward
        numbers[:, 7 + 4 * k] = np.einsum("ij,ij->i", inward, start)
    moved = corner + radius * normal[:, None]
    grow = seam(radius) + np.where(waving[solid], swing, 0.0)[:, None]
    kinds = np.where(waving[solid], WAVING_FACE, FACE).astype(np.uint8)
    return Obstacles(
        numbers,
        kinds,
        np.stack([solid, solid], axis=1).astype(np.int32),
        moved.min(axis=1) - grow,
        moved.max(axis=1) + grow,
    )


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
) -> Obstacles:
    one, two = _edge_sides(mesh.triangles)  # directed edges 3 t + k, each with its reverse
    t_one, k_one, t_two = one // 3, one % 3, two // 3
    start = corners[t_one, k_one]
    along = corners[t_one, (k_one + 1) % 3] - start
    length = np.linalg.norm(along, axis=1)
    far_corner = corners[t_two, (two % 3 + 2) % 3]
    # convex towards the shot: the neighbour falls away behind this face's plane
    bend = np.linalg.norm(np.cross(normals[t_one], normals[t_two]), axis=1)
    behind = np.einsum("ij,ij->i", normals[t_one], far_corner - start) < 0.0
    folded = np.einsum("ij,ij->i", normals[t_one], normals[t_two]) < 0.0
    flat = (bend < 2.0 * seam(radius) / radius) & ~folded
    convex = (behind & ~flat) | ~solid[t_one] | ~solid[t_two]
    rim = (convex & (waving[t_one] | waving[t_two])) | (flat & (waving[t_one] != waving[t_two]))
    if rim.any():
        edge = np.flatnonzero(rim)[0]
        raise SceneError(
            f"the vibrating surface has a free rim at the edge of triangles {t_one[edge]} and {t_two[edge]}: "
            "a moving edge is not supported yet; let the sonotrode fill the chamber's floor from wall to wall, flat"
        )
    keep = np.flatnonzero(convex & (length > 0.0))
    numbers = np.zeros((len(keep), 16))
    numbers[:, 0:3] = start[keep]
    numbers[:, 3:6] = along[keep] / length[keep, None]
    numbers[:, 6] = length[keep]
    numbers[:, 7:10] = normals[t_one[keep]] - normals[t_two[keep]]
    ends = np.stack([start[keep], start[keep] + along[keep]], axis=1)
    return Obstacles(
        numbers,
        np.full(len(keep), CAPSULE, dtype=np.uint8),
        np.stack([np.where(solid[t_one], t_one, t_two), np.where(solid[t_two], t_two, t_one)], axis=1)[keep].astype(
            np.int32
        ),
        ends.min(axis=1) - radius,
        ends.max(axis=1) + radius,
    )


def _edge_sides(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Each undirected edge once, as the two directed edges (3 triangle + corner) that share it."""
    count = int(triangles.max()) + 1
    a = triangles.reshape(-1).astype(np.int64)
    b = np.roll(triangles, -1, axis=1).reshape(-1).astype(np.int64)
    forward, backward = a * count + b, b * count + a
    order = np.argsort(forward)
    partner = order[np.searchsorted(forward, backward, sorter=order)]
    one = np.flatnonzero(np.arange(len(a)) < partner)
    return one, partner[one]
