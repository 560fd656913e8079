"""What chambers over a polygon share: flat sides that may lean, upright edges sharp or rounded.

  ____________            in plan: the sides at the sonotrode; above they are moved out by the lean,
 /            \\           and the arcs of the edges, of the same radius all the way up, with them
|              |
 \\____________/
"""

from abc import abstractmethod
from typing import Self

import numpy as np
from pydantic import model_validator

from chamberopt.common.toml_fields import quantity
from chamberopt.design.shapes.base import ParametricChamber
from chamberopt.design.shapes.construction.limits import LEAST_MM, refuse_beyond, refuse_inward
from chamberopt.design.shapes.construction.loft import lofted
from chamberopt.design.shapes.construction.outline import arcs, area, most_inward, moved
from chamberopt.design.shapes.construction.surface import ShapeSurface


class PolygonChamber(ParametricChamber):
    """Flat sides over a convex polygon."""

    corner_radius_mm: float = quantity(
        0,
        1000,
        "mm",
        "of the upright edges between side walls, seen from above; up to 0.05: sharp",
        0.0,
    )

    @abstractmethod
    def floor(self) -> np.ndarray:
        """The sides at the sonotrode: corners (n, 2) m, convex, counter-clockwise."""

    @property
    def radius(self) -> float:
        """Of the upright edges [m]; 0: sharp."""
        return 1e-3 * self.corner_radius_mm if self.corner_radius_mm > LEAST_MM else 0.0

    @property
    def is_round(self) -> bool:
        """Whether `facets` makes a difference."""
        return self.radius > 0.0

    @model_validator(mode="after")
    def _makes_a_cavity(self) -> Self:
        most = most_inward(self.floor())
        refuse_inward(self.slope, [-most / self.height], self.inclination_deg)
        most += min(0.0, self.lean)
        fits = max(LEAST_MM, 1e3 * most)
        refuse_beyond(
            "corner_radius_mm",
            self.corner_radius_mm,
            fits,
            "too large for the sides between the edges",
        )
        return self

    def surface(self, vertices: np.ndarray, triangles: np.ndarray) -> ShapeSurface:
        """4 triangles for each corner of the rounded polygon."""
        floor = self.floor()
        owner, out = (
            arcs(floor, self.facets)
            if self.radius
            else (np.arange(len(floor)), np.zeros((len(floor), 2)))
        )
        plans = [
            moved(floor, lean - self.radius)[owner] + self.radius * out for lean in (0.0, self.lean)
        ]
        return lofted(
            [
                np.c_[plan, np.full(len(plan), z)]
                for plan, z in zip(plans, (0.0, self.height), strict=True)
            ]
        )

    def room(self) -> float:
        """Of the cavity, its edges sharp [m³]: Simpson's rule, exact here."""
        floor = self.floor()
        return (
            self.height
            / 6.0
            * sum(w * area(floor, s * self.lean) for s, w in ((0.0, 1.0), (0.5, 4.0), (1.0, 1.0)))
        )
