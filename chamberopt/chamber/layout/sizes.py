"""Propose the sizes of a chamber round a part."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from chamberopt.design.tolerances import iso_2768_m
from chamberopt.geometry.heights import points_up_to
from chamberopt.geometry.triangles import area_vectors, side_pairs, sides_of, unit_vectors

# Room for balls to get round the part and gather speed, in ball diameters and as a share of the
# part's width. A study varies these starting points.
SIDE_GAP, GAP_SHARE, MIN_GAP = 5.0, 0.15, 4e-3
DISTANCE, DISTANCE_SHARE, MIN_DISTANCE = 6.0, 0.2, 8e-3
ABOVE = 5.0  # ball diameters between target and ceiling
CLOSEST = 0.6  # share of that which is left where the ceiling lies off a face of the part
ROUNDS = 3  # in which what is below the ceiling and the sonotrode's distance follow each other
# Edges of a part that turn by more are at one level if they lie within ONE_LEVEL [m]; they count if
# together they are longer than this share of the rectangle round the part.
LEVEL_EDGE_DEG, ONE_LEVEL, MUCH = 20.0, 1e-5, 0.05
SEEN = 1e-3  # m of a part that stand out above a ceiling at least
OVER_LEDGE = 2.0  # ball diameters between a face that looks up and a ceiling over it
SHAPES = ("cylinder", "box", "prism", "conformal")
LONG = 1.6  # least length over width of a part whose sides the walls follow
SIDES = 6  # of a prism


@dataclass(frozen=True)
class Sizes:
    """Shape and sizes of a proposed chamber round a part."""

    shape: str
    plan: dict[str, float | str]  # keys of [chamber] for its form in plan, and their values
    distance: float  # sonotrode to part [m]
    height: float  # [m]
    gap: float  # part to side wall [m]
    through_ceiling: bool  # true if the part goes out through the ceiling
    top: float  # height over the part's lowest point that must be below the ceiling [m]
    closed: tuple[str, ...] = ()  # sides at which a face of the part is the wall, such as "-x"

    @property
    def is_fixed(self) -> bool:
        """Whether faces of the part are walls on two opposite sides, so that its plan is fixed."""
        return any({axis, f"-{axis}"} <= {*self.closed} for axis in "xy")

    def lengths_mm(self) -> dict[str, float]:
        """Return the lengths of these sizes by their keys of [chamber]."""
        lengths = {key: one for key, one in self.plan.items() if isinstance(one, float)}
        height, distance = round(1e3 * self.height, 3), round(1e3 * self.distance, 3)
        return {**lengths, "height_mm": height, "sonotrode_distance_mm": distance}


def shape_for(box: np.ndarray) -> str:
    """Return the name of the chamber's shape for a part with a bounding box of these sides (3,).

    It is "box" if the part is long seen from above, else "cylinder".
    """
    return "box" if max(box[:2]) > LONG * min(box[:2]) else "cylinder"


def propose_sizes(
    vertices: np.ndarray,
    target_top: float,
    ball: float,
    shape: str,
    wider: float = 1.0,
    target: np.ndarray | None = None,
    triangles: np.ndarray | None = None,
) -> Sizes:
    """Return the sizes of a chamber of the named shape, with room for balls round the part.

    A part that goes out through the ceiling needs room round what of it is below. Such a ceiling
    lies off the part's level faces, so that it meets the same section however it is set up.

    Args:
        vertices: vertices of the turned part, with its lowest point at z = 0 [m], shape (n, 3).
        target_top: height of the target's highest point [m].
        ball: diameter of a ball [m].
        wider: factor on the room beside, below and above the part.
        target: vertices of the target alone [m], shape (k, 3), for a chamber round the target whose
            walls the part goes out through; None for one round the part.
        triangles: of the part, (m, 3), where all of its faces count; None to look at its vertices.
    """
    top = float(vertices[:, 2].max())
    above = ABOVE * ball * wider
    through = top > target_top + 2.0 * above
    below = target_top if through else top

    def room_below(points: np.ndarray) -> tuple[float, float]:
        """Return the sonotrode's distance and the height [m] for the points below the ceiling."""
        width = float(np.ptp(points[:, :2], axis=0).max())
        least = max(DISTANCE * ball, DISTANCE_SHARE * min(width, top), MIN_DISTANCE)
        distance = 1e-3 * _up_mm(least * wider)
        height = 1e-3 * _up_mm(distance + below + above)
        if through and triangles is not None:
            least = distance + below + CLOSEST * above
            ends = least, min(height + above, distance + top - SEEN)
            if _ends_under_ledge(vertices, triangles, below):  # no ball gets over it
                off = 2e-3 * iso_2768_m(1e3 * (distance + below))
                height = least = 1e-3 * _up_mm(distance + below + off)
                ends = least, ends[1]
            height = _off_ledges(vertices, triangles, distance, height, ends, ball)
        return distance, height

    distance, height = room_below(vertices)
    inside = vertices if target is None else target
    if target is None and through:
        for _ in range(ROUNDS):
            inside = _up_to(vertices, triangles, height - distance)
            distance, height = room_below(inside)
    middle = middle_in_plan(vertices if target is None else target)  # on the chamber's axis
    half = np.abs(inside[:, :2] - middle).max(axis=0)
    gap = max(SIDE_GAP * ball, GAP_SHARE * 2.0 * float(half.max()), MIN_GAP) * wider
    radius = float(np.linalg.norm(inside[:, :2] - middle, axis=1).max())
    across = _up_mm(2.0 * (radius + gap))
    plans: dict[str, dict[str, float | str]] = {
        "cylinder": {"diameter_mm": across},
        "box": dict(zip(("length_mm", "width_mm"), map(_up_mm, 2.0 * (half + gap)), strict=True)),
        "prism": {"sides": SIDES, "across_mm": across},
        "conformal": {"outline": "hull", "gap_mm": _up_mm(gap)},
    }
    return Sizes(shape, plans[shape], distance, height, gap, through, below)


def _up_to(vertices: np.ndarray, triangles: np.ndarray | None, level: float) -> np.ndarray:
    """Return points (k, 3) [m] round what of a part is not above a level [m]."""
    if triangles is None:
        return vertices[vertices[:, 2] <= level + 1e-9]
    return points_up_to(vertices, triangles, level)


def _ledges(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the heights [m] at which a part's section changes, and which look up, both (k,).

    They are those of level edges that are long together: where the part turns sharply, as at a face
    or a chamfer, and the lowest and highest lines of rounds, as of a level bore.
    """
    pairs = side_pairs(triangles)
    ends = vertices[sides_of(triangles)[pairs[:, 0]]]
    is_level = np.abs(ends[:, 1, 2] - ends[:, 0, 2]) < ONE_LEVEL
    pairs, ends = pairs[is_level], ends[is_level]
    normal = unit_vectors(area_vectors(vertices, triangles))[pairs // 3]
    # A side goes from a corner of its triangle to the next; the third corner is opposite.
    opposite = vertices[triangles[pairs // 3, (pairs % 3 + 2) % 3], 2] - ends[:, :1, 2]
    is_turn = (opposite >= -ONE_LEVEL).all(axis=1) | (opposite <= ONE_LEVEL).all(axis=1)
    cosine = np.einsum("ij,ij->i", normal[:, 0], normal[:, 1])
    used = is_turn | (cosine < np.cos(np.radians(LEVEL_EDGE_DEG)))
    up = normal[used, :, 2].sum(axis=1) > 0.0
    length = np.linalg.norm(ends[used, 1] - ends[used, 0], axis=1)
    key = 2.0 * np.round(ends[used, 0, 2] / ONE_LEVEL) + up
    keys, row = np.unique(key, return_inverse=True)
    around = 2.0 * float(np.ptp(vertices[:, :2], axis=0).sum())
    keys = keys[np.bincount(row, length, len(keys)) > MUCH * around]
    return ONE_LEVEL * np.floor(0.5 * keys), keys % 2.0 == 1.0


def _ends_under_ledge(vertices: np.ndarray, triangles: np.ndarray, top: float) -> bool:
    """Return whether a target ends at a level face that looks down, as under a platform.

    Args:
        vertices, triangles: the turned part, with its lowest point at z = 0 [m].
        top: height of the target's highest point [m].
    """
    levels, up = _ledges(vertices, triangles)
    return bool((np.abs(levels[~up] - top) < ONE_LEVEL).any())


def _off_ledges(
    vertices: np.ndarray,
    triangles: np.ndarray,
    distance: float,
    height: float,
    ends: tuple[float, float],
    ball: float,
) -> float:
    """Return the height [m] of a ceiling between two ends that is off all ledges of a part.

    It keeps twice its tolerance off them, so that the ceiling meets one section of the part, and
    over those that look up two balls. It is lowered, so that the face goes out and no ball lies on
    it, or else raised. It stays where there is no such height.

    Args:
        vertices, triangles, ball: as of propose_sizes.
        distance, height, ends: over the sonotrode [m]: the part's lowest point, and the ceiling.
    """
    levels, up = _ledges(vertices, triangles)
    off = 2e-3 * iso_2768_m(1e3 * height)
    over = np.where(up, max(OVER_LEDGE * ball, off), off)

    def is_free(one: float) -> bool:
        above = one - distance - levels
        return not ((above > 1e-9 - off) & (above < over - 1e-9)).any()

    if is_free(height):
        return height
    most = math.ceil(1e3 * (ends[1] - ends[0]))
    tried = (height + way * k for way in (-1e-3, 1e-3) for k in range(1, most + 1))
    inside = (one for one in tried if ends[0] - 1e-9 <= one <= ends[1] + 1e-9)
    return round(next((one for one in inside if is_free(one)), height), 9)


def middle_in_plan(points: np.ndarray) -> np.ndarray:
    """Return the middle of the box round points (n, 3), seen from above, (2,)."""
    return np.asarray(0.5 * (points[:, :2].min(axis=0) + points[:, :2].max(axis=0)))


def _up_mm(length: float) -> float:
    """Return a length given in m in whole millimetres, rounded up."""
    return float(math.ceil(1e3 * length - 1e-6))
