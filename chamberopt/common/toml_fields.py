"""Read TOML files, and define their field types: numbers with a unit, lists, positions, files."""

import math
import os
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo
from pydantic.fields import FieldInfo

from chamberopt.common import toml_errors
from chamberopt.common.errors import InputError
from chamberopt.common.files import is_of_the_program
from chamberopt.common.limits import MAX_TEXT_BYTES, read_limited
from chamberopt.common.toml_errors import CrossCheckError, Problem

MAX_COORDINATE_MM = 10000  # distance from the middle of the sonotrode: no chamber is larger

Vector = tuple[float, float, float]
T = TypeVar("T")
# TOML has only lists. They become tuples when they are read. Their items stay strict.
Several = Annotated[tuple[T, ...], Field(strict=False)]
Pair = Annotated[tuple[float, float], Field(strict=False)]
Triple = Annotated[Vector, Field(strict=False)]


def _nonzero(direction: Vector) -> Vector:
    if not any(direction):
        text = "given [0, 0, 0], which points nowhere; e.g. [0, 0, -1] is down"
        raise CrossCheckError([Problem("", text)])
    return direction


def _within_limits(position: tuple[float, ...]) -> tuple[float, ...]:
    if max(map(abs, position)) > MAX_COORDINATE_MM:
        allowed = f"each must be from -{MAX_COORDINATE_MM} to {MAX_COORDINATE_MM} mm"
        raise CrossCheckError([Problem("", f"given {list(position)}; {allowed}")])
    return position


def _existing(mesh: str, info: ValidationInfo) -> str:
    path = from_file(mesh, info.context)
    if (info.context or {}).get("needs_mesh") and not path.is_file():
        missing = toml_errors.explain_missing_file(path, "mesh file", "*")
        raise CrossCheckError([Problem("", f"given {mesh!r}: {missing}")])
    return str(path)


def _as_tuple(names: object) -> object:
    return (names,) if isinstance(names, str) else names


def _form(form: str) -> object:
    return Field(json_schema_extra={"form": form})


# Error messages show the form.
Direction = Annotated[Triple, AfterValidator(_nonzero), _form("three numbers [x, y, z], not all 0")]
Position = Annotated[Triple, AfterValidator(_within_limits), _form("three numbers [x, y, z] in mm")]
Shift = Annotated[Pair, AfterValidator(_within_limits), _form("two numbers [x, y] in mm")]
# rotations about x, then y, then z
Turns = Annotated[Triple, _form("three numbers [x, y, z] in degrees")]
# Paths are relative to the file that names them, and absolute once read. The design therefore stays
# valid at any place of its file.
File = Annotated[
    str, Field(min_length=1), AfterValidator(lambda path, info: str(from_file(path, info.context)))
]
MeshFile = Annotated[str, Field(min_length=1), AfterValidator(_existing)]
Names = Annotated[
    tuple[str, ...],
    Field(strict=False, min_length=1),
    BeforeValidator(_as_tuple),
    _form("a name in quotes, or a list of names"),
]


def quantity(low: float, high: float, unit: str, what: str, default: Any = ...) -> Any:
    """Return a pydantic field for a number from `low` to `high`.

    Args:
        unit, what: unit and meaning of the number, for error messages.
        default: value if the file leaves the number out; without it the number is required.
    """
    return Field(default, ge=low, le=high, description=what, json_schema_extra={"unit": unit})


def allowed_range(field: FieldInfo) -> tuple[float, float]:
    """Return the least and the largest allowed value of a number field.

    A side without a bound gives an infinite value.
    """
    low = max((one.ge for one in field.metadata if hasattr(one, "ge")), default=-math.inf)
    high = min((one.le for one in field.metadata if hasattr(one, "le")), default=math.inf)
    return low, high


def list_field(form: str, what: str, default: Any = ...) -> Any:
    """Return a pydantic field for a list.

    Args:
        form: form of the list, for error messages, such as "three numbers [x, y, z] in mm".
        what: meaning of the list, for error messages.
        default: value if the file leaves the list out; without it the list is required.
    """
    return Field(default, description=what, json_schema_extra={"form": form})


def from_file(path: str, context: Mapping[str, Any] | None) -> Path:
    """Return the absolute path of a file that a design names relative to the design's folder.

    Args:
        context: context of the pydantic validation: under "folder" the design's folder, and under
            "recorded" True for a design that a result recorded, whose links are not followed.
    """
    context = context or {}
    named = context.get("folder", Path()) / path
    # Files that a result names are recorded and not looked for on this machine.
    return Path(os.path.abspath(named)) if context.get("recorded") else named.resolve()


def unit_vector(direction: Vector) -> Vector:
    """Return the direction scaled to length 1."""
    x, y, z = (float(k) / math.hypot(*direction) for k in direction)
    return x, y, z


def metres(millimetres: Vector) -> Vector:
    """Return a position in m that is given in mm."""
    x, y, z = (k * 1e-3 for k in millimetres)
    return x, y, z


def read_toml(
    path: Path, kind: str, remedy: str = "start from a copy of a shipped one"
) -> tuple[str, dict[str, Any]]:
    """Return the text of a TOML file, and the values read from it.

    Args:
        kind: kind of the file in messages, such as "design".
        remedy: end of the message on a file that is empty or no file of this kind.

    Raises:
        InputError: if the file is missing, too large or not TOML.
    """
    if path.is_dir():
        inside = sorted(p.name for p in path.glob("*.toml"))
        hint = f"; files in it: {', '.join(inside[:8])}" if inside else ""
        raise InputError(f"{path}: is a folder; give a {kind} file (.toml){hint}")
    try:
        follow = not is_of_the_program(path.parent)
        content = read_limited(path, MAX_TEXT_BYTES, f"{kind} file (.toml)", follow)
        source = content.decode("utf-8-sig")
    except FileNotFoundError:
        raise InputError(toml_errors.explain_missing_file(path, f"{kind} file", "*.toml")) from None
    except UnicodeDecodeError as error:
        text = f"not UTF-8 text (byte {error.start}); a {kind} file is TOML, save it as UTF-8"
        raise InputError(f"{path}: {text}") from None
    if not source.strip():
        text = f"the file is empty; a {kind} file is TOML, {remedy}"
        raise InputError(f"{path}: {text}")
    try:
        return source, tomllib.loads(source)
    except tomllib.TOMLDecodeError as error:
        place, text = str(path), str(error)
        found = re.search(r"^(.*?) \(at line (\d+), column (\d+)\)$", text, re.DOTALL)
        if found:
            place, text = f"{path}:{found[2]}", f"{found[1]}, column {found[3]}"
        message = f"{place}: not valid TOML: {text}; correct the line, e.g. name = 1.5"
        raise InputError(message) from None
    # A number with thousands of digits, or thousands of nested brackets.
    except (ValueError, RecursionError) as error:
        message = f"{path}: not a {kind} file: {error}; {remedy}"
        raise InputError(message) from None
