"""A chamber that follows the part: its shadow on the floor, grown by a gap, extruded.

     outline = "hull"             outline = "silhouette"
       ____________                 _____    _____
      /  _    _    \\               /  _  \\__/  _  \\
     |  | |__| |    |             |  | |____| |  |      inner: the part from above
     |  |______|    |             |  |________|  |      outer: the wall, `gap` away
      \\____________/               \\____________/
"""

from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from chamberopt.common.errors import InputError
from chamberopt.common.toml_errors import CrossCheckError, Problem
from chamberopt.common.toml_fields import quantity
from chamberopt.design.shapes.base import ParametricChamber
from chamberopt.design.shapes.construction.limits import LEAST, refuse_inward
from chamberopt.design.shapes.construction.loft import lofted
from chamberopt.design.shapes.construction.outline import arcs
from chamberopt.design.shapes.construction.surface import TAG_SONOTRODE, TAG_WALL, ShapeSurface
from chamberopt.geometry.solids import Outline, extrude, plan_outline

SIMPLIFIED = 5e-6  # m: the outline may be off by this much, an eighth of what 64 facets are off a wall of 70 mm


class Conformal(ParametricChamber):
    """The shadow is that of what is below the ceiling; holes in it are filled."""

    shape: Literal["conformal"]
    outline: Literal["hull", "silhouette"] = Field(
        description="what is grown: the convex hull of the part's shadow on the floor, or the shadow itself"
    )
    gap_mm: float = quantity(
        0.1, 1000, "mm", "between the part's outline and the wall, at the sonotrode"
    )
    corner_radius_mm: float = quantity(
        0,
        1000,
        "mm",
        "of corners that jut into the chamber: the wall spans narrower notches of a silhouette",
        0.0,
    )

    @property
    def gap(self) -> float:
        """Between the part's outline and the wall, at the sonotrode [m]."""
        return self.gap_mm * 1e-3

    @property
    def is_round(self) -> bool:
        """Whether `facets` makes a difference: outward corners are arcs about the part's."""
        return True

    @model_validator(mode="after")
    def _makes_a_cavity(self) -> Self:
        if self.outline == "silhouette" and self.inclination_deg:
            text = f'given {self.inclination_deg:g}: not supported with outline = "silhouette"; use "hull", or 0'
            raise CrossCheckError([Problem("inclination_deg", text)])
        if self.outline == "hull" and self.corner_radius_mm:
            text = f"given {self.corner_radius_mm:g}, but a hull has no corners that jut in; leave it out"
            raise CrossCheckError([Problem("corner_radius_mm", text)])
        refuse_inward(self.slope, [(LEAST - self.gap) / self.height], self.inclination_deg)
        return self

    def surface(self, vertices: np.ndarray, triangles: np.ndarray) -> ShapeSurface:
        """Round the part as it stands. InputError where nothing of it is below the ceiling, or it is in pieces."""
        if not len(vertices) or vertices[:, 2].min() >= self.height:
            raise InputError(
                f"chamber.height_mm: given {self.height_mm:g}: no part below that ceiling, whose outline could be "
                "followed; raise height_mm or lower chamber.sonotrode_distance_mm"
            )
        outline = plan_outline(vertices, triangles, self.height)
        return self._leaning(outline) if self.outline == "hull" else self._upright(outline)

    def _leaning(self, outline: Outline) -> ShapeSurface:
        corners = outline.hull(SIMPLIFIED)
        owner, out = arcs(corners, self.facets)
        plans = [corners[owner] + (self.gap + lean) * out for lean in (0.0, self.lean)]
        return lofted(
            [
                np.c_[plan, np.full(len(plan), z)]
                for plan, z in zip(plans, (0.0, self.height), strict=True)
            ]
        )

    def _upright(self, outline: Outline) -> ShapeSurface:
        radius = 1e-3 * self.corner_radius_mm
        grown = outline.offset(self.gap + radius, self.facets)
        around = (grown.offset(-radius, self.facets) if radius else grown).without_holes(SIMPLIFIED)
        if len(around) > 1:
            raise InputError(
                f"chamber.gap_mm: given {self.gap_mm:g}, with which the part's shadow stays in {len(around)} pieces, "
                'each with a chamber of its own; raise it or corner_radius_mm, or use outline = "hull"'
            )
        vertices, triangles = extrude(around[0], self.height)
        low = (vertices[triangles][..., 2] == 0.0).all(axis=1)
        return ShapeSurface(
            vertices, triangles, np.where(low, TAG_SONOTRODE, TAG_WALL).astype(np.uint8)
        )

    def widths_mm(self) -> dict[str, float]:
        """Up; across is as wide as the part."""
        return {"height_mm": self.height_mm}

    def notes(self, ball: float) -> list[str]:
        """Where shot does not get beside the part."""
        if self.gap >= ball:
            return []
        return [
            f"chamber.gap_mm = {self.gap_mm:g} is narrower than a ball of {1e3 * ball:g} mm: shot gets under the part, "
            "but not beside it; raise it, unless that is meant"
        ]
