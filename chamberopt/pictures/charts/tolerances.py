"""A tornado chart: what each tolerance alone does to a figure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from chamberopt.pictures.charts.colours import BLUE, GREY, ORANGE
from chamberopt.pictures.charts.figure_style import SMALL, literal, style_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from chamberopt.common.estimate import Estimate


class TornadoBar(NamedTuple):
    """Change of the figure at the low and at the high end of a number."""

    name: str
    low: Estimate
    high: Estimate


def draw_tornado(axes: Axes, bars: Sequence[TornadoBar], x_label: str) -> None:
    """Draw a bar for each end of each number, with its 95 % interval; grey where in the noise.

    The first bar is on top.
    """
    for row, bar in enumerate(bars):
        for end, colour in ((bar.low, ORANGE), (bar.high, BLUE)):
            resolved = abs(end.value) > end.half_width
            axes.barh(row, end.value, 0.6, color=colour if resolved else GREY, alpha=0.8)
            if end.half_width:
                axes.errorbar(end.value, row, xerr=end.half_width, color="black", lw=0.8, capsize=2)
    axes.axvline(0.0, color="black", lw=0.8)
    axes.set_yticks(range(len(bars)), [literal(bar.name) for bar in bars], fontsize=SMALL)
    axes.set_ylim(len(bars) - 0.5, -0.5)
    style_axes(axes, x_label)
    axes.tick_params(axis="x", labelsize=SMALL)
    axes.locator_params(axis="x", nbins=5)  # as many as fit beside each other in a report
