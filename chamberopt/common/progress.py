"""What a person sees while something long runs: a bar with best-so-far and time left, never in a pipe."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from sim_core import Physics

Progress = Callable[[int, int, "float | None"], None]
"""Called as progress(done, total, best so far or None)."""


@contextmanager
def progress_bar(what: str, stream: TextIO | None = None) -> Iterator[Progress]:
    """A bar for the time of a `with` block, as a function (done, total, best so far or None).

    Goes to stderr (or `stream`), and is silent where that is not a terminal: logs and pipes stay clean.
    """
    stream = stream or sys.stderr
    if not stream.isatty():
        yield lambda done, total, best: None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )
    from rich.progress import Progress as Bar

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[best]}", style="bold"),
        TimeElapsedColumn(),
        TextColumn("left", style="dim"),
        # An evaluation can take seconds: the estimate looks back over all of them (speed_estimate_period).
        TimeRemainingColumn(),
    )
    with Bar(
        *columns, console=Console(file=stream), speed_estimate_period=3600, transient=True
    ) as bar:
        task = bar.add_task(what, total=None, best="")

        def show(done: int, total: int, best: float | None) -> None:
            bar.update(
                task, completed=done, total=total, best="" if best is None else f"best {best:.4f}"
            )

        yield show


def compile_with_message(
    physics: Physics,
    balls: int,
    alike: bool = True,
    bore: bool = False,
    stream: TextIO | None = None,
) -> float:
    """Compiles the simulator for these effects if it never was, here, and says so; seconds it took, else 0."""
    import sim_core

    stream = stream or sys.stderr
    if sim_core.is_compiled(physics, balls, alike, bore):
        return 0.0
    print("compiling the simulator (once per set of effects) ...", file=stream, flush=True)
    seconds = float(sim_core.compile_simulator(physics, balls, alike, bore))
    print(f"compiled in {seconds:.0f} s", file=stream, flush=True)
    return seconds
