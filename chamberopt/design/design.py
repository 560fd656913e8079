"""One complete design of a chamber and its process, with the values of its design file.

Fields have the names and units of the file (`height_mm`). Properties without a suffix are SI
(`height`, in metres). This package is the only place where units are converted. Every table is
frozen, refuses unknown keys, and has bounds wide enough for any real peening set-up.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cache, partial
from numbers import Integral, Real
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, cast

import pydantic
from pydantic import BaseModel, Field, ValidationError, ValidationInfo
from pydantic.fields import FieldInfo

from chamberopt.common import toml_errors
from chamberopt.common.errors import InputError
from chamberopt.common.notebook import ShownInNotebook
from chamberopt.common.toml_errors import CrossCheckError, Problem, text_choices
from chamberopt.common.toml_fields import Several, from_file, list_field
from chamberopt.design.calibration import (
    CalibrationField,
    calibration_problems,
    why_no_intensity,
    with_measured_values,
)
from chamberopt.design.effects import Effects
from chamberopt.design.fixture import Holder, Mask, fixture_problems
from chamberopt.design.flexure import StressTable, flexure_problems, stress_problems
from chamberopt.design.materials import Materials, with_friction, with_numbers
from chamberopt.design.part import PartTable
from chamberopt.design.process import MAX_STEPS, Process, Step, step_problems, values_in_step
from chamberopt.design.ranges import Ranges
from chamberopt.design.shape_surface import further_sonotrode_tag
from chamberopt.design.shapes import SHAPES, ChamberTable
from chamberopt.design.shapes.base import is_custom
from chamberopt.design.shapes.custom import RecordedShape, load_custom_shape
from chamberopt.design.shapes.imported import IMPORTED, Imported
from chamberopt.design.shot import ShotTable
from chamberopt.design.sonotrode import FurtherSonotrode, Sonotrode
from chamberopt.design.table_base import MAX_NAMES, STRICT, FileTable
from chamberopt.design.tolerances import FORM as TOLERANCE_FORM
from chamberopt.design.tolerances import Tolerance, tolerance_problems
from chamberopt.design.zones import MAX_ZONES, Zone, zone_problems

# Each further sonotrode has a tag below 255 and needs a cut through all walls before it.
MAX_SONOTRODES = 50
MAX_TO_SETTLE = 50
SHAPE = "chamber.shape"
NOT_VARIED = (
    "calibration.", "zones.", "ranges.", "part.tessellation.", "holder.at.", "mask.at.", "stress.",
    "process.intensity_mmA.", "process.coverage_percent",
)  # fmt: skip


class Design(FileTable, ShownInNotebook):
    """One complete design: part, chamber, sonotrode, shot, materials, effects, process."""

    to_settle: Annotated[Several[str], Field(max_length=MAX_TO_SETTLE)] = list_field(
        f"a list of at most {MAX_TO_SETTLE} texts",
        "what is to be settled before the chamber is built; warned of until it is taken out",
        (),
    )
    settled: Annotated[Several[str], Field(max_length=MAX_TO_SETTLE)] = list_field(
        f"a list of at most {MAX_TO_SETTLE} texts",
        "what was to be settled and is, with the day and perhaps how: for the record on the sheet",
        (),
    )
    part: PartTable
    chamber: ChamberTable
    sonotrode: Sonotrode
    sonotrodes: Annotated[Several[FurtherSonotrode], Field(max_length=MAX_SONOTRODES)] = list_field(
        f"a list of at most {MAX_SONOTRODES} tables, [[sonotrodes]]",
        "further ones beside the floor",
        (),
    )
    shot: ShotTable
    materials: Materials
    zones: Annotated[Several[Zone], Field(max_length=MAX_ZONES)] = list_field(
        f"a list of at most {MAX_ZONES} tables, [[zones]]",
        "surfaces of the part with figures and limits of their own",
        (),
    )
    holder: Holder | None = Field(
        default=None, description="what holds the part in the room; absent: it hangs in the air"
    )
    mask: Mask | None = Field(default=None, description="what keeps the shot from faces")
    effects: Effects = Field(default_factory=Effects)
    process: Process
    steps: Annotated[Several[Step], Field(max_length=MAX_STEPS)] | None = list_field(
        f"a list of 2 to {MAX_STEPS} tables, [[steps]]",
        "poses, charges or chambers in which the part is peened one after another",
        None,
    )
    calibration: CalibrationField = None
    tolerances: dict[str, Tolerance] | None = Field(
        default=None,
        max_length=MAX_NAMES,
        description="how far numbers of the design may lie off in production, by dotted name; "
        "absent: simulate --tolerances takes the usual 4 µm peak to valley of the amplitude",
        json_schema_extra={"form": f"NAME = {TOLERANCE_FORM}"},
    )
    ranges: Ranges | None = Field(
        default=None, description="how well numbers are known that are not calibrated"
    )
    stress: StressTable | None = Field(
        default=None, description="asks for the residual stress under the peened surface"
    )

    @pydantic.model_validator(mode="wrap")
    @classmethod
    def _use_class_of_its_shape(
        cls,
        data: object,
        handler: pydantic.ModelWrapValidatorHandler["Design"],
        info: ValidationInfo,
    ) -> "Design":
        """Validate with the subclass whose chamber table has the keys of the design's shape.

        The design of each step is checked like any other.
        """
        if cls is not Design or not isinstance(data, Mapping):
            found = handler(data)
            return found if found is data else _with_checked_steps(found, info.context)
        return design_class(data, info.context).model_validate(data, context=info.context)

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle only the values. A worker process makes the class for the design's shape anew."""
        return _unpickled, (self.model_dump(), self.is_recorded, self.chamber.sha256)

    @property
    def simulated(self) -> "Design":
        """Return the design to simulate, with its calibration's values in place of its own."""
        found: Design = with_measured_values(self)
        return found

    @property
    def in_steps(self) -> "dict[str, Design]":
        """The design of each step by its name, with its share of the peening and simulated time.

        A design without steps is returned by the name "".
        """
        if not self.steps:
            return {"": self}
        values = self.model_dump()
        return {
            step.name: validate(
                Design, values_in_step(values, self.steps, k), recorded=self.is_recorded
            )
            for k, step in enumerate(self.steps)
        }

    @property
    def ball_diameters(self) -> tuple[float, ...]:
        """Diameters of the balls of all steps [m], in ascending order, each once."""
        found = {one for step in self.in_steps.values() for one in step.shot.diameters}
        return tuple(sorted(found))

    @property
    def has_like_steps(self) -> bool:
        """True if all steps throw balls of the same sizes with the same sonotrodes."""
        like = {
            (tuple(size for size, _ in one.shot.sizes), one.sonotrode, one.sonotrodes)
            for one in self.in_steps.values()
        }
        return len(like) == 1

    @property
    def turning_holder_tag(self) -> int | None:
        """Tag in the simulator of the holder of a part that turns; None without one."""
        if self.effects.part_turn is None or self.holder is None or self.holder.kind == "bore":
            return None
        return further_sonotrode_tag(len(self.sonotrodes))  # after those of all sonotrodes

    def require_one_step(self, what: str) -> None:
        """Raise InputError if the design has steps, for a command that cannot take them.

        Args:
            what: what cannot be done with several steps, as the subject of a sentence.
        """
        if self.steps:
            raise InputError(
                f"steps: {what} is not supported for a design with [[steps]]; give a design of the "
                "step that you mean, without [[steps]]"
            )

    @property
    def is_recorded(self) -> bool:
        """True if the design comes from a result file and its chamber has a user's own shape.

        The Python file of that shape is then not run.
        """
        return isinstance(self.chamber, RecordedShape)

    @pydantic.model_validator(mode="before")
    @classmethod
    def _name_the_setup_file_once(cls, data: Any) -> object:
        """Copy mesh and unit of [part] to a chamber that is drawn in the same file."""
        part, chamber = (_table(data, name) for name in ("part", "chamber"))
        if part is None or chamber is None or chamber.get("shape") != IMPORTED:
            return data
        file = {key: part[key] for key in ("mesh", "unit") if key in part}
        return {**data, "chamber": {**file, **chamber}}

    @pydantic.model_validator(mode="before")
    @classmethod
    def _look_up_metals(cls, data: Any, info: ValidationInfo) -> object:
        """Replace names of metals by the catalogue's numbers, so that results hold the numbers.

        Friction and roughness that a file does not give are those of the catalogue for these
        metals. A result that does not have them was simulated without.
        """
        if (materials := _table(data, "materials")) is None:
            return data
        shot = data.get("shot")
        of_shot = shot.get if isinstance(shot, Mapping) else partial(getattr, shot)
        material = of_shot("material", None)
        numbers = with_numbers(materials, material)
        is_record = bool((info.context or {}).get("recorded"))
        effects = with_friction(data.get("effects", {}), numbers, material, is_record)
        return {**data, "materials": numbers, "effects": effects}

    @pydantic.field_validator("effects", mode="before")
    @classmethod
    def _accept_auto(cls, effects: object) -> object:
        if isinstance(effects, (str, int, float, list)) and effects != "auto":
            allowed = '"auto", or a table, e.g. { gravity = true, drag = true }'
            raise CrossCheckError([Problem("", f"given {effects!r}; allowed: {allowed}")])
        return {"auto": True} if effects == "auto" else effects

    def _problems(self) -> Iterator[Problem]:
        yield from self._setup_problems()
        yield from self._size_problems()
        if self.tolerances:
            yield from tolerance_problems(self, dict(toml_errors.numeric_fields(self)))
        yield from zone_problems(self.zones, self.calibration)
        yield from step_problems(self.steps or ())
        yield from calibration_problems(self)
        yield from flexure_problems(self)
        yield from stress_problems(self)
        balls_mm, turns = 1e3 * min(self.shot.diameters), self.effects.part_turn is not None
        yield from fixture_problems(self.holder, self.mask, balls_mm, turns)
        if self.sonotrodes and self.sonotrode.motion == "random_phase":
            text = 'given "random_phase" beside sonotrodes: not supported together; leave it out'
            yield Problem("sonotrode.motion", text)
        filled = self.shot.mass / self.shot.density / self.chamber.room()
        if filled > 0.5:
            why = f"whose balls fill {filled:.0%} of the chamber"
            text = f"given {self.shot.mass_g:g}, {why}; at most 50 % is allowed, usual are a few"
            yield Problem("shot.mass_g", text)

    def _size_problems(self) -> Iterator[Problem]:
        """Yield a problem for each part, ball or sonotrode that does not fit into the chamber."""
        chamber, sonotrode = self.chamber, self.sonotrode
        amplitude_um = sonotrode.zero_to_peak_um * sonotrode.largest_share
        distance, widths = chamber.sonotrode_distance_mm, chamber.widths_mm()
        if distance is None:  # the drawn distance is known only once the set-up's file is read
            distance = math.inf
        distance_field = "chamber.sonotrode_distance_mm"
        height = widths.get("height_mm", math.inf)
        if height <= distance < math.inf:
            why = f"not below chamber.height_mm = {height:g}: the part would be outside"
            text = f"given {distance:g}, {why}; lower it or raise the height"
            yield Problem(distance_field, text)
        if 10 * amplitude_um >= 1e3 * distance:
            why = f"less than ten amplitudes of the sonotrode ({amplitude_um:g} µm)"
            yield Problem(distance_field, f"given {distance:g}, {why}; raise it")
        ball_field = "shot.diameter_mm" if self.shot.mix is None else "shot.mix"
        ball = 1e3 * self.shot.diameter
        narrow = [f"chamber.{key} = {width:g}" for key, width in widths.items() if ball >= width]
        if narrow:
            why = f"which does not fit a chamber with {' and '.join(narrow)}"
            yield Problem(ball_field, f"given {ball:g}, {why}; use a smaller ball")
        elif ball >= distance - 1e-3 * amplitude_um:
            less = f"{distance_field} = {distance:g} less the amplitude of {amplitude_um:g} µm"
            remedy = "no ball fits under the part; use a smaller ball or raise the distance"
            yield Problem(ball_field, f"given {ball:g}, not below {less}: {remedy}")

    def _setup_problems(self) -> Iterator[Problem]:
        """Yield a problem for each given key that a set-up drawn in one file already decides."""
        chamber, part = self.chamber, self.part
        if not isinstance(chamber, Imported):
            return
        if (chamber.mesh, chamber.unit) != (part.mesh, part.unit):
            text = "not as in [part], though a set-up is one file; leave mesh and unit out"
            yield Problem("chamber.mesh", text)
        beside = f'beside chamber.shape = "{IMPORTED}"'
        for key, value in (("rotate_deg", part.rotate_deg), ("offset_mm", part.offset_mm)):
            if any(value):
                text = f"given {list(value)} {beside}: the part is where its file has it"
                yield Problem(f"part.{key}", f"{text}; leave it out")
        for key, is_given in (
            ("tessellation", part.tessellation is not None),
            ("target.element_mm", part.target.element_mm is not None),
        ):
            if is_given:
                text = f"given {beside}: not supported together; leave it out"
                yield Problem(f"part.{key}", text)

    def numbers(self) -> tuple[str, ...]:
        """Return the dotted names, such as shot.mass_g, of all continuous numbers that may vary."""
        return tuple(
            name
            for name, field in self.numeric_fields()
            if field.annotation is not int and not name.startswith(NOT_VARIED)
        )

    def numeric_fields(self) -> Iterator[tuple[str, FieldInfo]]:
        """Yield the dotted name and the field of every number, also of those that steps change."""
        yield from toml_errors.numeric_fields(self)
        for k, (step, one) in enumerate(
            zip(self.steps or (), self.in_steps.values(), strict=False)
        ):
            changed = {
                f"{table}.{key}"
                for table, change in step.changes.items()
                if isinstance(change, dict)
                for key in change
            }
            for name, field in toml_errors.numeric_fields(one):
                if ".".join(name.split(".")[:2]) in changed:
                    yield f"steps.{k}.{name}", field

    def whole_numbers(self) -> tuple[str, ...]:
        """Return the dotted names of all whole numbers of the chamber, such as its sides."""
        fields = toml_errors.numeric_fields(self)
        others = ("process.", "calibration.", "zones.", "tolerances.", "chamber.facets")
        whole = (name for name, field in fields if field.annotation is int)
        return tuple(name for name in whole if not name.startswith(others))

    def choices(self) -> dict[str, tuple[str, ...]]:
        """Return the allowed texts of each key with texts that a study may vary, by dotted name."""
        tables = {"chamber": self.chamber, "sonotrode": self.sonotrode, "shot": self.shot}
        found = (one for name, table in tables.items() for one in text_choices(table, name))
        choices = {name: texts for name, texts in found if name != "chamber.unit"}
        generated = tuple(name for name in SHAPES if name != IMPORTED)
        return choices | ({SHAPE: generated} if self.chamber.shape in generated else {})

    def chamber_keys(self, shape: str) -> dict[str, bool]:
        """Return for each key of a chamber of this shape, by its dotted name, whether its value is
        a whole number.
        """
        fields = SHAPES[shape].model_fields.items()
        return {f"chamber.{key}": field.annotation is int for key, field in fields}

    @property
    def why_no_intensity(self) -> str:
        """The reason why the design has no Almen intensity; an empty text if it has one."""
        return why_no_intensity(self.calibration)

    def why_fixed(self, name: str) -> str:
        """Return why a study cannot vary the number at a dotted name; an empty text if it can."""
        if name == SHAPE:
            return "a shape of your own, or one that is drawn; it cannot vary"
        if name.startswith("ranges."):
            return "how well a number is known, not a choice of the design; it cannot vary"
        if name.startswith("calibration."):
            return "what was measured, with errors that intervals hold already; it cannot vary"
        numbers = self.numbers()
        try:
            self.value(name)
        except InputError as error:
            if name in numbers:
                return str(error).removeprefix(f"{name}: ")
            return f"unknown; {toml_errors.did_you_mean(name, numbers)}"
        if name.startswith("process.accuracy."):
            return (
                "a setting of the simulation, not of the chamber; it cannot vary, see "
                "[search_accuracy]"
            )
        if name.startswith(("zones.", "process.intensity_mmA.", "process.coverage_percent")):
            return "what is asked of the design, not a choice of it; it cannot vary"
        return "" if name in numbers else "a whole number cannot vary; leave it out"

    def value(self, name: str) -> float:
        """Return the number at a dotted name such as shot.mass_g, in the unit of the design file.

        Raises InputError if there is no such number, or it is not set in this design.
        """
        known = [known for known, _ in self.numeric_fields()]
        if name not in known:
            hint = toml_errors.did_you_mean(name, known)
            raise InputError(f"{name}: not a number of a design; {hint}")
        value: Any = self
        for step in name.split("."):
            if isinstance(value, dict):
                value = value[step]
            else:
                value = value[int(step)] if isinstance(value, tuple) else getattr(value, step)
            if value is None:
                raise InputError(f"{name}: not set in this design; give it a value there first")
        return cast(float, value)

    def setting(self, name: str) -> float | str:
        """Return the number at a dotted name such as shot.mass_g, or the text if `choices` has the
        name.

        Raises InputError if there is neither, or it is not set in this design.
        """
        if name not in self.choices():
            return self.value(name)
        table, key = name.split(".")
        return str(getattr(getattr(self, table), key))

    def changed(self, values: Mapping[str, Any]) -> "Design":
        """Return a copy of the design with other values, checked again as a whole.

        The values are in the file's units, by dotted name, e.g. {"chamber.height_mm": 45}. An entry
        of a list is named by its position: part.offset_mm.0. With another chamber.shape the chamber
        keeps the keys that both shapes have. Raises InputError if a name is not a key of a design,
        or the new values are out of range or contradict each other.
        """
        data = self.model_dump()
        if (shape := values.get(SHAPE, self.chamber.shape)) != self.chamber.shape:
            known = SHAPES[shape].model_fields if shape in SHAPES else data["chamber"]
            data["chamber"] = {key: one for key, one in data["chamber"].items() if key in known}
        for name, value in values.items():
            data = _replaced(data, name, name.split("."), value)
        return validate(Design, data, recorded=self.is_recorded)


def _with_checked_steps(design: Design, context: Mapping[str, object] | None) -> Design:
    """Return a design with the checked values of its steps, and with absolute paths in them.

    Raises CrossCheckError, which names every problem of the design of a step.
    """
    if not design.steps:
        return design
    values, checked = design.model_dump(), []
    problems: list[Problem] = []
    for k, step in enumerate(design.steps):
        own = values_in_step(values, design.steps, k)
        try:
            checked.append(
                step.with_values(Design.model_validate(own, context=context).model_dump())
            )
        except ValidationError as error:
            found = toml_errors.explain_validation_error(error, design_class(own, context))
            problems += (Problem(f"steps.{k}.{one.field}", one.text) for one in found)
    if problems:
        raise CrossCheckError(problems)
    return design.model_copy(update={"steps": tuple(checked)})


def _unpickled(data: dict[str, object], recorded: bool, sha256: str) -> Design:
    """Return a design from its pickled values, in a worker process.

    Raises InputError if the Python file of its own shape has other contents on this machine.

    Args:
        sha256: checksum of that file where the design was pickled.
    """
    design = validate(Design, data, recorded=recorded)
    if design.chamber.sha256 != sha256:
        raise InputError(
            f"chamber.shape: {design.chamber.shape}: on this worker its sha256 is "
            f"{design.chamber.sha256[:16]}, expected {sha256[:16]}; give all machines the same file"
        )
    return design


def _replaced(old: Any, name: str, steps: Sequence[str], value: Any) -> Any:
    """Return a copy of a table or list with another value at the end of a path.

    Args:
        name: dotted name of the value, for messages.
        steps: the path: keys of tables and positions in lists.
    """
    if not steps:
        return _of_the_same_kind(old, value)
    step, rest = steps[0], steps[1:]
    if isinstance(old, dict) and (step in old or not rest):  # an unknown last key is reported later
        return {**old, step: _replaced(old.get(step), name, rest, value)}
    if isinstance(old, tuple) and step.isdecimal() and int(step) < len(old):
        k = int(step)
        return (*old[:k], _replaced(old[k], name, rest, value), *old[k + 1 :])
    lacking = "not set in this design; give it a value there first"
    raise InputError(f"{name}: {lacking if old is None else 'not a key of a design'}")


def _of_the_same_kind(old: Any, value: Any) -> Any:
    """Return a new number in the type of the old value, int or float; other values as they are.

    A number that is not whole becomes a float. Numbers of numpy are accepted too, and a Path in the
    place of a text.
    """
    if isinstance(value, Path):
        return str(value)
    is_number = isinstance(value, Real) and not isinstance(value, bool)
    if not is_number:
        return value
    whole = isinstance(value, Integral) and not isinstance(old, float)
    if isinstance(old, int):
        whole = float(value).is_integer()
    return int(value) if whole else float(value)


class AnyShape(ChamberTable):
    """Stand-in for a chamber of an unknown shape, so that other problems are reported too."""

    model_config = pydantic.ConfigDict(**{**STRICT, "extra": "ignore"})

    shape: Literal[tuple(SHAPES)] = Field(  # type: ignore[valid-type]
        description="form of the cavity, or a Python file with one of your own"
    )

    @pydantic.field_validator("shape", mode="before")
    @classmethod
    def _load_custom_shape(cls, shape: Any, info: ValidationInfo) -> object:
        if is_custom(shape):
            try:
                load_custom_shape(from_file(shape, info.context))
            except InputError as error:
                raise CrossCheckError([Problem("", f"given {shape!r}: {error}")]) from None
        return shape


def design_class(
    data: Mapping[str, object], context: Mapping[str, object] | None = None
) -> type[Design]:
    """Return the subclass of Design whose chamber table has the keys of the shape in `data`.

    Args:
        data: values of a design file.
        context: folder of the file, and whether the values come from a result ("recorded").
    """
    chamber = data.get("chamber")
    name = chamber.get("shape") if isinstance(chamber, Mapping) else getattr(chamber, "shape", None)
    if not is_custom(name):
        return _designs_with(SHAPES.get(name, AnyShape) if isinstance(name, str) else AnyShape)
    if (context or {}).get("recorded"):
        return _designs_with(RecordedShape)
    try:
        return _designs_with(load_custom_shape(from_file(str(name), context)))
    except InputError:
        return _designs_with(AnyShape)


def _table(data: object, name: str) -> Mapping[str, object] | None:
    table = data.get(name) if isinstance(data, Mapping) else None
    return table if isinstance(table, Mapping) else None


@cache
def _designs_with(table: type[ChamberTable]) -> type[Design]:
    chamber = (table, Field(description="the cavity before the part is taken out of it"))
    return pydantic.create_model("Design", __base__=Design, __doc__=Design.__doc__, chamber=chamber)


Model = TypeVar("Model", bound=BaseModel)


def validate(
    model: type[Model],
    data: Mapping[str, object],
    path: Path | None = None,
    source: str = "",
    recorded: bool = False,
) -> Model:
    """Check values against a model, such as Design, and return them as a frozen instance of it.

    Args:
        model: class of the instance.
        data: values as read from a file.
        path: path of the file that holds the data. Paths of meshes and shapes are relative to it.
        source: text of that file, for line numbers in messages.
        recorded: True for the design of a result. No file that it names is looked for or run.
    Raises:
        InputError: names every problem.
    """
    folder = path.parent if path else Path()
    context = {"folder": folder, "needs_mesh": path and not recorded, "recorded": recorded}
    try:
        return model.model_validate(data, context=context)
    except ValidationError as error:
        shown: type[BaseModel] = design_class(data, context) if model is Design else model
        problems = toml_errors.explain_validation_error(error, shown)
        raise InputError(toml_errors.format_problems(problems, path, source)) from None
