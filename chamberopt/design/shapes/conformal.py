"""A chamber that follows the part: its shadow on the floor, grown by a gap and extruded.

     outline = "hull"             outline = "silhouette"
       ____________                 _____    _____
      /  _    _    \\               /  _  \\__/  _  \\
     |  | |__| |    |             |  | |____| |  |      inner: the part from above
     |  |______|    |             |  |________|  |      outer: the wall, `gap` away
      \\____________/               \\____________/
"""

from collections.abc import Iterator
from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from chamberopt.common.errors import InputError
from chamberopt.common.toml_errors import Problem
from chamberopt.common.toml_fields import quantity
from chamberopt.design.shape_surface import TAG_SONOTRODE, TAG_WALL, ShapeSurface
from chamberopt.design.shapes.base import ParametricChamber
from chamberopt.design.shapes.outlines import MIN_LENGTH, corner_arcs, refuse_meeting_walls
from chamberopt.design.table_base import SI
from chamberopt.geometry.solids import Outline, extrude, plan_outline

# Tolerance of the outline [m]: an eighth of the error of 64 facets on a wall 70 mm across.
SIMPLIFIED = 5e-6


class Conformal(ParametricChamber):
    """A chamber whose wall follows the shadow of the part on the floor.

    Only the part below the ceiling counts. Holes in the shadow are filled.
    """

    shape: Literal["conformal"]
    outline: Literal["hull", "silhouette"] = Field(
        description="what is grown: the convex hull of the part's shadow on the floor, or the "
        "shadow itself"
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

    gap = SI("gap_mm", 1e-3, "From the part's outline to the wall, at the sonotrode [m]")

    @property
    def is_round(self) -> bool:
        """True, because outward corners are arcs about the part's corners."""
        return True

    def _problems(self) -> Iterator[Problem]:
        if self.outline == "silhouette" and self.inclination_deg:
            text = 'not supported with outline = "silhouette"; use "hull", or 0'
            yield Problem("inclination_deg", f"given {self.inclination_deg:g}: {text}")
        if self.outline == "hull" and self.corner_radius_mm:
            text = "but a hull has no corners that jut in; leave it out"
            yield Problem("corner_radius_mm", f"given {self.corner_radius_mm:g}, {text}")

    @model_validator(mode="after")
    def _makes_a_cavity(self) -> Self:
        least_slope = (MIN_LENGTH - self.gap) / self.height
        refuse_meeting_walls(self.slope, [least_slope], self.inclination_deg)
        return self

    def surface(self, vertices: np.ndarray, triangles: np.ndarray) -> ShapeSurface:
        """Return the cavity's surface with its wall round the part's shadow.

        Raises InputError if no part is below the ceiling, or the shadow stays in several pieces.
        """
        if not len(vertices) or vertices[:, 2].min() >= self.height:
            raise InputError(
                f"chamber.height_mm: given {self.height_mm:g}: no part below that ceiling, whose "
                "outline could be followed; raise height_mm or lower chamber.sonotrode_distance_mm"
            )
        outline = plan_outline(vertices, triangles, self.height)
        return self._leaning(outline) if self.outline == "hull" else self._upright(outline)

    def _leaning(self, outline: Outline) -> ShapeSurface:
        corners = outline.hull(SIMPLIFIED)
        corner, direction = corner_arcs(corners, self.facets)
        low, high = (corners[corner] + (self.gap + lean) * direction for lean in (0.0, self.lean))
        return self.lofted_over(low, high)

    def _upright(self, outline: Outline) -> ShapeSurface:
        radius = 1e-3 * self.corner_radius_mm
        grown = outline.offset(self.gap + radius, self.facets)
        around = (grown.offset(-radius, self.facets) if radius else grown).without_holes(SIMPLIFIED)
        if len(around) > 1:
            raise InputError(
                f"chamber.gap_mm: given {self.gap_mm:g}, with which the part's shadow stays in "
                f"{len(around)} pieces, each with a chamber of its own; raise it or "
                'corner_radius_mm, or use outline = "hull"'
            )
        vertices, triangles = extrude(around[0], self.height)
        low = (vertices[triangles][..., 2] == 0.0).all(axis=1)
        tags = np.where(low, TAG_SONOTRODE, TAG_WALL).astype(np.uint8)
        return ShapeSurface(vertices, triangles, tags)

    def widths_mm(self) -> dict[str, float]:
        """Return the chamber's height [mm] by its key. Other widths depend on the part."""
        return {"height_mm": self.height_mm}

    def notes(self, ball: float) -> list[str]:
        """Return a remark if balls of this diameter [m] do not fit beside the part."""
        if self.gap >= ball:
            return []
        return [
            f"chamber.gap_mm = {self.gap_mm:g} is narrower than a ball of {1e3 * ball:g} mm: shot "
            "gets under the part, but not beside it; raise it, unless that is meant"
        ]
