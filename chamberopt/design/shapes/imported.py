"""A set-up from CAD: sonotrode, chamber and part in one mesh; the sonotrode's distance can vary.

 as drawn        farther                nearer
|  part  |      |  part  |             |  part  |
|        |      |        |             |________|  <- cut off where the walls still rise straight
|________|      |        |
 sonotrode      |        |  <- walls carried on straight down from the sonotrode's outline
                |________|
"""

from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field

from chamberopt.common.toml_fields import File, Names, quantity
from chamberopt.design.shapes.base import ChamberTable
from chamberopt.design.shapes.construction.cad_distance import move_sonotrode
from chamberopt.design.shapes.construction.cad_setup import Setup, read_setup
from chamberopt.design.shapes.construction.surface import ShapeSurface
from chamberopt.geometry.mesh_io.units import Unit

IMPORTED = "imported"


class Imported(ChamberTable):
    """A chamber drawn with its part in one file; what is neither part nor sonotrode is wall."""

    shape: Literal["imported"]
    sonotrode_distance_mm: float | None = quantity(  # type: ignore[assignment]
        0.1, 2000, "mm", "mean sonotrode face to lowest point of the part; absent: as drawn", None
    )
    part: Names = Field(description="groups of the file: the part")
    sonotrode: Names = Field(description="groups of the file: the sonotrode's flat face")
    mesh: File = Field(description="the set-up's file: that of [part], so leave it out")
    unit: Unit = Field(
        default="guess", description="of its numbers: that of [part], so leave it out"
    )

    @property
    def sonotrode_distance(self) -> float:  # type: ignore[override]
        """Mean sonotrode face to lowest point of the part [m]."""
        given = self.sonotrode_distance_mm
        return self.setup().distance if given is None else given * 1e-3

    def setup(self) -> Setup:
        """The set-up as drawn, read once; InputError if it is no closed room with a sonotrode."""
        return read_setup(Path(self.mesh), self.unit, self.part, self.sonotrode)

    def surface(self, vertices: np.ndarray, triangles: np.ndarray) -> ShapeSurface:
        """The room as drawn, its floor moved to the wanted distance."""
        return move_sonotrode(self.setup(), self.sonotrode_distance)
