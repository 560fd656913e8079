"""A closed surface from rings of points, one above the other."""

from collections.abc import Sequence

import numpy as np

from chamberopt.design.shapes.construction.surface import TAG_SONOTRODE, TAG_WALL, ShapeSurface


def lofted(rings: Sequence[np.ndarray], peak: np.ndarray | None = None) -> ShapeSurface:
    """Floor, sides, ceiling over rings (n, 3) m of equally many points, lowest first, each round a convex outline and
    counter-clockwise seen from above. The floor is the sonotrode; 2 n triangles a ring.

            ____ ring 1      ceiling: a fan about its middle, or about a peak (3,) m
           /____\\
           |    | ring 0     floor: a fan about its middle
    """
    n, k = len(rings[0]), len(rings)
    middle = rings[-1].mean(axis=0) if peak is None else peak
    vertices = np.concatenate([*rings, [rings[0].mean(axis=0), middle]])
    here, beside = np.arange(n), (np.arange(n) + 1) % n
    floor = np.c_[np.full(n, k * n), beside, here]
    sides = []
    for ring in range(k - 1):
        low, high = ring * n, (ring + 1) * n
        sides += [
            np.c_[low + here, low + beside, high + beside],
            np.c_[low + here, high + beside, high + here],
        ]
    top = (k - 1) * n
    ceiling = np.c_[np.full(n, k * n + 1), top + here, top + beside]
    triangles = np.concatenate([floor, *sides, ceiling]).astype(np.int32)
    tags = np.repeat(np.array([TAG_SONOTRODE, TAG_WALL], dtype=np.uint8), [n, len(triangles) - n])
    return ShapeSurface(vertices, triangles, tags)
