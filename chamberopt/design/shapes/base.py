"""Base classes of chambers of several shapes.

Each shape is a file beside this file, entered in registry.py.

ChamberTable          keys of every chamber: shape, sonotrode distance, holes, deflectors
  WalledChamber       + side walls all round, which may lean
    RoundChamber      a profile turned about the axis
    ParametricChamber + a height
      PolygonChamber  flat sides over a convex polygon
"""

import math
from abc import abstractmethod
from typing import ClassVar, Self

import numpy as np
from pydantic import Field, ValidationInfo, field_validator, model_validator

from chamberopt.common.toml_errors import CrossCheckError, Problem
from chamberopt.common.toml_fields import Several, from_file, list_field, quantity
from chamberopt.design.shape_surface import ShapeSurface, lofted
from chamberopt.design.shapes import outlines
from chamberopt.design.shapes.cad_setup import Setup
from chamberopt.design.shapes.hole_and_deflector_tables import Deflector, Hole
from chamberopt.design.shapes.outlines import (
    MIN_LENGTH,
    MIN_LENGTH_MM,
    refuse_above,
    refuse_meeting_walls,
)
from chamberopt.design.table_base import SI, FileTable


class ChamberTable(FileTable):
    """A cavity before the part is taken out of it. Its floor is the sonotrode, at z = 0.

    A shape is a subclass with its own keys, in the file's units, and ``surface``.
    """

    sha256: ClassVar[str] = ""  # digest of the file of a user's own shape
    ceiling_key: ClassVar[str] = "shape"  # key to change when the ceiling is too low

    shape: str = Field(description="form of the cavity")
    sonotrode_distance_mm: float = quantity(
        0.1, 2000, "mm", "mean sonotrode face to lowest point of the part within the walls"
    )
    deflectors: Several[Deflector] = list_field(
        "a list of tables, [[chamber.deflectors]]", "bodies that stand in the chamber", ()
    )
    holes: Several[Hole] = list_field(
        "a list of tables, [[chamber.holes]]", "blind bores in its wall", ()
    )

    @field_validator("shape")
    @classmethod
    def _absolute(cls, shape: str, info: ValidationInfo) -> str:
        """Make the path of a user's own shape absolute, like the path of the part's mesh."""
        return str(from_file(shape, info.context)) if is_custom(shape) else shape

    sonotrode_distance = SI(
        "sonotrode_distance_mm", 1e-3, "Sonotrode to lowest point of the part within the walls [m]"
    )

    @abstractmethod
    def surface(self, vertices: np.ndarray, triangles: np.ndarray) -> ShapeSurface:
        """Return the closed surface of the cavity before the part is taken out of it.

        Raises InputError if the values make no cavity.

        Args:
            vertices, triangles: surface of the part in the chamber, (n, 3) [m] and (m, 3), for
                shapes that follow the part.
        """

    def plan(self) -> np.ndarray | None:
        """Return the convex outline of the cavity from above, where it is known without the part.

        Its corners (n, 2) [m] are counter-clockwise. Return None for a cavity that follows the
        part, which all of the part below the ceiling is in, or that a file draws.
        """
        return None

    def setup(self) -> Setup | None:
        """Return the CAD set-up if chamber and part are drawn in one file; otherwise None."""
        return None

    def widths_mm(self) -> dict[str, float]:
        """Return the inner widths [mm] of the cavity, each by the key of the design that sets it.

        Every ball must be smaller than each width.
        """
        return {}

    def room(self) -> float:
        """Return an upper bound of the cavity's volume [m³], without building its surface."""
        return math.inf

    @property
    def is_round(self) -> bool:
        """True if the cavity has round walls, whose number of flat sides the key `facets` sets."""
        return False

    def notes(self, ball: float) -> list[str]:
        """Return remarks on the chamber's values for shot with this largest ball diameter [m]."""
        return []


class WalledChamber(ChamberTable):
    """A cavity with side walls all round, which may lean."""

    inclination_deg: float = quantity(
        -45, 45, "degrees", "of the side walls: above 0 wider at the ceiling", 0.0
    )
    facets: int = quantity(8, 1024, "", "flat sides that stand for a full turn of a round wall", 64)

    @property
    def slope(self) -> float:
        """Outward shift of the side walls for each metre of height [m/m]."""
        return math.tan(math.radians(self.inclination_deg))


class ParametricChamber(WalledChamber):
    """A cavity with a floor, sides that may lean, and a flat ceiling at a given height."""

    ceiling_key: ClassVar[str] = "height_mm"

    height_mm: float = quantity(2, 2000, "mm", "inner height, sonotrode to ceiling")

    height = SI("height_mm", 1e-3, "Inner height [m]")

    @property
    def lean(self) -> float:
        """Outward shift of the side walls from floor to ceiling [m]."""
        return self.height * self.slope

    def lofted_over(self, floor: np.ndarray, ceiling: np.ndarray) -> ShapeSurface:
        """Return the cavity's surface between outlines (n, 2) [m] at the floor and the ceiling."""
        rings = ((floor, 0.0), (ceiling, self.height))
        return lofted([np.c_[ring, np.full(len(ring), z)] for ring, z in rings])


class PolygonChamber(ParametricChamber):
    """A chamber with flat sides over a convex polygon, which may lean; edges sharp or rounded.

      ____________            in plan: the sides at the sonotrode; higher up they are moved out by
     /            \\           the lean, and with them the arcs of the edges, of constant radius
    |              |
     \\____________/
    """

    corner_radius_mm: float = quantity(
        0,
        1000,
        "mm",
        "of the upright edges between side walls, seen from above; up to 0.05: sharp",
        0.0,
    )

    @abstractmethod
    def floor(self) -> np.ndarray:
        """Return the corners (n, 2) [m] of the polygon at the sonotrode.

        The polygon is convex and its corners are counter-clockwise.
        """

    def plan(self) -> np.ndarray:
        """Return the larger one of the polygons at floor and ceiling, (n, 2) [m], without radii."""
        return outlines.move_sides(self.floor(), max(0.0, self.lean))

    @property
    def radius(self) -> float:
        """Radius of the upright edges [m]; 0 for sharp edges."""
        return 1e-3 * self.corner_radius_mm if self.corner_radius_mm > MIN_LENGTH_MM else 0.0

    @property
    def is_round(self) -> bool:
        """True if the upright edges are rounded, so that the key `facets` has an effect."""
        return self.radius > 0.0

    @model_validator(mode="after")
    def _makes_a_cavity(self) -> Self:
        room = outlines.largest_inward_move(self.floor())
        refuse_meeting_walls(self.slope, [-room / self.height], self.inclination_deg)
        limit = max(MIN_LENGTH_MM, 1e3 * (room + min(0.0, self.lean)))
        why = "too large for the sides between the edges"
        refuse_above("corner_radius_mm", self.corner_radius_mm, limit, why)
        return self

    def surface(self, vertices: np.ndarray, triangles: np.ndarray) -> ShapeSurface:
        """Return the cavity's surface, with 4 triangles for each corner of the rounded polygon."""
        floor = self.floor()
        if self.radius:
            corner, direction = outlines.corner_arcs(floor, self.facets)
        else:
            corner, direction = np.arange(len(floor)), np.zeros((len(floor), 2))
        moves = (0.0 - self.radius, self.lean - self.radius)
        rings = [outlines.move_sides(floor, x)[corner] + self.radius * direction for x in moves]
        return self.lofted_over(*rings)

    def room(self) -> float:
        """Return the volume [m³] of the cavity as if its edges were sharp.

        Simpson's rule is exact here.
        """
        moves = (share * self.lean for share in (0.0, 0.5, 1.0))
        low, middle, high = (outlines.area_inside(self.floor(), move) for move in moves)
        return self.height / 6.0 * (1.0 * low + 4.0 * middle + 1.0 * high)


class RoundChamber(WalledChamber):
    """A round chamber: a profile, which may lean and have rounded corners, turned about the axis.

    Corners of the wall's flat sides lie on the round wall. The sides therefore lie inside it, by at
    most radius * (1 - cos(pi/facets)): 0.04 mm for 70 mm across and 64 facets.
    """

    corner_radius_mm: float = quantity(
        0, 1000, "mm", "of the rounded edge between side wall and ceiling; up to 0.05: sharp", 0.0
    )

    @abstractmethod
    def upright(self) -> np.ndarray:
        """Return the profile with an upright wall: points (radius, height) [m], shape (n, 2).

        It goes from the sonotrode's edge to the axis.
        """

    @property
    def is_round(self) -> bool:
        """True: the wall is round, made of flat sides whose number the key `facets` sets."""
        return True

    def profile(self) -> np.ndarray:
        """Return the profile with the wall's lean: points (radius, height) [m], shape (n, 2).

        Its corners are sharp.
        """
        line = self.upright()
        off_axis = line[:, 0] > 0.0
        return np.asarray(
            np.c_[line[:, 0] + np.where(off_axis, self.slope * line[:, 1], 0.0), line[:, 1]]
        )

    @model_validator(mode="after")
    def _makes_a_cavity(self) -> Self:
        line = self.upright()
        wall = line[(line[:, 0] > 0.0) & (line[:, 1] > 0.0)]
        least_slopes = (MIN_LENGTH - wall[:, 0]) / wall[:, 1]
        refuse_meeting_walls(self.slope, least_slopes, self.inclination_deg)
        limit = max(MIN_LENGTH_MM, 1e3 * outlines.largest_corner_radius(self.profile()))
        why = "too large for the sides beside an edge"
        refuse_above("corner_radius_mm", self.corner_radius_mm, limit, why)
        if outlines.crosses_itself(self._rounded()):
            text = f"given {self.corner_radius_mm:g}, with which the profile crosses itself"
            raise CrossCheckError([Problem("corner_radius_mm", f"{text}; lower it")])
        return self

    def plan(self) -> np.ndarray:
        """Return the corners (n, 2) [m] of the wall's flat sides where they are farthest out."""
        angle = 2.0 * np.pi * np.arange(self.facets) / self.facets
        return np.asarray(self.profile()[:, 0].max() * np.c_[np.cos(angle), np.sin(angle)])

    def surface(self, vertices: np.ndarray, triangles: np.ndarray) -> ShapeSurface:
        """Return the cavity's surface: 2 * facets triangles for each profile point but the last."""
        return outlines.revolve(self._rounded(), self.facets)

    def room(self) -> float:
        """Return the volume [m³] of the cavity, with a wall that is truly round."""
        return outlines.revolved_volume(self._rounded())

    def _rounded(self) -> np.ndarray:
        return outlines.round_corners(self.profile(), 1e-3 * self.corner_radius_mm, self.facets)


def is_custom(shape: object) -> bool:
    """True if a design's shape is the path of a Python file, written by the user."""
    return isinstance(shape, str) and shape.endswith(".py")
