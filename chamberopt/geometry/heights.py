"""The height of a surface over an outline on the floor, and what of it is below a level."""

from __future__ import annotations

import math

import numpy as np

from chamberopt.geometry.triangles import sides_of

INSIDE = 1e-6  # m: what is less far inside an outline, such as a face in a wall, is not over it


def lowest_over(vertices: np.ndarray, triangles: np.ndarray, outline: np.ndarray) -> float:
    """Return the height [m] of the lowest point of a surface over an outline; inf without one.

    It is at a vertex, where an edge crosses the outline, or over a corner of the outline.

    Args:
        vertices, triangles: of the surface, (n, 3) [m] and (m, 3); each vertex is a corner.
        outline: corners (k, 2) [m] of a convex outline, counter-clockwise.
    """
    along = np.roll(outline, -1, axis=0) - outline
    out = np.c_[along[:, 1], -along[:, 0]] / np.linalg.norm(along, axis=1)[:, None]
    reach = np.einsum("ij,ij->i", outline, out) - INSIDE

    def lowest(points: np.ndarray) -> float:
        within = (points[:, :2] @ out.T <= reach + 1e-3 * INSIDE).all(axis=1)
        return float(points[within, 2].min(initial=math.inf))

    least = vertices[:, 2].min()
    if lowest(vertices[vertices[:, 2] == least]) == least:  # usual, and saves the rest
        return float(least)
    found = lowest(vertices)
    start, end = vertices[sides_of(triangles)].transpose(1, 0, 2)
    for normal, at in zip(out, reach, strict=True):
        before, after = start[:, :2] @ normal - at, end[:, :2] @ normal - at
        cut = (before > 0.0) != (after > 0.0)
        share = (before[cut] / (before[cut] - after[cut]))[:, None]
        found = min(found, lowest(start[cut] + share * (end[cut] - start[cut])))
    one, *others = vertices[triangles].transpose(1, 0, 2)
    (ax, ay, az), (bx, by, bz) = ((other - one).T for other in others)
    twice = ax * by - ay * bx
    flat = np.abs(twice) > 0.0  # others stand upright: their edges were cut
    for x, y in outline - INSIDE * (out + np.roll(out, 1, axis=0)):
        dx, dy = x - one[flat, 0], y - one[flat, 1]
        u = (dx * by[flat] - dy * bx[flat]) / twice[flat]
        v = (ax[flat] * dy - ay[flat] * dx) / twice[flat]
        over = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)
        height = (one[flat, 2] + u * az[flat] + v * bz[flat])[over]
        found = min(found, float(height.min(initial=math.inf)))
    return found


def points_up_to(vertices: np.ndarray, triangles: np.ndarray, level: float) -> np.ndarray:
    """Return points (k, 3) [m] whose hull is that of what of a closed surface is below a level.

    They are its vertices up to the level, and the places where its edges cross it.

    Args:
        vertices, triangles: as of lowest_over.
        level: height [m].
    """
    start, end = vertices[sides_of(triangles)].transpose(1, 0, 2)
    below, above = start[:, 2] - level, end[:, 2] - level
    cut = (below < 0.0) & (above > 0.0)  # an edge is a side of two triangles, one either way
    share = (below[cut] / (below[cut] - above[cut]))[:, None]
    crossings = start[cut] + share * (end[cut] - start[cut])
    return np.concatenate([vertices[vertices[:, 2] <= level], crossings])
