"""Write and read arrays.npz: the simulated chamber of a result, and the coverage of its part.

A finished result is read from result.json, arrays.npz and hits.npz. The files that its design names
are not read again.
The surfaces in .vtp and .stl files beside it are for other programs.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from chamberopt.chamber.build import Chamber
from chamberopt.chamber.fixture import Fixture
from chamberopt.chamber.part import Part, PartOfFile
from chamberopt.common.errors import InputError
from chamberopt.common.limits import MAX_NUMBER
from chamberopt.common.npz_files import is_of_type, load_record, save_record
from chamberopt.coverage.field.display_mesh import DisplayField, DisplayMesh
from chamberopt.design.shape_surface import TAG_PART, TAG_SONOTRODE
from chamberopt.geometry.meshes.part_mesh import PartMesh
from chamberopt.geometry.meshes.raw_mesh import ElementNumbers
from chamberopt.geometry.meshes.units import METRES_PER
from chamberopt.geometry.smoothing.part import SmoothingFacts
from chamberopt.geometry.triangles import areas
from chamberopt.results.vtp_files import Surface, cavity_surface, field_surface, part_surface

if TYPE_CHECKING:
    from chamberopt.results.load import Result

ARRAYS_FILE = "arrays.npz"
REMEDY = "restore the file, or simulate again"
LARGEST = 1e4  # m, m² or m³; every part and chamber is smaller
STEEPEST = 1e12  # 1/m; every curvature is smaller, and every component of a file's normals
ROUNDING = 1e-6  # of single precision


@dataclass(frozen=True)
class ResultArrays:
    """The chamber of a result with its part, and coverage and other values on the part's surface.

    elements: values of each triangle of the part, by name, shape (m,). Unknown values are NaN.
    display: a finer mesh of the part to draw, with values at its vertices. Each triangle of this
        mesh lies in a triangle of the part.
    """

    chamber: Chamber
    elements: dict[str, np.ndarray]
    display: DisplayField

    @property
    def part(self) -> Surface:
        """The part's triangles [mm] with their values."""
        return part_surface(self.chamber.part, self.elements)

    @property
    def field(self) -> Surface:
        """The mesh of the part to draw [mm], with coverage and other values at its vertices."""
        return field_surface(self.display, self.elements)

    @property
    def cavity(self) -> Surface:
        """The closed surface round the air in the chamber [mm]."""
        return cavity_surface(self.chamber)


class Rule(NamedTuple):
    """The type, shape and bounds that an array in arrays.npz must have.

    kinds: names of the allowed types, e.g. "float32 float64".
    shape: lengths of the axes, e.g. "points 3". All arrays with the same named length ("points")
        must agree in it.
    low, high: least and largest allowed value. If `high` is a named length, values must be below
        that length.
    unknown: True if values may be NaN.
    """

    kinds: str
    shape: str
    low: float
    high: float | str
    unknown: bool = False


WHOLE = "int8 int32 int64"
FLOAT = "float32 float64"
MARK = 0, 1
SHARE = 0.0, 1.0 + ROUNDING
AMOUNT = 0.0, MAX_NUMBER
METRES = -LARGEST, LARGEST
UNIT = -1.0 - ROUNDING, 1.0 + ROUNDING
ANY = -np.inf, np.inf

# Bounds of the columns that a result has for each triangle of the part and each vertex to draw.
SHARES = dict.fromkeys(("coverage", "coverage_interval", "reachable", "resolved"), SHARE)
AMOUNTS = dict.fromkeys(
    ("dent_density", "dents_in_window", "impacts_per_mm2", "energy_per_mm2", "mean_normal_speed",
     "p90_normal_speed", "mean_angle_deg", "mean_dent_um"),
    AMOUNT,
)  # fmt: skip
OTHERS = {"*": (-MAX_NUMBER, MAX_NUMBER)}
VALUES: dict[str, tuple[float, float]] = SHARES | AMOUNTS | OTHERS
ALWAYS_KNOWN = "coverage", "reachable", "resolved"
# Columns that every result has. The other arrays are fields of the record, which are there.
NEEDED = (
    *(f"elements.{name}" for name in ("coverage", "coverage_interval", "impacts", "dents")),
    *(f"elements.{name}" for name in ("element", "target", "exposed_area_mm2")),
    *(f"display.fields.{name}" for name in (*SHARES, "dent_density")),
)


def _mesh_rules(place: str, points: str, faces: str) -> dict[str, Rule]:
    return {
        f"{place}.vertices": Rule("float64", f"{points} 3", *METRES),
        f"{place}.triangles": Rule("int32", f"{faces} 3", 0, points),
    }


def _file_rules(place: str, points: str, faces: str) -> dict[str, Rule]:
    return _mesh_rules(place, points, faces) | {
        f"{place}.numbering.elements": Rule(WHOLE, faces, *ANY),
        f"{place}.numbering.faces": Rule(WHOLE, faces, *ANY),
        f"{place}.numbering.cad_face": Rule(WHOLE, faces, -1, MAX_NUMBER),
    }


def _value_rules(place: str, rows: str, always: Sequence[str] = ()) -> dict[str, Rule]:
    """Return a rule for each column in VALUES, by the array's name "place.column".

    Args:
        place: first part of the names of the arrays, such as "elements".
        rows: name of the length that all columns share, such as "triangles".
        always: names of the columns that must not have NaN.
    """
    return {
        f"{place}.{name}": Rule(FLOAT, rows, *bounds, unknown=name not in always)
        for name, bounds in VALUES.items()
    }


# An array is of the first rule whose name matches. No other arrays are read.
PART, FILE, MESH = "chamber.part", "chamber.part.file", "display.mesh"
RULES: dict[str, Rule] = {
    **_mesh_rules("chamber", "corners", "faces"),
    **_mesh_rules(PART, "points", "triangles"),
    "chamber.tags": Rule("uint8", "faces", 0, 255),
    "chamber.source": Rule(WHOLE, "faces", -1, "triangles"),
    "chamber.fitting": Rule(WHOLE, "faces", -1, "faces"),
    **_mesh_rules("chamber.fixtures.holder", "of_holder", "on_holder"),
    **_mesh_rules("chamber.fixtures.mask", "of_mask", "on_mask"),
    "chamber.exposed_area": Rule("float64", "triangles", 0.0, LARGEST),
    f"{PART}.area": Rule("float64", "triangles", 0.0, LARGEST),
    f"{PART}.target": Rule("bool", "triangles", *MARK),
    f"{PART}.zones.*": Rule("bool", "triangles", *MARK),
    f"{PART}.surface": Rule(WHOLE, "triangles", -1, MAX_NUMBER),
    f"{PART}.normals": Rule("float32", "triangles 3 3", -STEEPEST, STEEPEST),
    f"{PART}.hollow": Rule("float32", "triangles", -STEEPEST, STEEPEST),
    f"{PART}.thickness": Rule("float32", "triangles", 0.0, np.inf),
    f"{FILE}.rotation": Rule("float64", "3 3", *METRES),
    f"{FILE}.shift": Rule("float64", "3", *METRES),
    **_file_rules(f"{FILE}.simulated", "points", "triangles"),
    **_file_rules(f"{FILE}.original", "own_points", "own_triangles"),
    "elements.impacts": Rule(WHOLE, "triangles", *AMOUNT),
    "elements.dents": Rule(WHOLE, "triangles", *AMOUNT),
    "elements.element": Rule(WHOLE, "triangles", *ANY),
    "elements.target": Rule("uint8", "triangles", *MARK),
    "elements.zone": Rule("uint8", "triangles", 0, 255),
    "elements.zone_*": Rule("uint8", "triangles", *MARK),
    "elements.exposed_area_mm2": Rule("float64", "triangles", *AMOUNT),
    "elements.reachable_area_mm2": Rule("float64", "triangles", *AMOUNT),
    **_value_rules("elements", "triangles"),
    f"{MESH}.vertices": Rule("float64", "vertices 3", *METRES),
    f"{MESH}.triangles": Rule(WHOLE, "cells 3", 0, "vertices"),
    f"{MESH}.normal": Rule(FLOAT, "vertices 3", *UNIT),
    f"{MESH}.face": Rule(WHOLE, "vertices", *ANY),
    f"{MESH}.part_triangle": Rule(WHOLE, "cells", 0, "triangles"),
    **_value_rules("display.fields", "vertices", ALWAYS_KNOWN),
}


def save_result_arrays(folder: Path, arrays: ResultArrays) -> None:
    """Write arrays.npz into a results folder."""
    save_record(folder / ARRAYS_FILE, arrays)


def load_result_arrays(result: Result) -> ResultArrays:
    """Return the arrays of a result.

    Raises InputError if the file is damaged, was changed or is of another part.
    """
    path = result.path(ARRAYS_FILE)
    arrays = read_result_arrays(path)
    part = arrays.chamber.part
    if part.sha256 != result.record.part_sha256 or set(part.zones) != {
        one.name for one in result.design.zones
    }:
        raise InputError(f"{path}: of another part or other zones than result.json; {REMEDY}")
    return arrays


def load_chamber(result: Result) -> Chamber:
    """Return the chamber of a result. Raise InputError if arrays.npz is damaged or was changed."""
    return load_result_arrays(result).chamber


def read_result_arrays(path: Path) -> ResultArrays:
    """Return the content of an arrays.npz.

    All of it is checked, because compiled functions and VTK trust their input.

    Raises:
        InputError: the file is missing, damaged or not the file that was written.
    """
    classes = (
        Chamber, Fixture, Part, PartOfFile, PartMesh, ElementNumbers, SmoothingFacts, DisplayField,
        DisplayMesh,
    )  # fmt: skip
    arrays = load_record(path, ResultArrays, classes, REMEDY)
    try:
        _require_sound(arrays)
    except (ValueError, TypeError) as error:
        raise InputError(f"{path}: damaged ({error}); {REMEDY}") from None
    return arrays


def _require_sound(arrays: ResultArrays) -> None:
    """Raise ValueError unless values of arrays.npz have their types and agree with each other."""
    if not is_of_type(arrays, ResultArrays):
        raise ValueError("a value is of another type than is written here")
    _require_rules(dict(_named_arrays(arrays)))
    _require_chamber(arrays.chamber)
    _require_known(arrays)


def _named_arrays(value: Any, name: str = "") -> Iterator[tuple[str, np.ndarray]]:
    """Yield each array in a nested record with its dotted name, as "chamber.part.area"."""
    if isinstance(value, np.ndarray):
        yield name, value
    inner = value if isinstance(value, dict) else {}
    if is_dataclass(value):
        inner = {one.name: getattr(value, one.name) for one in fields(value)}
    for key, one in inner.items():
        yield from _named_arrays(one, f"{name}.{key}" if name else key)


def _require_rules(arrays: Mapping[str, np.ndarray]) -> None:
    """Raise ValueError unless all NEEDED arrays are there and each obeys its rule in RULES."""
    if missing := [name for name in NEEDED if name not in arrays]:
        raise ValueError(f"without {missing[0]}")
    rest = dict(arrays)
    lengths: dict[str, int] = {}
    for key, rule in RULES.items():
        for name in [one for one in rest if fnmatchcase(one, key)]:
            _require_array(name, rest.pop(name), rule, lengths)
    if rest:
        raise ValueError(f"{next(iter(rest))[:60]!r} is an array that no result has")


def _require_array(name: str, array: np.ndarray, rule: Rule, lengths: dict[str, int]) -> None:
    """Raise ValueError unless an array obeys its rule.

    `lengths` has the named lengths of earlier arrays. New lengths of this array are added to it.
    """
    if array.dtype not in map(np.dtype, rule.kinds.split()):
        raise ValueError(f"{name} is of type {array.dtype}")
    wanted = rule.shape.split()
    if len(array.shape) == len(wanted):
        for length, one in zip(array.shape, wanted, strict=True):
            lengths.setdefault(one, int(one) if one.isdigit() else length)
    expected = tuple(lengths.get(one) for one in wanted)
    if array.shape != expected:
        raise ValueError(f"{name} has the shape {array.shape}, expected {expected}")
    high = lengths[rule.high] - 1 if isinstance(rule.high, str) else rule.high
    sound = (array >= rule.low) & (array <= high)
    if not (sound | np.isnan(array) if rule.unknown else sound).all():
        raise ValueError(f"{name} has a number that is not from {rule.low:g} to {high:g}")


def _require_chamber(chamber: Chamber) -> None:
    """Raise ValueError unless a chamber has a part, a sonotrode, known units and a volume."""
    part = chamber.part
    if part.file is None:
        raise ValueError("without its part")
    for tag, surface in ((TAG_PART, "part"), (TAG_SONOTRODE, "sonotrode")):
        if not (chamber.tags == tag).any():
            raise ValueError(f"without a {surface} in the cavity")
    meshes = part.file.simulated, part.file.as_read
    for unit in (part.unit, *(mesh.unit for mesh in meshes)):
        if unit not in METRES_PER:
            raise ValueError(f"unit {unit!r}")
    if part.surface is not None and (part.surface >= len(part.names)).any():
        raise ValueError("a surface of its part is without its name")
    if not 0.0 < chamber.volume <= LARGEST:
        raise ValueError(f"volume {chamber.volume!r}")


def _require_known(arrays: ResultArrays) -> None:
    """Raise ValueError if coverage is unknown at a point of the part that balls can reach.

    Also raise ValueError if the values and the chamber have different targets, element numbers or
    exposed areas, or if no exposed triangle is in the target.
    """
    elements, shown, mesh = arrays.elements, arrays.display.fields, arrays.display.mesh
    part, area = arrays.chamber.part, 1e6 * arrays.chamber.exposed_area
    same = {"target": part.target, "element": part.elements, "exposed_area_mm2": area}
    for name, column in same.items():
        if not np.array_equal(elements[name], column):
            raise ValueError(f"elements.{name} is not as in its chamber")
    exposed = area > 0.0
    if np.isnan(elements["coverage"][exposed]).any():
        raise ValueError("an exposed triangle has no coverage")
    if not part.target[exposed].any():
        raise ValueError("nothing of its target is exposed")
    if not np.array_equal(np.unique(mesh.part_triangle), np.arange(len(exposed))):
        raise ValueError("the mesh to draw leaves out triangles of the part")
    reached = shown["reachable"] > 0.5
    if any(np.isnan(shown[one][reached]).any() for one in ("dent_density", "coverage_interval")):
        raise ValueError("a place on it has no coverage")
    target = mesh.triangles[part.target[mesh.part_triangle]]
    if not areas(mesh.vertices, target).sum() > 0.0:
        raise ValueError("its target has no area")
