"""Propose a pose of a part over the sonotrode: its target down, and evenly exposed.

Balls come from below. So the exposure of a point of the target is (1 + cos a) / 2, where a is the
angle between its normal and the way down: 1 where the target faces the sonotrode, 1/2 on upright
walls, 0 where it faces up. The pose has the highest mean minus standard deviation of the exposure
over the target's area, as the objective of a study has of coverage (coverage/metrics.py). A shaft
that does not turn should therefore stand: if it lies, it is hit below and not above. This rule
gives a first pose and is no simulation. A pose that a fixture gives more simply has an advantage:
it is taken where it is worse by less.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import TYPE_CHECKING, Literal

import numpy as np

from chamberopt.chamber.layout.sizes import LONG
from chamberopt.geometry.triangles import area_vectors, rotation_matrix, unit_vectors

if TYPE_CHECKING:
    from chamberopt.chamber.layout.target import Surface
    from chamberopt.geometry.meshes.part_mesh import PartMesh

Turns = tuple[float, float, float]
Upright = Literal["standing", "lying", "on-edge"]
"""Which of a part's sizes is upright: its longest one, its shortest one, or that between."""
Pose = Literal[Upright, "turning"]
"""A pose to ask for. A part turns about a level axis, round which its target looks the same."""
AT_SIDE: tuple[Upright, ...] = ("lying", "on-edge")  # in which a part is held at its side
TURNING: Literal["turning"] = "turning"

# Advantages in the mean minus standard deviation of the exposure, over poses of any angle: of the
# pose as drawn, of turns by multiples of 90 and of 45 degrees, and of turns by steps of 15 and 5.
AS_DRAWN, ALONG_AXIS, DIAGONAL = 0.10, 0.08, 0.05
OF_STEP = {15.0: 0.02, 5.0: 0.01}
# What a long part may lose by hanging, where no sonotrode is large enough for it lying.
HANGING = 0.15
SIDED = 0.01  # mean cosine over a target from which on it looks to one side
ALIKE = 0.1  # standard deviation of the exposure up to which all of a target is exposed alike
LOW = 0.05  # advantage of a target at the part's lower end over a target at its upper end
FLAT = 0.999  # length of the mean unit normal of a target that counts as flat
LEVEL_DEG = 0.5  # a flat face is level if it is tilted by less
# Steps of the turn that brings the long side to x, and the share by which the rectangle round the
# part may be larger than the smallest one. Simple turns are taken first.
SQUARE_STEPS = ((90.0, 0.05), (45.0, 0.05), (15.0, 0.01), (5.0, 0.01), (1.0, 0.01))
NEAR_SQUARE = 0.6  # cosine to an axis of the file from which on a tilted target may as well face it
NEARLY_SQUARE = 1.01  # length over width up to which a rectangle has no long side


def propose_pose(
    vertices: np.ndarray, triangles: np.ndarray, target: np.ndarray
) -> tuple[Turns, str]:
    """Return turns of a part about x, then y, then z [degrees], and the reason for them.

    Args:
        vertices: vertices of the part [m], shape (n, 3).
        triangles: triangles of the part, normals outward, shape (m, 3).
        target: marks the triangles of the target, the surface to peen, shape (m,).
    """
    weight, normal = _weighted_normals(vertices, triangles, target)
    middle = weight @ vertices[triangles[target]].mean(axis=1)

    def worth(down: np.ndarray, bonus: float) -> float:
        along = vertices @ -down
        height = float((middle @ -down - along.min()) / max(np.ptp(along), 1e-12))
        return round(_evenness(weight, normal, down) - LOW * height + bonus, 6)  # equal: the first

    turns = max(_poses(normal, weight), key=lambda one: worth(_down(one[0]), one[1]))[0]
    down = _down(turns)
    facing = float(weight @ (normal @ down))
    if facing > 0.5:
        reason = "the target faces the sonotrode"
    elif facing > 0.1 or _evenness(weight, normal, down) < 0.5 * (1.0 + facing) - ALIKE:
        reason = "the target's sides are as evenly exposed as they can be"
    else:
        reason = "the target stands upright, so that all its sides are exposed alike"
    return turns, reason


def hanging_pose(
    vertices: np.ndarray, triangles: np.ndarray, target: np.ndarray, turns: Turns
) -> Turns | None:
    """Return turns with which a long part stands on end, if its target is exposed nearly as well.

    Such a part needs a small sonotrode. It is None for a part that is not long, or stands already.

    Args:
        vertices, triangles, target: as of propose_pose.
        turns: the pose that would be taken otherwise [degrees].
    """
    sides = np.ptp(vertices, axis=0)
    axis = int(sides.argmax())
    weight, normal = _weighted_normals(vertices, triangles, target)
    lying = _evenness(weight, normal, _down(turns))
    ends = [sign * np.eye(3)[axis] for sign in (-1.0, 1.0)]
    down = max(ends, key=lambda one: _evenness(weight, normal, one))
    stands = abs(_down(turns)[axis]) > np.cos(np.radians(LEVEL_DEG))
    if stands or sides[axis] < LONG * np.sort(sides)[1]:
        return None
    return turns_down(down) if _evenness(weight, normal, down) >= lying - HANGING else None


def pose_by_size(
    vertices: np.ndarray, triangles: np.ndarray, target: np.ndarray, pose: Upright
) -> Turns:
    """Return turns with which a part stands, lies or stands on edge, its target more down than up.

    Args:
        vertices, triangles, target: as of propose_pose.
    """
    size = ("lying", "on-edge", "standing").index(pose)
    axis = int(np.argsort(np.ptp(vertices, axis=0), kind="stable")[size])
    weight, normal = _weighted_normals(vertices, triangles, target)
    sign = 1.0 if float(weight @ normal[:, axis]) > SIDED else -1.0
    return turns_down(sign * np.eye(3)[axis])


def upside_down(
    vertices: np.ndarray, triangles: np.ndarray, target: np.ndarray, turns: Turns
) -> Turns | None:
    """Return turns with which a part stands upside down, if its target is exposed nearly as well.

    Args:
        vertices, triangles, target: as of propose_pose.
        turns: the pose that would be taken otherwise [degrees].
    """
    weight, normal = _weighted_normals(vertices, triangles, target)
    down = _down(turns)
    is_as_good = _evenness(weight, normal, -down) >= _evenness(weight, normal, down) - HANGING
    return turns_down(-down) if is_as_good else None


def square_poses(turns: Turns) -> list[Turns]:
    """Return the poses near a tilted one in which an axis of the file is down, the nearest first.

    There are none if an axis is down already.
    """
    down = _down(turns)
    axes = sorted((*np.eye(3), *-np.eye(3)), key=lambda axis: -float(axis @ down))
    if axes[0] @ down > FLAT:
        return []
    return [turns_down(axis) for axis in axes if axis @ down > NEAR_SQUARE]


def _weighted_normals(
    vertices: np.ndarray, triangles: np.ndarray, target: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return of each triangle of a target its share of the area (m,) and its normal (m, 3)."""
    vectors = area_vectors(vertices, triangles)[target]
    weight = np.linalg.norm(vectors, axis=1)
    return weight / weight.sum(), unit_vectors(vectors)


def _evenness(weight: np.ndarray, normal: np.ndarray, down: np.ndarray) -> float:
    """Return the mean minus standard deviation of the exposure with a direction (3,) down."""
    exposed = 0.5 * (1.0 + normal @ down)
    mean = float(weight @ exposed)
    return mean - float(np.sqrt(max(weight @ (exposed - mean) ** 2, 0.0)))


def square_to_walls(vertices: np.ndarray, turns: Turns) -> Turns:
    """Return the turns [degrees] with a further turn about z that brings the part's long side to x.

    The long side is the longer side of the smallest rectangle round the part, seen from above. The
    turn is the simplest that gives nearly this rectangle.
    """
    from shapely import MultiPoint

    hull = MultiPoint((vertices @ rotation_matrix(turns).T)[:, :2]).convex_hull
    box = np.array(hull.minimum_rotated_rectangle.exterior.coords)
    sides = np.diff(box[:3], axis=0)
    x, y = sides[np.linalg.norm(sides, axis=1).argmax()]
    corners = np.array(hull.exterior.coords)

    def sides_at(angle: float) -> np.ndarray:
        turn = rotation_matrix((0.0, 0.0, angle))[:2, :2]
        return np.asarray(np.ptp(corners @ turn.T, axis=0))

    def excess(angle: float) -> tuple[float, bool, float]:
        """Return what is least at the best of several angles: area, whether y is long, angle."""
        x, y = sides_at(angle)
        return round(float(x * y), 9), y > NEARLY_SQUARE * x, angle

    for step, larger in SQUARE_STEPS:
        angle = min(np.arange(0.0, 180.0, step).tolist(), key=excess)
        if np.prod(sides_at(angle)) <= (1.0 + larger) * hull.minimum_rotated_rectangle.area:
            break
    else:
        angle = round(float(-np.degrees(np.arctan2(y, x)) % 180.0), 1)
    return turns[0], turns[1], angle - 180.0 if angle > 90.0 else angle


def end_to_wall(turns: Turns, axis: np.ndarray) -> Turns:
    """Return turns [degrees] with a further turn about z that makes an axis point along x.

    Args:
        axis: unit vector of the part's file, which is level in the pose, (3,).
    """
    x, y, _ = np.round(rotation_matrix((turns[0], turns[1], 0.0)) @ axis, 9) + 0.0
    return turns[0], turns[1], round(float(np.degrees(np.arctan2(-y + 0.0, x))), 4) + 0.0


def pose_in_words(mesh: PartMesh, known: Sequence[Surface], turns: Turns) -> str:
    """Return words for a pose as a fixture gives it: which face is level, and the turn upright.

    Args:
        mesh: the part.
        known: surfaces of the part, the largest first.
        turns: turns of the part about x, then y, then z [degrees].
    """
    if not any(turns):
        return "as drawn"
    up = rotation_matrix(turns)[2]  # in the part's file
    tilts = {}  # of flat faces [degrees]: 0 facing down, 180 facing up
    for one in known:
        if "faces" in one.keys and "alike" not in one.keys["faces"][0]:
            vectors = area_vectors(mesh.vertices, mesh.triangles[one.triangles])
            whole = vectors.sum(axis=0)
            length = np.linalg.norm(whole)
            if length > FLAT * np.linalg.norm(vectors, axis=1).sum():
                down = float(np.clip(-whole @ up / length, -1.0, 1.0))
                tilts[one.name] = float(np.degrees(np.arccos(down)))
    axis = axis_down(turns)
    words = [f"the file's {axis} down"] if axis else []
    level = [f"{name} level facing down" for name, tilt in tilts.items() if tilt < LEVEL_DEG]
    level += [f"{name} level facing up" for name, tilt in tilts.items() if tilt > 180.0 - LEVEL_DEG]
    words += level[:1]
    if not words:
        tilted = [f"{name} tilted by {min(t, 180.0 - t):.3g} degrees" for name, t in tilts.items()]
        turned = [f"{turns[k]:.4g} degrees about {'xy'[k]}" for k in (0, 1) if turns[k]]
        words.append(tilted[0] if tilted else f"turned by {', then '.join(turned)}")
    if turns[2]:
        way = ", clockwise as seen from above" if turns[2] < 0.0 else ""
        words.append(f"turned by {abs(turns[2]):.4g} degrees about the vertical{way}")
    return ", ".join(words)


def axis_down(turns: Turns) -> str:
    """Return which axis of the part's file points down, as "+x"; "" if none does.

    Args:
        turns: turns of the part about x, then y, then z [degrees], (3,).
    """
    up = rotation_matrix(turns)[2]
    axis = int(np.abs(up).argmax())
    if abs(up[axis]) <= np.cos(np.radians(LEVEL_DEG)):
        return ""
    return f"{'-' if up[axis] > 0.0 else '+'}{'xyz'[axis]}"


def _poses(normal: np.ndarray, weight: np.ndarray) -> Iterator[tuple[Turns, float]]:
    """Yield turns [degrees] of the part, the simplest first, and an advantage for each.

    The advantage is added to the mean minus standard deviation of the exposure.

    Args:
        normal: unit normals of the target's triangles, (m, 3).
        weight: area of each triangle over the target's area, (m,).
    """
    for axis in (2, 0, 1):
        for sign in (-1.0, 1.0):
            as_drawn = (axis, sign) == (2, -1.0)
            yield turns_down(sign * np.eye(3)[axis]), AS_DRAWN if as_drawn else ALONG_AXIS
    mean = weight @ normal
    if np.linalg.norm(mean) > FLAT:
        yield turns_down(mean / np.linalg.norm(mean)), 0.0  # lies on a face
        return
    for x, y, z in product((0.0, -1.0, 1.0), repeat=3):
        if abs(x) + abs(y) + abs(z) == 2.0:
            yield turns_down(np.array([x, y, z]) / np.sqrt(2.0)), DIAGONAL
    directions = [*np.linalg.eigh((weight[:, None] * normal).T @ normal)[1].T]
    directions += [-one for one in directions]
    if np.linalg.norm(mean) > 0.05:
        directions.insert(0, mean / np.linalg.norm(mean))
    for direction in directions:
        x, y, _ = turns = turns_down(direction)
        for step, bonus in OF_STEP.items():
            yield (step * round(x / step) + 0.0, step * round(y / step) + 0.0, 0.0), bonus
        yield turns, 0.0


def _down(turns: Turns) -> np.ndarray:
    """Return the direction (3,) of the part's file that these turns turn down."""
    return np.asarray(-rotation_matrix(turns)[2])


def turns_down(down: np.ndarray) -> Turns:
    """Return the turns about x, then y [degrees] that turn a direction down, so that it is level.

    >>> turns_down(np.array([1.0, 0.0, 0.0]))
    (0.0, 90.0, 0.0)
    """
    x, y, z = down
    across = float(np.hypot(y, z))
    about_x = np.degrees(np.arctan2(-y + 0.0, -z)) if across > 1e-9 else 0.0
    about_y = np.degrees(np.arctan2(x, across))
    return round(float(about_x), 4) + 0.0, round(float(about_y), 4) + 0.0, 0.0
