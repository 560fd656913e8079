"""Show on stderr how far a command has come: its named steps with counts and time left.

After `write_json_lines` each step writes lines of JSON, for a program to read: {"step": name,
"done": 3, "total": 20, "best": 0.81}, and at its end {"step": name, "ended": true}. What a command
knows before its end is a line too, such as {"draft": {...}} of a proposal, or {"held": {"balls": 2,
"place": "(1.0, 2.0, 3.0) mm"}} of balls that are held in gaps.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, TextIO

if TYPE_CHECKING:
    from rich.progress import Progress as Display

# Called as progress(done, total, best value so far or None); total is 0 where it is not known. What
# is done may hold parts of an item.
Progress = Callable[[float, int, "float | None"], None]

# s until a step gets a line in a log; each further line comes after twice the time
FIRST_LINE = 30.0
FEW, FEW_SHARE = 3, 0.1  # items done, and share of all: from the fewer on their pace is told
LEAST_PAUSE = 0.2  # s between JSON lines of a step
_json_lines = _is_quiet = False
# display on the terminal now, at most one: steps within steps share it
_displays: list[Display] = []
_counted = 0  # steps that run now and told a total at their beginning


class StoppedError(Exception):
    """Raised by a function of type Progress, to end a step that the user has stopped."""


def write_json_lines() -> None:
    """Make all later steps write their progress as lines of JSON."""
    global _json_lines
    _json_lines = True


def tell_program(name: str, known: Callable[[], Mapping[str, object]]) -> None:
    """Write what is known so far as a line of JSON, where a program reads those of steps.

    Args:
        known: works it out, only where it is read.
    """
    if _json_lines and not _is_quiet:
        _write_json({name: known()}, sys.stderr)


@contextmanager
def no_steps() -> Iterator[None]:
    """Show no step during a `with` block, in no thread."""
    global _is_quiet
    before, _is_quiet = _is_quiet, True
    try:
        yield
    finally:
        _is_quiet = before


@contextmanager
def step(
    what: str, total: int | None = None, *, stream: TextIO | None = None
) -> Iterator[Progress]:
    """Show a named step of a command during a `with` block.

    Yields the function that the block calls as progress(done, total, best value so far or None).
    `total` is the number of items to do, if it is known at the beginning.

    On a terminal the step has a line on stderr (or `stream`) from its beginning to its end, below
    the line of the step in whose `with` block it runs. In a Jupyter notebook the line is below the
    cell. To a log or a pipe, a long step writes a plain line now and then. What runs within a step
    of a known total tells no time left, and nothing to a log: the outer step does.
    """
    global _counted
    stream, is_within = stream or sys.stderr, _counted > 0
    _counted += total is not None
    try:
        with _shown(what, total, stream, is_within) as told:
            yield told
    finally:
        _counted -= total is not None


@contextmanager
def _shown(what: str, total: int | None, stream: TextIO, is_within: bool) -> Iterator[Progress]:
    """Show a step as `step` says.

    Args:
        is_within: True if it runs within a step of a known total.
    """
    if _is_quiet:
        yield untold
        return
    if _json_lines:
        write = _json_writer(what, stream)
        write(0, total or 0, None)
        try:
            yield write
        finally:
            _write_json({"step": what, "ended": True}, stream)
        return
    if not _displays and not stream.isatty() and not _is_notebook():
        yield untold if is_within else _log_lines(what, stream)
        return
    with _display(stream) as display:
        row = display.add_task(what, total=None, count="", best="", left="")
        update = partial(_update, display, row, is_within)
        if total is not None:
            update(0, total, None)
        try:
            yield update
        finally:
            display.refresh()
            display.remove_task(row)


def untold(done: float, total: int, best: float | None) -> None:
    """Ignore the progress of a step that is not shown."""


def _is_notebook() -> bool:
    """Return True in a Jupyter notebook that can show a display which changes.

    rich draws it with ipywidgets. Without them, only lines of a log can be shown.
    """
    if "IPython" not in sys.modules or find_spec("ipywidgets") is None:
        return False
    from rich.console import Console

    return Console().is_jupyter


def _update(
    display: Display, row: Any, is_within: bool, done: float, total: int, best: float | None
) -> None:
    best_text = "" if best is None else f"best {best:.4f}"
    count = f"{int(done):,}/{total:,}" if total else f"{int(done):,} so far"
    known = None if is_within else total or None
    left = "left" if known else ""
    display.update(row, completed=done, total=known, count=count, best=best_text, left=left)


@contextmanager
def _display(stream: TextIO) -> Iterator[Display]:
    """Yield the terminal's progress display; the outermost step opens it, inner steps share it."""
    if _displays:
        yield _displays[0]
        return
    from rich import progress as rich
    from rich.console import Console

    columns = (
        "{task.description}",
        rich.BarColumn(),
        "[green]{task.fields[count]}",
        "[bold]{task.fields[best]}",
        rich.TimeElapsedColumn(),
        "[dim]{task.fields[left]}",
        rich.TimeRemainingColumn(),
    )
    # An evaluation can take seconds. The time left is estimated from all evaluations of the last
    # hour.
    console = Console(file=stream)
    with rich.Progress(
        *columns, console=console, speed_estimate_period=3600, transient=True, redirect_stdout=False
    ) as display:
        _displays.append(display)
        try:
            yield display
        finally:
            _displays.clear()


def _json_writer(what: str, stream: TextIO) -> Progress:
    due = 0.0

    def write(done: float, total: int, best: float | None) -> None:
        nonlocal due
        if time.monotonic() >= due or done == total:
            due = time.monotonic() + LEAST_PAUSE
            found = {"step": what, "done": round(done, 2), "total": total, "best": best}
            _write_json(found, stream)

    return write


def _write_json(found: Mapping[str, object], stream: TextIO) -> None:
    """Write a line of JSON in one piece, as steps of several threads write to one stream."""
    stream.write(f"{json.dumps(found)}\n")
    stream.flush()


def _log_lines(what: str, stream: TextIO) -> Progress:
    begun = time.monotonic()
    due, first = begun + FIRST_LINE, None

    def write(done: float, total: int, best: float | None) -> None:
        nonlocal due, first
        now = time.monotonic()
        if first is None or done < first[1]:  # or what is counted has begun anew
            first = now, done  # earlier work, such as compiling, is not counted
        if now < due or not first[1] < done < total:
            return
        due = now + (now - begun)
        found = "" if best is None else f", best {best:.4f}"
        left = (now - first[0]) * (total - done) / (done - first[1])
        known = done - first[1] >= min(FEW, FEW_SHARE * total)  # the first may be slow, as resumed
        # Less than a second is a step whose first part was quick, not one that is about to end.
        time_left = f", about {left:.0f} s left" if known and left >= 1.0 else ""
        print(f"{what}: {int(done):,} of {total:,}{found}{time_left}", file=stream, flush=True)

    return write
