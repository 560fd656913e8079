"""Where later candidates cover more or less than the first, as a .png; what is within the noise is pale."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from chamberopt.common.files import atomic_write
from chamberopt.output.viewer.actors import BACKGROUND, DARK
from chamberopt.output.viewer.images.coverage import panels
from chamberopt.output.viewer.subprocess_drawing import draw_in_subprocess
from chamberopt.output.vtp_files import pyvista, read_surface

# From brown (less) over white to violet (more): told apart by colour-blind readers, and from either grey.
COLOURS = "PuOr"
PALE, NO_TARGET = "#e6e9ec", "#a9b0b7"


def write_differences(
    path: Path, part: Path, columns: Sequence[tuple[np.ndarray, np.ndarray]]
) -> None:
    """The part [mm] of a coverage.vtp, with cell data difference_K [%-points] and real_K, K = 1 the second candidate.

    columns: of each later one, value (m,) -1..1, NaN off the target, and real (m,) bool.
    """
    surface = read_surface(part)
    surface.clear_data()
    for k, (value, real) in enumerate(columns, start=1):
        surface.cell_data[f"difference_{k}"] = 100.0 * value
        surface.cell_data[f"real_{k}"] = real.astype(np.uint8)
    with atomic_write(path) as temporary:
        surface.save(temporary)


def draw_difference(surface: str | Path, titles: Sequence[str], picture: str | Path) -> str | None:
    """Draw what write_differences wrote, from two sides, each candidate with its title and all on one scale.

    Returns None, or one line saying why there is no picture.
    """
    return draw_in_subprocess(
        {"draw": "difference", "surface": str(surface), "titles": list(titles)}, picture
    )


def render_difference(job: dict[str, Any]) -> None:
    """Each candidate from below, where the shot comes from, and from the other side above."""
    surface = read_surface(Path(job["surface"]))
    titles = job["titles"]
    plotter, place = panels(len(titles))
    reach = _reach(surface, len(titles))
    for k, title in enumerate(titles):
        for row, side in enumerate((-1.0, 1.0)):
            plotter.subplot(*place(row, k))
            _show(plotter, surface, k + 1, reach, bar=(row, k) == (1, len(titles) - 1))
            if row == 0:
                plotter.add_text(title, position="upper_left", font_size=13, color=DARK)
            else:
                text = "violet: more coverage   orange: less   pale: within the noise   grey: not in the target"
                plotter.add_text(text, position="lower_left", font_size=9, color=DARK)
            plotter.camera_position = [
                (-side, 1.4 * side, 0.8 * side),
                (0.0, 0.0, 0.0),
                (0.0, 0.0, 1.0),
            ]
            wanted = surface.extract_cells(np.isfinite(surface[f"difference_{k + 1}"]))
            plotter.reset_camera(bounds=wanted.bounds)
            plotter.enable_anti_aliasing("ssaa")
    with atomic_write(Path(job["picture"])) as temporary:
        plotter.screenshot(temporary)


def _show(plotter: Any, surface: Any, k: int, reach: float, bar: bool) -> None:
    plotter.set_background(BACKGROUND)
    plotter.remove_all_lights()
    plotter.add_light(pyvista().Light(light_type="headlight"))
    value = np.asarray(surface[f"difference_{k}"]).copy()
    target = np.isfinite(value)
    value[np.asarray(surface[f"real_{k}"]) == 0] = np.nan
    surface["shown"] = value
    if not target.all():
        plotter.add_mesh(surface.extract_cells(~target), color=NO_TARGET, ambient=0.7, diffuse=0.3)
    style = {
        "vertical": True, "title": "difference\n[%-points]\n", "fmt": "%+.1f", "n_labels": 5, "color": DARK,
        "width": 0.06, "height": 0.55, "position_x": 0.84, "position_y": 0.2,
        "title_font_size": 20, "label_font_size": 20,
    }  # fmt: skip
    plotter.add_mesh(
        surface.extract_cells(target), scalars="shown", cmap=COLOURS, clim=(-reach, reach), nan_color=PALE, ambient=0.6,
        diffuse=0.4, show_scalar_bar=bar, scalar_bar_args=style if bar else None,
    )  # fmt: skip


def _reach(surface: Any, count: int) -> float:
    """How far the scale goes to each side: a round number that holds nearly all of what is real, %-points."""
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
