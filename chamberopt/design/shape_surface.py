"""The closed surface of a chamber's shape. Tags, a number for each triangle, mark the triangles of
part, sonotrode and wall.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

# Further sonotrodes have the tags from 3 on, in the design's order.
TAG_PART, TAG_SONOTRODE, TAG_WALL = 0, 1, 2


def further_sonotrode_tag(k: int) -> int:
    """Return the tag (number of the kind of surface) of the further sonotrode `sonotrodes.k`."""
    return TAG_WALL + 1 + k


def is_sonotrode(tags: np.ndarray) -> np.ndarray:
    """Return True for each tag (k,) of a sonotrode, be it the first or a further sonotrode."""
    return np.asarray((tags == TAG_SONOTRODE) | (tags > TAG_WALL))


@dataclass(frozen=True)
class ShapeSurface:
    """The closed surface of the cavity before the part is taken out of it."""

    vertices: np.ndarray  # [m], shape (n, 3), float64
    triangles: np.ndarray  # shape (k, 3), int32; closed, with normals out of the cavity
    tags: np.ndarray  # shape (k,), uint8
    # Shape (k,), int32: the part triangle that each TAG_PART triangle lies on, else -1. None if the
    # part is a separate body that still has to be cut out.
    source: np.ndarray | None = None


def lofted(rings: Sequence[np.ndarray], peak: np.ndarray | None = None) -> ShapeSurface:
    """Return a closed surface through rings of points, lowest first; its floor is the sonotrode.

            ____ ring 1      ceiling: a fan about its middle, or about a peak
           /____\\
           |    | ring 0     floor: a fan about its middle

    There are 2 n triangles for each ring.

    Args:
        rings: points of each ring [m], (n, 3) with the same n, round a convex outline,
            counter-clockwise from above.
        peak: point in the middle of the ceiling [m], (3,); None for the mean of the last ring.
    """
    n, k = len(rings[0]), len(rings)
    middle = rings[-1].mean(axis=0) if peak is None else peak
    vertices = np.concatenate([*rings, [rings[0].mean(axis=0), middle]])
    here, beside = np.arange(n), (np.arange(n) + 1) % n
    floor = np.c_[np.full(n, k * n), beside, here]
    sides = []
    for ring in range(k - 1):
        low, high = ring * n, (ring + 1) * n
        sides.append(np.c_[low + here, low + beside, high + beside])
        sides.append(np.c_[low + here, high + beside, high + here])
    top = (k - 1) * n
    ceiling = np.c_[np.full(n, k * n + 1), top + here, top + beside]
    triangles = np.concatenate([floor, *sides, ceiling]).astype(np.int32)
    tags = np.repeat(np.array([TAG_SONOTRODE, TAG_WALL], dtype=np.uint8), [n, len(triangles) - n])
    return ShapeSurface(vertices, triangles, tags)
