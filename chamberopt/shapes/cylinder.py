"""A round chamber on the sonotrode: the floor shakes, the side and the ceiling stand still.

 ___________  z = height      ceiling: wall
/           \\  corner radius
|           |                 side: wall, `facets` flat sides; upright, or leaning: a cone
\\___________/  z = 0           floor: sonotrode
      |
      axis x = y = 0
"""

import math
from typing import Literal

import numpy as np

from chamberopt.fields import quantity
from chamberopt.shapes.loft import lofted
from chamberopt.shapes.surface import ShapeSurface
from chamberopt.shapes.table import ParametricChamber


class Cylinder(ParametricChamber):
    """Corners of the wall lie on the circle of the given diameter, so its flat sides lie inside, by at most
    diameter/2 * (1 - cos(pi/facets)): 0.04 mm for 70 mm and 64 facets.
    """

    shape: Literal["cylinder"]
    diameter_mm: float = quantity(2, 2000, "mm", "inner diameter, at the sonotrode")

    @property
    def diameter(self) -> float:
        """Inner diameter at the sonotrode [m]."""
        return self.diameter_mm * 1e-3

    def surface(self, vertices: np.ndarray, triangles: np.ndarray) -> ShapeSurface:
        """4 * facets triangles."""
        angle = 2.0 * np.pi * np.arange(self.facets) / self.facets
        circle = self.diameter / 2.0 * np.c_[np.cos(angle), np.sin(angle)]
        low = np.c_[circle, np.zeros(self.facets)]
        high = np.c_[circle, np.full(self.facets, self.height)]
        return lofted([low, high])

    def widths_mm(self) -> dict[str, float]:
        """Across and up."""
        return {"diameter_mm": self.diameter_mm, "height_mm": self.height_mm}

    def room(self) -> float:
        """Of the round cavity [m³]."""
        return math.pi / 4.0 * self.diameter**2 * self.height
