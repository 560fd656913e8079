"""A shape of one's own: two half rounds with straight walls between them, for long parts over a long sonotrode.

A design takes it with shape = "shapes/oblong.py". Its keys below are checked, can vary in a study, and are named in
errors like those of the shipped shapes; so are those it has from ParametricChamber (height_mm, facets ...).
"""

import numpy as np

from chamberopt.design.shapes import InputError, ParametricChamber, ShapeSurface, lofted, quantity


class Oblong(ParametricChamber):
    """Two half rounds over z = 0, the ceiling's as much wider as the walls lean."""

    length_mm: float = quantity(4, 2000, "mm", "over both round ends, along x, at the sonotrode")
    width_mm: float = quantity(2, 2000, "mm", "between the straight walls, at the sonotrode")

    def surface(self, vertices: np.ndarray, triangles: np.ndarray) -> ShapeSurface:
        """A ring of points at the sonotrode and one at the ceiling; the part (vertices, triangles) is not asked."""
        straight, radius = 1e-3 * (self.length_mm - self.width_mm), 0.5e-3 * self.width_mm
        if straight < 1e-3 or radius + self.lean < 1e-3:
            raise InputError(
                f"chamber.length_mm: given {self.length_mm:g} with width_mm = {self.width_mm:g} and inclination_deg = "
                f"{self.inclination_deg:g}; it must be 1 mm more than the width, and the ceiling 2 mm wide"
            )
        angle = np.pi * (np.arange(self.facets // 2 + 1) / (self.facets // 2) - 0.5)
        end = np.c_[np.cos(angle), np.sin(angle)]
        outward = np.concatenate(
            [end, -end]
        )  # counter-clockwise: the end at +x, then the one at -x
        middle = np.repeat([[0.5 * straight, 0.0], [-0.5 * straight, 0.0]], len(end), axis=0)
        low, high = (middle + r * outward for r in (radius, radius + self.lean))
        return lofted(
            [np.c_[low, np.zeros(len(low))], np.c_[high, np.full(len(high), self.height)]]
        )

    @property
    def is_round(self) -> bool:
        """`facets` makes a difference: `chamberopt accuracy` tries others."""
        return True

    def widths_mm(self) -> dict[str, float]:
        """No ball wider than the least of these fits: said before anything is built."""
        return {"width_mm": self.width_mm, "height_mm": self.height_mm}
