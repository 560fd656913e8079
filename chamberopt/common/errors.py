"""Errors that a user can put right, and errors of lost workers."""

from __future__ import annotations

from concurrent.futures import BrokenExecutor
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pydantic import ValidationError


class InputError(Exception):
    """A design, study, mesh or result folder cannot be used as it is.

    The message is one sentence with the field, file or triangle and the remedy. The command line
    prints the message alone and exits with status 2.
    """


class OutputTakenError(InputError):
    """The place for a result holds something, or another process writes to it."""


class WorkerLostError(BrokenExecutor):
    """A worker died while it ran a task, and so did the worker that tried again."""


class ClusterLostError(BrokenExecutor):
    """The cluster ended with tasks unfinished; the command line exits with status 1."""


def first_wrong_value(error: ValidationError) -> str:
    """Where the first wrong value of a program's own file lies, and what is wrong with it."""
    first = error.errors(include_url=False, include_input=False)[0]
    where, why = ".".join(map(str, first["loc"])), first["msg"].removeprefix("Value error, ")
    return f"{where}: {why}" if where else why
