"""Cavities, one per file, by the name a design gives them.

A new shape: a file with a subclass of ChamberTable, and its name here.
"""

from chamberopt.shapes.box import Box
from chamberopt.shapes.conformal import Conformal
from chamberopt.shapes.cylinder import Cylinder
from chamberopt.shapes.imported import Imported
from chamberopt.shapes.loft import lofted
from chamberopt.shapes.prism import Prism
from chamberopt.shapes.revolve import Revolve
from chamberopt.shapes.surface import (
    TAG_PART,
    TAG_SONOTRODE,
    TAG_WALL,
    ShapeSurface,
    is_sonotrode,
    tag_of_further,
)
from chamberopt.shapes.table import ChamberTable, ParametricChamber, WalledChamber

__all__ = [
    "SHAPES",
    "TAG_PART",
    "TAG_SONOTRODE",
    "TAG_WALL",
    "ChamberTable",
    "ParametricChamber",
    "ShapeSurface",
    "WalledChamber",
    "is_sonotrode",
    "lofted",
    "tag_of_further",
]

SHAPES: dict[str, type[ChamberTable]] = {
    "cylinder": Cylinder,
    "box": Box,
    "prism": Prism,
    "revolve": Revolve,
    "conformal": Conformal,
    "imported": Imported,
}
