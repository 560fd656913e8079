"""Shapes of chambers: each has a file here and a name by which a design chooses it.

To add a shape, write a file with a subclass of ChamberTable and enter it in SHAPES. A user's own
shape may import the names in __all__.
"""

from chamberopt.common.errors import InputError
from chamberopt.common.toml_fields import quantity
from chamberopt.design.shape_surface import (
    TAG_PART,
    TAG_SONOTRODE,
    TAG_WALL,
    ShapeSurface,
    further_sonotrode_tag,
    is_sonotrode,
    lofted,
)
from chamberopt.design.shapes.base import ChamberTable, ParametricChamber, WalledChamber
from chamberopt.design.shapes.conformal import Conformal
from chamberopt.design.shapes.imported import Imported
from chamberopt.design.shapes.revolve import Revolve
from chamberopt.design.shapes.straight import Box, Cylinder, Prism

__all__ = [
    "SHAPES", "TAG_PART", "TAG_SONOTRODE", "TAG_WALL", "ChamberTable", "InputError",
    "ParametricChamber", "ShapeSurface", "WalledChamber", "further_sonotrode_tag", "is_sonotrode",
    "lofted", "quantity",
]  # fmt: skip

SHAPES: dict[str, type[ChamberTable]] = {
    "cylinder": Cylinder,
    "box": Box,
    "prism": Prism,
    "revolve": Revolve,
    "conformal": Conformal,
    "imported": Imported,
}
