"""What a shape hands on: a closed surface whose triangles know what they belong to."""

from dataclasses import dataclass

import numpy as np

TAG_PART, TAG_SONOTRODE, TAG_WALL = (
    0,
    1,
    2,
)  # and 3, 4 ...: the further sonotrodes, in the design's order


def further_sonotrode_tag(k: int) -> int:
    """The tag of sonotrodes.k of a design."""
    return TAG_WALL + 1 + k


def is_sonotrode(tags: np.ndarray) -> np.ndarray:
    """Which tags (k,) are a sonotrode's, the first's or a further one's."""
    return (tags == TAG_SONOTRODE) | (tags > TAG_WALL)


@dataclass(frozen=True)
class ShapeSurface:
    """The cavity before the part is taken out of it.

    vertices (n, 3) float64 m · triangles (k, 3) int32, closed, normals pointing out of the cavity · tags
    (k,) uint8 · source (k,) int32: where the part is drawn as a piece of this surface, the part triangle that each
    TAG_PART triangle lies on, else -1; None where the part is a body of its own, still to be cut out.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    tags: np.ndarray
    source: np.ndarray | None = None
