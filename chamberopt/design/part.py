"""The part of a design: its mesh file, its pose in the chamber, and the target to be covered."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BeforeValidator, Field

from chamberopt.common.number_text import plain
from chamberopt.common.toml_errors import CrossCheckError, Problem
from chamberopt.common.toml_fields import (
    MeshFile,
    Names,
    Pair,
    Position,
    Several,
    Shift,
    Triple,
    Turns,
    list_field,
    quantity,
)
from chamberopt.design.table_base import FileTable
from chamberopt.geometry.faces import Border
from chamberopt.geometry.meshes.step_tessellation import Tessellation
from chamberopt.geometry.meshes.units import Unit
from chamberopt.geometry.smoothing.part import Rule

MAX_FACES = 500
DEFAULT_CREASE_DEG = 30.0


class FaceAt(FileTable):
    """A face of the part, selected by a point on it."""

    at_mm: Position = Field(description="a place on the face, in the part file's frame")
    crease_deg: float = quantity(
        0.1,
        180,
        "degrees",
        "the face ends where neighbouring triangles turn by more",
        DEFAULT_CREASE_DEG,
    )
    cad_face: bool = Field(
        default=False,
        description="the face as the STEP file has it, also where it goes on smoothly; crease_deg "
        "is left out",
    )
    fillet: bool = Field(
        default=False,
        description="the fillet as its curvature tells, also in a file of facets; crease_deg is "
        "left out",
    )
    alike: bool = Field(default=False, description="also all faces congruent with it, or mirrored")

    def _problems(self) -> Iterator[Problem]:
        if self.cad_face and self.fillet:
            yield Problem("fillet", "given beside cad_face; give one of them")
        elif not isinstance(self.border, float) and self.crease_deg != DEFAULT_CREASE_DEG:
            yield Problem("crease_deg", f"given beside {self.border}, which has its own border")

    @property
    def border(self) -> Border:
        """What ends the face."""
        if self.fillet:
            return "fillet"
        return "cad_face" if self.cad_face else self.crease_deg


class Selection(FileTable):
    """Conditions that choose triangles of the part. A triangle must meet all given conditions."""

    surface: Names = list_field(
        'a name in quotes, or a list of names, e.g. ["flank", "root"]',
        "groups, sets, properties or colours of the part's file; all: the whole surface",
        ("all",),
    )
    faces: Annotated[Several[FaceAt], Field(max_length=MAX_FACES)] = list_field(
        f"a list of at most {MAX_FACES} tables {{ at_mm = [x, y, z] }}",
        "faces by a place on each; { at_mm = [x, y, z], alike = true } is all that are like it",
        (),
    )
    direction: Triple | None = list_field(
        "three numbers [x, y, z], not all 0", "reference direction in the part file's frame", None
    )
    angle_deg: Pair | None = list_field(
        "two numbers [low, high], 0 <= low < high <= 180",
        "between outward normal and direction, degrees",
        None,
    )
    box_mm: Annotated[tuple[Triple, Triple], Field(strict=False)] | None = list_field(
        "two corners [[x, y, z], [x, y, z]], low before high, mm",
        "holding the triangles' centroids, in the part file's frame",
        None,
    )
    radius_mm: Pair | None = list_field(
        "two numbers [low, high], 0 <= low < high, mm",
        "distance of the triangles' centroids from the z axis of the part file's frame",
        None,
    )

    def _problems(self) -> Iterator[Problem]:
        if (self.direction is None) != (self.angle_deg is None):
            names = ("direction", "angle_deg")
            given, lacking = names if self.angle_deg is None else names[::-1]
            yield Problem(given, f"given without {lacking}; give both or neither")
        if self.direction is not None and not any(self.direction):
            text = "given [0, 0, 0], which points nowhere; e.g. [0, 0, -1] is down"
            yield Problem("direction", text)
        if self.angle_deg is not None and not 0 <= self.angle_deg[0] < self.angle_deg[1] <= 180:
            allowed = "[low, high] with 0 <= low < high <= 180 degrees"
            yield Problem("angle_deg", f"given {list(self.angle_deg)}; allowed: {allowed}")
        if self.radius_mm is not None and not 0 <= self.radius_mm[0] < self.radius_mm[1]:
            text = f"given {list(self.radius_mm)}; allowed: [low, high] with 0 <= low < high"
            yield Problem("radius_mm", text)
        if self.box_mm is not None and not all(a < b for a, b in zip(*self.box_mm, strict=True)):
            corners = [list(corner) for corner in self.box_mm]
            text = f"given {corners}; each low corner must be below its high corner"
            yield Problem("box_mm", text)

    @property
    def in_words(self) -> str:
        """What is chosen, by the keys that are given, such as "the surface root of its file"."""
        return self.words_at(None)

    def words_at(self, first_mm: Sequence[float] | None) -> str:
        """Return what is chosen in words, with the first face's place in another frame.

        Args:
            first_mm: that place, (3,); None: that of the file, which is named then.
        """
        named = self.surface != ("all",)
        words = [f"the surface {' and '.join(self.surface)} of its file"] if named else []
        if self.faces:
            count = len(self.faces)
            several = "one face" if count == 1 else f"{count} faces"
            place = ", ".join(plain(round(x, 1) + 0.0) for x in first_mm or self.faces[0].at_mm)
            alike = ", with all faces alike" if any(one.alike for one in self.faces) else ""
            first = "" if count == 1 else "such as "
            of_file = " of its file" if first_mm is None else ""
            words.append(f"{several}, {first}at ({place}) mm{of_file}{alike}")
        if self.direction is not None and self.angle_deg is not None:
            low, high = map(plain, self.angle_deg)
            way = ", ".join(map(plain, self.direction))
            words.append(f"what looks {low} to {high}° away from ({way}) of its file")
        if self.box_mm is not None:
            sides = zip("xyz", *self.box_mm, strict=True)
            ends = ", ".join(f"{axis} {plain(a)} to {plain(b)}" for axis, a, b in sides)
            words.append(f"within {ends} mm of its file")
        if self.radius_mm is not None:
            low, high = map(plain, self.radius_mm)
            words.append(f"{low} to {high} mm from the z axis of its file")
        return "; ".join(words)


class Target(Selection):
    """The triangles of the part that must be covered."""

    element_mm: float | None = quantity(
        0.01, 1000, "mm", "wanted side of the target's triangles; absent: the file's", None
    )
    cut: bool = Field(
        default=False,
        description="divide the triangles that cross a side of box_mm, so that it ends straight",
    )
    beside_mm: float | None = quantity(
        0.1,
        100,
        "mm",
        "also what lies so near on the faces that go on from it, smoothly as beside a fillet, or "
        "over hollow edges as beside the toes of a weld; absent: nothing",
        None,
    )
    reachable: bool = Field(
        default=False, description="only what a ball can touch, in the design's own chamber"
    )

    def _problems(self) -> Iterator[Problem]:
        yield from super()._problems()
        if self.cut and self.box_mm is None:
            yield Problem("cut", "given without box_mm; give the box at whose sides to cut")

    def words_at(self, first_mm: Sequence[float] | None) -> str:
        beside = f"with {plain(self.beside_mm or 0.0)} mm of the faces that go on from it"
        return "; ".join(
            filter(None, (super().words_at(first_mm), beside if self.beside_mm else ""))
        )

    @property
    def element(self) -> float | None:
        """Wanted side of the target's triangles [m]; None to keep the triangles of the file."""
        return None if self.element_mm is None else self.element_mm * 1e-3


class TessellationTable(FileTable):
    """Fineness of the triangles into which the surface of a STEP file is divided."""

    chord_mm: float = quantity(
        1e-4, 10, "mm", "distance that triangles keep from the surface", 0.02
    )
    angle_deg: float = quantity(1, 60, "degrees", "largest angle between neighbours", 6.0)
    side_mm: float | None = quantity(
        0.01, 1000, "mm", "longest side; absent: a fortieth of the part's diagonal", None
    )

    @property
    def limits(self) -> Tessellation:
        """Return the limits on the triangles of a STEP file, in metres and radians."""
        side = 0.0 if self.side_mm is None else 1e-3 * self.side_mm
        return Tessellation(1e-3 * self.chord_mm, math.radians(self.angle_deg), side)


class SmoothingTable(FileTable):
    """Fineness to which facets of curved surfaces are divided, and limit to the surface's move.

    A ball of radius r in a hollow touches two neighbouring facets, a distance r tan(a / 2) from
    their common edge, where a is the angle between the facets. Dents of diameter d cover the strip
    along the edge if a < d / (2 r). Dents are 0.15 to 0.25 r wide, so a must be 4 to 7 degrees.
    """

    off: bool = Field(
        default=False, description='{ off = true }: smoothing = "off", the facets of the file'
    )
    limit_deg: float = quantity(1, 30, "degrees", "largest angle between facets", 6.0)
    narrow_mm: float = quantity(
        0.001, 10, "mm",
        "width below which facets are not divided: a tenth of the radius of balls of 1.2 mm", 0.06,
    )  # fmt: skip
    tolerance_mm: float | None = quantity(
        0, 10, "mm", "the farthest that the surface may move; absent: as far as its facets tell",
        None,
    )  # fmt: skip

    def rule(self, triangles: np.ndarray) -> Rule:
        """Return these limits in SI units, as a rule for smoothing the marked triangles (m,)."""
        tolerance = math.inf if self.tolerance_mm is None else 1e-3 * self.tolerance_mm
        turn = math.radians(self.limit_deg)
        return Rule(triangles, self.off, turn, 1e-3 * self.narrow_mm, tolerance)


def _accept_off(smoothing: object) -> object:
    if isinstance(smoothing, (str, int, float, list)) and smoothing != "off":
        allowed = '"off", or a table, e.g. { limit_deg = 4 }'
        raise CrossCheckError([Problem("", f"given {smoothing!r}; allowed: {allowed}")])
    return {"off": True} if smoothing == "off" else smoothing


Smoothing = Annotated[SmoothingTable, BeforeValidator(_accept_off)]


class PartTable(FileTable):
    """The part's mesh file and the part's pose in the chamber."""

    mesh: MeshFile = Field(description="mesh file, path relative to the design file")
    unit: Unit = Field(default="guess", description="of the numbers in the mesh file")
    rotate_deg: Turns = Field(default=(0.0, 0.0, 0.0), description="turns about x, then y, then z")
    offset_mm: Shift = Field(default=(0.0, 0.0), description="sideways from the chamber axis")
    tessellation: TessellationTable | None = Field(
        default=None, description="how fine the triangles of a STEP file are"
    )
    smoothing: Smoothing = Field(
        default_factory=SmoothingTable,
        description='how rounds are divided of which the file has facets; "off": not at all',
    )
    target: Target = Field(default_factory=Target, description="which triangles must be covered")

    @property
    def mesh_path(self) -> Path:
        """Absolute path of the mesh file."""
        return Path(self.mesh)

    @property
    def limits(self) -> Tessellation | None:
        """Return the limits on the triangles of a STEP file; None if the design gives none."""
        return None if self.tessellation is None else self.tessellation.limits

    @property
    def offset(self) -> tuple[float, float]:
        """Sideways shift (x, y) from the chamber axis [m]."""
        return self.offset_mm[0] * 1e-3, self.offset_mm[1] * 1e-3
