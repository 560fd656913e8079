"""Draw tornado charts, which show the effect of each single tolerance on coverage or intensity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from chamberopt.pictures.charts.colours import BLUE, GREY, ORANGE
from chamberopt.pictures.charts.figure_style import SMALL, literal, new_figure, style_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from chamberopt.common.estimate import Estimate


class TornadoBar(NamedTuple):
    """Changes of a result at the low and at the high end of the tolerance of a design's number."""

    name: str
    low: Estimate
    high: Estimate


class TornadoPanel(NamedTuple):
    """The chart of a result, such as mean coverage: its bars, by names of toleranced numbers."""

    title: str
    x_label: str
    bars: Mapping[str, TornadoBar]


def tornado_figure(panels: Sequence[TornadoPanel]) -> Figure:
    """Return the tornado charts of several results, such as mean coverage, side by side.

    The toleranced numbers are ordered by their effect on the first result.
    """

    def size(name: str) -> float:
        return max(abs(end.value) for end in panels[0].bars[name][1:])

    names = sorted(panels[0].bars, key=size, reverse=True)
    figure = new_figure(11.0 if len(panels) > 1 else 5.5, 1.3 + 0.35 * len(names))
    drawn = figure.subplots(1, len(panels), squeeze=False, sharey=True)[0]
    for axes, panel in zip(drawn, panels, strict=True):
        draw_tornado(axes, [panel.bars[name] for name in names], panel.x_label)
        axes.set_title(panel.title, fontsize=SMALL, loc="right")
    return figure


def draw_tornado(axes: Axes, bars: Sequence[TornadoBar], x_label: str) -> None:
    """Draw the change of a result at each end of each number's tolerance, with 95 % intervals.

    The first toleranced number is on top. Bars no longer than their interval are grey.
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
    axes.locator_params(axis="x", nbins=5)  # as many labels as fit in a report
