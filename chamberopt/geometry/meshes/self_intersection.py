"""Find triangles of a closed surface that cross each other.

A part whose surface crosses itself cannot be cut out of a chamber, and the attempt gives no error.
Candidate pairs come from a tree of boxes over the triangles, in the order of a k-d tree. The tree
is compared with itself level by level. Each pair is then tested exactly.

Source: T. Möller, "A fast triangle-triangle intersection test", J. Graphics Tools 2 (1997) 25.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from chamberopt.geometry.meshes.surface_error import SurfaceError, format_point
from chamberopt.geometry.triangles import find_shells, heights, unit_normals

CHUNK = 1 << 18  # pairs tested at once, which bounds memory at some 100 MB
# Share of the bounding box's diagonal. Surfaces that pass through each other by less only touch.
TOUCH = 1e-6


def refuse_self_intersection(path: Path, vertices: np.ndarray, triangles: np.ndarray) -> None:
    """Raise SurfaceError, which says where, if a body's closed surface crosses itself.

    Several bodies may overlap: they are united where the chamber is made.
    """
    pairs = crossing_pairs(vertices, triangles)
    if not pairs.shape[1]:
        return
    corners = vertices[triangles]
    pairs = np.sort(pairs, axis=0)
    first = pairs[:, np.lexsort(pairs[::-1])[0]]
    middle = corners[first].reshape(-1, 3).mean(axis=0)
    sides = corners[np.unique(pairs)][:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2, 3)
    message = (
        f"{path}: the surface crosses itself: {pairs.shape[1]} pairs of triangles, "
        f"the first near {format_point(middle)} (triangles {first[0] + 1} and "
        f"{first[1] + 1}); heal it in the CAD program, or make its pieces separate bodies"
    )
    raise SurfaceError(message, corners, sides)


def crossing_pairs(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return the pairs (2, k) of triangles of one closed body that cross each other."""
    corners = vertices[triangles]
    touch = TOUCH * float(np.linalg.norm(np.ptp(vertices, axis=0)))
    shells, _ = find_shells(vertices, triangles)
    # thinner triangles have no direction
    usable = np.flatnonzero(heights(vertices, triangles) > touch)
    found = []
    for a, b in _close_pairs(corners[usable]):
        a, b = usable[a], usable[b]
        same = shells[a] == shells[b]
        found.append(np.stack(_crossing(corners, a[same], b[same], touch)))
    return np.concatenate(found, axis=1) if found else np.zeros((2, 0), dtype=np.int64)


def _close_pairs(corners: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the pairs of triangles (m, 3, 3) whose bounding boxes overlap, each pair once.

    Each item holds the first and the second triangles of many pairs.
    """
    from scipy.spatial import cKDTree

    # this order keeps neighbours together
    order = cKDTree(corners.mean(axis=1), leafsize=1).indices
    low, high = corners.min(axis=1)[order].T.copy(), corners.max(axis=1)[order].T.copy()
    levels = [(low, high)]  # levels of boxes, each (3, count); the next level joins boxes in pairs
    while levels[-1][0].shape[1] > 1:
        low, high = levels[-1]
        if low.shape[1] % 2:
            low, high = np.c_[low, np.full(3, np.inf)], np.c_[high, np.full(3, -np.inf)]
        levels.append(
            (np.minimum(low[:, ::2], low[:, 1::2]), np.maximum(high[:, ::2], high[:, 1::2]))
        )
    waiting = [(len(levels) - 1, np.zeros(1, dtype=np.int64), np.zeros(1, dtype=np.int64))]
    while waiting:
        level, i, j = waiting.pop()
        for low, high in zip(*levels[level], strict=True):
            overlap = (low[i] <= high[j]) & (low[j] <= high[i])
            i, j = i[overlap], j[overlap]
        if level == 0:
            different = i != j
            yield order[i[different]], order[j[different]]
            continue
        # The four pairs of halves. A box paired with itself has its two halves only once.
        two = i != j
        i, j = (
            np.r_[2 * i, 2 * i + 1, 2 * i, 2 * i[two] + 1],
            np.r_[2 * j, 2 * j + 1, 2 * j + 1, 2 * j[two]],
        )
        count = levels[level - 1][0].shape[1]
        exist = (i < count) & (j < count)
        i, j = i[exist], j[exist]
        waiting += [
            (level - 1, i[at : at + CHUNK], j[at : at + CHUNK]) for at in range(0, len(i), CHUNK)
        ]


def _crossing(
    corners: np.ndarray, a: np.ndarray, b: np.ndarray, touch: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the pairs of triangles a, b (k,) that cross each other by more than `touch` [m]."""
    for _ in range(2):  # each triangle must have corners on both sides of the other's plane
        distance = _distances(corners[a], corners[b])
        through = (distance.min(axis=1) < -touch) & (distance.max(axis=1) > touch)
        a, b = b[through], a[through]
    if not len(a):
        return a, b
    of_a, of_b = corners[a], corners[b]
    along = np.cross(unit_normals(of_a), unit_normals(of_b))
    along /= np.linalg.norm(along, axis=1)[:, None]
    low_a, high_a = _interval(of_a, _distances(of_a, of_b), along)
    low_b, high_b = _interval(of_b, _distances(of_b, of_a), along)
    common = np.minimum(high_a, high_b) - np.maximum(low_a, low_b)
    return a[common > touch], b[common > touch]


def _distances(corners: np.ndarray, planes: np.ndarray) -> np.ndarray:
    """Return the distances (k, 3) [m] of triangles' corners from the planes of other triangles.

    Args:
        corners, planes: corners of the triangles, and of the other triangles, (k, 3, 3) each.
    """
    return np.asarray(np.einsum("kij,kj->ki", corners - planes[:, :1], unit_normals(planes)))


def _interval(
    corners: np.ndarray, distance: np.ndarray, along: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return where triangles begin and end on the lines in which they cross other planes.

    Both are positions along the lines [m], (k,).

    Args:
        corners: corners of the triangles [m], (k, 3, 3).
        distance: distances of the corners from the other planes [m], (k, 3).
        along: unit vectors of the lines, (k, 3).
    """
    positions = []
    for i, j in ((0, 1), (1, 2), (2, 0)):
        through = distance[:, i] * distance[:, j] < 0.0
        share = np.divide(
            distance[:, i], distance[:, i] - distance[:, j], out=np.zeros(len(along)), where=through
        )
        point = corners[:, i] + share[:, None] * (corners[:, j] - corners[:, i])
        positions.append(np.where(through, np.einsum("kj,kj->k", point, along), np.nan))
    return np.nanmin(positions, axis=0), np.nanmax(positions, axis=0)
