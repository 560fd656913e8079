"""Draw every dent of one peening treatment on the part as a .png, with unpeened surface pale.

Each dent is a flat disc of its diameter in the plane of the triangle that was hit. It is lifted a
little so that the facets of a rounded edge do not hide it. Later dents are drawn over earlier
dents. Sight lines are parallel, so lengths are the same all over the picture.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.pictures.actors import NO_RENDER, Discs, disc_actor, light
from chamberopt.pictures.camera import Vector, near_directions, near_views, seen_area, view_frame
from chamberopt.pictures.charts.colours import PART_GREY
from chamberopt.pictures.drawn_part import DrawnPart
from chamberopt.pictures.panels import NEAR_CAPTIONS
from chamberopt.pictures.picture_page import ColourBar, Panel, Row, write_page
from chamberopt.pictures.subprocess_drawing import draw_in_subprocess
from chamberopt.pictures.view import View, aim_along
from chamberopt.results.arrays_file import ARRAYS_FILE, read_result_arrays
from chamberopt.results.vtp_files import MM, pyvista

if TYPE_CHECKING:
    from matplotlib.colors import Colormap

    from chamberopt.coverage.dents import Dents

MIN_PIXELS, MAX_PIXELS = 200, 4000  # longer side: still readable, and allowed by graphics drivers
MIN_SHORTER_SIDE = 4  # pixels; a target seen edge on is narrower
MARGIN = 1.06  # sides of the picture over sides of the target
GROUND = "#efe9da"  # of the target without dents: a print of black would be all ink
LIGHTEST = 0.8  # end of the colours of viridis that cannot be mistaken for the ground
AMBIENT = 0.75  # brightness of a surface seen edge on, over its brightness face on
INNER, RIM_SHADE = 0.8, 0.72  # a dent's darker rim: its inner radius and its brightness
MIN_RIM_PIXELS = 12.0  # smallest diameter of a dent with a drawn rim


def draw_dents(
    result: Path,
    dents: Dents,
    title: str,
    picture: Path,
    view: Vector | None = None,
    pixels: int = 1000,
) -> str | None:
    """Draw dents on the target of a result, with a bar of dent diameters and a scale in mm.

    Args:
        result: results folder whose arrays.npz holds the part.
        dents: dents in order of time.
        title: written above the picture.
        picture: file to write, .png.
        view: direction from the part to the eye. None shows a flat target face on, and any other
            target from the direction that shows most of it.
        pixels: longer side of one view [pixels].
    Returns:
        None, or one line that says why there is no picture.
    Raises:
        InputError: from `view` the target is seen edge on.
    """
    job = {"folder": str(result), "title": title, "view": view, "pixels": pixels,
           "place": dents.place, "normal": dents.normal, "radius": dents.radius}  # fmt: skip
    return draw_in_subprocess(render_dents, job, picture)


def require_pixels(pixels: int) -> None:
    """Raise InputError if a picture's longer side [pixels] is too small to read or too large."""
    if not MIN_PIXELS <= pixels <= MAX_PIXELS:
        raise InputError(f"--pixels: given {pixels}; {MIN_PIXELS} to {MAX_PIXELS} are supported")


def render_dents(job: dict[str, Any]) -> None:
    """Draw the picture of draw_dents; this runs in a child process."""
    diameter = 2e6 * job["radius"]  # µm
    low, high = np.percentile(diameter, [1.0, 99.0]) if len(diameter) else (0.0, 1.0)
    colours, limits = dent_colours(), (float(low), max(float(high), float(low) + 1.0))
    shade = np.clip((diameter - limits[0]) / (limits[1] - limits[0]), 0.0, 1.0)
    rgb = (255.0 * colours(shade)[:, :3]).astype(np.uint8)
    discs = Discs(job["place"] * MM, -job["normal"], job["radius"] * MM, rgb)
    part = DrawnPart(read_result_arrays(Path(job["folder"]) / ARRAYS_FILE).field)
    panels = [
        Panel(render_side(part, discs, view, job["pixels"]), caption, is_cut=part.rest.n_cells > 0)
        for view, caption in zip(_views(part, job["view"]), NEAR_CAPTIONS, strict=False)
    ]
    legend = [(GROUND, "not peened"), (PART_GREY, "not in the target")]
    bar = ColourBar("dent diameter [µm]", colours, limits, "both")
    write_page(job["picture"], [Row(job["title"], panels)], legend[: 1 + panels[0].is_cut], bar)


def dent_colours() -> Colormap:
    """Return the dark part of viridis, a colour map that colour-blind readers can read."""
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap

    return ListedColormap(colormaps["viridis"](np.linspace(0.0, LIGHTEST, 256)), "dark viridis")


def _views(part: DrawnPart, wanted: Vector | None) -> list[np.ndarray]:
    """Return the directions to the eye from which the target is drawn.

    These are the wanted direction alone, or if `wanted` is None, directions that show the target.
    """
    if wanted is not None:
        return [np.array(wanted)]
    eyes = near_directions(part.whole)
    return near_views(seen_area(part.whole, [part.rest], eyes), eyes)


def render_side(
    part: DrawnPart,
    discs: Discs,
    view: Sequence[float] | np.ndarray,
    pixels: int,
    ground: str = GROUND,
) -> View:
    """Render the target and its dents from one direction.

    Args:
        part: the part to draw, with its whole target. The rest of the part is grey.
        discs: dents in order of time.
        view: direction to the eye.
        pixels: longer side of the image.
        ground: colour of the target without dents.
    Returns:
        The image.
    Raises:
        InputError: the target is seen edge on.
    """
    frame = view_frame(np.asarray(view))
    corners = np.asarray(part.whole.points) @ frame.T
    low, high = corners.min(axis=0), corners.max(axis=0)
    pixel_mm = MARGIN * float((high - low)[:2].max()) / pixels
    columns, rows = (max(1, round(MARGIN * side / pixel_mm)) for side in (high - low)[:2])
    if min(columns, rows) < MIN_SHORTER_SIDE:
        raise InputError("--view: from there the target is seen edge on; give another direction")

    plotter = pyvista().Plotter(off_screen=True, window_size=[columns, rows])
    plotter.enable_anti_aliasing("ssaa")
    light(plotter)
    target = plotter.add_mesh(part.whole, color=ground, lighting=False, **NO_RENDER)
    rest = plotter.add_mesh(
        part.rest if part.rest.n_cells else pyvista().Sphere(radius=0.0),
        color=PART_GREY, ambient=AMBIENT, diffuse=1.0 - AMBIENT, **NO_RENDER,
    )  # fmt: skip
    aim_along(plotter, frame, 0.5 * (low + high) @ frame, 0.5 * rows * pixel_mm)
    corner = 0.5 * (low + high)[:2] + 0.5 * pixel_mm * np.array([-columns, rows])
    bare = _screenshot(plotter)
    shown = discs.only(discs.normal @ frame[2] > 0.0)
    if not len(shown.radius):
        return View(bare.astype(np.uint8), frame, corner, pixel_mm)
    actor = disc_actor(_with_rims(shown, pixel_mm), AMBIENT)
    plotter.add_actor(actor, **NO_RENDER)
    dented = _screenshot(plotter)
    # At an edge a disc reaches beyond the target. So pixels that do not show the target keep their
    # colour without dents.
    plotter.remove_actor(actor, render=False)
    plotter.set_background("black")
    target.prop.color, rest.prop.color, rest.prop.lighting = "white", "black", False
    share = _screenshot(plotter) / 255.0
    plotter.close()
    image = (bare + share * (dented - bare)).round().astype(np.uint8)
    return View(image, frame, corner, pixel_mm)


def _screenshot(plotter: Any) -> np.ndarray:
    plotter.render()
    return np.asarray(plotter.screenshot(None, return_img=True))[..., :3].astype(float)


def _with_rims(discs: Discs, pixel_mm: float) -> Discs:
    """Return the discs with a darker rim round each large disc.

    A large disc becomes two: a darker disc under a smaller disc of the disc's colour.
    """
    rimmed = 2.0 * discs.radius > MIN_RIM_PIXELS * pixel_mm
    row = np.repeat(np.arange(len(rimmed)), 1 + rimmed)
    found = discs.only(row)
    upper = np.zeros(len(row), dtype=bool)
    upper[1:] = row[1:] == row[:-1]
    lower = rimmed[row] & ~upper
    found.radius[upper] *= INNER
    found.colour[lower] = (RIM_SHADE * found.colour[lower]).astype(np.uint8)
    return found
