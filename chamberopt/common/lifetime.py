"""Processes that end with the one that started them, however that one ends.

The operating system closes a process's end of a pipe when the process ends, also when it is killed.
So the other end, which the started process watches in a thread, tells it on every system.
"""

from __future__ import annotations

import _thread
import os
import signal
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from multiprocessing import parent_process

GRACE_S = 2.0  # in which an interrupted command removes what it has not finished
ENDED = 130  # exit status, as after Ctrl-C


def end_with_stdin(clean_up: Callable[[], None] = lambda: None) -> None:
    """End this process when the pipe that is its standard input is closed.

    Args:
        clean_up: is called before.
    """

    def watch() -> None:
        with suppress(OSError):
            while os.read(0, 4096):
                pass
        clean_up()
        os._exit(ENDED)

    threading.Thread(target=watch, daemon=True).start()


def interrupt_with_stdin() -> None:
    """Interrupt this process as Ctrl-C does when its standard input is closed, and then end it."""

    def interrupt() -> None:
        if os.name == "posix":
            os.kill(os.getpid(), signal.SIGINT)
        else:
            _thread.interrupt_main()
        time.sleep(GRACE_S)

    end_with_stdin(interrupt)


def end_with_parent() -> None:
    """End this process of `multiprocessing` when the one that started it has ended.

    A worker that waits for its next task sees the end of its pipe, but one that works does not.
    """
    parent = parent_process()

    def watch() -> None:
        if parent is not None:
            parent.join()
            os._exit(ENDED)

    threading.Thread(target=watch, daemon=True).start()
