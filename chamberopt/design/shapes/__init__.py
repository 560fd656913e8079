"""Shapes of chambers: each has a file here and a name by which a design chooses it.

A user's own shape may import the names below. registry.py lists the shapes.
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
