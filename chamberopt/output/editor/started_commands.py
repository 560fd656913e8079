"""Commands that the page starts: the same as those of the command line, in processes of theirs."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from threading import Thread
from typing import Any

MOST_LINES = 200  # of a command's remarks that the page shows


class StartedCommand:
    """A command in a folder, with what it has printed."""

    def __init__(self, arguments: Sequence[str], folder: Path) -> None:
        self.arguments = list(arguments)
        self._lines: list[str] = []
        self._steps: dict[str, dict[str, Any]] = {}
        self._process = subprocess.Popen(
            [sys.executable, "-m", "chamberopt", *arguments, "--progress", "jsonl"],
            cwd=folder,
            start_new_session=True,  # Ctrl-C is for the server, which tells it once
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            encoding="utf-8",
            errors="replace",
        )
        self._reader = Thread(target=self._read, daemon=True)
        self._reader.start()

    def status(self) -> dict[str, Any]:
        """What the page shows; `exit` is None while the command runs."""
        code = self._process.poll()
        if code is not None:
            self._reader.join(5.0)
        return {
            "command": f"chamberopt {' '.join(self.arguments)}",
            "steps": [] if code is not None else list(self._steps.values()),
            "lines": self._lines[-MOST_LINES:],
            "exit": code,
        }

    def stop(self) -> None:
        """As Ctrl-C: what was done is kept where the command keeps it."""
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)

    def _read(self) -> None:
        for line in self._process.stdout or ():
            step = _step(line)
            if step is None:
                self._lines.append(line.rstrip("\n"))
            elif step.get("ended"):
                self._steps.pop(step["step"], None)
            else:
                self._steps[step["step"]] = step


def _step(line: str) -> dict[str, Any] | None:
    """What a line says of a step (see common/progress.py); None for any other line."""
    if not line.startswith('{"step"'):
        return None
    try:
        return dict(json.loads(line))
    except ValueError:
        return None
