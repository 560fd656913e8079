"""A round chamber, a cylinder or a cone: the floor vibrates, side and ceiling stand still.

 ___________  z = height      ceiling: wall
/           \\  corner radius
|           |                 side: wall, `facets` flat sides; upright, or leaning: a cone
|___________|  z = 0          floor: sonotrode
      |
      axis x = y = 0
"""

from typing import Literal

import numpy as np

from chamberopt.common.toml_fields import quantity
from chamberopt.design.shapes.base import ParametricChamber, RoundChamber
from chamberopt.design.table_base import SI


class Cylinder(RoundChamber, ParametricChamber):
    """A round chamber with a straight side wall."""

    shape: Literal["cylinder"]
    diameter_mm: float = quantity(2, 2000, "mm", "inner diameter, at the sonotrode")

    diameter = SI("diameter_mm", 1e-3, "Inner diameter at the sonotrode [m]")

    def upright(self) -> np.ndarray:
        """Up the side, then in along the ceiling."""
        radius = self.diameter / 2.0
        return np.array([[radius, 0.0], [radius, self.height], [0.0, self.height]])

    def widths_mm(self) -> dict[str, float]:
        """Diameter and height."""
        return {"diameter_mm": self.diameter_mm, "height_mm": self.height_mm}
