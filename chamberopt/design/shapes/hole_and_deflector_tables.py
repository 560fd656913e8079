"""Tables of a design file for holes in a chamber's wall, and for deflectors in the chamber."""

from collections.abc import Iterator
from pathlib import Path
from typing import Literal

from pydantic import Field

from chamberopt.common import toml_fields
from chamberopt.common.toml_errors import Problem
from chamberopt.common.toml_fields import (
    Direction,
    MeshFile,
    Position,
    Triple,
    Turns,
    list_field,
    quantity,
)
from chamberopt.design.table_base import SI, FileTable, Metres
from chamberopt.geometry.meshes.units import Unit

SIZE_KEYS = {
    "plate": ("size_mm",),
    "rod": ("diameter_mm", "length_mm"),
    "ball": ("diameter_mm",),
    "mesh": ("mesh",),
}


class Deflector(FileTable):
    """A body that stands still in the chamber and acts on the shot as a wall.

    It is a plate (a box), a rod along its z, a ball, or any closed mesh.
    """

    kind: Literal["plate", "rod", "ball", "mesh"] = Field(description="what it is")
    at_mm: Position = Field(description="its middle (of a mesh: its box's), in the chamber's frame")
    rotate_deg: Turns = Field(default=(0.0, 0.0, 0.0), description="turns about x, then y, then z")
    size_mm: Triple | None = list_field(
        "three numbers [x, y, z] in mm, above 0", "sides of a plate", None
    )
    diameter_mm: float | None = quantity(0.1, 2000, "mm", "of a rod or ball", None)
    length_mm: float | None = quantity(0.1, 2000, "mm", "of a rod", None)
    mesh: MeshFile | None = Field(default=None, description="mesh file of a closed body")
    unit: Unit = Field(default="guess", description="of the numbers in the mesh file")

    def _problems(self) -> Iterator[Problem]:
        needed = SIZE_KEYS[self.kind]
        for name in ("size_mm", "diameter_mm", "length_mm", "mesh"):
            given = getattr(self, name) is not None
            if name in needed and not given:
                yield Problem(name, f"missing; a {self.kind} has {' and '.join(needed)}")
            if given and name not in needed:
                text = f"not of a {self.kind}, which has {' and '.join(needed)}; leave it out"
                yield Problem(name, text)
        if self.size_mm is not None and not all(0.1 <= side <= 2000 for side in self.size_mm):
            text = f"given {list(self.size_mm)}; each side must be from 0.1 to 2000 mm"
            yield Problem("size_mm", text)

    at = Metres("at_mm", "Its middle (x, y, z) [m]")
    size = Metres("size_mm", "Sides of a plate [m]")
    diameter = SI("diameter_mm", 1e-3, "Diameter of a rod or ball [m]")
    length = SI("length_mm", 1e-3, "Length of a rod [m]")

    @property
    def mesh_path(self) -> Path:
        """Absolute path of the mesh file of a deflector of kind "mesh"."""
        return Path(self.mesh)  # type: ignore[arg-type]


class PlacedBore(FileTable):
    """Base class of a round bore in the chamber's wall: a hole, or a further sonotrode's well."""

    at_mm: Position
    axis: Direction
    diameter_mm: float

    at = Metres("at_mm", "The point (x, y, z) [m] of its axis that at_mm gives")

    @property
    def direction(self) -> tuple[float, float, float]:
        """Direction of the bore's axis, a unit vector (3,) in the chamber's frame."""
        return toml_fields.unit_vector(self.axis)

    diameter = SI("diameter_mm", 1e-3, "Its diameter [m]")


class Hole(PlacedBore):
    """A round blind bore from the room into its wall, e.g. for the shaft that holds the part."""

    at_mm: Position = Field(description="in the room, on the bore's axis; in the chamber's frame")
    axis: Direction = Field(description="the way out of the room")
    diameter_mm: float = quantity(0.1, 2000, "mm", "of the bore")
    depth_mm: float = quantity(0.1, 2000, "mm", "beyond the wall, along the axis")

    depth = SI("depth_mm", 1e-3, "Depth beyond the wall [m]")
