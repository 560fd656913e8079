"""What a shape hands on: a closed surface whose triangles know whether they are sonotrode or wall."""

from dataclasses import dataclass

import numpy as np

TAG_PART, TAG_SONOTRODE, TAG_WALL = 0, 1, 2


@dataclass(frozen=True)
class ShapeSurface:
    """The cavity before the part is taken out of it.

    vertices (n, 3) float64 m · triangles (k, 3) int32, closed, normals pointing out of the cavity · tags
    (k,) uint8.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    tags: np.ndarray
