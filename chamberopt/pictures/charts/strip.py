"""Draw the picture of a virtual Almen strip (`chamberopt strip`).

It has the saturation curve (arc height over time), and the curves that a peening shop would fit to
five arc heights.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.number_text import estimate_text, plain
from chamberopt.pictures.charts.colours import BLACK, BLUE, DARK_GREY, GREEN, ORANGE
from chamberopt.pictures.charts.figure_style import (
    SMALL,
    TITLE,
    new_figure,
    save_picture,
    style_axes,
)

if TYPE_CHECKING:
    from chamberopt.peening.kirk_fit import KirkFit
    from chamberopt.peening.virtual_strip import VirtualStrip

CAVEAT = "five points tell the intensity better than the saturation time"
MULTIPLE_NAMES = "T/4", "T/2", "T", "2 T", "4 T"


def fit_text(fit: KirkFit, strip: VirtualStrip) -> str:
    """Return a text with intensity and saturation time of a fitted curve.

    With each value stands its deviation [%] from the value of the virtual strip itself.
    """
    off = 100.0 * (fit.intensity / strip.intensity.value - 1.0)
    late = 100.0 * (fit.saturation_time / strip.time.value - 1.0)
    symbol = "I" if strip.is_calibrated else "S"
    return (
        f"{symbol} = {plain(fit.intensity, 3)} {strip.unit} ({off:+.0f} %), "
        f"T = {plain(fit.saturation_time, 3)} s ({late:+.0f} %)"
    )


def strip_picture(path: Path, strip: VirtualStrip) -> None:
    """Write a chart of arc height against peening time as .png.

    It shows the virtual strip with its interval, the five arc heights and both fitted curves.
    """
    figure = new_figure(8.6, 5.6)
    axes = figure.subplots()
    times = np.r_[0.0, strip.drawn_at]
    middle, half = np.array([[0.0, 0.0], *([one.value, one.half_width] for one in strip.drawn)]).T
    axes.fill_between(times, middle - half, middle + half, color=BLUE, alpha=0.2, lw=0,
                      label="95 % interval")  # fmt: skip
    axes.plot(times, middle, color=BLUE, lw=1.8, label="virtual strip")
    height, saturation = strip.intensity.value, strip.time.value
    axes.vlines([saturation, 2.0 * saturation], 0.0, [height, 1.1 * height],
                color=DARK_GREY, lw=0.8, ls=":")  # fmt: skip
    axes.hlines([height, 1.1 * height], 0.0, [saturation, 2.0 * saturation],
                color=DARK_GREY, lw=0.8, ls=":")  # fmt: skip
    for fit, parameters, colour, line in zip(
        strip.fits, ("two", "three"), (ORANGE, GREEN), ("--", "-."), strict=True
    ):
        axes.plot(times, fit.at(times), color=colour, lw=1.2, ls=line,
                  label=f"fit of {parameters} parameters: {fit_text(fit, strip)}")  # fmt: skip
    values, bars = np.array([[one.value, one.half_width] for one in strip.heights]).T
    axes.errorbar(strip.at, values, bars, fmt="o", ms=5, capsize=3, lw=1, color=BLACK, zorder=5,
                  label=f"five points, {', '.join(MULTIPLE_NAMES)}")  # fmt: skip
    symbol = "I" if strip.is_calibrated else "S"
    title = (
        f"{strip.setting.type} strip, {strip.setting.place}\n"
        f"{symbol} = {estimate_text(strip.intensity, unit=strip.unit)}, "
        f"T = {estimate_text(strip.time, unit='s')}"
    )
    axes.set_title(title, loc="left", fontsize=TITLE)
    quantity = f"arc height of a {strip.of}" if strip.of else "arc strength, not calibrated"
    style_axes(axes, "peening time, s", f"{quantity}, {strip.unit}")
    axes.set_xlim(0.0, times[-1])
    axes.set_ylim(0.0, 1.12 * float((middle + np.where(np.isfinite(half), half, 0.0)).max()))
    axes.legend(fontsize=SMALL, frameon=False, loc="lower right", title=CAVEAT)
    save_picture(figure, path)
