"""Every dent of one peening on the part, what is not peened black, as a .png; needs no OpenGL."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.files import atomic_write
from chamberopt.output.resimulate.dent_map import REST, TARGET, DentMap

if TYPE_CHECKING:
    from matplotlib.colors import Colormap

    from chamberopt.coverage.dents import Dents

FINER = 2  # the map's pixels in one of the picture's: smooth rims
INCH = 130  # pixels
LETTERS = 12  # of the title in an inch
FEWEST, MOST = 200, 1500  # pixels of a side: to read the text by, and 1.6 GB
LOW = 0.8  # height over width of pictures that are put one above the other
BARE, GROUND, PLAIN = 0.0, np.array([0.72, 0.745, 0.77]), 1.0
SHADE = 0.75  # of full light on what is seen at a slant
RIM, RIM_SHADE = (
    0.8,
    0.72,
)  # share of a dent's radius from where it is drawn darker, to tell it from its neighbour
SEEN_RIMS = 12  # pixels across a dent from which rims are drawn
LIGHT = 0.35  # of viridis, from where it cannot be taken for black


def dent_picture(maps: Sequence[DentMap], dents: Dents, title: str, picture: Path) -> None:
    """Draw maps of the same dents beside or above one another, with a bar of dent diameters [µm] and a scale [mm].

    FINER pixels of the maps become one of the picture.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

    diameter = 2e6 * dents.radius
    low, high = np.percentile(diameter, [1.0, 99.0]) if len(dents) else (0.0, 1.0)
    colours, limits = light_colours(), Normalize(low, max(high, low + 1.0), clip=True)
    tall = max(one.view.shape[0] / one.view.shape[1] for one in maps)
    rows, columns = (len(maps), 1) if tall < LOW else (1, len(maps))
    side = max(max(one.view.shape) for one in maps) / FINER / INCH
    size = (side * columns + 1.2, (side * max(tall, 0.25) + 0.3) * rows + 0.6)
    figure = Figure(figsize=size, dpi=INCH, layout="constrained")
    FigureCanvasAgg(figure)
    every = np.atleast_1d(figure.subplots(rows, columns))
    for axes, one in zip(every, maps, strict=True):
        axes.imshow(image(one, dents, colours, limits), interpolation="antialiased")
        axes.set_axis_off()
        _scale(axes, one)
    legend = "black: not peened   grey: not in the target"
    text = "\n".join(fill(one, int(LETTERS * size[0])) for one in (title, legend))
    figure.suptitle(text, x=0.01, ha="left", fontsize=10, parse_math=False)
    bar = figure.colorbar(
        ScalarMappable(limits, colours), ax=list(every), shrink=0.7, extend="both", pad=0.01
    )
    bar.set_label("dent diameter [µm]")
    with atomic_write(picture) as temporary:
        figure.savefig(temporary)


def require_pixels(pixels: int) -> None:
    """InputError for a picture too small to read or too large to hold."""
    if not FEWEST <= pixels <= MOST:
        raise InputError(f"--pixels: given {pixels}; {FEWEST} to {MOST} are supported")


def light_colours() -> Colormap:
    """The light part of viridis: told apart by colour-blind readers, and from black."""
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap

    return ListedColormap(colormaps["viridis"](np.linspace(LIGHT, 1.0, 256)), "light viridis")


def image(one: DentMap, dents: Dents, colours: Colormap, limits: Any) -> np.ndarray:
    """The picture (rows, columns, 3), 0..1, FINER times smaller than the map."""
    picture = np.full((*one.view.shape, 3), PLAIN)
    light = (SHADE + (1.0 - SHADE) * one.facing)[..., None]
    rest, target = one.ground == REST, one.ground == TARGET
    picture[rest] = (GROUND * light)[rest]
    picture[target] = BARE
    dented = one.dent >= 0
    bright = light[dented]
    across = 2.0 * dents.radius[one.dent[dented]] / (FINER * one.view.pixel)
    bright = (
        bright * np.where((one.off[dented] > RIM) & (across > SEEN_RIMS), RIM_SHADE, 1.0)[:, None]
    )
    picture[dented] = colours(limits(2e6 * dents.radius[one.dent[dented]]))[:, :3] * bright
    rows, columns = (FINER * (side // FINER) for side in one.view.shape)
    blocks = picture[:rows, :columns].reshape(rows // FINER, FINER, columns // FINER, FINER, 3)
    return np.asarray(blocks.mean(axis=(1, 3)))


def _scale(axes: Any, one: DentMap) -> None:
    """A bar of a round length, about a fifth of the picture, under it."""
    rows, columns = (side // FINER for side in one.view.shape)
    pixel_mm = 1e3 * FINER * one.view.pixel
    wanted = 0.2 * columns * pixel_mm
    length = max(step * 10.0 ** np.floor(np.log10(wanted)) for step in (0.5, 1.0, 2.0, 5.0) if
                 step * 10.0 ** np.floor(np.log10(wanted)) <= wanted)  # fmt: skip
    low = rows * 1.015
    axes.plot(
        [0, length / pixel_mm],
        [low, low],
        color="black",
        lw=2,
        clip_on=False,
        solid_capstyle="butt",
    )
    axes.text(0, low + 0.008 * rows, f"{length:g} mm", va="top", fontsize=9)
