"""Tables of every key of the program's files, from the pydantic models that read them.

A key's meaning is its description there; for a key that is a table, the table's docstring.
"""

from collections.abc import Iterator, Mapping
from typing import Annotated, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from chamberopt.chamber.shop import Shop
from chamberopt.common.toml_errors import accepted_values, table_of
from chamberopt.design.calibration import Calibration
from chamberopt.design.design import AnyShape, Design
from chamberopt.design.shapes import SHAPES
from chamberopt.design.shapes.base import ChamberTable
from chamberopt.peening.measured import Measured
from chamberopt.search.study.schema import Study

HEAD = ["{.keys}", "| key | meaning | value | default |", "|---|---|---|---|"]
# Files of their own, of which another file gives the path.
OTHER_FILES = {
    Design: "[keys of a design](design.md)",
    Calibration: "[keys of a machine](machine.md)",
}
CUSTOM = 'A file of one\'s own (`shape = "my_shape.py"`) adds keys of its own.'


def of_file(model: type[BaseModel]) -> str:
    """Return a heading and a table for each table of a file, as MyST text."""
    names: dict[type[BaseModel], str] = {}
    _name_tables(model, "", names)
    lines: list[str] = []
    for table, name in names.items():
        fields = dict(table.model_fields)
        if table is ChamberTable:
            fields["shape"] = AnyShape.model_fields["shape"]  # which lists them
        lines += _table(table, name, f"[{name}]" if name else "The file", fields, names)
        if table is ChamberTable:
            lines += _shapes(names)
    return "\n".join(lines)


PAGES = {
    "docs/reference/design": Design,
    "docs/reference/study_file": Study,
    "docs/reference/shop": Shop,
    "docs/reference/measurements": Measured,
    "docs/reference/machine": Calibration,
}


def meaning(field: FieldInfo) -> str:
    """Return what a key says: its description, or what its table says; "" if there is neither."""
    if field.description:
        return field.description
    table = _inner(field)
    return "" if table is None else _summary(table)


def every_key(model: type[BaseModel], prefix: str = "") -> Iterator[tuple[str, FieldInfo]]:
    """Yield the dotted name and the field of each key of a file, also of tables in tables."""
    for key, field in model.model_fields.items():
        yield prefix + key, field
        table = _inner(field)
        if table is not None and table not in OTHER_FILES:
            yield from every_key(table, f"{prefix}{key}.")
        for shape in SHAPES.values() if table is ChamberTable else ():
            yield from ((f"{prefix}{key}.{own}", field) for own, field in _own_keys(shape).items())


def _name_tables(model: type[BaseModel], name: str, names: dict[type[BaseModel], str]) -> None:
    """Enter a table and the tables in it into `names`, each where the file has it first."""
    names[model] = name
    for key, field in model.model_fields.items():
        table = _inner(field)
        if table is not None and table not in (*OTHER_FILES, *names):
            _name_tables(table, f"{name}.{key}".strip("."), names)


def _shapes(names: dict[type[BaseModel], str]) -> Iterator[str]:
    """Yield the lines of the keys that only chambers of one shape have."""
    for name, shape in SHAPES.items():
        title = f'[chamber] with shape = "{name}"'
        yield from _table(shape, f"chamber-{name}", title, _own_keys(shape), names)
    yield f"\n{CUSTOM}\n"


def _own_keys(shape: type[ChamberTable]) -> dict[str, FieldInfo]:
    """Return the keys that not every chamber has."""
    fields = shape.model_fields.items()
    return {key: field for key, field in fields if key not in ChamberTable.model_fields}


def _table(
    model: type[BaseModel],
    name: str,
    title: str,
    fields: Mapping[str, FieldInfo],
    names: Mapping[type[BaseModel], str],
) -> Iterator[str]:
    yield from ["", f"## {title}", "", _summary(model), "", *HEAD]
    for key, field in fields.items():
        anchor = f"{name}.{key}".strip(".").replace(".", "-")
        value, table = accepted_values(field), _inner(field)
        if table in OTHER_FILES:
            value += f" ({OTHER_FILES[table]})"
        elif table is not None:
            value = _linked(value, names[table], f"{name}.{key}".strip("."))
        extra = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
        unit = f" {extra['unit']}" if extra.get("unit") else ""
        cells = [f"[`{key}`]{{#{anchor}}}", meaning(field), value + unit, _default(field)]
        yield "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
    yield ""


def _linked(value: str, section: str, name: str) -> str:
    """Return what a key that is a table accepts, with a link to the section of this table.

    Args:
        section: name under which the table has its section.
        name: name of the key, which is another if it holds a table like that.
    """
    target = f"(#{section.replace('.', '').lower()})"
    if f"[[{section}]]" in value:
        return value.replace(f"[[{section}]]", f"[\\[\\[{section}\\]\\]]{target}")
    return f"{value}: {'' if section == name else 'as '}[\\[{section}\\]]{target}"


def _inner(field: FieldInfo) -> type[BaseModel] | None:
    """Return the model of a key that is a table, a list of tables or a table of named tables."""
    if (table := table_of(field) or table_of(field, of_rows=True)) is not None:
        return table
    if get_origin(field.annotation) is not dict:
        return None
    _, value = get_args(field.annotation)
    value = get_args(value)[0] if get_origin(value) is Annotated else value
    return value if isinstance(value, type) and issubclass(value, BaseModel) else None


def _summary(model: type[BaseModel]) -> str:
    return " ".join((model.__doc__ or "").split("\n\n")[0].split())


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    if field.default is PydanticUndefined or field.default in (None, (), ""):
        return "–"
    return f"`{_toml(field.default)}`"


def _toml(value: object) -> str:
    """Return a value as a TOML file writes it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return f"[{', '.join(map(_toml, value))}]"
    if isinstance(value, str):
        return f'"{value}"'
    return f"{value:g}" if isinstance(value, float) else str(value)
