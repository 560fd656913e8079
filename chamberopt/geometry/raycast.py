"""What is seen of a surface from one side, pixel by pixel, along parallel lines: which triangle, and where on it.

Plain arithmetic, no graphics library: the same picture on every machine.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

MARGIN = 1.06  # of the picture's sides over what it must hold
AT_ONCE = 2_000_000  # pixels of triangles looked at together
TOUCH = 1e-9  # pixels: neighbours leave no crack between them


@dataclass(frozen=True)
class View:
    """Parallel sight lines: right, up, towards the eye (3,) unit vectors · centre (3,) m · pixel m · its shape."""

    right: np.ndarray
    up: np.ndarray
    towards: np.ndarray
    centre: np.ndarray
    pixel: float
    shape: tuple[int, int]

    def offsets(self, row: np.ndarray, column: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How far each pixel is to the right of the centre, and above it, (k,) [m]."""
        rows, columns = self.shape
        return self.pixel * (column - 0.5 * (columns - 1)), self.pixel * (0.5 * (rows - 1) - row)


def view_of(points: np.ndarray, towards: np.ndarray, longest: int) -> View:
    """A view that holds points (n, 3) [m] from the direction of the eye, z up; its longer side that many pixels."""
    towards = np.asarray(towards, dtype=float) / np.linalg.norm(towards)
    upright = np.array([0.0, 0.0, 1.0]) if abs(towards[2]) < 0.99 else np.array([0.0, 1.0, 0.0])
    right = np.cross(upright, towards)
    right /= np.linalg.norm(right)
    frame = np.stack([right, np.cross(towards, right), towards])
    low, high = (points @ frame.T).min(axis=0), (points @ frame.T).max(axis=0)
    pixel = MARGIN * float((high - low)[:2].max()) / longest
    rows, columns = (max(1, round(MARGIN * side / pixel)) for side in (high - low)[1::-1])
    return View(frame[0], frame[1], frame[2], 0.5 * (low + high) @ frame, pixel, (rows, columns))


def seen(view: View, corners: np.ndarray) -> np.ndarray:
    """The nearest of the triangles (m, 3, 3) [m] in each pixel, (rows, columns) int32; -1 where there is none.

    Of triangles at the same place the first is seen. Those seen edge on are not.
    """
    rows, columns = view.shape
    offset = (corners - view.centre) / view.pixel
    u, v = 0.5 * (columns - 1) + offset @ view.right, 0.5 * (rows - 1) - offset @ view.up
    depth = offset @ view.towards
    nearest = np.full(rows * columns, -np.inf)
    which = np.full(rows * columns, -1, dtype=np.int32)
    boxes = np.cumsum((np.ptp(u, axis=1) + 1.0) * (np.ptp(v, axis=1) + 1.0))
    ends = np.unique(
        [*np.searchsorted(boxes, np.arange(AT_ONCE, boxes[-1], AT_ONCE)), len(corners)]
    )
    for begin, end in zip([0, *ends[:-1]], ends, strict=True):
        own = slice(begin, end)
        triangle, row, column = _pixels(u[own], v[own], view.shape)
        away = _depth(u[own], v[own], depth[own], triangle, row, column)
        pixel = row * columns + column
        better = away > nearest[pixel] + TOUCH
        triangle, pixel, away = triangle[better], pixel[better], away[better]
        np.maximum.at(nearest, pixel, away)
        first = (away >= nearest[pixel] - TOUCH)[::-1]
        which[pixel[::-1][first]] = begin + triangle[::-1][first]
    return which.reshape(rows, columns)


def places(
    view: View, corners: np.ndarray, triangle: np.ndarray, row: np.ndarray, column: np.ndarray
) -> np.ndarray:
    """Where the sight lines of pixels meet the triangles seen in them, all (k,), of (m, 3, 3): (k, 3) [m]."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    slope, level = normal @ view.towards, ((corners[:, 0] - view.centre) * normal).sum(axis=1)
    depth = (corners - view.centre) @ view.towards
    across, above = view.offsets(row, column)
    gap = (
        level[triangle]
        - across * (normal @ view.right)[triangle]
        - above * (normal @ view.up)[triangle]
    )
    reach = np.divide(gap, slope[triangle], out=depth[triangle, 0], where=slope[triangle] != 0.0)
    reach = np.clip(reach, depth.min(axis=1)[triangle], depth.max(axis=1)[triangle])
    found = np.empty((len(row), 3))
    for axis in range(3):
        sides = view.right[axis] * across + view.up[axis] * above + view.towards[axis] * reach
        found[:, axis] = view.centre[axis] + sides
    return found


def _pixels(
    u: np.ndarray, v: np.ndarray, shape: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """All pixels inside triangles with corners u, v (m, 3) [pixels]: triangle, row, column, row after row."""
    rows, columns = shape
    triangle, row = _ranges(np.ceil(v.min(axis=1) - TOUCH), np.floor(v.max(axis=1) + TOUCH), rows)
    left, right = np.full(len(row), np.inf), np.full(len(row), -np.inf)
    for one, two in ((0, 1), (1, 2), (2, 0)):
        ua, va, ub, vb = (x[triangle, k] for k in (one, two) for x in (u, v))
        with np.errstate(divide="ignore", invalid="ignore"):
            share = (row - va) / (vb - va)
        crosses = (share >= -TOUCH) & (share <= 1.0 + TOUCH)
        at = ua + np.where(crosses, share, 0.0) * (ub - ua)
        left = np.where(crosses, np.minimum(left, at), left)
        right = np.where(crosses, np.maximum(right, at), right)
    met = left <= right
    triangle, row = triangle[met], row[met]
    line, column = _ranges(np.ceil(left[met] - TOUCH), np.floor(right[met] + TOUCH), columns)
    return triangle[line], row[line], column


def _ranges(low: np.ndarray, high: np.ndarray, end: int) -> tuple[np.ndarray, np.ndarray]:
    """All whole numbers from low to high (n,) within 0 .. end - 1: whose they are, and they themselves."""
    low, high = np.maximum(low, 0).astype(np.int64), np.minimum(high, end - 1).astype(np.int64)
    count = np.maximum(high - low + 1, 0)
    owner = np.repeat(np.arange(len(low)), count)
    return owner, np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count) + low[owner]


def _depth(
    u: np.ndarray,
    v: np.ndarray,
    depth: np.ndarray,
    triangle: np.ndarray,
    row: np.ndarray,
    column: np.ndarray,
) -> np.ndarray:
    """How near each pixel's triangle is, (k,) [pixels]; -inf for one seen edge on."""
    du, dv, dd = (x[:, 1:] - x[:, :1] for x in (u, v, depth))
    twice = du[:, 0] * dv[:, 1] - du[:, 1] * dv[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        along_u = (dd[:, 0] * dv[:, 1] - dd[:, 1] * dv[:, 0]) / twice
        along_v = (dd[:, 1] * du[:, 0] - dd[:, 0] * du[:, 1]) / twice
    found = depth[:, 0][triangle]
    with np.errstate(invalid="ignore"):
        found = (
            found
            + along_u[triangle] * (column - u[triangle, 0])
            + along_v[triangle] * (row - v[triangle, 0])
        )
    found = np.clip(found, depth.min(axis=1)[triangle], depth.max(axis=1)[triangle])
    return np.where(np.abs(twice)[triangle] > TOUCH, found, -np.inf)
