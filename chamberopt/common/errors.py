"""Errors that a user can put right, errors of lost workers, and text that is safe to show."""

from __future__ import annotations

import re
from concurrent.futures import BrokenExecutor
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pydantic import ValidationError

FORMULA = ("=", "+", "-", "@", "\t", "\n")  # the beginnings of one in spreadsheet programs
# Characters that a terminal obeys instead of showing them, or that reverse the text.
CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")


class InputError(Exception):
    """A design, study, mesh or result folder cannot be used as it is.

    The message is one sentence with the field, file or triangle and the remedy. The command line
    prints the message alone and exits with status 2.
    """


class UnreadableError(InputError):
    """A file cannot be read now, by no fault of the design or candidate that names it."""


class OutputTakenError(InputError):
    """The place for a result holds something, or another process writes to it."""


class WorkerLostError(BrokenExecutor):
    """A worker died while it ran a task, and so did the worker that tried again."""


class ClusterLostError(BrokenExecutor):
    """The cluster ended with tasks unfinished; the command line exits with status 1."""


def visible(text: str) -> str:
    """The text with control characters as escapes; it keeps its tabs and line breaks."""
    return CONTROL.sub(lambda one: one[0].encode("unicode_escape").decode(), text)


def one_line(text: str) -> str:
    """The text as `visible` gives it, with line breaks as escapes too."""
    return visible(text).replace("\n", "\\n")


def spreadsheet_cell(value: Any) -> Any:
    """A value of a .csv file; a text that a spreadsheet would take for a formula is quoted.

    A carriage return becomes a line feed: the csv module leaves it without quotes, and a
    spreadsheet begins a row after it.

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
    """Where the first wrong value of a program's own file lies, and what is wrong with it."""
    first = error.errors(include_url=False, include_input=False)[0]
    where, why = ".".join(map(str, first["loc"])), first["msg"].removeprefix("Value error, ")
    return f"{where}: {why}" if where else why
