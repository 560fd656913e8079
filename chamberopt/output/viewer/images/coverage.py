"""Coverage of one result, or of several side by side on one colour scale, as a .png."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from chamberopt.output.viewer.actors import draw_in_chamber, draw_target
from chamberopt.output.viewer.drawn_part import DrawnPart, colour_range
from chamberopt.output.viewer.subprocess_drawing import draw_in_subprocess, write_screenshot
from chamberopt.output.vtp_files import CHAMBER, COVERAGE, pyvista, read_surface

MAX_COLUMNS = 4  # results beside each other; further ones are drawn below


def draw_coverage(
    folders: Sequence[str | Path], titles: Sequence[str], picture: str | Path
) -> str | None:
    """Draw the coverage of one result, or of several side by side on one colour scale.

    Args:
        folders: each with coverage.vtp and chamber.vtp.
        titles: of the results.
        picture: file to write, .png.

    Returns:
        None, or one line that says why there is no picture.
    """
    job = {"draw": "coverage", "folders": [str(one) for one in folders], "titles": list(titles)}
    return draw_in_subprocess(job, picture)


def render_coverage(job: dict[str, Any]) -> None:
    """Draw each result twice in the drawing process: in its chamber, and the target from near."""
    folders = [Path(folder) for folder in job["folders"]]
    parts = [DrawnPart(read_surface(folder / COVERAGE)) for folder in folders]
    chambers = [read_surface(folder / CHAMBER) for folder in folders]
    limits = colour_range(parts)
    plotter, place = panels(len(folders))
    for column, (part, chamber, title) in enumerate(
        zip(parts, chambers, job["titles"], strict=True)
    ):
        plotter.subplot(*place(0, column))
        draw_in_chamber(plotter, part, chamber, title, limits)
        plotter.subplot(*place(1, column))
        draw_target(plotter, part, limits, bar=column == len(folders) - 1)
    write_screenshot(plotter, job["picture"])


def panels(count: int) -> tuple[Any, Callable[[int, int], tuple[int, int]]]:
    """Make a plotter with two views of each of `count` results.

    The views of a single result stand beside each other. Those of several results stand one below
    the other, in bands of MAX_COLUMNS results.

    Returns:
        The plotter, and a function that gives row and column of view 0 or 1 of the k-th result.
    """
    if count == 1:
        size, shape = [1800, 900], (1, 2)
    else:
        columns, bands = min(count, MAX_COLUMNS), -(-count // MAX_COLUMNS)
        size, shape = [900 * columns, 1500 * bands], (2 * bands, columns)
    plotter = pyvista().Plotter(off_screen=True, shape=shape, window_size=size, border=False)

    def place(view: int, k: int) -> tuple[int, int]:
        return (0, view) if count == 1 else (2 * (k // MAX_COLUMNS) + view, k % MAX_COLUMNS)

    return plotter, place
