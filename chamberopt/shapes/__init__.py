"""Parametric cavities, one per file, by the name a design gives them.

A new shape: a file with a function of the design's chamber table that returns a ShapeSurface, and a line
here.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

from chamberopt.errors import InputError
from chamberopt.shapes.cylinder import cylinder
from chamberopt.shapes.surface import TAG_PART, TAG_SONOTRODE, TAG_WALL, ShapeSurface

if TYPE_CHECKING:
    from chamberopt.config import Design

__all__ = ["SHAPES", "TAG_PART", "TAG_SONOTRODE", "TAG_WALL", "ShapeSurface", "shape_surface"]

SHAPES: dict[str, Callable[..., ShapeSurface]] = {"cylinder": cylinder}


def shape_surface(design: "Design") -> ShapeSurface:
    """The cavity that the design's chamber table describes. Raises InputError for a name that is no shape."""
    name = design.chamber.shape
    if name not in SHAPES:
        raise InputError(f"chamber.shape: given {name!r}; not supported, allowed: {', '.join(sorted(SHAPES))}")
    return SHAPES[name](design.chamber)
