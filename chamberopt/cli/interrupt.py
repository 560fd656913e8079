"""Ctrl-C in a study: the first waits for the running evaluation, the second stops at once."""

from __future__ import annotations

import os
import signal
import sys
from types import FrameType
from typing import Self

FIRST = "finishing this evaluation, then stopping; press Ctrl-C again to stop now"
SECOND = "stopped; the running evaluation is lost, all earlier ones are on disk"
EARLY = "interrupted; no evaluation was running"
SHOW_CURSOR = "\033[?25h"  # a progress bar hides it


class Interrupt:
    """Handle SIGINT during a `with` block; `requested` is True once the user wants to stop.

    Until `wait_for_evaluation` is called, Ctrl-C ends the process with os._exit. An exception would
    not do: Python drops one that comes while a module is imported, one during compilation can crash
    the compiler, and replicas that run in threads would be waited for. Nothing can be lost: each
    trial is on disk before the next evaluation begins, and files are written atomically.
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
        """From now on finish the running evaluation first, unless Ctrl-C comes twice."""
        self._waits, self._how_to_resume = True, how_to_resume

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        if self._waits and not self.requested:
            self.requested = True
            _write(FIRST)
            return
        _write(f"{SECOND}\n{self._how_to_resume}" if self._waits else EARLY)
        os._exit(130)


def _write(text: str) -> None:
    """Write to the terminal without `print`: the signal can come in the middle of one."""
    cursor = SHOW_CURSOR if sys.stderr.isatty() else ""
    os.write(2, f"\n{text}{cursor}\n".encode(errors="backslashreplace"))
