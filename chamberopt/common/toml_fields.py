"""The kinds of numbers a file holds, with what is shown when one is wrong."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo

from chamberopt.common import toml_errors
from chamberopt.common.toml_errors import CrossCheckError, Problem

# TOML has lists only: these two become tuples at the door, their numbers stay strict.
Pair = Annotated[tuple[float, float], Field(strict=False)]
Triple = Annotated[tuple[float, float, float], Field(strict=False)]


def _nonzero(direction: tuple[float, float, float]) -> tuple[float, float, float]:
    if not any(direction):
        raise CrossCheckError(
            [Problem("", "given [0, 0, 0], which points nowhere; e.g. [0, 0, -1] is down")]
        )
    return direction


Direction = Annotated[Triple, AfterValidator(_nonzero)]


def _within_reach(place: tuple[float, float, float]) -> tuple[float, float, float]:
    if max(map(abs, place)) > MAX_COORDINATE_MM:
        raise CrossCheckError(
            [
                Problem(
                    "",
                    f"given {list(place)}; each must be from -{MAX_COORDINATE_MM} to {MAX_COORDINATE_MM} mm",
                )
            ]
        )
    return place


MAX_COORDINATE_MM = 10000  # from the middle of the sonotrode: no chamber is larger
Position = Annotated[Triple, AfterValidator(_within_reach)]


def unit_vector(direction: tuple[float, float, float]) -> tuple[float, float, float]:
    """The same direction, of length 1."""
    x, y, z = (float(k) / math.hypot(*direction) for k in direction)
    return x, y, z


def metres(millimetres: tuple[float, float, float]) -> tuple[float, float, float]:
    """A position [mm] in m."""
    x, y, z = (k * 1e-3 for k in millimetres)
    return x, y, z


def _absolute(path: str, info: ValidationInfo) -> str:
    return str(from_file(path, info.context))


def _there(mesh: str, info: ValidationInfo) -> str:
    path = from_file(mesh, info.context)
    if (info.context or {}).get("needs_mesh") and not path.is_file():
        raise CrossCheckError(
            [
                Problem(
                    "",
                    f"given {mesh!r}: {toml_errors.explain_missing_file(path, 'mesh file', '*')}",
                )
            ]
        )
    return str(path)


# Counts from the file that names it; held absolute from there on, so that a design stays right wherever it is saved.
File = Annotated[str, Field(min_length=1), AfterValidator(_absolute)]
MeshFile = Annotated[str, Field(min_length=1), AfterValidator(_there)]


def _listed_name(names: Any) -> Any:
    return (names,) if isinstance(names, str) else names


# One name may stand alone.
Names = Annotated[tuple[str, ...], Field(strict=False, min_length=1), BeforeValidator(_listed_name)]


def quantity(low: float, high: float, unit: str, what: str, default: Any = ...) -> Any:
    """A bounded number of the file; unit and meaning are shown when it is wrong."""
    return Field(default, ge=low, le=high, description=what, json_schema_extra={"unit": unit})


def list_field(form: str, what: str, default: Any = ...) -> Any:
    """A list of numbers of the file, its form shown when it is wrong."""
    return Field(default, description=what, json_schema_extra={"form": form})


def from_file(path: str, context: Mapping[str, Any] | None) -> Path:
    """Absolute path of a file that a design names relative to its own; context as ``design.checked`` makes it."""
    return ((context or {}).get("folder", Path()) / path).resolve()
