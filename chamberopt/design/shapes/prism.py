"""A chamber with n equal flat walls: a regular polygon, extruded."""

from typing import Literal

import numpy as np

from chamberopt.common.toml_fields import quantity
from chamberopt.design.shapes.base import PolygonChamber


class Prism(PolygonChamber):
    """A prism measured across flats: by the widest round bar that fits in."""

    shape: Literal["prism"]
    sides: int = quantity(3, 64, "", "flat walls")
    across_mm: float = quantity(
        2, 2000, "mm", "diameter of the circle that touches all sides, at the sonotrode"
    )
    turn_deg: float = quantity(-360, 360, "degrees", "about z; at 0 the first side faces +x", 0.0)

    def floor(self) -> np.ndarray:
        """The corners, beginning at the one after the first side."""
        half_angle = np.pi / self.sides
        angle = np.radians(self.turn_deg) + half_angle * (2.0 * np.arange(self.sides) + 1.0)
        return 0.5e-3 * self.across_mm / np.cos(half_angle) * np.c_[np.cos(angle), np.sin(angle)]

    def widths_mm(self) -> dict[str, float]:
        """Width across flats, and height."""
        return {"across_mm": self.across_mm, "height_mm": self.height_mm}
