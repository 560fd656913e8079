"""Define the errors of the program, and make texts safe to show in terminals and spreadsheets."""

from __future__ import annotations

import re
from concurrent.futures import BrokenExecutor
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pydantic import ValidationError

FORMULA = ("=", "+", "-", "@", "\t", "\n")  # beginnings of a formula in spreadsheet programs
# Characters that a terminal obeys instead of showing them, or that reverse the text.
CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")


class InputError(Exception):
    """Error for a design, study, mesh or result folder that cannot be used as it is.

    The message is one sentence with the field, file or triangle and the remedy. The command line
    prints only the message and exits with status 2.
    """


class UnreadableError(InputError):
    """Error for a file that cannot be read now, although the design may name it rightly."""


class OutputTakenError(InputError):
    """Error for an output path that already holds files or that another process writes to."""


class WorkerLostError(BrokenExecutor):
    """Error for a task whose worker process died, and died again when the task was repeated."""


class ClusterLostError(BrokenExecutor):
    """Error for a Dask cluster that ended before its tasks. The command exits with status 1."""


def visible(text: str) -> str:
    """Return the text with control characters written as escapes. Tabs and line breaks stay."""
    return CONTROL.sub(lambda one: one[0].encode("unicode_escape").decode(), text)


def one_line(text: str) -> str:
    """Return the text as one line, with control characters and line breaks written as escapes."""
    return visible(text).replace("\n", "\\n")


def spreadsheet_cell(value: object) -> object:
    """Return a value as it is written to a .csv file.

    A text that a spreadsheet would take for a formula gets an apostrophe in front. A carriage
    return becomes a line feed, because the csv module does not quote a carriage return, and a
    spreadsheet would begin a new row there.

    Source: OWASP, "CSV Injection".
    """
    if not isinstance(value, str):
        return value
    text = value.replace("\r\n", "\n").replace("\r", "\n")
    if not text.startswith(FORMULA):
        return text
    try:
        float(text)
    except ValueError:
        return f"'{text}"
    return text


def first_wrong_value(error: ValidationError) -> str:
    """Return the dotted name of the first wrong value in a file, and what is wrong with it."""
    first = error.errors(include_url=False, include_input=False)[0]
    where, why = ".".join(map(str, first["loc"])), first["msg"].removeprefix("Value error, ")
    return f"{where}: {why}" if where else why
