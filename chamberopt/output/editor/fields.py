"""What the page asks of a design: each number and choice with unit, bounds and description."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from pydantic.fields import FieldInfo

from chamberopt.common.toml_errors import numeric_fields, text_choices
from chamberopt.design.design import Design

if TYPE_CHECKING:
    from chamberopt.output.editor.edited_file import EditedFile

# Tables whose numbers are measured, not chosen; those that the page changes by picking; and what
# the part is meshed by, which would make it another part.
NOT_SHOWN = ("calibration.", "part.target.", "zones.", "tolerances.", "part.tessellation.")


def design_fields(file: EditedFile) -> list[dict[str, Any]]:
    """Every number and choice of the design, in the order of its tables."""
    design, varied = file.design, set(file.design.numbers())
    rows: list[dict[str, Any]] = []
    for name, field in _numbers(design):
        row: dict[str, Any] = {"name": name, "value": _value(design, name), **_bounds(field)}
        extra = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
        row |= {"unit": extra.get("unit", "") or _unit(name), "text": field.description or ""}
        row |= {"whole": field.annotation is int, "varies": name in varied}
        rows.append(row | {"fixed": file.is_fixed(name)})
    for name, allowed in _choices(design).items():
        table, key = name.split(".")
        text = type(getattr(design, table)).model_fields[key].description or ""
        row = {"name": name, "value": design.setting(name), "choices": allowed, "text": text}
        rows.append(row)
    return rows


def field_names(design: Design) -> set[str]:
    """The names of these numbers and choices: nothing else is a field of the page."""
    return {*(name for name, _ in _numbers(design)), *_choices(design)}


def _numbers(design: Design) -> Iterator[tuple[str, FieldInfo]]:
    """Every number, but for parts of a list in a table that the design does not have."""
    for name, field in numeric_fields(design):
        in_list = name.rpartition(".")[2].isdecimal()
        if not name.startswith(NOT_SHOWN) and (not in_list or _value(design, name) is not None):
            yield name, field


def _choices(design: Design) -> dict[str, tuple[str, ...]]:
    """Texts to choose from; a shape is none of them, because it has keys of its own."""
    tables = {"chamber": design.chamber, "sonotrode": design.sonotrode}
    found = (one for name, table in tables.items() for one in text_choices(table, name))
    return {name: texts for name, texts in found if name not in ("chamber.unit", "chamber.shape")}


def _value(design: Design, name: str) -> float | None:
    """The number of a design, None where it is not set."""
    value: Any = design
    for step in name.split("."):
        value = value[int(step)] if isinstance(value, tuple) else getattr(value, step, None)
    return value


def _bounds(field: FieldInfo) -> dict[str, float]:
    """Least and largest value that the schema allows, as far as it has them."""
    found: dict[str, float] = {}
    for constraint in field.metadata:
        for key, name in (("ge", "least"), ("le", "most")):
            if (value := getattr(constraint, key, None)) is not None:
                found[name] = float(value)
    return found


def _unit(name: str) -> str:
    """The unit that the name of a list ends in."""
    key = name.rstrip("0123456789.").rpartition(".")[2]
    return {"mm": "mm", "deg": "degrees", "um": "µm", "s": "s"}.get(key.rpartition("_")[2], "")
