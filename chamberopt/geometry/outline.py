"""Outlines of faces seen along an axis: the convex hull, the circles and the rectangle about it."""

from __future__ import annotations

import numpy as np

from chamberopt.geometry.triangles import unit_vectors


def frame_along(axis: np.ndarray) -> np.ndarray:
    """Return two unit vectors across an axis, and the axis: rows of a rotation, (3, 3)."""
    aside = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    aside /= np.linalg.norm(aside)
    return np.array([aside, np.cross(axis, aside), axis])


def convex_hull(points: np.ndarray) -> np.ndarray | None:
    """Return the corners (n, 2) of the convex hull of points (p, 2), counter-clockwise.

    Return None if the points lie on a line.
    """
    from scipy.spatial import ConvexHull, QhullError

    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except QhullError:
        return None


def centroid(hull: np.ndarray) -> np.ndarray:
    """Return the centroid (2,) of the area in a convex hull (n, 2)."""
    nexts = np.roll(hull, -1, axis=0)
    twice = hull[:, 0] * nexts[:, 1] - nexts[:, 0] * hull[:, 1]
    return np.asarray(((hull + nexts) * twice[:, None]).sum(axis=0) / (3.0 * twice.sum()))


def radii(hull: np.ndarray, middle: np.ndarray) -> tuple[float, float]:
    """Return the radius of the widest circle about a point in a hull, and of that round it."""
    along = unit_vectors(np.roll(hull, -1, axis=0) - hull)
    out = np.c_[along[:, 1], -along[:, 0]]
    inner = np.einsum("ij,ij->i", hull - middle, out).min()
    return float(inner), float(np.linalg.norm(hull - middle, axis=1).max())


def narrowest_rectangle(hull: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the rectangle of least area round a hull: middle, sides (2,), and axes (2, 2).

    The first side is the longer one.

    Source: H. Freeman and R. Shapira, Comm. ACM 18 (1975) 409: one side lies along an edge.
    """
    along = unit_vectors(np.roll(hull, -1, axis=0) - hull)
    axes = np.stack([along, np.c_[-along[:, 1], along[:, 0]]], axis=1)  # (n, 2, 2)
    places = np.einsum("kij,pj->kpi", axes, hull)
    low, high = places.min(axis=1), places.max(axis=1)
    best = int(np.prod(high - low, axis=1).argmin())
    middle, sides, own = 0.5 * (low + high)[best] @ axes[best], (high - low)[best], axes[best]
    if sides[0] < sides[1]:
        sides, own = sides[::-1], np.array([own[1], -own[0]])
    return middle, sides, own


def fitted_circle(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the middle (2,) and the radius of the circle that fits points (p, 2) best.

    Source: I. Kåsa, IEEE Trans. Instrum. Meas. 25 (1976) 8: |p|² = 2 p m + c by least squares.
    """
    origin = points.mean(axis=0)
    off = points - origin
    rows = np.c_[2.0 * off, np.ones(len(off))]
    x, y, c = np.linalg.lstsq(rows, (off * off).sum(axis=1), rcond=None)[0]
    return origin + np.array([x, y]), float(np.sqrt(c + x * x + y * y))


def distances_in_plan(corners: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Return how far each triangle (n, 3, 2) is from a point (2,), 0 where it holds it, (n,).

    Triangles may be seen edge on.
    """
    off = corners - point
    along = np.roll(off, -1, axis=1) - off
    square = np.maximum((along * along).sum(axis=2), 1e-300)
    share = np.clip(-(off * along).sum(axis=2) / square, 0.0, 1.0)
    least = np.linalg.norm(off + share[..., None] * along, axis=2).min(axis=1, initial=np.inf)
    side = along[..., 0] * off[..., 1] - along[..., 1] * off[..., 0]
    holds = (side > 0.0).all(axis=1) | (side < 0.0).all(axis=1)
    return np.where(holds, 0.0, least)
