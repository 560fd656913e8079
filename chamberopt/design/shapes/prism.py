"""A chamber with n equal flat walls: a regular polygon, extruded."""

from typing import Literal

import numpy as np
from pydantic import Field

from chamberopt.common.toml_fields import quantity
from chamberopt.design.shapes.polygon import PolygonChamber


class Prism(PolygonChamber):
    """Measured across flats: by the widest round bar that fits in, whatever the number of sides."""

    shape: Literal["prism"]
    sides: int = Field(ge=3, le=64, description="flat walls")
    across_mm: float = quantity(
        2, 2000, "mm", "diameter of the circle that touches all sides, at the sonotrode"
    )
    turn_deg: float = quantity(-360, 360, "degrees", "about z; at 0 the first side faces +x", 0.0)

    def floor(self) -> np.ndarray:
        """From the corner after the first side on."""
        angle = np.radians(self.turn_deg) + np.pi / self.sides * (2.0 * np.arange(self.sides) + 1.0)
        return (
            0.5e-3
            * self.across_mm
            / np.cos(np.pi / self.sides)
            * np.c_[np.cos(angle), np.sin(angle)]
        )

    def widths_mm(self) -> dict[str, float]:
        """Across flats and up."""
        return {"across_mm": self.across_mm, "height_mm": self.height_mm}
