"""Ctrl-C in a study: the first lets the evaluation under way finish and be saved, the second stops at once."""

from __future__ import annotations

import os
import signal
import sys
from types import FrameType
from typing import Self

FIRST = "finishing this evaluation, then stopping; Ctrl-C again to stop now"
SECOND = "stopped; the evaluation under way is lost, all before it are on disk"
EARLY = "interrupted; no evaluation was under way"
SHOW_CURSOR = "\033[?25h"  # a progress bar hides it


class Interrupt:
    """Takes SIGINT for the time of a `with` block; `asked` says that the user wants to stop.

    Until `be_patient` a Ctrl-C ends the process. No exception does it: Python drops one that comes while a module is
    being imported, in the middle of compiling it can crash, and replicas that run in threads would be waited for.
    Nothing can be lost: every row of a record is on disk before the next evaluation begins, and no file takes its name
    half written.
    """

    def __init__(self) -> None:
        self.asked = False
        self._patient, self._how_to_go_on = False, ""

    def __enter__(self) -> Self:
        self._before = signal.getsignal(signal.SIGINT)
        if (
            self._before is not signal.SIG_IGN
        ):  # as in the background of a script, where Ctrl-C is not meant for us
            signal.signal(signal.SIGINT, self._on_signal)
        return self

    def __exit__(self, *_: object) -> None:
        signal.signal(signal.SIGINT, self._before)

    def be_patient(self, how_to_go_on: str) -> None:
        """From here on what is under way is finished first, unless Ctrl-C comes twice."""
        self._patient, self._how_to_go_on = True, how_to_go_on

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        if self._patient and not self.asked:
            self.asked = True
            _say(FIRST)
            return
        _say(f"{SECOND}\n{self._how_to_go_on}" if self._patient else EARLY)
        os._exit(130)


def _say(text: str) -> None:
    """Straight to the terminal: a signal can come in the middle of a print."""
    cursor = SHOW_CURSOR if sys.stderr.isatty() else ""
    os.write(2, f"\n{text}{cursor}\n".encode(errors="backslashreplace"))
