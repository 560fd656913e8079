"""A part as its file has it, from two sides, as a .png: its target, or what is wrong with it."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.output.viewer.actors import BACKGROUND, DARK, FAULT, GREY, SONOTRODE, add_chamber
from chamberopt.output.viewer.subprocess_drawing import (
    draw_in_subprocess,
    picture_path,
    write_screenshot,
)
from chamberopt.output.vtp_files import CHAMBER, MM, pyvista, read_surface, write_chamber

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber


def draw_part(
    corners: np.ndarray,
    title: str,
    picture: str | Path,
    marked: np.ndarray | None = None,
    edges: np.ndarray | None = None,
    missed: np.ndarray | None = None,
    chamber: Chamber | None = None,
) -> str | None:
    """Draw a part from two sides.

    Args:
        corners: of its triangles [m], shape (n, 3, 3).
        title: written above the picture.
        picture: file to write, .png.
        marked: triangles drawn orange, bool, shape (n,).
        edges: drawn red and seen through the part [m], shape (k, 2, 3).
        missed: triangles drawn red, bool, shape (n,).
        chamber: drawn as glass round the part in a third view.

    Returns:
        None, or one line that says why there is no picture.

    Raises:
        InputError: `picture` cannot be written.
    """
    path = picture_path(picture)
    none = np.zeros(len(corners), dtype=bool)
    marked, missed = (none if chosen is None else chosen for chosen in (marked, missed))
    edges = np.zeros((0, 2, 3)) if edges is None else edges
    with tempfile.TemporaryDirectory() as folder:
        part = Path(folder) / "part.npz"
        np.savez(
            part, corners=corners * MM, marked=marked & ~missed, missed=missed, edges=edges * MM
        )
        job = {"draw": "part", "part": str(part), "title": title}
        if chamber is not None:
            write_chamber(Path(folder), chamber)
            job["chamber"] = str(Path(folder) / CHAMBER)
        return draw_in_subprocess(job, path)


def render_part(job: dict[str, Any]) -> None:
    """Draw the part in the drawing process: from two opposite sides, and in its chamber."""
    with np.load(job["part"]) as data:
        corners, marked, missed, edges = (
            data[name] for name in ("corners", "marked", "missed", "edges")
        )
    surface = pyvista().PolyData.from_regular_faces(
        corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)
    )
    lines = pyvista().line_segments_from_points(edges.reshape(-1, 3)) if len(edges) else None
    views = [((1.0, -1.6, 0.7), None), ((-1.0, 1.6, -0.7), None)]
    if "chamber" in job:
        views.append((views[0][0], read_surface(Path(job["chamber"]))))
    plotter = pyvista().Plotter(
        off_screen=True, shape=(1, len(views)), window_size=[900 * len(views), 900], border=False
    )
    for column, (eye, chamber) in enumerate(views):
        plotter.subplot(0, column)
        plotter.set_background(BACKGROUND)
        if chamber is not None:
            add_chamber(plotter, chamber)
        for chosen, colour in ((~(marked | missed), GREY), (marked, SONOTRODE), (missed, FAULT)):
            if chosen.any():
                opacity = 1.0 if lines is None else 0.35
                plotter.add_mesh(surface.extract_cells(chosen), color=colour, opacity=opacity)
        if lines is not None:
            plotter.add_mesh(lines, color=FAULT, line_width=6, lighting=False)
        if column == 0:
            plotter.add_text(job["title"], position="upper_left", font_size=11, color=DARK)
        plotter.camera_position = [eye, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)]
        plotter.reset_camera()
        plotter.enable_anti_aliasing("ssaa")
    write_screenshot(plotter, job["picture"])
