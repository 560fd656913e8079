"""Docstrings of this repository in the form that napoleon reads.

The house form leaves out what a reader of the code does not need: the heading of the attributes of
a record, and the marks of a drawing or an example, which are indented by four more columns.
"""

import re
from typing import Any

from pydantic import BaseModel

ATTRIBUTE = re.compile(r"\w+(, \w+)*: ")


def adapt(app: Any, what: str, name: str, of: object, options: Any, lines: list[str]) -> None:
    """Change the lines of a docstring in place: the handler of autodoc-process-docstring."""
    changed: list[str] = []
    is_paragraph = True  # the next line begins a paragraph
    in_attributes = False
    for line in lines:
        if is_paragraph and line.startswith("    ") and not _heads_section(changed):
            changed += ["::", ""]
        if is_paragraph:
            in_attributes = what == "class" and bool(ATTRIBUTE.match(line))
            if in_attributes:
                changed.append("Attributes:")
        changed.append(f"    {line}" if in_attributes and line.strip() else line)
        is_paragraph = not line.strip() and not (changed and _in_drawing(changed))
    lines[:] = changed


def shorten(app: Any, what: str, name: str, of: object, options: Any, *signature: str) -> Any:
    """Leave out the keys of a file's table, which a page of their own lists, as arguments."""
    if what == "class" and isinstance(of, type) and issubclass(of, BaseModel):
        return "", None
    return None


def _heads_section(lines: list[str]) -> bool:
    """True if what comes before is the heading of a section such as Args, or inside one."""
    before = next((line for line in reversed(lines) if line and not line.startswith(" ")), "")
    return before.endswith(":") and before[:-1] in (
        "Args", "Returns", "Raises", "Yields", "Attributes", "Source", "Sources", "Example",
        "Examples", "Note", ":",
    )  # fmt: skip


def _in_drawing(lines: list[str]) -> bool:
    """True if the last paragraph is one of the indented blocks that were marked already."""
    before = next((line for line in reversed(lines) if line and not line.startswith(" ")), "")
    return before == "::"
