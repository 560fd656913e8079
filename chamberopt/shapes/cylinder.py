"""A round chamber on the sonotrode: the floor shakes, the side and the ceiling stand still.

         ___________  z = height      ceiling: wall
        /           \\
        |           |                 side: wall, `facets` flat sides
        \\___________/  z = 0           floor: sonotrode
              |
              axis x = y = 0
"""

from typing import Protocol

import numpy as np

from chamberopt.shapes.surface import TAG_SONOTRODE, TAG_WALL, ShapeSurface


class CylinderSpec(Protocol):
    """What the cylinder reads from the design's chamber table: lengths [m], facets a count."""

    @property
    def diameter(self) -> float: ...
    @property
    def height(self) -> float: ...
    @property
    def facets(self) -> int: ...


def cylinder(chamber: CylinderSpec) -> ShapeSurface:
    """The closed surface of a round cavity: 4 * facets triangles.

    The corners lie on the circle of the given diameter, so the flat sides lie inside it, by at most
    diameter/2 * (1 - cos(pi/facets)): 0.04 mm for 70 mm and 64 facets.
    """
    n = chamber.facets
    angle = 2.0 * np.pi * np.arange(n) / n
    circle = chamber.diameter / 2.0 * np.c_[np.cos(angle), np.sin(angle)]
    low = np.c_[circle, np.zeros(n)]
    high = np.c_[circle, np.full(n, chamber.height)]
    centres = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, chamber.height]])
    vertices = np.concatenate([low, high, centres])

    here, beside = np.arange(n), (np.arange(n) + 1) % n
    floor = np.c_[np.full(n, 2 * n), beside, here]
    side = np.concatenate([np.c_[here, beside, n + beside], np.c_[here, n + beside, n + here]])
    ceiling = np.c_[np.full(n, 2 * n + 1), n + here, n + beside]
    tags = np.repeat(np.array([TAG_SONOTRODE, TAG_WALL], dtype=np.uint8), [n, 3 * n])
    return ShapeSurface(vertices, np.concatenate([floor, side, ceiling]).astype(np.int32), tags)
