"""Propose a pose of a part over the sonotrode: its target down, and evenly exposed.

Balls come from below. So the exposure of a point of the target is (1 + cos a) / 2, where a is the
angle between its normal and the way down: 1 where the target faces the sonotrode, 1/2 on upright
walls, 0 where it faces up. The pose has the highest mean minus standard deviation of the exposure
over the target's area, as the objective of a study has of coverage (coverage/metrics.py). A shaft
should therefore stand upright: if it lies, it is hit below and not above. This rule gives a first
pose and is no simulation.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from chamberopt.geometry.triangles import area_vectors, rotation_matrix, unit_vectors

Turns = tuple[float, float, float]

# Advantage of the pose as drawn and of other poses along the file's axes, over all other poses.
AS_DRAWN, ALONG_AXIS = 0.10, 0.08
LOW = 0.05  # advantage of a target at the part's lower end over a target at its upper end


def propose_pose(
    vertices: np.ndarray, triangles: np.ndarray, target: np.ndarray
) -> tuple[Turns, str]:
    """Return turns of a part about x, then y, then z [degrees], and the reason for them.

    Args:
        vertices: vertices of the part [m], shape (n, 3).
        triangles: triangles of the part, normals outward, shape (m, 3).
        target: marks the triangles of the target, the surface to peen, shape (m,).
    """
    vectors = area_vectors(vertices, triangles)[target]
    weight = np.linalg.norm(vectors, axis=1)
    normal, weight = unit_vectors(vectors), weight / weight.sum()
    middle = weight @ vertices[triangles[target]].mean(axis=1)

    def worth(down: np.ndarray, bonus: float) -> float:
        exposed = 0.5 * (1.0 + normal @ down)
        mean = float(weight @ exposed)
        spread = float(np.sqrt(max(weight @ (exposed - mean) ** 2, 0.0)))
        along = vertices @ -down
        height = float((middle @ -down - along.min()) / max(np.ptp(along), 1e-12))
        return mean - spread - LOW * height + bonus

    tried = [
        (worth(down, bonus), -k, down) for k, (down, bonus) in enumerate(_downs(normal, weight))
    ]
    down = max(tried)[2]
    facing = float(weight @ (normal @ down))
    if facing > 0.5:
        reason = "the target faces the sonotrode"
    elif facing > 0.1:
        reason = "the target's sides are as evenly exposed as they can be"
    else:
        reason = "the target stands upright, so that all its sides are exposed alike"
    return turns_down(down), reason


def square_to_walls(vertices: np.ndarray, turns: Turns) -> Turns:
    """Return the turns [degrees] with a further turn about z that brings the part's long side to x.

    The long side is the longer side of the smallest rectangle round the part, seen from above.
    """
    from shapely import MultiPoint

    plan = (vertices @ rotation_matrix(turns).T)[:, :2]
    box = np.array(MultiPoint(plan).convex_hull.minimum_rotated_rectangle.exterior.coords)
    sides = np.diff(box[:3], axis=0)
    x, y = sides[np.linalg.norm(sides, axis=1).argmax()]
    angle = -np.degrees(np.arctan2(y, x)) % 180.0
    angle = round(float(angle - 180.0 if angle > 90.0 else angle), 1) + 0.0
    return turns[0], turns[1], angle


def _downs(normal: np.ndarray, weight: np.ndarray) -> Iterator[tuple[np.ndarray, float]]:
    """Yield directions (3,) of the part's file that may be turned down, and an advantage for each.

    The advantage is added to the mean minus standard deviation of the exposure.

    Args:
        normal: unit normals of the target's triangles, (m, 3).
        weight: area of each triangle over the target's area, (m,).
    """
    for axis in (2, 0, 1):
        for sign in (-1.0, 1.0):
            yield sign * np.eye(3)[axis], AS_DRAWN if (axis, sign) == (2, -1.0) else ALONG_AXIS
    mean = weight @ normal
    if np.linalg.norm(mean) > 0.05:
        yield mean / np.linalg.norm(mean), 0.0
    for direction in np.linalg.eigh((weight[:, None] * normal).T @ normal)[1].T:
        yield direction, 0.0
        yield -direction, 0.0


def turns_down(down: np.ndarray) -> Turns:
    """Return the turns about x, then y [degrees, to a tenth] that turn a direction down.

    >>> turns_down(np.array([1.0, 0.0, 0.0]))
    (0.0, 90.0, 0.0)
    """
    x, y, z = down
    across = float(np.hypot(y, z))
    about_x = np.degrees(np.arctan2(-y, -z)) if across > 1e-9 else 0.0
    return (
        round(float(about_x), 1) + 0.0,
        round(float(np.degrees(np.arctan2(x, across))), 1) + 0.0,
        0.0,
    )
