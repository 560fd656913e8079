"""The command line: thin, one function a command. Results go to stdout, progress and errors to stderr.

Exit status: 0 done, 1 the simulation, a worker or the disk failed, 2 something to put right in the input,
130 interrupted. Heavy packages (numba, trimesh, pyvista, sklearn) are imported inside the commands: --help answers at
once.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from concurrent.futures import BrokenExecutor
from io import TextIOWrapper

from cyclopts import CycloptsError

from chamberopt.cli import compare, designs, export, flight, inspect, report, studies
from chamberopt.cli.options import app
from chamberopt.common.errors import InputError

# The modules register their commands.
__all__ = ["app", "compare", "designs", "export", "flight", "inspect", "main", "report", "studies"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command; its exit status. Every error a user can put right is one message on stderr."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(
                errors="backslashreplace"
            )  # a terminal without ± must not cost the figures
    try:
        app(
            list(sys.argv[1:] if arguments is None else arguments),
            exit_on_error=False,
            print_error=False,
            result_action="return_value",
        )
    except CycloptsError as error:
        return _failed(f"{str(error).rstrip()} (chamberopt --help lists what there is)", 2)
    except InputError as error:
        return _failed(str(error), 2)
    except KeyboardInterrupt as error:
        return _failed("interrupted; what had been finished stays on disk", 130, error)
    except BrokenPipeError:  # the reader of our stdout left, as `head` does
        sys.stderr.close()
        return 0
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        return _failed(
            f"{where}{error.strerror or error}; what had been finished stays on disk", 1, error
        )
    except MemoryError as error:
        return _failed("out of memory; what had been finished stays on disk", 1, error)
    except BrokenExecutor as error:
        what = f"{str(error) or 'a worker process died, twice'} (killed from outside, or out of memory: use fewer workers)"
        return _failed(f"{what}; what had been finished stays on disk", 1, error)
    except (ValueError, RuntimeError) as error:
        return _simulator_failed(error)
    return 0


def _simulator_failed(error: Exception) -> int:
    """sim_core's own two errors; anything else is ours, and shows where it came from."""
    import sim_core

    if isinstance(error, sim_core.SceneError):
        return _failed(str(error), 2, error)
    if isinstance(error, sim_core.SimulationError):
        return _failed(f"the simulation stopped: {error}", 1, error)
    raise error


def _failed(message: str, status: int, error: BaseException | None = None) -> int:
    """Says what went wrong, and what was noted on the way up: which candidate it was, how to go on."""
    print("\n".join([message, *getattr(error, "__notes__", ())]), file=sys.stderr)
    return status
