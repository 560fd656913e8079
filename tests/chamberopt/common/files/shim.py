"""Run a command whose system calls are counted, with one failing, or whose files are listed."""

from __future__ import annotations

import base64
import fcntl
import io
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from chamberopt.cli import main
from chamberopt.common.errors import InputError
from chamberopt.common.files import opened, written
from chamberopt.page.edited_file import EditedFile
from chamberopt.pictures import subprocess_drawing

CALLS = ((os, "open"), (os, "write"), (os, "fsync"), (os, "replace"), (os, "mkdir"),
         (fcntl, "flock"))  # fmt: skip
# Audit events, and how many of their arguments are names.
EVENTS = {
    "open": 1, "os.rename": 2, "os.remove": 1, "os.mkdir": 1, "os.rmdir": 1, "os.listdir": 1,
    "os.scandir": 1, "os.chmod": 1, "os.truncate": 1, "os.link": 2, "os.symlink": 2,
    "shutil.rmtree": 1, "tempfile.mkstemp": 1,
}  # fmt: skip


def run_failing(words: Sequence[str]) -> int:
    """Run a command whose n-th call fails; the number of calls ends what it prints.

    Args:
        words: n, or 0 for none; the error's number; "once", or "on" for this and later calls that
            make something; then those of the command, or "save" for the page's Save.
    """
    number, error, how, *command = words
    counter = Counter(int(number), int(error), how == "on")
    counter.watch()
    status = save() if command == ["save"] else main(command)
    print(f"\ncalls: {counter.count}", flush=True)
    return status


def save() -> int:
    """Save a change of a design as the page does."""
    try:
        EditedFile(Path("design.toml"), trusted=False).save({"chamber.height_mm": 31.0})
    except InputError as error:
        print(error, file=sys.stderr)
        return 2
    except OSError as error:
        print(f"{error.filename}: {error.strerror}", file=sys.stderr)
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

        def open_file(name: str, mode: str, opener: Callable[..., int]) -> io.BufferedRandom:
            return io.BufferedRandom(File(name, mode.replace("b", ""), opener=opener))

        written.open = open_file  # type: ignore[attr-defined]

    def tick(self, makes: bool = True) -> None:
        """Count a call; a full disk goes on failing those that make something."""
        self.count += 1
        goes_on = self._stays and makes and 0 < self._number <= self.count
        if self.count == self._number or goes_on:
            raise OSError(self._error, os.strerror(self._error))

    def _counted(self, call: Callable[..., Any]) -> Callable[..., Any]:
        here = os.getcwd()

        def counted(*given: Any, **named: Any) -> Any:
            # Descriptors are those of the layer; other folders hold caches and fonts.
            if isinstance(given[0], int) or os.path.abspath(given[0]).startswith(here):
                opens = call.__name__ == "open"
                self.tick(not opens or bool(given[1] & os.O_CREAT))
            return call(*given, **named)

        return counted


def run_traced(words: Sequence[str]) -> int:
    """Run a command, and print each name in this folder that it opens, makes, or removes.

    A line is "traced: r NAME" for what is only read, and w for the rest.
    """
    opened.BY_DESCRIPTOR = False  # so that each event tells the whole name
    here, seen = Path.cwd(), set()

    def hook(event: str, given: tuple[Any, ...]) -> None:
        for name in given[: EVENTS.get(event, 0)]:
            if isinstance(name, (str, os.PathLike)):
                path = Path(os.path.abspath(name))
                writes = event != "open" or bool(given[2] & (os.O_RDWR | os.O_WRONLY | os.O_CREAT))
                if path.is_relative_to(here) and path != here:
                    seen.add(f"traced: {'rw'[writes]} {path.relative_to(here).as_posix()}")

    sys.addaudithook(hook)
    status = run_drawing(words)
    print("\n" + "\n".join(sorted(seen)), flush=True)
    return status


# A picture of one pixel, which a process sheet can show.
PIXEL = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="
)


def run_drawing(words: Sequence[str]) -> int:
    """Run a command, or "save"; pictures of VTK are written, but have nothing on them."""

    def drawn(render: Any, job: Any, picture: str | Path, *_: Any, **__: Any) -> None:
        written.write_bytes(Path(picture), PIXEL)

    subprocess_drawing.missing_opengl = lambda: None
    for module in list(sys.modules.values()):
        if vars(module).get("draw_in_subprocess"):
            module.draw_in_subprocess = drawn  # type: ignore[attr-defined]
    return save() if list(words) == ["save"] else main(words)
