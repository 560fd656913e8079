"""Progress on the terminal: a bar with the best value so far and the time left."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from sim_core import Physics

# Called as progress(done, total, best value so far or None).
Progress = Callable[[int, int, "float | None"], None]


@contextmanager
def progress_bar(what: str, stream: TextIO | None = None) -> Iterator[Progress]:
    """Show a progress bar during a `with` block, and give the function that updates it.

    The bar goes to stderr (or `stream`). Nothing is shown where that is not a terminal, so that
    logs and pipes stay clean.
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
        TimeRemainingColumn(),
    )
    # An evaluation can take seconds. The time left is estimated from all of the last hour's.
    with Bar(
        *columns, console=Console(file=stream), speed_estimate_period=3600, transient=True
    ) as bar:
        task = bar.add_task(what, total=None, best="")

        def show(done: int, total: int, best: float | None) -> None:
            text = "" if best is None else f"best {best:.4f}"
            bar.update(task, completed=done, total=total, best=text)

        yield show


def compile_with_message(
    physics: Physics,
    balls: int,
    alike: bool = True,
    bore: bool = False,
    stream: TextIO | None = None,
) -> float:
    """Compile the simulator for these effects, with a message, unless that was done before here.

    Returns:
        Seconds that it took; 0 if the compiled simulator was there.
    """
    import sim_core

    stream = stream or sys.stderr
    if sim_core.is_compiled(physics, balls, alike, bore):
        return 0.0
    print("compiling the simulator (once per set of effects) ...", file=stream, flush=True)
    seconds = float(sim_core.compile_simulator(physics, balls, alike, bore))
    print(f"compiled in {seconds:.0f} s", file=stream, flush=True)
    return seconds
