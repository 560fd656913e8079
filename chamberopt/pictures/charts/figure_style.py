"""Make a matplotlib figure, save it, style its axes and choose their range, for all charts."""

from __future__ import annotations

import io
import math
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import numpy as np

from chamberopt.common.files import write_bytes

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

    from chamberopt.common.estimate import Estimate

TITLE, SMALL = 11, 9  # font sizes of titles, and of legends and other small text, in every figure
SVG = "http://www.w3.org/2000/svg"


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure of this size [inch], which can be drawn without a display."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    ignore_settings_here()
    figure = Figure(figsize=(width, height), dpi=130, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def ignore_settings_here() -> None:
    """Make matplotlib ignore a settings file in the current folder, which could run programs."""
    import matplotlib

    if Path("matplotlibrc").exists():
        matplotlib.rcdefaults()


def save_picture(figure: Figure, path: Path, finer: int = 1) -> None:
    """Write a figure as .png, whole or not at all, with `finer` times as many pixels a side."""
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=finer * figure.dpi)
    write_bytes(path, content.getvalue())


def svg_text(figure: Figure, name: str, tooltips: Mapping[str, Sequence[str]] | None = None) -> str:
    """Return a figure as an SVG element for an HTML page. Its text can be selected and searched.

    Args:
        name: makes the ids inside unique among the figures of a page.
        tooltips: for the gid (id) of a line, the texts that appear when the mouse is over its
            markers, in the order of its points.
    """
    from matplotlib import rc_context

    file = io.StringIO()
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": name}):
        no_metadata = dict.fromkeys(("Creator", "Date", "Format", "Type"))
        figure.savefig(file, format="svg", metadata=no_metadata)
    text = file.getvalue()
    ElementTree.register_namespace("", SVG)
    ElementTree.register_namespace("xlink", "http://www.w3.org/1999/xlink")
    root = ElementTree.fromstring(text)
    for element in root.iter():
        identity = element.get("id", "")
        for marker, tooltip in zip(
            element.iter(f"{{{SVG}}}use"), (tooltips or {}).get(identity, ()), strict=False
        ):
            ElementTree.SubElement(marker, f"{{{SVG}}}title").text = tooltip
        if identity and f"#{identity}" not in text:
            del element.attrib["id"]  # such as axes_1, which every figure has
    root.set("width", f"{100.0 * figure.get_figwidth():g}")  # pixels; the page may shrink it
    del root.attrib["height"]
    return ElementTree.tostring(root, encoding="unicode")


def style_axes(axes: Axes, x_label: str = "", y_label: str = "") -> None:
    """Give axes a light grid and labels, and remove their frame at the top and right."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.25, lw=0.6)
    axes.set_axisbelow(True)
    if x_label:
        axes.set_xlabel(x_label)
    if y_label:
        axes.set_ylabel(y_label)


def name_choices(axis: Axis, texts: Sequence[str]) -> None:
    """Label an axis with texts, the first at 0, the next at 1. Without texts it stays as it is."""
    if texts:
        axis.set_ticks(range(len(texts)), [one.replace("_", " ") for one in texts])


def value_range(estimates: Sequence[Estimate], most: float = math.inf) -> tuple[float, float]:
    """Return axis limits that show all values, and intervals unless they are very wide.

    Wide intervals, for example of a time that may be infinite, would flatten everything else. They
    are cut off where they extend beyond the values by more than the span of the values.

    Args:
        most: the largest value that is possible, such as 1 for a share: the axis ends there.
    """
    values = np.array([one.value for one in estimates])
    half_widths = np.array([one.half_width for one in estimates])
    half_widths[~np.isfinite(half_widths)] = 0.0  # which have no bars
    span = float(np.ptp(values))
    shown = np.minimum(half_widths, span) if span > 0.0 else half_widths
    low, high = float((values - shown).min()), float((values + shown).max())
    margin = 0.05 * (high - low) or 0.5
    return low - margin, min(high + margin, most)


def keep_below(axes: Axes, most: float) -> None:
    """Let the upright axis of a chart end at the largest value that is possible, such as 1."""
    if axes.get_ylim()[1] > most:
        axes.set_ylim(top=most)


def literal(text: str) -> str:
    """Return a text that matplotlib shows as it is.

    Otherwise `$` begins a formula, and a label that begins with `_` is hidden.
    """
    text = text.replace("$", r"\$")
    return f" {text}" if text.startswith("_") else text
