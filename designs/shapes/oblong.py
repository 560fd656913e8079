"""A custom shape: two half rounds joined by straight walls, for long parts over a long sonotrode.

A design chooses it with shape = "shapes/oblong.py". Its keys below are checked, can vary in a
study, and are named in errors, like those of the shipped shapes. So are the keys that it inherits
from ParametricChamber (height_mm, facets ...).
"""

import numpy as np

from chamberopt.design.shapes import InputError, ParametricChamber, ShapeSurface, quantity


class Oblong(ParametricChamber):
    """Two half rounds over z = 0; those of the ceiling are wider by as much as the walls lean."""

    length_mm: float = quantity(4, 2000, "mm", "over both round ends, along x, at the sonotrode")
    width_mm: float = quantity(2, 2000, "mm", "between the straight walls, at the sonotrode")

    def surface(self, vertices: np.ndarray, triangles: np.ndarray) -> ShapeSurface:
        """The wall between outlines at the sonotrode and at the ceiling; it ignores the part."""
        straight, radius = 1e-3 * (self.length_mm - self.width_mm), 0.5e-3 * self.width_mm
        if straight < 1e-3 or radius + self.lean < 1e-3:
            raise InputError(
                f"chamber.length_mm: given {self.length_mm:g} with width_mm = {self.width_mm:g} "
                f"and inclination_deg = {self.inclination_deg:g}; it must be 1 mm more than the "
                "width, and the ceiling 2 mm wide"
            )
        angle = np.pi * (np.arange(self.facets // 2 + 1) / (self.facets // 2) - 0.5)
        end = np.c_[np.cos(angle), np.sin(angle)]
        outward = np.concatenate([end, -end])  # counter-clockwise: the end at +x, then that at -x
        middle = np.repeat([[0.5 * straight, 0.0], [-0.5 * straight, 0.0]], len(end), axis=0)
        low, high = (middle + r * outward for r in (radius, radius + self.lean))
        return self.lofted_over(low, high)

    @property
    def is_round(self) -> bool:
        """Whether `facets` makes a difference: `chamberopt accuracy` then tries other numbers."""
        return True

    def widths_mm(self) -> dict[str, float]:
        """Inner widths by key: balls that are wider than the smallest are refused early."""
        return {"width_mm": self.width_mm, "height_mm": self.height_mm}
