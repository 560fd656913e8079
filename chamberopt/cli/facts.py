"""Lines with the facts of a design or study that was checked, by their names."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from chamberopt.documents.facts import range_text


def table_lines(table: Mapping[str, Any], prefix: str = "") -> list[str]:
    """Return a nested table as lines of text in aligned columns.

    A note or warning in the table is a line of its own.
    """
    lines: list[str] = []
    for name, value in table.items():
        label = f"{prefix + name:33} "
        if isinstance(value, Mapping) and (text := range_text(value)):
            lines.append(label + text)
        elif isinstance(value, Mapping):
            lines += table_lines(value, f"{prefix}{name}.")
        elif name in ("notes", "warnings"):
            lines += [f"{name.removesuffix('s')}: {text}" for text in value]
        else:
            text = _list_text(value, name) if isinstance(value, list) else f"{value}"
            lines.append(label + text)
    return lines


def _list_text(values: list[Any], name: str) -> str:
    """Return a list as text. Sizes are written "1 x 2 x 3", other values with commas between."""
    if values and isinstance(values[0], float):
        separator = " x " if name.startswith("bounding_box") else ", "
        return separator.join(f"{value:g}" for value in values)
    return ", ".join(values) or "none"
