"""What round chambers share: a profile that leans, its corners rounded, turned about the axis."""

from abc import abstractmethod
from typing import Self

import numpy as np
from pydantic import model_validator

from chamberopt.common.toml_errors import CrossCheckError, Problem
from chamberopt.common.toml_fields import quantity
from chamberopt.design.shapes.base import WalledChamber
from chamberopt.design.shapes.construction.limits import (
    LEAST,
    LEAST_MM,
    refuse_beyond,
    refuse_inward,
)
from chamberopt.design.shapes.construction.profile import (
    crosses,
    largest_radius,
    revolved,
    rounded,
    volume,
)
from chamberopt.design.shapes.construction.surface import ShapeSurface


class RoundChamber(WalledChamber):
    """Corners of the wall's flat sides lie on the round wall, so the sides lie inside, by at most
    radius * (1 - cos(pi/facets)): 0.04 mm for 70 mm across and 64 facets.
    """

    corner_radius_mm: float = quantity(
        0, 1000, "mm", "of the rounded edge between side wall and ceiling; up to 0.05: sharp", 0.0
    )

    @abstractmethod
    def upright(self) -> np.ndarray:
        """The wall before it leans: points (r, z) m, (n, 2), from the sonotrode's rim to the ceiling on the axis."""

    @property
    def is_round(self) -> bool:
        """Whether `facets` makes a difference."""
        return True

    def profile(self) -> np.ndarray:
        """The wall as it leans, corners sharp: (n, 2) m."""
        line = self.upright()
        off_axis = line[:, 0] > 0.0
        return np.c_[line[:, 0] + np.where(off_axis, self.slope * line[:, 1], 0.0), line[:, 1]]

    @model_validator(mode="after")
    def _makes_a_cavity(self) -> Self:
        line = self.upright()
        wall = line[(line[:, 0] > 0.0) & (line[:, 1] > 0.0)]
        refuse_inward(self.slope, (LEAST - wall[:, 0]) / wall[:, 1], self.inclination_deg)
        most = max(LEAST_MM, 1e3 * largest_radius(self.profile()))
        refuse_beyond(
            "corner_radius_mm",
            self.corner_radius_mm,
            most,
            "too large for the sides beside an edge",
        )
        if crosses(self._rounded()):
            text = (
                f"given {self.corner_radius_mm:g}, with which the profile crosses itself; lower it"
            )
            raise CrossCheckError([Problem("corner_radius_mm", text)])
        return self

    def surface(self, vertices: np.ndarray, triangles: np.ndarray) -> ShapeSurface:
        """2 * facets triangles for each point of the rounded profile."""
        return revolved(self._rounded(), self.facets)

    def room(self) -> float:
        """Of the round cavity [m³]."""
        return volume(self._rounded())

    def _rounded(self) -> np.ndarray:
        return rounded(self.profile(), 1e-3 * self.corner_radius_mm, self.facets)
