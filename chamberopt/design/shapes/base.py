"""What the chamber table of a design holds, whatever the shape: one class a shape, each in a file of its own."""

import math
from abc import abstractmethod
from typing import Annotated, ClassVar

import numpy as np
from pydantic import BaseModel, Field, ValidationInfo, field_validator

from chamberopt.common.toml_fields import from_file, list_field, quantity
from chamberopt.design.materials import STRICT
from chamberopt.design.shapes.construction.cad_setup import Setup
from chamberopt.design.shapes.construction.surface import ShapeSurface
from chamberopt.design.shapes.hole_and_deflector_tables import Deflector, Hole


class ChamberTable(BaseModel):
    """A cavity before the part is taken out of it; its floor is the sonotrode, at z = 0.

    A shape is a subclass with keys of its own, in the file's units, and ``surface``.
    """

    model_config = STRICT

    sha256: ClassVar[str] = ""  # of the file, where the shape is a user's own
    ceiling_key: ClassVar[str] = "shape"  # what to change when the ceiling is too low

    shape: str = Field(description="form of the cavity")
    sonotrode_distance_mm: float = quantity(
        0.1, 2000, "mm", "mean sonotrode face to lowest point of the part"
    )
    deflectors: Annotated[tuple[Deflector, ...], Field(strict=False)] = list_field(
        "a list of tables, [[chamber.deflectors]]", "bodies that stand in the chamber", ()
    )
    holes: Annotated[tuple[Hole, ...], Field(strict=False)] = list_field(
        "a list of tables, [[chamber.holes]]", "blind bores in its wall", ()
    )

    @field_validator("shape")
    @classmethod
    def _absolute(cls, shape: str, info: ValidationInfo) -> str:
        """A user's own file is held absolute from here on, like the part's mesh."""
        return str(from_file(shape, info.context)) if is_custom(shape) else shape

    @property
    def sonotrode_distance(self) -> float:
        """Mean sonotrode face to lowest point of the part [m]."""
        return self.sonotrode_distance_mm * 1e-3

    @abstractmethod
    def surface(self, vertices: np.ndarray, triangles: np.ndarray) -> ShapeSurface:
        """The closed surface of the cavity, without the part; vertices (n, 3) m and triangles (m, 3) are the part as
        it stands in it, for shapes that follow it. Raises InputError for values that make no cavity.
        """

    def setup(self) -> Setup | None:
        """What a file has drawn, where chamber and part come from one file; None for a parametric cavity."""
        return None

    def widths_mm(self) -> dict[str, float]:
        """Inner widths [mm] by the key that sets them: no ball wider than the least of them fits."""
        return {}

    def room(self) -> float:
        """A volume [m³] that the cavity does not exceed, as far as the table alone says."""
        return math.inf

    @property
    def is_round(self) -> bool:
        """Whether `facets` makes a difference."""
        return False

    def notes(self, ball: float) -> list[str]:
        """What to know of these values with shot whose largest balls have this diameter [m]."""
        return []


class WalledChamber(ChamberTable):
    """A cavity with side walls all round, that may lean."""

    inclination_deg: float = quantity(
        -45, 45, "degrees", "of the side walls: above 0 wider at the ceiling", 0.0
    )
    facets: int = Field(
        default=64,
        ge=8,
        le=1024,
        description="flat sides that stand for a full turn of a round wall",
    )

    @property
    def slope(self) -> float:
        """How far the side walls go outward for each metre up."""
        return math.tan(math.radians(self.inclination_deg))


class ParametricChamber(WalledChamber):
    """A cavity made from its parameters: floor, sides that may lean, flat ceiling."""

    ceiling_key: ClassVar[str] = "height_mm"

    height_mm: float = quantity(2, 2000, "mm", "inner height, sonotrode to ceiling")

    @property
    def height(self) -> float:
        """Inner height [m]."""
        return self.height_mm * 1e-3

    @property
    def lean(self) -> float:
        """How far the side walls go outward over the height [m]."""
        return self.height * self.slope


def is_custom(shape: object) -> bool:
    """Whether a design's shape names a Python file of the user's."""
    return isinstance(shape, str) and shape.endswith(".py")
