"""Run one command: every error that the user can correct is one message and an exit status."""

from __future__ import annotations

import errno
import sys
from collections.abc import Sequence
from concurrent.futures import BrokenExecutor
from io import TextIOWrapper

from cyclopts import CycloptsError

from chamberopt.cli import commands  # noqa: F401  # registers every command with the app
from chamberopt.cli.console import show
from chamberopt.cli.interrupt import KEPT
from chamberopt.cli.options import app
from chamberopt.common.errors import InputError

UNUSABLE_NAME = (errno.ENAMETOOLONG, errno.ELOOP)


def run_command(arguments: Sequence[str] | None = None) -> int:
    """Run one command, by default that of sys.argv, and return its exit status."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            # A terminal that cannot show ± must not end the command before its results are printed.
            stream.reconfigure(errors="backslashreplace")
    try:
        given = list(sys.argv[1:] if arguments is None else arguments)
        app(given, exit_on_error=False, print_error=False, result_action="return_value")
    except CycloptsError as error:
        return _fail(f"{str(error).rstrip()} (chamberopt --help lists commands and options)", 2)
    except InputError as error:
        return _fail(str(error), 2)
    except KeyboardInterrupt as error:
        return _fail(f"interrupted; {KEPT}", 130, error)
    except BrokenPipeError:  # the program that reads stdout has ended, as `head` does
        sys.stderr.close()
        return 0
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        if error.errno in UNUSABLE_NAME:
            return _fail(f"{where}{error.strerror}; check the path", 2)
        return _fail(f"{where}{error.strerror or error}; {KEPT}", 1, error)
    except MemoryError as error:
        return _fail(f"out of memory; {KEPT}", 1, error)
    except BrokenExecutor as error:
        cause = "killed from outside, or out of memory: use fewer workers"
        what = str(error) or "a worker process died, twice"
        return _fail(f"{what} ({cause}); {KEPT}", 1, error)
    except (ValueError, RuntimeError) as error:
        import sim_core

        if isinstance(error, sim_core.SceneError):
            return _fail(str(error), 2, error)
        if isinstance(error, sim_core.SimulationError):
            return _fail(f"the simulation stopped: {error}", 1, error)
        raise  # a fault of ours
    return 0


def _fail(message: str, status: int, error: BaseException | None = None) -> int:
    """Print the message and the notes of the error: the candidate concerned, how to go on."""
    show([message, *getattr(error, "__notes__", ())], sys.stderr)
    return status
