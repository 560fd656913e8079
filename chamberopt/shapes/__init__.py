"""Parametric cavities, one per file, by the name a design gives them.

A new shape: a file with a subclass of ChamberTable, and its name here.
"""

from chamberopt.shapes.cylinder import Cylinder
from chamberopt.shapes.surface import TAG_PART, TAG_SONOTRODE, TAG_WALL, ShapeSurface
from chamberopt.shapes.table import ChamberTable, ParametricChamber

__all__ = [
    "SHAPES",
    "TAG_PART",
    "TAG_SONOTRODE",
    "TAG_WALL",
    "ChamberTable",
    "ParametricChamber",
    "ShapeSurface",
]

SHAPES: dict[str, type[ChamberTable]] = {"cylinder": Cylinder}
