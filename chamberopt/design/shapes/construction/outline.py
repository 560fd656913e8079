"""Convex outlines in plan: their sides moved, their corners rounded.

An outline is an array of corners (n, 2) [m], counter-clockwise.
"""

import numpy as np

from chamberopt.design.shapes.construction.limits import MIN_LENGTH


def corner_angles(outline: np.ndarray) -> np.ndarray:
    """Angle [rad] by which the outline turns left at each corner, (n,)."""
    before, after = _directions(outline)
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    return np.arctan2(cross, np.einsum("ij,ij->i", before, after))


def move_sides(outline: np.ndarray, distance: float) -> np.ndarray:
    """Corners of the outline whose sides are moved outward by a distance [m]."""
    before, after = _directions(outline)
    outward = np.c_[before[:, 1] + after[:, 1], -before[:, 0] - after[:, 0]]
    return outline + distance * outward / (1.0 + np.einsum("ij,ij->i", before, after))[:, None]


def largest_inward_move(outline: np.ndarray) -> float:
    """How far [m] all sides can be moved inward until one of them is only MIN_LENGTH long."""
    tangent = np.tan(corner_angles(outline) / 2.0)
    length = np.hypot(*(np.roll(outline, -1, axis=0) - outline).T)
    return max(0.0, float(((length - MIN_LENGTH) / (tangent + np.roll(tangent, -1))).min()))


def area_inside(outline: np.ndarray, distance: float = 0.0) -> float:
    """Area [m²] of the outline whose sides are moved outward by a distance [m]."""
    (x, y), (xn, yn) = outline.T, np.roll(outline, -1, axis=0).T
    around = np.hypot(xn - x, yn - y).sum()
    corners = np.tan(corner_angles(outline) / 2.0).sum()
    area = 0.5 * (x * yn - y * xn).sum() + distance * around + distance * distance * corners
    return float(area)


def corner_arcs(outline: np.ndarray, facets: int) -> tuple[np.ndarray, np.ndarray]:
    """Points of a rounded outline: the corner of each, (k,), and its direction from there, (k, 2).

    Corners plus radius times directions are the outline grown by the radius. Each corner has a fan
    from the normal of one side to that of the next, in steps of at most a full turn / facets. A
    corner of less than half a step gets one direction, longer than 1, that moves both sides by the
    radius.
    """
    before, _ = _directions(outline)
    turn = corner_angles(outline)
    steps = facets * turn / (2.0 * np.pi)
    count = np.where(steps < 0.5, 0, np.ceil(steps - 1e-9)).astype(int)
    corner = np.repeat(np.arange(len(outline)), count + 1)
    step = np.concatenate([np.arange(n + 1) for n in count])
    share = np.where(count[corner] > 0, step / np.maximum(count[corner], 1), 0.5)
    angle = np.arctan2(-before[:, 0], before[:, 1])[corner] + share * turn[corner]
    size = np.where(count > 0, 1.0, 1.0 / np.cos(turn / 2.0))[corner]
    return corner, size[:, None] * np.c_[np.cos(angle), np.sin(angle)]


def _directions(outline: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors (n, 2) along the side before and the side after each corner."""
    after = np.roll(outline, -1, axis=0) - outline
    after /= np.hypot(*after.T)[:, None]
    return np.roll(after, 1, axis=0), after
