"""Draw dimensions, axes and planes of sections on a page, and write tolerances behind numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from chamberopt.common.number_text import typeset_plain as plain
from chamberopt.pictures.charts.colours import DARK_GREY
from chamberopt.pictures.drawing.cuts import SAME

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# All lengths are in mm on the page.

Point = tuple[float, float]
# Value, least and largest value [mm] by key. All three are equal of what follows from other sizes.
Limits = Mapping[str, tuple[float, float, float]]
SIZE, WIDTH = 7.0, 0.4  # pt, of the text and of the lines
SHORT = 9.0  # mm: a shorter dimension has its arrows outside
STUB = 3.5  # mm, of arrows outside
# mm, width of a letter, about, and of the arrows and the line beside a text that breaks it; and how
# far beyond its line a text is that leaves no room for them
LETTER, ARROWS, BESIDE_LINE = 1.25, 5.0, 1.7


def dimension(
    axes: Axes,
    start: Point,
    end: Point,
    away: float,
    text: str,
    upright: bool = False,
    before: bool = False,
) -> None:
    """Draw a dimension: the horizontal or, if upright, the vertical distance of two points.

    Args:
        away: distance of the dimension line below the points, or left of the points if upright.
        text: text in the line, beside it where it is as long, or behind it where it is short.
        before: before a short line, to the left or below, not behind it.
    """

    def turn(x: float, y: float) -> Point:
        return (y, x) if upright else (x, y)

    (x1, y1), (x2, y2) = turn(*start), turn(*end)
    line, past = y1 - away, 1.0 if away > 0 else -1.0
    for x, y in ((x1, y1), (x2, y2)):
        axes.plot(
            *zip(turn(x, y - 0.5 * past), turn(x, line - past), strict=True),
            color=DARK_GREY,
            lw=WIDTH,
        )
    arrow = {"lw": WIDTH, "color": DARK_GREY, "shrinkA": 0.0, "shrinkB": 0.0, "mutation_scale": 5.0}
    middle = x2 - x1 >= SHORT
    if middle:
        ends = [(x1, x2, "<|-|>")]
        place = 0.5 * (x1 + x2)
    else:
        ends = [(x1 - STUB, x1, "-|>"), (x2 + STUB, x2, "-|>"), (x1, x2, "-")]
        place = x1 - STUB - 1.0 if before else x2 + STUB + 1.0
    fits = not middle or fits_in_line(x2 - x1, text)
    for a, b, style in ends:
        arrowed = {**arrow, "arrowstyle": style}
        axes.annotate("", turn(b, line), turn(a, line), arrowprops=arrowed, annotation_clip=False)
    inline = {"fc": "white", "ec": "none", "pad": 0.6}
    x, y = turn(place, line if fits else line - past * BESIDE_LINE)
    ha = "center" if middle or upright else "right" if before else "left"
    va = "center" if middle or not upright else "top" if before else "bottom"
    rotation = 90.0 if upright else 0.0
    axes.text(x, y, text, size=SIZE, ha=ha, va=va, rotation=rotation, bbox=inline, parse_math=False)


def fits_in_line(length: float, text: str) -> bool:
    """Return whether a dimension has room for its text in its line."""
    return length >= LETTER * len(text) + ARROWS


def across_line(axes: Axes, start: Point, end: Point, name: str = "") -> None:
    """Draw a dash-dotted line: an axis, or a section's plane with its name at both ends."""
    axes.plot(*zip(start, end, strict=True), color=DARK_GREY, lw=0.5, ls=(0, (9, 2, 1.5, 2)))
    if name:
        length = math.dist(start, end)
        for (x, y), (from_x, from_y) in ((start, end), (end, start)):
            x, y = x + 2.0 * (x - from_x) / length, y + 2.0 * (y - from_y) / length
            axes.text(x, y, name, size=8.0, ha="center", va="center", weight="bold")


def reference(text: str) -> str:
    """Return the text of a dimension that follows from others: in parentheses (ISO 129-1)."""
    return f"({text})"


def with_limits(text: str, length: float, limits: Limits, *keys: str) -> str:
    """Return the text of a dimension with the tolerance of the key that it shows, if any.

    Args:
        length: the dimension [mm]. A key with another value is not what is drawn.
        keys: keys of [chamber] whose value the dimension may be.
    """
    for key in keys:
        value, low, high = limits.get(key, (math.inf, 0.0, 0.0))
        if abs(value - length) < SAME:
            return toleranced(text, value, low, high)
    return text


def toleranced(text: str, value: float, low: float, high: float) -> str:
    """Return the text of a dimension with its tolerance, or the size that follows from others.

    Args:
        value, low, high: the dimension, and what it may be [mm]; `low` and `high` are equal where
            it follows.
    """
    if low == high:
        return reference(plain(low))
    down, up = value - low, high - value
    if abs(up - down) < 1e-9 * value:
        return f"{text} ±{plain(up)}"
    lower = f"{'−' if down > 0.0 else '+'}{plain(abs(down))}" if down else "0"
    return f"{text} +{plain(up)}/{lower}"
