"""Draw every dent of one peening on the part, what is not peened black, as a .png.

Each dent is a flat disc of its diameter in the plane of the triangle that was hit, lifted a little
so that the facets of a rounded edge do not hide it. Later dents are drawn over earlier ones. Sight
lines are parallel, so lengths are the same all over the picture.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.output.plots.figure_style import save_picture
from chamberopt.output.viewer.actors import GREY, NO_RENDER, Discs, disc_actor, light
from chamberopt.output.viewer.drawn_part import DrawnPart
from chamberopt.output.viewer.subprocess_drawing import draw_in_subprocess
from chamberopt.output.viewer.view_state import Vector
from chamberopt.output.vtp_files import COVERAGE, MM, pyvista, read_surface

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap

    from chamberopt.coverage.dents import Dents

MIN_PIXELS, MAX_PIXELS = 200, 4000  # of the longer side: readable, and what graphics drivers allow
MIN_SHORTER_SIDE = 4  # pixels; below it the target is seen edge on
MARGIN = 1.06  # of the picture's sides over the target's
FLAT = 0.9  # a target counts as flat if its mean unit normal is at least this long
# From near and a little below, where the shot comes from; and from the opposite side.
OPPOSITE_VIEWS: tuple[Vector, Vector] = ((1.0, -1.4, -0.5), (-1.0, 1.4, 0.5))
WIDE = 0.8  # height over width below which two views are put above one another
PIXELS_PER_INCH, LETTERS_PER_INCH = 130, 12
DARKEST = 0.35  # where the part of viridis begins that cannot be mistaken for black
AMBIENT = 0.75  # brightness of a surface seen edge on, as a share of one seen face on
INNER, RIM_SHADE = 0.8, 0.72  # a dent's darker rim: its inner radius and its brightness
MIN_RIM_PIXELS = 12.0  # diameter of the dents from which rims are drawn


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
        result: results folder whose coverage.vtp holds the part.
        dents: in order of time.
        title: written above the picture.
        picture: file to write, .png.
        view: direction from the part to the eye; None shows a flat target face on, any other from
            two opposite sides.
        pixels: longer side of one view, as require_pixels accepts it.

    Returns:
        None, or one line that says why there is no picture.

    Raises:
        InputError: from `view` the target is seen edge on.
    """
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder) / "dents.npz"
        np.savez(data, place=dents.place, normal=dents.normal, radius=dents.radius)
        job = {"draw": "dents", "folder": str(result), "dents": str(data), "title": title,
               "view": view, "pixels": pixels}  # fmt: skip
        return draw_in_subprocess(job, picture)


def require_pixels(pixels: int) -> None:
    """Raise InputError for a picture too small to read or too large to draw."""
    if not MIN_PIXELS <= pixels <= MAX_PIXELS:
        raise InputError(f"--pixels: given {pixels}; {MIN_PIXELS} to {MAX_PIXELS} are supported")


def render_dents(job: dict[str, Any]) -> None:
    """Draw the picture in the drawing process."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

    with np.load(job["dents"]) as data:
        diameter = 2e6 * data["radius"]  # µm
        low, high = np.percentile(diameter, [1.0, 99.0]) if len(diameter) else (0.0, 1.0)
        colours, limits = dent_colours(), Normalize(low, max(high, low + 1.0), clip=True)
        rgb = (255.0 * colours(limits(diameter))[:, :3]).astype(np.uint8)
        discs = Discs(data["place"] * MM, -data["normal"], data["radius"] * MM, rgb)
    part = DrawnPart(read_surface(Path(job["folder"]) / COVERAGE))
    views = [job["view"]] if job["view"] else default_views(part)
    sides = [render_side(part, discs, view, job["pixels"]) for view in views]

    height, width = np.max([image.shape[:2] for image, _ in sides], axis=0) / PIXELS_PER_INCH
    rows, columns = (len(sides), 1) if height < WIDE * width else (1, len(sides))
    size = (width * columns + 1.2, (height + 0.3) * rows + 0.6)
    figure = Figure(figsize=size, dpi=PIXELS_PER_INCH, layout="constrained")
    FigureCanvasAgg(figure)
    every = np.atleast_1d(figure.subplots(rows, columns))
    for axes, (image, pixel_mm) in zip(every, sides, strict=True):
        axes.imshow(image, interpolation="antialiased")
        axes.set_axis_off()
        _draw_length_scale(axes, image.shape, pixel_mm)
    legend = "black: not peened   grey: not in the target"
    letters = int(LETTERS_PER_INCH * size[0])
    text = "\n".join(fill(one, letters) for one in (job["title"], legend))
    figure.suptitle(text, x=0.01, ha="left", fontsize=10, parse_math=False)
    bar = figure.colorbar(
        ScalarMappable(limits, colours), ax=list(every), shrink=0.7, extend="both", pad=0.01
    )
    bar.set_label("dent diameter [µm]")
    save_picture(figure, Path(job["picture"]))


def dent_colours() -> Colormap:
    """Return the light part of viridis, which colour-blind readers tell apart."""
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap

    return ListedColormap(colormaps["viridis"](np.linspace(DARKEST, 1.0, 256)), "light viridis")


def default_views(part: DrawnPart) -> Sequence[Vector]:
    """Directions to the eye: face on for a flat target, else from two opposite sides."""
    area = np.asarray(part.whole["area"])
    x, y, z = area @ np.asarray(part.whole.face_normals) / area.sum()
    return [(x, y, z)] if x * x + y * y + z * z > FLAT * FLAT else OPPOSITE_VIEWS


def render_side(
    part: DrawnPart, discs: Discs, view: Vector, pixels: int
) -> tuple[np.ndarray, float]:
    """Render the target, black, and its dents from one direction.

    Args:
        part: its target is shown whole; the rest of it is grey.
        discs: the dents, in order of time.
        view: direction to the eye.
        pixels: longer side of the image.

    Returns:
        The image, uint8 of shape (rows, columns, 3), and the size of its pixels [mm].

    Raises:
        InputError: the target is seen edge on.
    """
    towards_eye = np.array(view) / np.linalg.norm(view)
    upright = (0.0, 0.0, 1.0) if abs(towards_eye[2]) < 0.99 else (0.0, 1.0, 0.0)
    right = np.cross(upright, towards_eye)
    right /= np.linalg.norm(right)
    frame = np.stack([right, np.cross(towards_eye, right), towards_eye])
    corners = np.asarray(part.whole.points) @ frame.T
    low, high = corners.min(axis=0), corners.max(axis=0)
    pixel_mm = MARGIN * float((high - low)[:2].max()) / pixels
    columns, rows = (max(1, round(MARGIN * side / pixel_mm)) for side in (high - low)[:2])
    if min(columns, rows) < MIN_SHORTER_SIDE:
        raise InputError("--view: from there the target is seen edge on; give another direction")

    plotter = pyvista().Plotter(off_screen=True, window_size=[columns, rows])
    plotter.enable_anti_aliasing("ssaa")
    light(plotter)
    target = plotter.add_mesh(part.whole, color="black", lighting=False, **NO_RENDER)
    rest = plotter.add_mesh(
        part.rest if part.rest.n_cells else pyvista().Sphere(radius=0.0),
        color=GREY, ambient=AMBIENT, diffuse=1.0 - AMBIENT, **NO_RENDER,
    )  # fmt: skip
    middle = 0.5 * (low + high) @ frame
    distance = 2.0 * float(part.whole.length)
    plotter.camera_position = [middle + distance * towards_eye, middle, frame[1]]
    plotter.camera.parallel_projection = True
    plotter.camera.parallel_scale = 0.5 * rows * pixel_mm
    plotter.renderer.ResetCameraClippingRange()
    bare = _screenshot(plotter)
    shown = discs.only(discs.normal @ towards_eye > 0.0)
    if not len(shown.radius):
        return bare.astype(np.uint8), pixel_mm
    actor = disc_actor(_with_rims(shown, pixel_mm), AMBIENT)
    plotter.add_actor(actor, **NO_RENDER)
    dented = _screenshot(plotter)
    # At an edge a disc reaches over the target, into the air or over the rest of the part. Pixels
    # that do not show the target keep the colour that they have without dents.
    plotter.remove_actor(actor, render=False)
    plotter.set_background("black")
    target.prop.color, rest.prop.color, rest.prop.lighting = "white", "black", False
    share = _screenshot(plotter) / 255.0
    plotter.close()
    return (bare + share * (dented - bare)).round().astype(np.uint8), pixel_mm


def _screenshot(plotter: Any) -> np.ndarray:
    plotter.render()
    return np.asarray(plotter.screenshot(None, return_img=True))[..., :3].astype(float)


def _with_rims(discs: Discs, pixel_mm: float) -> Discs:
    """Turn each large disc into a darker one and, upon it, a smaller one in its own colour."""
    rimmed = 2.0 * discs.radius > MIN_RIM_PIXELS * pixel_mm
    row = np.repeat(np.arange(len(rimmed)), 1 + rimmed)
    found = discs.only(row)
    upper = np.zeros(len(row), dtype=bool)
    upper[1:] = row[1:] == row[:-1]
    lower = rimmed[row] & ~upper
    found.radius[upper] *= INNER
    found.colour[lower] = (RIM_SHADE * found.colour[lower]).astype(np.uint8)
    return found


def _draw_length_scale(axes: Axes, shape: tuple[int, ...], pixel_mm: float) -> None:
    """Draw a bar of a round length, at most a fifth of the image's width, below the image."""
    longest = 0.2 * shape[1] * pixel_mm
    power = 10.0 ** np.floor(np.log10(longest))
    length = max(step * power for step in (1.0, 2.0, 5.0) if step * power <= longest)
    bar, below = [0.0, length / pixel_mm], 1.015 * shape[0]
    axes.plot(bar, [below, below], color="black", lw=2, clip_on=False, solid_capstyle="butt")
    axes.text(0.0, below + 0.008 * shape[0], f"{length:g} mm", va="top", fontsize=9)
