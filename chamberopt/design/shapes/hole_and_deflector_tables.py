"""What stands in a chamber or is bored into its wall, whatever its shape: deflectors and fixture holes."""

from pathlib import Path
from typing import Literal, Self

from pydantic import BaseModel, Field, model_validator

from chamberopt.common.toml_errors import CrossCheckError, Problem
from chamberopt.common.toml_fields import (
    Direction,
    MeshFile,
    Position,
    Triple,
    list_field,
    metres,
    quantity,
    unit_vector,
)
from chamberopt.design.materials import STRICT
from chamberopt.geometry.mesh_io.units import Unit

SIZES = {
    "plate": ("size_mm",),
    "rod": ("diameter_mm", "length_mm"),
    "ball": ("diameter_mm",),
    "mesh": ("mesh",),
}


class Deflector(BaseModel):
    """A body that stands still in the chamber, wall to the shot: a plate (a box), a rod along its z, a ball, or any
    closed mesh.
    """

    model_config = STRICT

    kind: Literal["plate", "rod", "ball", "mesh"] = Field(description="what it is")
    at_mm: Position = list_field(
        "three numbers [x, y, z] in mm", "its middle (of a mesh: its box's), in the chamber's frame"
    )
    rotate_deg: Triple = list_field(
        "three numbers [x, y, z] in degrees", "turns about x, then y, then z", (0.0, 0.0, 0.0)
    )
    size_mm: Triple | None = list_field(
        "three numbers [x, y, z] in mm, above 0", "sides of a plate", None
    )
    diameter_mm: float | None = quantity(0.1, 2000, "mm", "of a rod or ball", None)
    length_mm: float | None = quantity(0.1, 2000, "mm", "of a rod", None)
    mesh: MeshFile | None = Field(default=None, description="mesh file of a closed body")
    unit: Unit = Field(default="guess", description="of the numbers in the mesh file")

    @model_validator(mode="after")
    def _agree(self) -> Self:
        problems = []
        for name in ("size_mm", "diameter_mm", "length_mm", "mesh"):
            wanted, given = name in SIZES[self.kind], getattr(self, name)
            if wanted and given is None:
                problems.append(
                    Problem(name, f"missing; a {self.kind} has {' and '.join(SIZES[self.kind])}")
                )
            if given is not None and not wanted:
                text = f"not of a {self.kind}, which has {' and '.join(SIZES[self.kind])}; leave it out"
                problems.append(Problem(name, text))
        if self.size_mm is not None and not all(0.1 <= side <= 2000 for side in self.size_mm):
            problems.append(
                Problem(
                    "size_mm", f"given {list(self.size_mm)}; each side must be from 0.1 to 2000 mm"
                )
            )
        if problems:
            raise CrossCheckError(problems)
        return self

    @property
    def at(self) -> tuple[float, float, float]:
        """Its middle (x, y, z) [m]."""
        return metres(self.at_mm)

    @property
    def size(self) -> tuple[float, float, float]:
        """Sides of a plate [m]."""
        return metres(self.size_mm)  # type: ignore[arg-type]

    @property
    def diameter(self) -> float:
        """Of a rod or ball [m]."""
        return self.diameter_mm * 1e-3  # type: ignore[operator]

    @property
    def length(self) -> float:
        """Of a rod [m]."""
        return self.length_mm * 1e-3  # type: ignore[operator]

    @property
    def mesh_path(self) -> Path:
        """Absolute path of a mesh's file."""
        return Path(self.mesh)  # type: ignore[arg-type]


class Hole(BaseModel):
    """A round blind bore from the room into its wall, e.g. for the shaft that the part is held by."""

    model_config = STRICT

    at_mm: Position = list_field(
        "three numbers [x, y, z] in mm", "in the room, on the bore's axis; in the chamber's frame"
    )
    axis: Direction = list_field("three numbers [x, y, z], not all 0", "the way out of the room")
    diameter_mm: float = quantity(0.1, 2000, "mm", "of the bore")
    depth_mm: float = quantity(0.1, 2000, "mm", "beyond the wall, along the axis")

    @property
    def at(self) -> tuple[float, float, float]:
        """A point of its axis in the room (x, y, z) [m]."""
        return metres(self.at_mm)

    @property
    def direction(self) -> tuple[float, float, float]:
        """The way out, a unit vector."""
        return unit_vector(self.axis)

    @property
    def diameter(self) -> float:
        """Of the bore [m]."""
        return self.diameter_mm * 1e-3

    @property
    def depth(self) -> float:
        """Beyond the wall [m]."""
        return self.depth_mm * 1e-3
