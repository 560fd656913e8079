"""Convex outlines in plan, (n, 2) m counter-clockwise: their sides moved, their corners rounded."""

import numpy as np

from chamberopt.design.shapes.construction.limits import LEAST


def turns(outline: np.ndarray) -> np.ndarray:
    """By what angle [rad] the outline turns left at each corner, (n,)."""
    before, after = _along(outline)
    return np.arctan2(
        before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0],
        np.einsum("ij,ij->i", before, after),
    )


def moved(outline: np.ndarray, out: float) -> np.ndarray:
    """Corners of the outline whose sides are moved outwards by so much [m]."""
    before, after = _along(outline)
    outward = np.c_[before[:, 1] + after[:, 1], -before[:, 0] - after[:, 0]]
    return outline + out * outward / (1.0 + np.einsum("ij,ij->i", before, after))[:, None]


def most_inward(outline: np.ndarray) -> float:
    """How far [m] all sides can be moved inwards until the first is only LEAST long."""
    tangent = np.tan(turns(outline) / 2.0)
    length = np.hypot(*(np.roll(outline, -1, axis=0) - outline).T)
    return max(0.0, float(((length - LEAST) / (tangent + np.roll(tangent, -1))).min()))


def area(outline: np.ndarray, out: float = 0.0) -> float:
    """Of the outline [m²], its sides moved outwards by so much."""
    (x, y), (xn, yn) = outline.T, np.roll(outline, -1, axis=0).T
    around = np.hypot(xn - x, yn - y).sum()
    return float(
        0.5 * (x * yn - y * xn).sum()
        + out * around
        + out * out * np.tan(turns(outline) / 2.0).sum()
    )


def arcs(outline: np.ndarray, facets: int) -> tuple[np.ndarray, np.ndarray]:
    """Whose corner each point of a rounded outline is, (k,), and which way it lies from there, (k, 2).

    Corners plus radius times directions are the outline grown by the radius: at each corner a fan from the normal of
    one side to the next one's, in steps of a full turn / facets at most. A turn of less than half a step gets one
    direction, longer than 1, that moves both sides by the radius.
    """
    before, _ = _along(outline)
    turn = turns(outline)
    steps = facets * turn / (2.0 * np.pi)
    count = np.where(steps < 0.5, 0, np.ceil(steps - 1e-9)).astype(int)
    owner = np.repeat(np.arange(len(outline)), count + 1)
    step = np.concatenate([np.arange(n + 1) for n in count])
    share = np.where(count[owner] > 0, step / np.maximum(count[owner], 1), 0.5)
    angle = np.arctan2(-before[:, 0], before[:, 1])[owner] + share * turn[owner]
    size = np.where(count > 0, 1.0, 1.0 / np.cos(turn / 2.0))[owner]
    return owner, size[:, None] * np.c_[np.cos(angle), np.sin(angle)]


def _along(outline: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors (n, 2) along the side before and the side after each corner."""
    after = np.roll(outline, -1, axis=0) - outline
    after /= np.hypot(*after.T)[:, None]
    return np.roll(after, 1, axis=0), after
