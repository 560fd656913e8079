"""Where later candidates cover more or less than the first one, as a .png."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from chamberopt.output.plots.colours import DIFFERENCE_MAP
from chamberopt.output.viewer.actors import DARK, light
from chamberopt.output.viewer.images.coverage import panels
from chamberopt.output.viewer.subprocess_drawing import draw_in_subprocess, write_screenshot
from chamberopt.output.vtp_files import read_surface, save_surface

# Brown (less) over white to violet (more), for colour-blind readers too, and unlike either grey.
PALE, NO_TARGET = "#e6e9ec", "#a9b0b7"
LEGEND = "violet: more coverage   orange: less   pale: within the noise   grey: not in the target"


def write_differences(
    path: Path, field: Path, columns: Sequence[tuple[np.ndarray, np.ndarray]]
) -> None:
    """Write a part with the differences of later candidates from the first.

    Candidate k = 1, 2, ... has point data difference_k [percentage points] and real_k, and the
    triangles have cell data target.

    Args:
        path: .vtp file to write.
        field: the first candidate's coverage.vtp.
        columns: for each later candidate the difference, -1..1, at the vertices of the target in
            their order, shape (v,), and whether it is real, bool, shape (v,).
    """
    surface = read_surface(field)
    target = np.asarray(surface["target"])
    used = np.unique(np.asarray(surface.regular_faces)[target > 0])
    normal = np.asarray(surface.point_data.active_normals)
    surface.clear_data()
    surface.cell_data["target"] = target
    surface.point_data.active_normals = normal
    for k, (value, real) in enumerate(columns, start=1):
        for name, column in ((f"difference_{k}", 100.0 * value), (f"real_{k}", real)):
            surface.point_data[name] = np.zeros(surface.n_points, dtype=np.float32)
            surface.point_data[name][used] = column
    save_surface(path, surface)


def draw_difference(surface: str | Path, titles: Sequence[str], picture: str | Path) -> str | None:
    """Draw what write_differences wrote, all candidates on one scale.

    Returns:
        None, or one line that says why there is no picture.
    """
    job = {"draw": "difference", "surface": str(surface), "titles": list(titles)}
    return draw_in_subprocess(job, picture)


def render_difference(job: dict[str, Any]) -> None:
    """Draw each candidate in the drawing process: from below, like the shot, and from above."""
    surface, titles = read_surface(Path(job["surface"])), job["titles"]
    plotter, place = panels(len(titles))
    limit = _scale_limit(surface, len(titles))
    for k, title in enumerate(titles):
        for row, side in enumerate((-1.0, 1.0)):
            plotter.subplot(*place(row, k))
            _add_difference(plotter, surface, k + 1, limit, bar=(row, k) == (1, len(titles) - 1))
            if row == 0:
                plotter.add_text(title, position="upper_left", font_size=13, color=DARK)
            else:
                plotter.add_text(LEGEND, position="lower_left", font_size=9, color=DARK)
            eye = (-side, 1.4 * side, 0.8 * side)
            plotter.camera_position = [eye, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)]
            plotter.reset_camera(bounds=surface.extract_cells(surface["target"] > 0).bounds)
            plotter.enable_anti_aliasing("ssaa")
    write_screenshot(plotter, job["picture"])


def _add_difference(plotter: Any, surface: Any, k: int, limit: float, bar: bool) -> None:
    light(plotter)
    target = np.asarray(surface["target"]) > 0
    corners = np.asarray(surface.regular_faces)
    real = (np.asarray(surface[f"real_{k}"])[corners] > 0.0).sum(axis=1) > 1  # of most corners
    look: dict[str, Any] = {"ambient": 0.7, "diffuse": 0.3}
    for chosen, colour in ((~target, NO_TARGET), (target & ~real, PALE)):
        if chosen.any():
            plotter.add_mesh(surface.extract_cells(chosen), color=colour, **look)
    style = {
        "vertical": True, "title": "difference\n[%-points]\n", "fmt": "%+.1f", "n_labels": 5,
        "color": DARK, "width": 0.06, "height": 0.55, "position_x": 0.84, "position_y": 0.2,
        "title_font_size": 20, "label_font_size": 20,
    }  # fmt: skip
    chosen = target & real
    shown = surface.extract_cells(chosen if chosen.any() else [int(np.flatnonzero(target)[0])])
    if not chosen.any():  # the colour bar needs an actor all the same
        shown[f"difference_{k}"] = np.full(shown.n_points, np.nan)
    plotter.add_mesh(
        shown, scalars=f"difference_{k}", cmap=DIFFERENCE_MAP, clim=(-limit, limit),
        nan_color=PALE, show_scalar_bar=bar, scalar_bar_args=style if bar else None, **look,
    )  # fmt: skip


def _scale_limit(surface: Any, count: int) -> float:
    """Return a round limit that holds nearly all real differences [percentage points]."""
    real = [
        np.abs(surface[f"difference_{k}"])[np.asarray(surface[f"real_{k}"]) > 0]
        for k in range(1, count + 1)
    ]
    values = np.concatenate(real)
    if not len(values):
        return 5.0
    most = float(np.percentile(values, 99.0))
    step = 1.0 if most <= 5.0 else 5.0
    return max(1.0, step * float(np.ceil(most / step)))
