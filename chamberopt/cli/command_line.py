"""Run one command. An error that the user can correct becomes one message and an exit status."""

from __future__ import annotations

import errno
import logging
import sys
from collections.abc import Sequence
from concurrent.futures import BrokenExecutor
from io import TextIOWrapper

from cyclopts import CycloptsError

from chamberopt.cli import commands  # noqa: F401  # registers every command with the app
from chamberopt.cli.console import show
from chamberopt.cli.interrupt import INTERRUPTED
from chamberopt.cli.options import app
from chamberopt.common.errors import InputError
from chamberopt.common.progress import write_json_lines

PROGRESS = "--progress"
UNUSABLE_NAME = (errno.ENAMETOOLONG, errno.ELOOP)


def run_command(arguments: Sequence[str] | None = None) -> int:
    """Run the command in `arguments`, by default sys.argv, and return its exit status."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            # A terminal that cannot show "±" must not end the command before it prints its results.
            stream.reconfigure(errors="backslashreplace")
    # matplotlib warns on stderr if it cannot keep its cache, for example without a home folder.
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    try:
        given = _without_progress(list(sys.argv[1:] if arguments is None else arguments))
        app(given, exit_on_error=False, print_error=False, result_action="return_value")
    except CycloptsError as error:
        return _fail(f"{str(error).rstrip()} (chamberopt --help lists commands and options)", 2)
    except InputError as error:
        return _fail(str(error), 2, error)
    except KeyboardInterrupt as error:
        return _fail(INTERRUPTED, 130, error)
    except BrokenPipeError:  # the program that reads stdout has ended, as `head` does
        sys.stderr.close()
        return 0
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        if error.errno in UNUSABLE_NAME:
            return _fail(f"{where}{error.strerror}; check the path", 2)
        return _fail(f"{where}{error.strerror or error}", 1, error)
    except MemoryError as error:
        return _fail("out of memory", 1, error)
    except BrokenExecutor as error:
        cause = "killed from outside, or out of memory: use fewer workers"
        what = str(error) or "a worker process died, twice"
        return _fail(f"{what} ({cause})", 1, error)
    except (ValueError, RuntimeError) as error:
        import sim_core

        if isinstance(error, sim_core.SceneError):
            return _fail(str(error), 2, error)
        if isinstance(error, sim_core.SimulationError):
            return _fail(f"the simulation stopped: {error}", 1, error)
        raise  # a fault of the program, not of the user
    return 0


def _without_progress(given: list[str]) -> list[str]:
    """Return the arguments without `--progress jsonl`, which every command accepts.

    If the option is there, progress is written as lines of JSON from now on.
    """
    if PROGRESS not in given:
        return given
    k = given.index(PROGRESS)
    if given[k + 1 : k + 2] != ["jsonl"]:
        raise InputError(f"{PROGRESS}: allowed: jsonl, lines of JSON on stderr for other programs")
    write_json_lines()
    return given[:k] + given[k + 2 :]


def _fail(message: str, status: int, error: BaseException | None = None) -> int:
    """Print a message and the notes of an error to stderr, and return `status`.

    The notes name the candidate that failed and say how to go on.
    """
    show([message, *getattr(error, "__notes__", ())], sys.stderr)
    return status
