"""Progress on the terminal: a bar with the best value so far and the time left."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TextIO

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
    from rich import progress as rich
    from rich.console import Console

    columns = (
        "{task.description}",
        rich.BarColumn(),
        rich.MofNCompleteColumn(),
        "[bold]{task.fields[best]}",
        rich.TimeElapsedColumn(),
        "[dim]left",
        rich.TimeRemainingColumn(),
    )
    # An evaluation can take seconds. The time left is estimated from all of the last hour's.
    console = Console(file=stream)
    with rich.Progress(
        *columns, console=console, speed_estimate_period=3600, transient=True
    ) as bar:
        task = bar.add_task(what, total=None, best="")

        def show(done: int, total: int, best: float | None) -> None:
            text = "" if best is None else f"best {best:.4f}"
            bar.update(task, completed=done, total=total, best=text)

        yield show
