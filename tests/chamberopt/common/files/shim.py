"""Run a command with the system calls of the file layer counted, and one of them failing."""

from __future__ import annotations

import builtins
import fcntl
import io
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from chamberopt.cli import main
from chamberopt.common.files import written

CALLS = ((os, "open"), (os, "write"), (os, "fsync"), (os, "replace"), (os, "mkdir"),
         (fcntl, "flock"))  # fmt: skip


def run_failing(words: Sequence[str]) -> int:
    """Run a command whose n-th call fails; the number of calls ends what it prints.

    Args:
        words: n, or 0 for none; the error's number; "once", or "on" for this and all later calls;
            then those of the command, or "save" for the page's Save.
    """
    number, error, how, *command = words
    counter = Counter(int(number), int(error), how == "on")
    counter.watch()
    status = save() if command == ["save"] else main(command)
    print(f"\ncalls: {counter.count}", flush=True)
    return status


def save() -> int:
    """Save a change of a design as the page does."""
    from chamberopt.common.errors import InputError
    from chamberopt.output.editor.edited_file import EditedFile

    try:
        EditedFile(Path("design.toml"), trusted=False).save({"chamber.height_mm": 31.0})
    except InputError as error:
        builtins.print(error, file=os.sys.stderr)
        return 2
    except OSError as error:
        builtins.print(f"{error.filename}: {error.strerror}", file=os.sys.stderr)
        return 1
    return 0


class Counter:
    """Counts calls that concern the folder in which the command runs, and fails one of them."""

    def __init__(self, number: int, error: int, stays: bool) -> None:
        self.count, self._number, self._error, self._stays = 0, number, error, stays

    def watch(self) -> None:
        for module, name in CALLS:
            setattr(module, name, self._counted(getattr(module, name)))
        counter = self

        class File(io.FileIO):
            def write(self, content: Any) -> int:
                counter.tick()
                return super().write(content)

        def opened(name: str, mode: str, opener: Callable[..., int]) -> io.BufferedRandom:
            return io.BufferedRandom(File(name, mode.replace("b", ""), opener=opener))

        written.open = opened  # type: ignore[attr-defined]

    def tick(self) -> None:
        self.count += 1
        if self.count == self._number or (self._stays and 0 < self._number <= self.count):
            raise OSError(self._error, os.strerror(self._error))

    def _counted(self, call: Callable[..., Any]) -> Callable[..., Any]:
        here = os.getcwd()

        def counted(*given: Any, **named: Any) -> Any:
            # Descriptors are those of the layer; other folders hold caches and fonts.
            if isinstance(given[0], int) or os.path.abspath(given[0]).startswith(here):
                self.tick()
            return call(*given, **named)

        return counted
