"""Docstrings of this repository in the form that napoleon reads.

The house form leaves out what a reader of the code does not need: the heading of the attributes of
a record, and the mark of a drawing or an example, which is indented by four more columns.
"""

import re
from itertools import groupby
from typing import Any

from pydantic import BaseModel

ATTRIBUTE = re.compile(r"\w+(, \w+)*: ")
SECTION = re.compile(r"(Args|Returns|Raises|Yields|Attributes|Notes?|Sources?|Examples?):$")
LITERAL = "::"  # what follows is shown as it is


def adapt(app: Any, what: str, name: str, of: object, options: Any, lines: list[str]) -> None:
    """Change the lines of a docstring in place: the handler of autodoc-process-docstring."""
    changed: list[str] = []
    before = ""  # the last line that is not indented
    for is_blank, group in groupby(lines, lambda line: not line.strip()):
        paragraph = list(group)
        if is_blank:
            changed += paragraph
            continue
        if paragraph[0].startswith("    "):
            if before != LITERAL and not SECTION.match(before):
                changed += [LITERAL, ""]
                before = LITERAL
        elif what == "class" and ATTRIBUTE.match(paragraph[0]):
            changed.append("Attributes:")
            paragraph = [f"    {line}" for line in paragraph]
        else:
            before = next(line for line in reversed(paragraph) if not line.startswith(" "))
        changed += paragraph
    lines[:] = changed


def shorten(app: Any, what: str, name: str, of: object, options: Any, *signature: str) -> Any:
    """Leave out the keys of a file's table, which a page of their own lists, as arguments."""
    if what == "class" and isinstance(of, type) and issubclass(of, BaseModel):
        return "", None
    return None
