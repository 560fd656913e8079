"""A part as its file has it, from two sides, as a .png: its target, or what is wrong with it."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.common.files import atomic_write
from chamberopt.output.viewer.actors import BACKGROUND, DARK, FAULT, GREY, SONOTRODE, add_chamber
from chamberopt.output.viewer.subprocess_drawing import draw_in_subprocess, picture_path
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
    """Draw a part as its file has it into a .png, from two sides; for what is wrong with it, or what its target is.

    corners (m, 3, 3) m · marked (m,) bool: triangles in orange · missed (m,) bool: in red · edges (k, 2, 3) m: drawn
    red, through the part · chamber: drawn as glass round the part, beside the two.
    Returns None, or one line saying why there is no picture. Raises InputError where no such file can be.
    """
    path = picture_path(picture)
    with tempfile.TemporaryDirectory() as folder:
        part = Path(folder) / "part.npz"
        marked, missed = (
            np.zeros(len(corners), dtype=bool) if chosen is None else chosen
            for chosen in (marked, missed)
        )
        edges = np.zeros((0, 2, 3)) if edges is None else edges
        np.savez(
            part, corners=corners * MM, marked=marked & ~missed, missed=missed, edges=edges * MM
        )
        job = {"draw": "part", "part": str(part), "title": title}
        if chamber is not None:
            write_chamber(Path(folder), chamber)
            job["chamber"] = str(Path(folder) / CHAMBER)
        return draw_in_subprocess(job, path)


def render_part(job: dict[str, Any]) -> None:
    """The part's surface from two opposite sides, edges shining through it, where there are any; and in its chamber."""
    with np.load(job["part"]) as data:
        corners, marked, missed, edges = (
            data["corners"],
            data["marked"],
            data["missed"],
            data["edges"],
        )
    surface = pyvista().PolyData.from_regular_faces(
        corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)
    )
    lines = pyvista().line_segments_from_points(edges.reshape(-1, 3)) if len(edges) else None
    cavity = read_surface(Path(job["chamber"])) if "chamber" in job else None
    views = (1.0, -1.0) if cavity is None else (1.0, -1.0, 0.0)
    plotter = pyvista().Plotter(
        off_screen=True, shape=(1, len(views)), window_size=[900 * len(views), 900], border=False
    )
    for column, side in enumerate(views):
        plotter.subplot(0, column)
        plotter.set_background(BACKGROUND)
        if cavity is not None and side == 0.0:
            add_chamber(plotter, cavity)
            side = 1.0
        for chosen, colour in ((~(marked | missed), GREY), (marked, SONOTRODE), (missed, FAULT)):
            if chosen.any():
                plotter.add_mesh(
                    surface.extract_cells(chosen),
                    color=colour,
                    opacity=1.0 if lines is None else 0.35,
                )
        if lines is not None:
            plotter.add_mesh(lines, color=FAULT, line_width=6, lighting=False)
        if column == 0:
            plotter.add_text(job["title"], position="upper_left", font_size=11, color=DARK)
        plotter.camera_position = [
            (side, -1.6 * side, 0.7 * side),
            (0.0, 0.0, 0.0),
            (0.0, 0.0, 1.0),
        ]
        plotter.reset_camera()
        plotter.enable_anti_aliasing("ssaa")
    with atomic_write(Path(job["picture"])) as temporary:
        plotter.screenshot(temporary)
