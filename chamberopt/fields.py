"""The kinds of numbers a file holds, with what is shown when one is wrong."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

# TOML has lists only: these two become tuples at the door, their numbers stay strict.
Pair = Annotated[tuple[float, float], Field(strict=False)]
Triple = Annotated[tuple[float, float, float], Field(strict=False)]


Unit = Literal["um", "mm", "cm", "m", "in", "guess"]
METRES_PER: dict[str, float] = {"um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}


def quantity(low: float, high: float, unit: str, what: str, default: Any = ...) -> Any:
    """A bounded number of the file; unit and meaning are shown when it is wrong."""
    return Field(default, ge=low, le=high, description=what, json_schema_extra={"unit": unit})


def listed(form: str, what: str, default: Any = ...) -> Any:
    """A list of numbers of the file, its form shown when it is wrong."""
    return Field(default, description=what, json_schema_extra={"form": form})


def from_file(path: str, context: Mapping[str, Any] | None) -> Path:
    """Absolute path of a file that a design names relative to its own; context as ``design.checked`` makes it."""
    return ((context or {}).get("folder", Path()) / path).resolve()
