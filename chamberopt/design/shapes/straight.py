"""Chambers with straight walls: box, cylinder or cone, and regular prism."""

from typing import Literal

import numpy as np

from chamberopt.common.toml_fields import quantity
from chamberopt.design.shapes.base import ParametricChamber, PolygonChamber, RoundChamber
from chamberopt.design.table_base import SI

# A rectangular chamber: flat walls square to x and y.


class Box(PolygonChamber):
    """A chamber with four flat sides."""

    shape: Literal["box"]
    length_mm: float = quantity(2, 2000, "mm", "inner size along x, at the sonotrode")
    width_mm: float = quantity(2, 2000, "mm", "inner size along y, at the sonotrode")

    def floor(self) -> np.ndarray:
        """Return the floor's corners (4, 2) [m], counter-clockwise from the corner at +x, -y."""
        half_sides = 0.5e-3 * np.array([self.length_mm, self.width_mm])
        return np.asarray(half_sides * np.array([[1, -1], [1, 1], [-1, 1], [-1, -1]]))

    def widths_mm(self) -> dict[str, float]:
        """Return length, width and height [mm] by their keys."""
        return {"length_mm": self.length_mm, "width_mm": self.width_mm, "height_mm": self.height_mm}


# A round chamber, a cylinder or a cone: the floor vibrates, side and ceiling stand still.
#
#  ___________  z = height      ceiling: wall
# /           \  corner radius
# |           |                 side: wall, `facets` flat sides; upright, or leaning: a cone
# |___________|  z = 0          floor: sonotrode
#       |
#       axis x = y = 0


class Cylinder(RoundChamber, ParametricChamber):
    """A round chamber with a straight side wall."""

    shape: Literal["cylinder"]
    diameter_mm: float = quantity(2, 2000, "mm", "inner diameter, at the sonotrode")

    diameter = SI("diameter_mm", 1e-3, "Inner diameter at the sonotrode [m]")

    def upright(self) -> np.ndarray:
        """Return the profile (radius, height) [m]: up the side, then in along the ceiling."""
        radius = self.diameter / 2.0
        return np.array([[radius, 0.0], [radius, self.height], [0.0, self.height]])

    def widths_mm(self) -> dict[str, float]:
        """Return diameter and height [mm] by their keys."""
        return {"diameter_mm": self.diameter_mm, "height_mm": self.height_mm}


class Prism(PolygonChamber):
    """A regular prism measured across flats, by the widest round bar that fits in."""

    shape: Literal["prism"]
    sides: int = quantity(3, 64, "", "flat walls")
    across_mm: float = quantity(
        2, 2000, "mm", "diameter of the circle that touches all sides, at the sonotrode"
    )
    turn_deg: float = quantity(-360, 360, "degrees", "about z; at 0 the first side faces +x", 0.0)

    def floor(self) -> np.ndarray:
        """Return the floor's corners (n, 2) [m], beginning with the corner after the first side."""
        half_angle = np.pi / self.sides
        angle = np.radians(self.turn_deg) + half_angle * (2.0 * np.arange(self.sides) + 1.0)
        return np.asarray(
            0.5e-3 * self.across_mm / np.cos(half_angle) * np.c_[np.cos(angle), np.sin(angle)]
        )

    def widths_mm(self) -> dict[str, float]:
        """Return the width across flats and the height [mm] by their keys."""
        return {"across_mm": self.across_mm, "height_mm": self.height_mm}
