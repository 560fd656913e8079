"""Dimension lines with arrows, and the dash-dotted lines of axes and sections. All in page mm."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from chamberopt.output.plots.colours import DARK_GREY

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Point = tuple[float, float]
SIZE, WIDTH = 7.0, 0.4  # pt, of the text and of the lines
SHORT = 9.0  # mm: a shorter dimension has its arrows and its text outside
STUB = 3.5  # mm, of arrows outside


def dimension(
    axes: Axes, start: Point, end: Point, away: float, text: str, upright: bool = False
) -> None:
    """A dimension between two points, beside one another or, upright, one above the other.

    Args:
        away: how far below the points, or left of them if upright, its line is drawn.
    """
    turn = (lambda x, y: (y, x)) if upright else (lambda x, y: (x, y))
    (x1, y1), (x2, y2) = turn(*start), turn(*end)
    line, past = y1 - away, 1.0 if away > 0 else -1.0
    for x, y in ((x1, y1), (x2, y2)):
        axes.plot(
            *zip(turn(x, y - 0.5 * past), turn(x, line - past), strict=True),
            color=DARK_GREY,
            lw=WIDTH,
        )
    arrow = {"lw": WIDTH, "color": DARK_GREY, "shrinkA": 0.0, "shrinkB": 0.0, "mutation_scale": 5.0}
    if x2 - x1 >= SHORT:
        ends = [(x1, x2, "<|-|>")]
        place = 0.5 * (x1 + x2)
    else:
        ends = [(x1 - STUB, x1, "-|>"), (x2 + STUB, x2, "-|>"), (x1, x2, "-")]
        place = x2 + STUB + 1.0
    for a, b, style in ends:
        arrowed = {**arrow, "arrowstyle": style}
        axes.annotate("", turn(b, line), turn(a, line), arrowprops=arrowed, annotation_clip=False)
    inline = {"fc": "white", "ec": "none", "pad": 0.6}
    middle = x2 - x1 >= SHORT
    x, y = turn(place, line)
    ha = "center" if middle or upright else "left"
    va = "bottom" if upright and not middle else "center"
    rotation = 90.0 if upright else 0.0
    axes.text(x, y, text, size=SIZE, ha=ha, va=va, rotation=rotation, bbox=inline, parse_math=False)


def across_line(axes: Axes, start: Point, end: Point, name: str = "") -> None:
    """The line of an axis, or of a section with its name at both ends."""
    axes.plot(*zip(start, end, strict=True), color=DARK_GREY, lw=0.5, ls=(0, (9, 2, 1.5, 2)))
    if name:
        length = math.dist(start, end)
        for (x, y), (from_x, from_y) in ((start, end), (end, start)):
            x, y = x + 2.0 * (x - from_x) / length, y + 2.0 * (y - from_y) / length
            axes.text(x, y, name, size=8.0, ha="center", va="center", weight="bold")
