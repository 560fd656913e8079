"""Coverage of one result, or of several side by side on one colour scale, as a .png."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from chamberopt.common.files import atomic_write
from chamberopt.output.viewer.actors import in_chamber, near
from chamberopt.output.viewer.drawn_part import DrawnPart, colour_range
from chamberopt.output.viewer.subprocess_drawing import draw_in_subprocess
from chamberopt.output.vtp_files import CHAMBER, COVERAGE, pyvista, read_surface

COLUMNS = 4  # results beside each other: more go below


def draw_coverage(
    folders: Sequence[str | Path], titles: Sequence[str], picture: str | Path
) -> str | None:
    """Draw the coverage of one result, or of several side by side on one colour scale, into a .png.

    folders: each with coverage.vtp and chamber.vtp. Returns None, or one line saying why there is no picture.
    """
    return draw_in_subprocess(
        {"draw": "coverage", "folders": [str(f) for f in folders], "titles": list(titles)}, picture
    )


def render_coverage(job: dict[str, Any]) -> None:
    """Each result twice: in its chamber, and the target from near; several results side by side."""
    folders = [Path(folder) for folder in job["folders"]]
    parts = [DrawnPart(read_surface(folder / COVERAGE)) for folder in folders]
    chambers = [read_surface(folder / CHAMBER) for folder in folders]
    limits = colour_range(parts)
    single = len(folders) == 1
    plotter, place = panels(len(folders))
    for column, (part, chamber, title) in enumerate(
        zip(parts, chambers, job["titles"], strict=True)
    ):
        plotter.subplot(*place(0, column))
        in_chamber(plotter, part, chamber, title, limits, bar=False)
        plotter.subplot(*place(1, column))
        near(plotter, part, limits, bar=single or column == len(folders) - 1)
    with atomic_write(Path(job["picture"])) as temporary:
        plotter.screenshot(temporary)


def panels(count: int) -> tuple[Any, Callable[[int, int], tuple[int, int]]]:
    """A plotter for so many results with two views each, and where view 0 or 1 of the k-th goes: (row, column).

    One result has its views beside each other, several below, in bands of COLUMNS results.
    """
    if count == 1:
        return pyvista().Plotter(
            off_screen=True, shape=(1, 2), window_size=[1800, 900], border=False
        ), lambda v, k: (0, v)
    columns, bands = min(count, COLUMNS), -(-count // COLUMNS)
    plotter = pyvista().Plotter(
        off_screen=True,
        shape=(2 * bands, columns),
        window_size=[900 * columns, 1500 * bands],
        border=False,
    )
    return plotter, lambda view, k: (2 * (k // COLUMNS) + view, k % COLUMNS)
