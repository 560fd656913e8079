"""Shapes of chambers: one file each, and the name by which a design chooses it.

The names a shape of one's own may import from here are below; registry.py lists the shapes.
"""

from chamberopt.common.errors import InputError
from chamberopt.common.toml_fields import quantity
from chamberopt.design.shapes.base import ChamberTable, ParametricChamber, WalledChamber
from chamberopt.design.shapes.registry import SHAPES
from chamberopt.design.shapes.surface import (
    TAG_PART,
    TAG_SONOTRODE,
    TAG_WALL,
    ShapeSurface,
    further_sonotrode_tag,
    is_sonotrode,
    lofted,
)

__all__ = [
    "SHAPES", "TAG_PART", "TAG_SONOTRODE", "TAG_WALL", "ChamberTable", "InputError",
    "ParametricChamber", "ShapeSurface", "WalledChamber", "further_sonotrode_tag", "is_sonotrode",
    "lofted", "quantity",
]  # fmt: skip
