"""Words and small pictures beside the part: title, colour bar, what the colours mean, a triangle's numbers."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np

from chamberopt.geometry.triangles import unit_normals
from chamberopt.output.viewer.actors import DARK, STILL, escape_dollars, ticks
from chamberopt.output.vtp_files import pyvista
from chamberopt.simulation.triangle_fields import Quantity

SMALL, LARGE = 8, 10  # fonts, in views of NARROW pixels or more
NARROW = 750
HIGH, WIDE = 2.3, 1.0  # a line, and a letter in the mean: pixels for each unit of font size
EDGE = 10  # pixels between words and the view's edge
MARK = "#d6006c"  # of the triangle that is asked about; in none of the colour maps
BINS = 20

Size = tuple[int, int]
"""Pixels of a view."""


def fonts(size: Size) -> tuple[int, int]:
    """The small and the large one: smaller in narrow views."""
    share = min(max(size[0] / NARROW, 0.75), 1.0)
    return round(SMALL * share), round(LARGE * share)


def wrapped(text: str, width: float, font: int) -> str:
    """Lines no wider than `width` [pixels]."""
    letters = max(int(width / (WIDE * font)), 12)
    return "\n".join("\n".join(textwrap.wrap(line, letters)) for line in text.splitlines())


def title(plotter: Any, text: str, lines: Sequence[str], size: Size) -> None:
    """In the upper left, as wide as leaves the bar its room; under it a triangle's numbers, if any."""
    small, large = fonts(size)
    above = wrapped(text, 0.72 * size[0], large)
    _words(
        plotter, "title", above, (EDGE, size[1] - EDGE), large
    ).prop.justification_vertical = "top"
    if lines:
        below = size[1] - 3 * EDGE - HIGH * large * len(above.splitlines())
        numbers = wrapped("\n".join(lines), 0.4 * size[0], small)
        _words(
            plotter, "numbers", numbers, (EDGE, below), small
        ).prop.justification_vertical = "top"


def bar(
    plotter: Any,
    quantity: Quantity,
    limits: tuple[float, float],
    actor: Any,
    number: int,
    size: Size,
) -> None:
    """The colour bar of an actor at the view's right edge, its title above it with the unit."""
    steps, written = ticks(limits)
    scale = plotter.add_scalar_bar(
        title=bar_name(number),  # the words above it are ours: VTK would shrink them to the bar
        mapper=actor.mapper, vertical=True, fmt=written, n_labels=steps + 1, color=DARK, label_font_size=16,
        width=50 / size[0], height=0.46, position_x=1.0 - 100 / size[0], position_y=0.4, render=False,
    )  # fmt: skip
    scale.DrawAboveRangeSwatchOff()
    scale.DrawNanAnnotationOff()
    words = "\n".join(textwrap.wrap(quantity.title, 20))
    above = _words(plotter, "bar title", words, (size[0] - EDGE, 0.885 * size[1]), fonts(size)[1])
    above.prop.justification_horizontal = "right"


def bar_name(number: int) -> str:
    """What pyvista calls the bar of a view by, and writes above it: nothing to be seen."""
    return " " * (number + 1)


def legend(
    plotter: Any, entries: Sequence[tuple[str, str]], remarks: Sequence[str], size: Size
) -> None:
    """Lower left: a patch of each colour with what it means, and remarks above."""
    small, _ = fonts(size)
    line = HIGH * small
    for row, (colour, meaning) in enumerate(reversed(entries)):
        y = EDGE + row * line
        patch = _words(plotter, f"patch {row}", "    ", (EDGE, y), small)
        patch.prop.background_color, patch.prop.background_opacity = colour, 1.0
        _words(plotter, f"meaning {row}", meaning, (EDGE + 4 * small, y), small)
    text = wrapped("\n".join(remarks), 0.32 * size[0], small)
    _words(plotter, "remarks", text, (EDGE, 2 * EDGE + len(entries) * line), small)


def histogram(plotter: Any, speed: np.ndarray) -> None:
    """Impact speeds (k,) [m/s] of a triangle as a chart in the lower right."""
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
    chart.background_color, chart.border_color = (1.0, 1.0, 1.0, 0.85), DARK
    plotter.add_chart(chart)


def mark(plotter: Any, corners: np.ndarray, length: float) -> None:
    """A triangle (3, 3) [mm] outlined, with a pin of some length on it."""
    foot = corners.mean(axis=0)
    tip = foot + length * unit_normals(corners)
    style = {"color": MARK, "lighting": False, "pickable": False, **STILL}
    plotter.add_mesh(
        pyvista().MultipleLines(np.vstack([corners, corners[:1]])), line_width=3, **style
    )
    plotter.add_mesh(pyvista().Line(foot, tip), line_width=3, **style)
    plotter.add_mesh(pyvista().Sphere(radius=0.12 * length, center=tip), **style)


def keys(plotter: Any, text: str, size: Size) -> None:
    """The list of keys, over everything."""
    font = fonts(size)[0]
    left = max(EDGE, 0.5 * size[0] - 30 * font)
    prop = _words(plotter, "keys", text, (left, 0.5 * size[1]), font).prop
    prop.font_family = "courier"
    prop.justification_vertical = "center"
    prop.background_color, prop.background_opacity = "white", 0.94
    prop.show_frame, prop.frame_color = True, DARK


def _words(plotter: Any, name: str, text: str, place: tuple[float, float], font: int) -> Any:
    """A text at a place [pixels] of the view, its lower left corner there."""
    return plotter.add_text(
        escape_dollars(text), position=place, font_size=font, color=DARK, name=name, render=False
    )
