"""The shapes of chambers by the name with which a design chooses a shape.

To add a shape, write a file with a subclass of ChamberTable and enter it here.
"""

from chamberopt.design.shapes.base import ChamberTable
from chamberopt.design.shapes.conformal import Conformal
from chamberopt.design.shapes.imported import Imported
from chamberopt.design.shapes.revolve import Revolve
from chamberopt.design.shapes.straight import Box, Cylinder, Prism

SHAPES: dict[str, type[ChamberTable]] = {
    "cylinder": Cylinder,
    "box": Box,
    "prism": Prism,
    "revolve": Revolve,
    "conformal": Conformal,
    "imported": Imported,
}
