"""The command line: one file for each command in commands/, what they share beside it.

Results go to stdout; progress, remarks and errors go to stderr. Exit status: 0 done; 1 the
simulation, a worker process or the disk failed; 2 the input must be corrected; 130 interrupted.
Heavy packages (numba, trimesh, pyvista, sklearn) are imported inside the commands, so that
--help answers at once.
"""

from __future__ import annotations

import gc
import os
from collections.abc import Sequence

from chamberopt.cli.interrupt import ignore_late_ctrl_c, interruptible

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command, which Ctrl-C ends from its first moment; return its exit status."""
    # What is imported and compiled stays: looking through it again and again took 7 % of the time.
    gc.set_threshold(100_000, 50, 1000)
    # No process that is started here imports modules that lie in the folder where it is started.
    os.environ["PYTHONSAFEPATH"] = "1"
    with interruptible():
        from chamberopt.cli.command_line import run_command

        status = run_command(arguments)
    if arguments is None:
        ignore_late_ctrl_c()
    return status
