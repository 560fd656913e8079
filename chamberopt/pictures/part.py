"""Draw a part before any simulation: its target in the chamber, or the faults of its mesh."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.pictures.actors import FAULT, GREY, NO_RENDER, SONOTRODE, add_edges
from chamberopt.pictures.camera import cells_of, near_directions, near_views, pushed_back, seen_area
from chamberopt.pictures.charts.colours import BLUE, OUTSIDE
from chamberopt.pictures.panels import BORDER, SIZE, choose_views, near_panels, part_panels
from chamberopt.pictures.picture_page import Panel, Row, write_page
from chamberopt.pictures.subprocess_drawing import draw_in_subprocess, picture_path
from chamberopt.pictures.view import render_view
from chamberopt.results.vtp_files import MM, cavity_surface, pyvista, size_text

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber


PLAIN, MARKED, MISSED, BEYOND = range(4)
COLOURS = {
    PLAIN: (GREY, "not in the target"),
    MARKED: (BLUE, "target"),
    MISSED: (FAULT, "target that hardly a ball can touch"),
    BEYOND: (OUTSIDE, "target outside the chamber"),
}
ALL = 0.999  # share of the target's area from which it is wholly in the chamber
OPPOSITE = np.array([(1.0, -1.6, 0.7), (-1.0, 1.6, -0.7)])


def draw_part(
    corners: np.ndarray,
    title: str,
    picture: str | Path,
    marked: np.ndarray | None = None,
    edges: np.ndarray | None = None,
    missed: np.ndarray | None = None,
    chamber: Chamber | None = None,
) -> str | None:
    """Draw a part with its target in its chamber, or with its faults.

    Args:
        corners: corners of the part's triangles [m], shape (n, 3, 3).
        title: text above the picture.
        picture: file to write, .png.
        marked: which triangles belong to the target, shape (n,).
        edges: lines drawn red and visible through the part [m], shape (k, 2, 3).
        missed: which triangles of the target balls can hardly touch, shape (n,).
        chamber: the chamber, drawn as glass round the part in a further view, with dimensions.
    Returns:
        None, or one line that says why there is no picture.
    Raises:
        InputError: `picture` cannot be written.
    """
    path = picture_path(picture)
    none = np.zeros(len(corners), dtype=bool)
    marked, missed = (none if chosen is None else chosen for chosen in (marked, missed))
    edges = np.zeros((0, 2, 3)) if edges is None else edges
    job = {"title": title, "corners": corners * MM, "marked": marked & ~missed, "missed": missed,
           "edges": edges * MM, "chamber": chamber}  # fmt: skip
    return draw_in_subprocess(render_part, job, path)


def render_part(job: dict[str, Any]) -> None:
    """Draw the picture of draw_part; this runs in a child process."""
    corners, marked, missed, edges = (
        job[name] for name in ("corners", "marked", "missed", "edges")
    )
    part = pyvista().PolyData.from_regular_faces(
        corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)
    )
    chamber = None if job["chamber"] is None else cavity_surface(job["chamber"])
    kinds = np.select([missed, marked], [MISSED, MARKED], PLAIN)
    shown = [(part, kinds)]
    if chamber is not None:  # surface inside the chamber is drawn over the part
        source = np.asarray(chamber["source"])
        inside, own = cells_of(chamber, source >= 0), kinds[source[source >= 0]]
        inside = pyvista().PolyData.from_regular_faces(  # with its normals out of the part
            inside.points, np.asarray(inside.regular_faces)[:, ::-1]
        )
        whole, there = (
            cells_of(one, kind != PLAIN).area for one, kind in ((part, kinds), (inside, own))
        )
        beyond = BEYOND if there < ALL * whole else MARKED
        shown = [(part, np.where(kinds == PLAIN, PLAIN, beyond)), (inside, own)]
    lines = pyvista().line_segments_from_points(edges.reshape(-1, 3)) if len(edges) else None

    def add(plotter: Any) -> None:
        for level, (surface, kind) in enumerate(shown):
            for k in np.unique(kind):
                actor = plotter.add_mesh(
                    cells_of(surface, kind == k), color=COLOURS[k][0], ambient=0.45, diffuse=0.6,
                    opacity=1.0 if lines is None else 0.35, **NO_RENDER,
                )  # fmt: skip
                if level == 0:
                    pushed_back(actor)
        if lines is not None:
            plotter.add_mesh(lines, color=FAULT, line_width=6, lighting=False, **NO_RENDER)
        else:
            add_edges(plotter, part)

    surface, kind = shown[-1]
    target, rest = cells_of(surface, kind != PLAIN), [part]
    if not target.n_cells:  # the part has faults, or lies outside the chamber
        points = np.concatenate([part.points, edges.reshape(-1, 3)])
        panels = [
            Panel(render_view(add, eye, points, SIZE, BORDER), caption)
            for eye, caption in zip(OPPOSITE, ("from one side", "from the other"), strict=True)
        ]
    elif chamber is None:
        eyes = near_directions(target)
        panels = near_panels(add, target, part, near_views(seen_area(target, rest, eyes), eyes))
    else:
        panels = part_panels(add, target, part, chamber, choose_views([(target, part)], [chamber]))
    legend = [COLOURS[k] for k in np.unique(np.concatenate([kind for _, kind in shown]))]
    legend = [(SONOTRODE, "sonotrode"), *legend] if chamber is not None else legend
    legend = legend if lines is None else [(FAULT, "what the message tells of")]
    write_page(
        job["picture"], [Row(job["title"], panels)], legend, remarks=[f"part {size_text(part)}"]
    )
