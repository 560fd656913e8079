"""Run commands of the command line that the page starts, each in a child process."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from threading import Lock, Thread
from typing import IO, Any

from chamberopt.common.child import GRACE_S, start_python
from chamberopt.common.errors import InputError
from chamberopt.common.files import RESULT
from chamberopt.page.page_words import at_keys, on_page

WARNING = "warning: "  # begins a line
JSON = "--json"  # option of a command that is asked for JSON
MOST_LINES = 200  # lines of a command's remarks that the page shows, the last ones
COMMAND = (
    "from chamberopt.common.child import interrupt_with_parent; interrupt_with_parent(); "
    "from chamberopt.cli import main; sys.exit(main())"
)


class StartedCommand:
    """A chamberopt command that runs in a folder, and the lines that it has printed so far."""

    def __init__(self, arguments: Sequence[str], folder: Path, result: str = "") -> None:
        self.arguments, self._folder, self._result = list(arguments), folder, result
        self._lines: list[str] = []
        self._answer: list[str] = []  # lines of JSON, of a command that was asked for JSON
        self._steps: dict[str, dict[str, Any]] = {}
        # Number of the present one, names and count of all, and the times at which they began [s].
        self._stage: dict[str, Any] | None = None
        self._stages_began: dict[int, float] = {}
        self._draft: dict[str, Any] | None = None  # a proposal before its pilots
        self._held: dict[str, Any] = {}  # balls that are held in gaps as it simulates
        self._began = time.monotonic()
        self._process = start_python(
            COMMAND,
            *arguments,
            "--progress",
            "jsonl",
            cwd=folder,
            # Ctrl-C is for the server, which tells the command once. Windows has groups for it.
            start_new_session=True,
            creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
            env={**os.environ, "PYTHONIOENCODING": "utf-8"},  # pipes of Windows have another
            stderr=subprocess.PIPE,
            text=True,
            encoding="utf-8",
            errors="replace",
        )
        printed = self._answer if JSON in arguments else self._lines
        streams = (self._process.stdout, printed), (self._process.stderr, self._lines)
        self._readers = [Thread(target=self._read, args=one, daemon=True) for one in streams]
        for one in self._readers:
            one.start()

    def status(self) -> dict[str, object]:
        """Return what the page shows of the command: printed lines and progress of its steps.

        The value `exit` is the exit status of the command, or None while it runs. `result` is the
        folder of the result that it will leave, if any, and `kept` whether it has left it: also a
        simulation that was stopped may. `printed` are its lines in the words of the
        page, as its warnings are; `fault` are those where it failed, and `at` has what the last of
        them says of an option. `answer` is what a command that was asked for JSON has answered, or
        None. `draft` is a proposal before its pilots, while the command runs, and `stage` the
        number of its present stage, count and names of all, and when those so far `began` [s].
        `held` tells of balls that are held in gaps in a replica that runs now, if any: their count
        and a place.
        """
        code = self._process.poll()
        if code is not None:
            for one in self._readers:
                one.join(5.0)
        lines = self._lines[-MOST_LINES:]
        warnings = [one.removeprefix(WARNING) for one in lines if one.startswith(WARNING)]
        printed = [words for words in map(on_page, lines) if words]
        return {
            "command": f"chamberopt {' '.join(self.arguments)}",
            "result": self._result,
            "kept": code is not None and (self._folder / self._result / RESULT).is_file(),
            "seconds": round(time.monotonic() - self._began),
            "steps": [] if code is not None else list(self._steps.values()),
            "lines": lines,
            "warnings": [on_page(text) for text in warnings],
            "printed": printed,
            "fault": printed if code else [],
            "at": at_keys(lines[-1]) if code and lines else {},
            "exit": code,
            "stage": self._stage and {**self._stage, "began": self._stages_began},
            "draft": self._draft if code is None else None,
            "held": self._held if code is None and self._held.get("balls") else None,
            "answer": json.loads("".join(self._answer)) if self._answer and code == 0 else None,
        }

    def stop(self) -> None:
        """Interrupt the command as Ctrl-C does."""
        if self._process.poll() is None:
            if sys.platform != "win32":
                self._process.send_signal(signal.SIGINT)
            else:
                self._close_pipe()

    def end(self) -> None:
        """End the command and its child processes within seconds; files on the disk stay."""
        self._close_pipe()
        try:
            self._process.wait(2.0 * GRACE_S)
        except subprocess.TimeoutExpired:
            if sys.platform != "win32":
                os.killpg(self._process.pid, signal.SIGKILL)
            self._process.kill()

    def _close_pipe(self) -> None:
        if self._process.stdin is not None:
            self._process.stdin.close()

    def _read(self, stream: IO[str], lines: list[str]) -> None:
        """Take the lines that the command prints to a stream until its end, its steps apart."""
        for line in stream:
            told = _told(line)
            if told is None:
                lines.append(line.rstrip("\n"))
            elif "draft" in told:
                self._draft = told["draft"]
            elif "stage" in told:
                self._stage = told["stage"]
                now = time.monotonic() - self._began
                self._stages_began[self._stage["number"]] = round(now, 1)
            elif "held" in told:
                self._held = told["held"]
            elif told.get("ended"):
                self._steps.pop(told["step"], None)
            else:
                self._steps[told["step"]] = told


def _told(line: str) -> dict[str, Any] | None:
    """Return what a command prints for a program as a line of JSON, or None for other lines."""
    if not line.startswith(('{"step"', '{"draft"', '{"stage"', '{"held"')):
        return None
    try:
        return dict(json.loads(line))
    except ValueError:
        return None


class OneCommand:
    """The command that the page has started last; a further one starts when it has ended."""

    def __init__(self) -> None:
        self._command: StartedCommand | None = None
        self._starting = Lock()

    def start(self, arguments: Sequence[str], folder: Path, result: str = "") -> dict[str, object]:
        """Start a command in a folder, and return its status.

        Args:
            arguments: those of the command line.
            result: folder that the command will leave, if any.

        Raises InputError if a command is running.
        """
        with self._starting:
            if self._command is not None and self._command.status()["exit"] is None:
                raise InputError("a command is running; stop it first, or wait for its end")
            self._command = StartedCommand(arguments, folder, result)
            return self._command.status()

    def status(self) -> dict[str, object]:
        """Return what the page shows of the command, or nothing if none was started."""
        return self._command.status() if self._command else {}

    def stop(self) -> None:
        if self._command:
            self._command.stop()

    def end(self) -> None:
        if self._command:
            self._command.end()
