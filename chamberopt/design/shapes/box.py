"""A rectangular chamber: flat walls square to x and y."""

from typing import Literal

import numpy as np

from chamberopt.common.toml_fields import quantity
from chamberopt.design.shapes.base import PolygonChamber


class Box(PolygonChamber):
    """Four sides."""

    shape: Literal["box"]
    length_mm: float = quantity(2, 2000, "mm", "inner size along x, at the sonotrode")
    width_mm: float = quantity(2, 2000, "mm", "inner size along y, at the sonotrode")

    def floor(self) -> np.ndarray:
        """The corners, beginning at +x, -y."""
        half_sides = 0.5e-3 * np.array([self.length_mm, self.width_mm])
        return half_sides * np.array([[1, -1], [1, 1], [-1, 1], [-1, -1]])

    def widths_mm(self) -> dict[str, float]:
        """Length, width and height."""
        return {"length_mm": self.length_mm, "width_mm": self.width_mm, "height_mm": self.height_mm}
