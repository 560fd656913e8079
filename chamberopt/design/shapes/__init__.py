"""Shapes of chambers: one file each, and the name by which a design chooses it.

To add a shape, write a file with a subclass of ChamberTable and enter it in SHAPES below.
"""

from chamberopt.common.errors import InputError
from chamberopt.common.toml_fields import quantity
from chamberopt.design.shapes.base import ChamberTable, ParametricChamber, WalledChamber
from chamberopt.design.shapes.box import Box
from chamberopt.design.shapes.conformal import Conformal
from chamberopt.design.shapes.construction.surface import (
    TAG_PART,
    TAG_SONOTRODE,
    TAG_WALL,
    ShapeSurface,
    further_sonotrode_tag,
    is_sonotrode,
    lofted,
)
from chamberopt.design.shapes.cylinder import Cylinder
from chamberopt.design.shapes.imported import Imported
from chamberopt.design.shapes.prism import Prism
from chamberopt.design.shapes.revolve import Revolve

__all__ = [
    "SHAPES",
    "TAG_PART",
    "TAG_SONOTRODE",
    "TAG_WALL",
    "ChamberTable",
    "InputError",
    "ParametricChamber",
    "ShapeSurface",
    "WalledChamber",
    "further_sonotrode_tag",
    "is_sonotrode",
    "lofted",
    "quantity",
]

SHAPES: dict[str, type[ChamberTable]] = {
    "cylinder": Cylinder,
    "box": Box,
    "prism": Prism,
    "revolve": Revolve,
    "conformal": Conformal,
    "imported": Imported,
}
