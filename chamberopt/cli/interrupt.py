"""Handle Ctrl-C: it ends a command at once, and a study after its running evaluations.

A simulation is ended with a result of what has ended by then.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Self

INTERRUPTED = "interrupted"
FIRST = "finishing what runs, then stopping; press Ctrl-C again to stop now"
SECOND = "stopped; the running evaluations are lost, all earlier ones are on disk"
EARLY = "interrupted; no evaluation was running"
KEEPING = "keeping what is simulated by now, then stopping; press Ctrl-C again to stop now"
SHOW_CURSOR = "\033[?25h"  # a progress bar hides it


# An exception that is raised inside this code is lost, or leaves a module half imported.
IMPORTS, COMPILERS = "<frozen importlib", ("numba", "llvmlite")
_requested = False  # whether Ctrl-C was pressed since the command began


@contextmanager
def interruptible() -> Iterator[None]:
    """Let Ctrl-C end the command, by KeyboardInterrupt or by ending the process at once.

    The process ends at once if Python would lose KeyboardInterrupt. An import, with which a command
    begins, loses it. If the user presses Ctrl-C a second time, the first was lost. No file
    is damaged, because files get their names when they are complete. Threads that simulate end with
    the process.
    """
    global _requested
    _requested = False

    def on_signal(number: int, frame: FrameType | None) -> None:
        global _requested
        if _requested or _would_be_lost(frame):
            _write(INTERRUPTED)
            os._exit(130)
        _requested = True
        raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, on_signal)
    if before is signal.SIG_IGN:  # a script's background job: Ctrl-C is not meant for this process
        signal.signal(signal.SIGINT, before)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if _requested:
        sys.stdout.flush()
        os._exit(130)


def is_requested() -> bool:
    """Return whether Ctrl-C was pressed since the command began."""
    return _requested


@contextmanager
def first_only_asks() -> Iterator[Callable[[], bool]]:
    """Let the first Ctrl-C in the block ask to stop and keep what is done; a second ends at once.

    Yields the function that tells whether it was pressed.
    """

    def on_signal(number: int, frame: FrameType | None) -> None:
        global _requested
        if _requested:
            _write(INTERRUPTED)
            os._exit(130)
        _requested = True
        _write(KEEPING)

    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or before is signal.SIG_IGN:
        yield is_requested
        return
    signal.signal(signal.SIGINT, on_signal)
    try:
        yield is_requested
    finally:
        signal.signal(signal.SIGINT, before)


def ignore_late_ctrl_c() -> None:
    """Ignore Ctrl-C at the end of a process whose command is done.

    Python still waits for threads at this point, and the signal would change the exit status.
    """
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.SIG_IGN)


def _would_be_lost(frame: FrameType | None) -> bool:
    while frame is not None:
        package = str(frame.f_globals.get("__name__", "")).partition(".")[0]
        if frame.f_code.co_filename.startswith(IMPORTS) or package in COMPILERS:
            return True
        frame = frame.f_back
    return False


class Interrupt:
    """Handle Ctrl-C while a study runs inside the `with` block of this object.

    requested: True once the user wants to stop.

    Until `wait_for_evaluation` is called, Ctrl-C ends the process with os._exit. An exception would
    not work. Python drops an exception during the import of a module. An exception during
    compilation can crash the compiler. Python would also wait for replicas that run in threads.
    No finished trial is lost: a trial is on disk as soon as the trial and all earlier trials are
    finished, and files are written atomically.
    """

    def __init__(self) -> None:
        self.requested = False
        self._waits, self._how_to_resume = False, ""

    def __enter__(self) -> Self:
        self._before = signal.getsignal(signal.SIGINT)
        # A script's background job ignores SIGINT: Ctrl-C is then not meant for this process.
        if self._before is not signal.SIG_IGN:
            signal.signal(signal.SIGINT, self._on_signal)
        return self

    def __exit__(self, *_: object) -> None:
        signal.signal(signal.SIGINT, self._before)

    def wait_for_evaluation(self, how_to_resume: str) -> None:
        """From now on, let the first Ctrl-C stop the study only after its running evaluations.

        A second Ctrl-C ends the process at once and prints `how_to_resume`.
        """
        self._waits, self._how_to_resume = True, how_to_resume

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        if self._waits and not self.requested:
            self.requested = True
            _write(FIRST)
            return
        _write(f"{SECOND}\n{self._how_to_resume}" if self._waits else EARLY)
        os._exit(130)


def _write(text: str) -> None:
    """Write to the terminal without `print`, because the signal can interrupt a `print`."""
    cursor = SHOW_CURSOR if sys.stderr.isatty() else ""
    os.write(2, f"\n{text}{cursor}\n".encode(errors="backslashreplace"))
