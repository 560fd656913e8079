"""Draw the coverage of a result on its part, or of several results on one colour scale."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from chamberopt.pictures.actors import SCATTER, add_edges, add_part, body_meanings, colour_meanings
from chamberopt.pictures.camera import target_in_chamber
from chamberopt.pictures.drawn_part import DrawnPart, beyond, colour_range
from chamberopt.pictures.panels import choose_views, part_panels, with_marks
from chamberopt.pictures.picture_page import ColourBar, Row, write_page
from chamberopt.pictures.subprocess_drawing import draw_in_subprocess
from chamberopt.results.arrays_file import ARRAYS_FILE, read_result_arrays
from chamberopt.results.vtp_files import size_text


def draw_coverage(
    folders: Sequence[str | Path],
    titles: Sequence[str],
    picture: str | Path,
    columns: int = 3,
    marks: Sequence[Sequence[float]] = (),
    finer: int = 1,
) -> str | None:
    """Draw the coverage of one result, or of several below one another on one colour scale.

    Args:
        folders: results folders, each with arrays.npz.
        titles: a title for each result.
        picture: file to write, .png.
        columns: views beside one another; further ones of a result are below them.
        marks: places on the part that get numbers from 1 on, each with the normal there, (n, 6)
            [mm].
        finer: times as many pixels along each side as on a screen, as for print.

    Returns:
        None, or one line that says why there is no picture.
    """
    job: dict[str, Any] = {
        "folders": [str(one) for one in folders],
        "titles": list(titles),
        "columns": columns,
        "finer": finer,
    }
    job["marks"] = [list(one) for one in marks]
    return draw_in_subprocess(render_coverage, job, picture)


def render_coverage(job: dict[str, Any]) -> None:
    """Draw the picture of draw_coverage; this runs in a child process.

    Each result is shown in its chamber, and its target from near.
    """
    results = [read_result_arrays(Path(one) / ARRAYS_FILE) for one in job["folders"]]
    chambers = [one.cavity for one in results]
    parts = [
        DrawnPart(one.field, chamber=chamber)
        for one, chamber in zip(results, chambers, strict=True)
    ]
    limits = colour_range(parts)
    targets = [target_in_chamber(one.part) for one in results]
    views = choose_views(targets, chambers)
    rows = []
    for one, part, title in zip(results, parts, job["titles"], strict=True):
        mask = one.chamber.fixtures.get("mask")
        has_plugs = mask is not None and mask.kind == "plugs"

        def add(plotter: Any, part: DrawnPart = part) -> None:
            add_part(plotter, part, limits)
            add_edges(plotter, part.surface)

        marks = [(str(k), np.reshape(one, (1, 6))) for k, one in enumerate(job["marks"], 1)]
        surfaces = part.inside, part.surface, one.cavity
        panels = part_panels(add, *surfaces, views, has_plugs, job["finer"])
        panels = with_marks(panels, marks, part.surface, one.cavity)
        for first in range(0, len(panels), job["columns"]):
            shown = panels[first : first + job["columns"]]
            rows.append(Row("" if first else title, shown))
    legend = [*body_meanings(chambers), *colour_meanings(parts)]
    remarks = [f"part {size_text(parts[0].surface)}", SCATTER]
    write_page(job["picture"], rows, legend, coverage_bar(parts, limits), remarks)


def coverage_bar(parts: Sequence[DrawnPart], limits: tuple[float, float]) -> ColourBar:
    """Return the colour bar of the quantity that the parts show.

    The label names the limits unless they are 0 and 100 %.
    """
    quantity = parts[0].quantity
    ends = {(True, True): "both", (True, False): "min", (False, True): "max"}
    label = quantity.title
    if quantity.unit == "%" and limits != (0.0, 100.0):
        label += f", scale from {limits[0]:g} to {limits[1]:g} %"
    return ColourBar(label, quantity.colours, limits, ends.get(beyond(parts, limits), "neither"))
