"""Write a picture of several views with captions, dimensions, a colour bar and a legend.

A view is an image of surfaces, drawn in 3D. Matplotlib lays out all else round the views, so
nothing lies over the part, and the size of texts does not depend on the picture's size.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from chamberopt.pictures.charts.colours import DARK_GREY
from chamberopt.pictures.charts.figure_style import literal, new_figure, save_picture
from chamberopt.pictures.view import View

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap

PER_INCH = 130  # pixels, as new_figure has them
TITLE, TEXT, SMALL = 14, 12, 11  # font sizes
LINE, HEADLINE = 30, 34  # pixels, height of a line of text and of a title
EDGE, BETWEEN = 14, 30  # pixels round the page and between views
BAR, PATCH = 130, 30  # pixels, width of a colour bar with labels, and of a colour in the legend
LETTER = 1.05  # pixels, width of a letter over its font size
GAP = 24  # pixels between a body and its dimension line
FOOT = 74  # pixels below a view, for its axes and its scale
TRIAD = 22  # pixels, length of the arrows of the axes
AXIS_COLOURS = {"x": "#a33530", "y": "#2e7d32", "z": "#1f4e9c"}


class Dimension(NamedTuple):
    """A dimension to draw beside a view.

    Attributes:
        ends: the two points between which it is measured [mm], (2, 3).
        row: how far outside it is drawn; row 1 is farther out than row 0.
    """

    ends: np.ndarray
    text: str
    row: int = 0


class Mark(NamedTuple):
    """A text to write at a place [mm], (3,)."""

    place: np.ndarray
    text: str


class Panel(NamedTuple):
    """A view with its caption.

    Attributes:
        view: the image to show.
        caption: short text above the view.
        dimensions: lengths to draw round the points `outside`.
        outside: points [mm], (k, 3), that no dimension may cross.
        is_cut: true if the part reaches beyond the view, which then has a frame.
        marks: texts to write on the view.
    """

    view: View
    caption: str
    dimensions: Sequence[Dimension] = ()
    outside: np.ndarray | None = None
    is_cut: bool = False
    marks: Sequence[Mark] = ()


class ColourBar(NamedTuple):
    """A colour bar to draw: the colours of a quantity between two limits, with a label."""

    label: str
    colours: str | Colormap
    limits: tuple[float, float]
    beyond: str = "neither"  # limits that values exceed: neither, min, max, both


class Row(NamedTuple):
    """A row of a picture: panels (views with captions) side by side, and their common title."""

    title: str
    panels: Sequence[Panel]


def write_page(
    picture: str | Path,
    rows: Sequence[Row],
    legend: Sequence[tuple[str, str]] = (),
    bar: ColourBar | None = None,
    remarks: Sequence[str] = (),
) -> None:
    """Write rows of views as a picture.

    Args:
        picture: .png file to write.
        rows: rows of views; one may have fewer views than another.
        legend: colours and their meaning.
        bar: colour bar beside the views.
        remarks: sentences below the views.
    """
    images = [[one.view.size for one in row.panels] for row in rows]
    heights = [max(one[0] for one in row) + FOOT for row in images]
    columns = zip_longest(*images, fillvalue=(0, 0))
    widths = [max(one[1] for one in column) for column in columns]
    left = EDGE + np.cumsum([0, *(one + BETWEEN for one in widths)])
    across = float(left[-1] + (BAR if bar else 0.0))
    titles = [_wrapped(row.title, across, TITLE) for row in rows]
    below, entries = (
        [_wrapped(one, across, SMALL) for one in remarks],
        _legend_lines(legend, across),
    )
    foot = EDGE + LINE * (len(entries) + sum(1 + one.count("\n") for one in below))
    heads = [LINE + HEADLINE * (1 + one.count("\n")) for one in titles]
    total = foot + sum(heads) + sum(heights) + EDGE
    figure = new_figure(across / PER_INCH, total / PER_INCH)

    def place(x: float, y: float, width: float, height: float) -> tuple[float, float, float, float]:
        """Convert a rectangle from pixels, with y from the top, to shares of the figure."""
        return x / across, 1.0 - (y + height) / total, width / across, height / total

    top = float(EDGE)
    for row, title, head, height in zip(rows, titles, heads, heights, strict=True):
        x, y, _, _ = place(EDGE, top, 0.0, 0.0)
        figure.text(x, y, literal(title), fontsize=TITLE, va="top", linespacing=1.3)
        for x, panel in zip(left, row.panels, strict=False):
            rows_of, columns_of = panel.view.size
            _draw_panel(figure.add_axes(place(x, top + head, columns_of, rows_of + FOOT)), panel)
        top += head + height
    if bar is not None:
        first = EDGE + heads[0]
        middle, long = 0.5 * (first + top), min(0.85 * (top - first), 600.0)
        _draw_bar(figure.add_axes(place(left[-1], middle - 0.5 * long, 30.0, long)), bar)
    axes = figure.add_axes(place(0.0, top, across, foot), xlim=(0.0, across), ylim=(foot, 0.0))
    axes.set_axis_off()
    _draw_foot(axes, below, entries)
    save_picture(figure, Path(picture), max(one.view.finer for row in rows for one in row.panels))


def _wrapped(text: str, pixels: float, font: int) -> str:
    """Return a text broken into lines of at most a width [pixels]."""
    letters = max(int(pixels / (LETTER * font)), 12)
    return "\n".join(fill(line, letters) for line in text.split("\n"))


def _draw_panel(axes: Axes, panel: Panel) -> None:
    from matplotlib.patches import Rectangle

    rows, columns = panel.view.size
    corners = (-0.5, columns - 0.5, rows - 0.5, -0.5)
    axes.imshow(panel.view.image, interpolation="antialiased", extent=corners)
    axes.set_aspect("auto")
    axes.set_xlim(-0.5, columns - 0.5)
    axes.set_ylim(rows + FOOT - 0.5, -0.5)
    axes.set_axis_off()
    if panel.is_cut:
        frame = Rectangle((-0.5, -0.5), columns, rows, fill=False, ec="#c4c9ce", clip_on=False)
        axes.add_patch(frame)
    axes.set_title(literal(panel.caption), loc="left", fontsize=TEXT)
    for one in panel.dimensions:
        _draw_dimension(axes, panel, one)
    for mark in panel.marks:
        x, y = panel.view.pixels(mark.place[None])[0]
        axes.text(x, y, mark.text, fontsize=TEXT, ha="center", va="center", weight="bold",
                  bbox={"boxstyle": "circle,pad=0.2", "fc": "white", "ec": "black"})  # fmt: skip
    _draw_triad(axes, panel.view.frame, (36.0, rows + 42.0))
    draw_scale(axes, panel.view, (100.0, rows + 34.0))


def draw_scale(axes: Axes, view: View, place: tuple[float, float]) -> None:
    """Draw a scale bar of a round length in mm, at most a quarter of the image's width."""
    longest = 0.25 * view.size[1] * view.pixel_mm
    power = 10.0 ** np.floor(np.log10(longest))
    length = max(step * power for step in (1.0, 2.0, 5.0) if step * power <= longest)
    x, y = place
    axes.plot([x, x + length / view.pixel_mm], [y, y], color="black", lw=2.5, clip_on=False,
              solid_capstyle="butt")  # fmt: skip
    axes.text(x, y + 8.0, f"{length:g} mm", va="top", fontsize=SMALL)


def _draw_triad(axes: Axes, frame: np.ndarray, place: tuple[float, float]) -> None:
    """Draw the x, y and z axes of a view as arrows, arrows towards the eye last."""
    for k in np.argsort(frame[2]):
        name = "xyz"[k]
        step = TRIAD * frame[:2, k] * [1.0, -1.0]
        colour = AXIS_COLOURS[name]
        axes.annotate("", np.add(place, step), place, annotation_clip=False,
                      arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.6,
                                  "shrinkA": 0, "shrinkB": 0})  # fmt: skip
        length = np.linalg.norm(step)
        if length > 0.25 * TRIAD:
            x, y = np.add(place, step * (1.0 + 9.0 / length))
            axes.text(x, y, name, color=colour,
                      ha="center", va="center", fontsize=SMALL)  # fmt: skip


def _draw_dimension(axes: Axes, panel: Panel, one: Dimension) -> None:
    """Draw a dimension line with its length, outside of all that the view shows.

    Extension lines join it to the points between which it is measured.
    """
    assert panel.outside is not None
    around = panel.view.pixels(panel.outside)
    start, end = panel.view.pixels(one.ends)
    along = (end - start) / max(float(np.linalg.norm(end - start)), 1e-9)
    away = np.array([-along[1], along[0]])
    if (0.5 * (start + end) - 0.5 * (around.min(axis=0) + around.max(axis=0))) @ away < 0.0:
        away = -away
    offset = float((around @ away).max()) + GAP * (1.0 + 1.8 * one.row)
    ends = [point + (offset - point @ away) * away for point in (start, end)]
    style: dict[str, Any] = {"color": DARK_GREY, "lw": 0.9, "clip_on": False}
    for point, tip in zip((start, end), ends, strict=True):
        axes.plot(*np.stack([point, tip + 5.0 * away]).T, **{**style, "lw": 0.6, "alpha": 0.6})
    axes.annotate("", ends[0], ends[1], annotation_clip=False,
                  arrowprops={"arrowstyle": "<|-|>", "color": DARK_GREY, "lw": 0.9,
                              "shrinkA": 0, "shrinkB": 0})  # fmt: skip
    angle = float(np.degrees(np.arctan2(-along[1], along[0])))
    angle = (angle + 90.0) % 180.0 - 90.0 if abs(abs(angle) - 90.0) > 1e-6 else 90.0
    x, y = 0.5 * (ends[0] + ends[1]) + 19.0 * away
    clear = {"facecolor": "white", "edgecolor": "none", "pad": 1.5}  # of lines of others
    axes.text(x, y, one.text, rotation=angle, ha="center", va="center", bbox=clear, zorder=5,
              rotation_mode="anchor", fontsize=SMALL, color=DARK_GREY)  # fmt: skip


def _draw_bar(axes: Axes, bar: ColourBar) -> None:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.ticker import MaxNLocator

    drawn = axes.figure.colorbar(
        ScalarMappable(Normalize(*bar.limits), bar.colours), cax=axes, extend=bar.beyond
    )
    drawn.locator = MaxNLocator(5, steps=[1, 2, 5, 10])  # ticks of few digits leave the label room
    drawn.update_ticks()
    drawn.set_label(literal(bar.label), fontsize=TEXT)
    axes.tick_params(labelsize=SMALL)


def _legend_lines(
    legend: Sequence[tuple[str, str]], across: float
) -> list[list[tuple[float, str, str]]]:
    """Return the entries of a legend, broken into lines of at most `across` pixels.

    An entry has its distance from the left [pixels], its colour and its meaning.
    """
    lines: list[list[tuple[float, str, str]]] = []
    x = across
    for colour, meaning in legend:
        width = PATCH + LETTER * TEXT * (len(meaning) + 2)
        if x + width > across:
            lines.append([])
            x = EDGE
        lines[-1].append((x, colour, meaning))
        x += width
    return lines


def _draw_foot(
    axes: Axes, remarks: Sequence[str], lines: Sequence[Sequence[tuple[float, str, str]]]
) -> None:
    """Write the legend and the remarks at the foot of a picture.

    Args:
        axes: axes in pixels from the upper left corner of the foot.
        lines: lines of the legend; an entry has its distance from the left [pixels], colour and
            meaning.
    """
    from matplotlib.patches import Rectangle

    for row, entries in enumerate(lines):
        y = LINE * (row + 0.5)
        for x, colour, meaning in entries:
            axes.add_patch(Rectangle((x, y - 8), 0.7 * PATCH, 16, fc=colour, ec="#666666", lw=0.5))
            axes.text(x + PATCH, y, literal(meaning), va="center", fontsize=TEXT)
    text = "\n".join(map(literal, remarks))
    y = LINE * (len(lines) + 0.1)
    axes.text(EDGE, y, text, va="top", fontsize=SMALL, linespacing=1.4, color=DARK_GREY)
