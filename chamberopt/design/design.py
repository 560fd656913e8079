"""Design: one complete candidate chamber, as a design file says it. The only place where units are converted.

Fields carry the file's names and units (`height_mm`); properties without a suffix are SI (`height`, metres).
Every table is frozen, refuses unknown keys, and holds bounds wide enough for any real peening set-up.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache
from numbers import Integral, Real
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar, cast

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ModelWrapValidatorHandler,
    ValidationError,
    ValidationInfo,
    create_model,
    field_validator,
    model_validator,
)

from chamberopt.common import toml_errors
from chamberopt.common.errors import InputError
from chamberopt.common.toml_errors import CrossCheckError, Problem
from chamberopt.common.toml_fields import (
    MeshFile,
    Names,
    Pair,
    Triple,
    from_file,
    list_field,
    quantity,
)
from chamberopt.design.effects import Effects
from chamberopt.design.materials import STRICT, Materials
from chamberopt.design.process import Process
from chamberopt.design.shapes import SHAPES, ChamberTable
from chamberopt.design.shapes.base import is_custom
from chamberopt.design.shapes.custom import KeptShape, custom_shape
from chamberopt.design.shapes.imported import IMPORTED, Imported
from chamberopt.design.shot import ShotTable
from chamberopt.design.sonotrode import FurtherSonotrode, Sonotrode
from chamberopt.geometry.mesh_io.units import Unit

MOST_SONOTRODES = (
    50  # further ones: each has a tag below 255, and takes a cut through all the walls before it
)


class Target(BaseModel):
    """Which triangles of the part must be covered; conditions given together intersect."""

    model_config = STRICT

    surface: Names = list_field(
        'a name in quotes, or a list of names, e.g. ["flank", "root"]',
        "groups, sets, properties or colours of the part's file; all: the whole surface",
        ("all",),
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

    element_mm: float | None = quantity(
        0.01, 1000, "mm", "wished side of the target's triangles; absent: the file's", None
    )
    reachable: bool = Field(
        default=False, description="only what a ball can touch, in the design's own chamber"
    )

    @property
    def element(self) -> float | None:
        """Wished side of the target's triangles [m]."""
        return None if self.element_mm is None else self.element_mm * 1e-3

    @model_validator(mode="after")
    def _agree(self) -> Self:
        problems = []
        if (self.direction is None) != (self.angle_deg is None):
            given, lacking = (
                ("direction", "angle_deg") if self.angle_deg is None else ("angle_deg", "direction")
            )
            problems.append(Problem(given, f"given without {lacking}; give both or neither"))
        if self.direction is not None and not any(self.direction):
            problems.append(
                Problem(
                    "direction", "given [0, 0, 0], which points nowhere; e.g. [0, 0, -1] is down"
                )
            )
        if self.angle_deg is not None and not 0 <= self.angle_deg[0] < self.angle_deg[1] <= 180:
            text = f"given {list(self.angle_deg)}; allowed: [low, high] with 0 <= low < high <= 180 degrees"
            problems.append(Problem("angle_deg", text))
        if self.box_mm is not None and not all(a < b for a, b in zip(*self.box_mm, strict=True)):
            corners = [list(corner) for corner in self.box_mm]
            problems.append(
                Problem("box_mm", f"given {corners}; each low corner must be below its high corner")
            )
        if problems:
            raise CrossCheckError(problems)
        return self


class PartTable(BaseModel):
    """The part's mesh and how it is placed in the chamber."""

    model_config = STRICT

    mesh: MeshFile = Field(description="mesh file, path relative to the design file")
    unit: Unit = Field(default="guess", description="of the numbers in the mesh file")
    rotate_deg: Triple = list_field(
        "three numbers [x, y, z] in degrees", "turns about x, then y, then z", (0.0, 0.0, 0.0)
    )
    offset_mm: Pair = list_field(
        "two numbers [x, y] in mm", "sideways from the chamber axis", (0.0, 0.0)
    )
    target: Target = Field(default_factory=Target, description="which triangles must be covered")

    @property
    def mesh_path(self) -> Path:
        """Absolute path of the mesh file."""
        return Path(self.mesh)

    @property
    def offset(self) -> tuple[float, float]:
        """Sideways shift (x, y) [m] from the chamber axis."""
        return self.offset_mm[0] * 1e-3, self.offset_mm[1] * 1e-3


class Design(BaseModel):
    """One complete candidate: part, chamber, sonotrode, shot, materials, effects, process."""

    model_config = STRICT

    part: PartTable
    chamber: ChamberTable
    sonotrode: Sonotrode
    sonotrodes: Annotated[
        tuple[FurtherSonotrode, ...], Field(strict=False, max_length=MOST_SONOTRODES)
    ] = list_field(
        f"a list of at most {MOST_SONOTRODES} tables, [[sonotrodes]]",
        "further ones beside the floor",
        (),
    )
    shot: ShotTable
    materials: Materials
    effects: Effects = Field(default_factory=Effects)
    process: Process

    @model_validator(mode="wrap")
    @classmethod
    def _of_its_shape(
        cls, data: Any, rest: ModelWrapValidatorHandler["Design"], info: ValidationInfo
    ) -> "Design":
        """The chamber's table has the keys of its shape: each shape has a subclass, with no more than that table."""
        if cls is not Design or not isinstance(data, Mapping):
            return rest(data)
        return design_class(data, info.context).model_validate(data, context=info.context)

    def __reduce__(self) -> tuple[Any, ...]:
        """Workers get the values: the class of a shape's designs is made anew there."""
        return validate, (Design, self.model_dump())

    @model_validator(mode="before")
    @classmethod
    def _one_file(cls, data: Any) -> Any:
        """A set-up and its part are one file, named once."""
        if not isinstance(data, Mapping) or not all(
            isinstance(data.get(k), Mapping) for k in ("part", "chamber")
        ):
            return data
        if data["chamber"].get("shape") != IMPORTED:
            return data
        of_part = {key: data["part"][key] for key in ("mesh", "unit") if key in data["part"]}
        return {**data, "chamber": {**of_part, **data["chamber"]}}

    @field_validator("effects", mode="before")
    @classmethod
    def _left_to_us(cls, effects: Any) -> Any:
        if isinstance(effects, (str, int, float, list)) and effects != "auto":
            text = f'given {effects!r}; allowed: "auto", or a table, e.g. {{ gravity = true, drag = true }}'
            raise CrossCheckError([Problem("", text)])
        return {"auto": True} if effects == "auto" else effects

    @model_validator(mode="after")
    def _agree(self) -> Self:
        chamber, shot = self.chamber, self.shot
        distance, widths = chamber.sonotrode_distance_mm, chamber.widths_mm()
        distance = math.inf if distance is None else distance  # as drawn: not known here
        problems = list(self._setup_problems())

        def wrong(field: str, given: float, why: str) -> None:
            problems.append(Problem(field, f"given {given:g}, {why}"))

        height = widths.get("height_mm", math.inf)
        if height <= distance < math.inf:
            why = f"not below chamber.height_mm = {height:g}: the part would be outside"
            wrong("chamber.sonotrode_distance_mm", distance, f"{why}; lower it or raise the height")
        if 10 * self.sonotrode.amplitude_um >= 1e3 * distance:
            why = f"less than ten amplitudes of the sonotrode ({self.sonotrode.amplitude_um:g} µm); raise it"
            wrong("chamber.sonotrode_distance_mm", distance, why)
        field, largest = (
            ("shot.diameter_mm" if shot.mix is None else "shot.mix"),
            1e3 * shot.diameter,
        )
        narrow = [f"chamber.{key} = {width:g}" for key, width in widths.items() if largest >= width]
        if narrow:
            wrong(
                field,
                largest,
                f"which does not fit a chamber with {' and '.join(narrow)}; use a smaller ball",
            )
        elif largest >= distance - 1e-3 * self.sonotrode.amplitude_um:
            swing = f"less the amplitude of {self.sonotrode.amplitude_um:g} µm"
            why = f"not below chamber.sonotrode_distance_mm = {distance:g} {swing}: no ball fits under the part"
            wrong(field, largest, f"{why}; use a smaller ball or raise the distance")
        problems += [
            Problem(f"effects.{effect}", "given beside shot.mix: not supported together yet")
            for effect in ("rest", "part_turn", "friction")
            if shot.mix is not None and getattr(self.effects, effect)
        ]
        if self.sonotrodes and self.sonotrode.motion == "random_phase":
            text = 'given "random_phase" beside sonotrodes: not supported together; leave it out'
            problems.append(Problem("sonotrode.motion", text))
        filled = shot.mass / shot.density / chamber.room()
        if filled > 0.5:
            why = f"whose balls fill {filled:.0%} of the chamber; at most 50 % is allowed, usual are a few"
            wrong("shot.mass_g", shot.mass_g, why)
        if problems:
            raise CrossCheckError(problems)
        return self

    def _setup_problems(self) -> Iterator[Problem]:
        """What a set-up that was drawn as a whole leaves no choice of."""
        chamber, part = self.chamber, self.part
        if not isinstance(chamber, Imported):
            return
        if (chamber.mesh, chamber.unit) != (part.mesh, part.unit):
            yield Problem(
                "chamber.mesh",
                "not as in [part], though a set-up is one file; leave mesh and unit out",
            )
        for key, value in (("rotate_deg", part.rotate_deg), ("offset_mm", part.offset_mm)):
            if any(value):
                text = f'given {list(value)} beside chamber.shape = "{IMPORTED}": the part is where its file has it'
                yield Problem(f"part.{key}", f"{text}; leave it out")
        if part.target.element_mm is not None:
            text = (
                f'given beside chamber.shape = "{IMPORTED}": not supported together; leave it out'
            )
            yield Problem("part.target.element_mm", text)

    def numbers(self) -> tuple[str, ...]:
        """Dotted names of every continuous number: what a study may vary."""
        return tuple(
            name for name, field in toml_errors.numeric_fields(self) if field.annotation is not int
        )

    def value(self, name: str) -> float:
        """The number at a dotted name, in the file's unit. InputError for a name that is none."""
        known = [known for known, _ in toml_errors.numeric_fields(self)]
        if name not in known:
            raise InputError(
                f"{name}: not a number of a design; {toml_errors.did_you_mean(name, known)}"
            )
        at: Any = self
        for step in name.split("."):
            at = at[int(step)] if isinstance(at, tuple) else getattr(at, step)
            if at is None:
                raise InputError(f"{name}: not set in this design; give it a value there first")
        return at

    def changed(self, values: Mapping[str, Any]) -> "Design":
        """A copy with other values, checked again as a whole.

        Args:
            values: new values in the file's units by dotted name, e.g. {"chamber.height_mm": 45}.
                An entry of a list goes by its position: part.offset_mm.0.
        Raises:
            InputError: a name is not a key of a design, or the new values are out of range or
                contradict each other.
        """
        data = self.model_dump()
        for name, value in values.items():
            data = _replaced(data, name, name.split("."), value)
        return validate(Design, data)


def _replaced(old: Any, name: str, steps: Sequence[str], value: Any) -> Any:
    """A table or list with another value at the end of a path of keys and positions."""
    if not steps:
        return _of_the_same_kind(old, value)
    step, rest = steps[0], steps[1:]
    if isinstance(old, dict) and (step in old or not rest):  # an unknown last key is reported later
        return {**old, step: _replaced(old.get(step), name, rest, value)}
    if isinstance(old, tuple) and step.isdecimal() and int(step) < len(old):
        k = int(step)
        return (*old[:k], _replaced(old[k], name, rest, value), *old[k + 1 :])
    why = (
        "not set in this design; give it a value there first"
        if old is None
        else "not a key of a design"
    )
    raise InputError(f"{name}: {why}")


def _of_the_same_kind(old: Any, value: Any) -> Any:
    """A number as whole or not as the one in its place, so that numpy's numbers can be given too."""
    is_number = isinstance(value, Real) and not isinstance(value, bool)
    if not is_number:
        return value
    if isinstance(old, int):
        return int(value) if float(value).is_integer() else float(value)
    whole = isinstance(value, Integral) and not isinstance(old, float)
    return int(value) if whole else float(value)


class AnyShape(ChamberTable):
    """Stands for a chamber whose shape is not known, so that what else is wrong can be said too."""

    model_config = ConfigDict(**{**STRICT, "extra": "ignore"})

    shape: Literal[tuple(SHAPES)] = Field(  # type: ignore[valid-type]
        description="form of the cavity, or a Python file with one of your own"
    )

    @field_validator("shape", mode="before")
    @classmethod
    def _own(cls, shape: Any, info: ValidationInfo) -> Any:
        if is_custom(shape):
            try:
                custom_shape(from_file(shape, info.context))
            except InputError as error:
                raise CrossCheckError([Problem("", f"given {shape!r}: {error}")]) from None
        return shape


def design_class(data: Mapping[str, Any], context: Mapping[str, Any] | None = None) -> type[Design]:
    """The class of designs whose chamber has the shape that the data name; context as in ``validate``."""
    chamber = data.get("chamber")
    name = chamber.get("shape") if isinstance(chamber, Mapping) else getattr(chamber, "shape", None)
    if not is_custom(name):
        return _designs_with(SHAPES.get(name, AnyShape) if isinstance(name, str) else AnyShape)
    try:
        return _designs_with(custom_shape(from_file(str(name), context)))
    except InputError:
        return _designs_with(AnyShape if (context or {}).get("needs_mesh") else KeptShape)


def _is_of_own_shape(data: Mapping[str, Any]) -> bool:
    chamber = data.get("chamber")
    return isinstance(chamber, Mapping) and is_custom(chamber.get("shape"))


@cache
def _designs_with(table: type[ChamberTable]) -> type[Design]:
    chamber = (table, Field(description="the cavity before the part is taken out of it"))
    return create_model("Design", __base__=Design, __doc__=Design.__doc__, chamber=chamber)


Table = TypeVar("Table", bound=BaseModel)


def validate(
    model: type[Table],
    data: Mapping[str, Any],
    path: Path | None = None,
    source: str = "",
    mesh_must_exist: bool = True,
) -> Table:
    """The data as a frozen model, or InputError with every problem; paths of meshes and shapes count from the file.

    A result can be looked at without the files it was made from: mesh_must_exist = False.
    """
    context = {"folder": path.parent if path else Path(), "needs_mesh": path and mesh_must_exist}
    try:
        return model.model_validate(data, context=context)
    except ValidationError as error:
        if model is Design and not mesh_must_exist and _is_of_own_shape(data):
            with suppress(ValidationError):  # the shape's file has changed since
                return cast(Table, _designs_with(KeptShape).model_validate(data, context=context))
        shown: type[BaseModel] = design_class(data, context) if model is Design else model
        problems = toml_errors.explain_validation_error(error, shown)
        raise InputError(toml_errors.format_problems(problems, path, source)) from None
