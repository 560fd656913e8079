"""Run the command line. commands/ has a file for each command, and this folder their shared code.

Results go to stdout. Progress, remarks and errors go to stderr.

Exit status:
    0: the command is done.
    1: the simulation, a worker process or the disk failed.
    2: the input must be corrected.
    130: the user interrupted the command.

Commands import heavy packages (numba, trimesh, pyvista, sklearn) inside their functions, so that
--help answers at once.
"""

from __future__ import annotations

import gc
import os
from collections.abc import Sequence

from chamberopt.cli.interrupt import ignore_late_ctrl_c, interruptible

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status. Ctrl-C ends it from its first moment."""
    # Imported modules and compiled code stay in memory. Scanning them for garbage took 7 % of time.
    gc.set_threshold(100_000, 50, 1000)
    # Child processes must not import modules from the folder in which they are started.
    os.environ["PYTHONSAFEPATH"] = "1"
    with interruptible():
        from chamberopt.cli.command_line import run_command

        status = run_command(arguments)
    if arguments is None:
        ignore_late_ctrl_c()
        gc.freeze()  # the process ends here: searching its modules for garbage took a second
    return status
