"""What is put into a plotter: the part, its chamber as glass, the colour bar."""

from __future__ import annotations

from typing import Any

import numpy as np

from chamberopt.shapes import TAG_WALL, is_sonotrode
from chamberopt.viewer.part import Part
from chamberopt.viewer.surfaces import Surface, pyvista

GREY, DARK, GLASS, SONOTRODE, BACKGROUND = "#b9bec4", "#2b3440", "#9db7cc", "#e08a2e", "white"
FAULT = "#d01c1c"


def show(plotter: Any, part: Part, limits: tuple[float, float], bar: bool) -> None:
    """The target coloured by its quantity, the rest of the part grey, lit from the camera."""
    plotter.set_background(BACKGROUND)
    plotter.remove_all_lights()
    plotter.add_light(pyvista().Light(light_type="headlight"))
    if part.rest.n_cells:
        plotter.add_mesh(part.rest, color=GREY, ambient=0.45, diffuse=0.55)
    style = {
        "vertical": True, "title": part.quantity.title + "\n", "fmt": _format(limits), "n_labels": 6, "color": DARK,
        "width": 0.06, "height": 0.55, "position_x": 0.88, "position_y": 0.2,
        "title_font_size": 20, "label_font_size": 20,
    }  # fmt: skip
    plotter.add_mesh(
        part.target, scalars="shown", cmap=part.quantity.colours, nan_color=GREY, clim=limits, ambient=0.7, diffuse=0.3,
        show_scalar_bar=bar, scalar_bar_args=style if bar else None,
    )  # fmt: skip


def in_chamber(plotter: Any, part: Part, chamber: Surface, title: str, limits: tuple[float, float], bar: bool) -> None:
    """The part inside the glass chamber, over the sonotrode."""
    show(plotter, part, limits, bar)
    room(plotter, chamber)
    plotter.add_text(title, position="upper_left", font_size=13, color=DARK)
    legend = "orange: sonotrode   grey: not in the target"
    plotter.add_text(legend, position="lower_left", font_size=9, color=DARK)
    plotter.camera_position = [(1.0, -1.6, 0.35), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)]
    plotter.reset_camera()
    plotter.enable_anti_aliasing("ssaa")


def room(plotter: Any, chamber: Surface) -> None:
    """The sonotrode, and the walls as glass with their edges."""
    tags = np.asarray(chamber["tag"])
    sonotrode, wall = (
        chamber.extract_cells(chosen).extract_surface(algorithm="dataset_surface")
        for chosen in (is_sonotrode(tags), tags == TAG_WALL)
    )
    plotter.add_mesh(sonotrode, color=SONOTRODE, lighting=False)
    plotter.add_mesh(wall, color=GLASS, opacity=0.16, specular=0.3)
    rims = wall.extract_feature_edges(30, non_manifold_edges=False, manifold_edges=False)
    plotter.add_mesh(rims, color=DARK, line_width=2, opacity=0.6)


def near(plotter: Any, part: Part, limits: tuple[float, float], bar: bool) -> None:
    """The target from near and a little below, where the shot comes from."""
    show(plotter, part, limits, bar)
    if part.reach:
        text = f"averaged over {part.reach:.1f} mm around each triangle: few dents were simulated"
        plotter.add_text(text, position="lower_left", font_size=9, color=DARK)
    plotter.camera_position = [(1.0, -1.4, -0.8), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)]
    plotter.reset_camera(bounds=part.target.bounds)
    plotter.camera.SetWindowCenter(0.14 if bar else 0.0, 0.0)  # makes room for the colour bar
    plotter.enable_anti_aliasing("ssaa")


def _format(limits: tuple[float, float]) -> str:
    """As many decimals as tell the labels of a colour bar apart."""
    span = limits[1] - limits[0]
    return f"%.{max(0, int(np.ceil(1.0 - np.log10(span)))) if span > 0.0 else 2}f"
