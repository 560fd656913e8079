"""Draw text and charts over a 3D view.

They are the title, the colour bar, the legend, the values of a chosen triangle and the list of
keys.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np

from chamberopt.geometry.triangles import unit_normals
from chamberopt.pictures.actors import DARK, NO_RENDER, colour_bar_ticks, escape_dollars
from chamberopt.pictures.camera import Room
from chamberopt.pictures.quantities import Quantity
from chamberopt.results.vtp_files import pyvista

SMALL_FONT, LARGE_FONT = 9, 11  # in views of at least FULL_WIDTH pixels
FULL_WIDTH = 750
MIN_SCALE = 0.75  # of fonts in narrower views
LINE_HEIGHT, LETTER_WIDTH = 2.3, 1.0  # pixels for each unit of font size; the width is a mean
MIN_LETTERS = 12  # in a line
TITLE, NUMBERS = 0.72, 0.27  # shares of a view's width, for its title and a triangle's numbers
EDGE = 10  # pixels between text and the edge of the view
MARK = "#d6006c"  # colour of the chosen triangle, which no colour map has
BINS = 20
NUMBER = re.compile(r"\S+ \S+ ± \S+( %)?|\d\S* mm²")

Size = tuple[int, int]
"""Width and height of a view [pixels]."""


def fonts(size: Size) -> tuple[int, int]:
    """Return the small and the large font size for a view of `size` [pixels]."""
    scale = min(max(size[0] / FULL_WIDTH, MIN_SCALE), 1.0)
    return round(SMALL_FONT * scale), round(LARGE_FONT * scale)


def _font_file() -> str:
    """Return the file of the font of the program's charts, which views take too."""
    from matplotlib import font_manager

    return str(font_manager.findfont("DejaVu Sans"))


def _set_font(prop: Any) -> None:
    """Give a text the font of the program's charts, by its text property of VTK."""
    import vtk

    prop.SetFontFamily(vtk.VTK_FONT_FILE)
    prop.SetFontFile(_font_file())
    prop.SetBold(False)


def wrap(text: str, width: float, font: int) -> str:
    """Return a text wrapped to lines of a width [pixels].

    A number stays on a line with its interval and its unit.
    """
    text = NUMBER.sub(lambda one: one[0].replace(" ", "\xa0"), text)
    letters = max(int(width / (LETTER_WIDTH * font)), MIN_LETTERS)
    lines = (textwrap.wrap(line, letters) for line in text.splitlines())
    return "\n".join("\n".join(several) for several in lines).replace("\xa0", " ")


def show_margins(plotter: Any, room: Room, size: Size) -> None:
    """Cover the sides of a view that are kept free for text with white, so that no part shows."""
    import vtk

    left, right = room.left / size[0], 1.0 - room.right / size[0]
    low, high = room.below / size[1], 1.0 - room.above / size[1]
    for number, (x0, x1, y0, y1) in enumerate(
        ((0.0, left, 0.0, 1.0), (right, 1.0, 0.0, 1.0), (0.0, 1.0, 0.0, low), (0.0, 1.0, high, 1.0))
    ):
        mapper, place = vtk.vtkPolyDataMapper2D(), vtk.vtkCoordinate()
        place.SetCoordinateSystemToNormalizedViewport()
        mapper.SetTransformCoordinate(place)
        corners = np.array([[x0, y0, 0.0], [x1, y0, 0.0], [x1, y1, 0.0], [x0, y1, 0.0]])
        mapper.SetInputData(pyvista().PolyData(corners, [4, 0, 1, 2, 3]))
        strip = vtk.vtkActor2D()
        strip.SetMapper(mapper)
        strip.GetProperty().SetColor(1.0, 1.0, 1.0)
        plotter.add_actor(strip, name=f"margin {number}", pickable=False, **NO_RENDER)


def title_height(title: str, size: Size) -> float:
    """Return the height of the title that show_title draws in a view [pixels]."""
    large = fonts(size)[1]
    return 2 * EDGE + LINE_HEIGHT * large * len(wrap(title, TITLE * size[0], large).splitlines())


def show_title(plotter: Any, title: str, lines: Sequence[str], size: Size) -> None:
    """Write the title in the upper left of a view, and below it lines about a chosen triangle."""
    small, large = fonts(size)
    title = wrap(title, TITLE * size[0], large)
    text = _add_text(plotter, "title", title, (EDGE, size[1] - EDGE), large)
    text.prop.justification_vertical = "top"
    text.prop.background_color, text.prop.background_opacity = "white", 0.85  # over a tall part
    if lines:
        below = size[1] - 3 * EDGE - LINE_HEIGHT * large * len(title.splitlines())
        numbers = wrap("\n".join(lines), NUMBERS * size[0], small)
        text = _add_text(plotter, "numbers", numbers, (EDGE, below), small)
        text.prop.justification_vertical = "top"


def show_colour_bar(
    plotter: Any,
    quantity: Quantity,
    limits: tuple[float, float],
    beyond: tuple[bool, bool],
    actor: Any,
    name: str,
    size: Size,
) -> None:
    """Draw the colour bar of a surface at the right edge of the view, with its title above it.

    Args:
        limits: values at the ends of the bar.
        beyond: whether values are below and above the limits.
        actor: actor of the surface, whose mapper has the colours.
        name: title of the bar.
        size: width and height of the view [pixels].
    """
    steps, number_format = colour_bar_ticks(limits)
    bar = plotter.add_scalar_bar(
        title=name,  # blanks, because VTK would shrink a title to the bar: it is written below
        mapper=actor.mapper, vertical=True, fmt=number_format, n_labels=steps + 1, color=DARK,
        label_font_size=16, width=50 / size[0], height=0.46, position_x=1.0 - 100 / size[0],
        position_y=0.4, render=False,
    )  # fmt: skip
    _set_font(bar.GetLabelTextProperty())
    bar.DrawAboveRangeSwatchOff()
    bar.DrawNanAnnotationOff()
    lines = textwrap.wrap(quantity.title, 14)
    if any(beyond) or (quantity.unit == "%" and limits != (0.0, 100.0)):
        low, high = (mark * is_beyond for mark, is_beyond in zip(("≤ ", "≥ "), beyond, strict=True))
        lines.append(f"{low}{limits[0]:g} to {high}{limits[1]:g} {quantity.unit}".rstrip())
    title = "\n".join(lines)
    place = (size[0] - EDGE, 0.885 * size[1])
    text = _add_text(plotter, "bar title", title, place, fonts(size)[1])
    text.prop.justification_horizontal = "right"


def show_legend(
    plotter: Any, entries: Sequence[tuple[str, str]], remarks: Sequence[str], size: Size, width: int
) -> None:
    """Draw a patch of each colour with its meaning in the lower left of a view, and remarks above.

    Args:
        entries: colours with their meanings.
        width: width of the legend [pixels].
    """
    small, _ = fonts(size)
    line, x, row = LINE_HEIGHT * small, EDGE, 0
    for number, (colour, meaning) in enumerate(reversed(entries)):
        taken = int((8 + LETTER_WIDTH * len(meaning)) * small)
        if x > EDGE and x + taken > width:
            x, row = EDGE, row + 1
        y = EDGE + row * line
        patch = _add_text(plotter, f"patch {number}", "    ", (x, y), small)
        patch.prop.background_color, patch.prop.background_opacity = colour, 1.0
        _add_text(plotter, f"meaning {number}", meaning, (x + 4 * small, y), small)
        x += taken
    text = wrap("   ".join(one.replace(" ", "\xa0") for one in remarks), width, small)
    _add_text(plotter, "remarks", text, (EDGE, EDGE + 1.2 * line + row * line), small)


def show_histogram(plotter: Any, speed: np.ndarray) -> None:
    """Draw a histogram of a triangle's impact speeds (k,) [m/s] in the lower right of a view."""
    chart = pyvista().Chart2D(size=(0.36, 0.33), loc=(0.63, 0.02))
    counts, edges = np.histogram(speed, BINS, (0.0, float(speed.max()) or 1.0))
    chart.bar(0.5 * (edges[:-1] + edges[1:]), counts.astype(float), color=MARK)
    chart.title = f"{len(speed)} simulated impacts"
    chart.x_label, chart.y_label = "normal speed [m/s]", "impacts"
    most = int(counts.max())
    chart.y_range = (0.0, 1.1 * most)
    whole = list(range(0, most + 1, -(-most // 5)))
    chart.y_axis.tick_locations, chart.y_axis.tick_labels = whole, [str(one) for one in whole]
    for axis in (chart.x_axis, chart.y_axis):
        axis.label_size, axis.tick_label_size, axis.grid = 15, 13, False
        for prop in (axis.GetTitleProperties(), axis.GetLabelProperties()):
            _set_font(prop)
    _set_font(chart.GetTitleProperties())
    chart.background_color, chart.border_color = (1.0, 1.0, 1.0, 0.85), DARK
    plotter.add_chart(chart)


def mark_triangle(plotter: Any, corners: np.ndarray, length: float) -> None:
    """Outline a triangle in a view, and draw a pin that stands on it.

    Args:
        corners: corners of the triangle [mm], (3, 3).
        length: length of the pin [mm].
    """
    centre = corners.mean(axis=0)
    tip = centre + length * unit_normals(corners)
    style = {"color": MARK, "lighting": False, "pickable": False, **NO_RENDER}
    plotter.add_mesh(
        pyvista().MultipleLines(np.vstack([corners, corners[:1]])), line_width=3, **style
    )
    plotter.add_mesh(pyvista().Line(centre, tip), line_width=3, **style)
    plotter.add_mesh(pyvista().Sphere(radius=0.12 * length, center=tip), **style)


def show_keys(plotter: Any, text: str, size: Size) -> None:
    """Write the list of the keys that the viewer understands over everything else."""
    font = fonts(size)[0]
    left = max(EDGE, 0.5 * size[0] - 30 * font)
    prop = _add_text(plotter, "keys", text, (left, 0.5 * size[1]), font).prop
    prop.font_family = "courier"
    prop.justification_vertical = "center"
    prop.background_color, prop.background_opacity = "white", 0.94
    prop.show_frame, prop.frame_color = True, DARK


def _add_text(plotter: Any, name: str, text: str, place: tuple[float, float], font: int) -> Any:
    """Add a text to a view, and return its actor.

    Args:
        place: position of the text's lower left corner in the view [pixels].
    """
    style = {"font_size": font, "font_file": _font_file(), "color": DARK, "render": False}
    return plotter.add_text(escape_dollars(text), position=place, name=name, **style)
