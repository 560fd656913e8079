"""Draw the picture of a calibration: measured points over the bands that the model predicts.

Each kind of measurement, such as arc heights, has a chart of its own.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.estimate import normal_quantile
from chamberopt.pictures.charts.colours import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY
from chamberopt.pictures.charts.figure_style import (
    SMALL,
    TITLE,
    new_figure,
    save_picture,
    style_axes,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from chamberopt.peening.calibrate import Calibrated
    from chamberopt.peening.posterior import Data, Model

COLOURS = BLUE, ORANGE, GREEN, PURPLE, SKY, GREY
COLUMNS = 2
TIMES = 60
Z = normal_quantile(0.95)


def calibration_picture(path: Path, found: Calibrated) -> None:
    """Write a chart for each kind of measurement into one .png.

    Measured points have bars of 95 %, and predictions have bands of 95 %.
    """
    kinds = list(dict.fromkeys(one.kind for one in found.data))
    rows = -(-len(kinds) // COLUMNS)
    figure = new_figure(6.4 * min(COLUMNS, len(kinds)), 4.4 * rows)
    panels = figure.subplots(rows, min(COLUMNS, len(kinds)), squeeze=False).ravel()
    for axes, kind in zip(panels, kinds, strict=False):
        some = [one for one in found.data if one.kind == kind]
        if kind == "arc heights":
            _arcs(axes, found, some)
        elif kind == "coverage":
            _coverage(axes, found, some)
        else:
            _ratios(axes, found, some)
        misfit = next(one for one in found.table.misfits if one.kind == kind)
        title = f"{kind}: chi² = {misfit.chi2:.1f} of {misfit.values}"
        axes.set_title(title, loc="left", fontsize=TITLE)
    for axes in panels[len(kinds) :]:
        axes.set_axis_off()
    save_picture(figure, path)


def _band(found: Calibrated, model: Model) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the predicted figures, and the lower and upper ends of their 95 % band.

    The model predicts logarithms. They are converted to the figures themselves.
    """
    at = model(found.posterior.values)
    sd = np.sqrt(found.posterior.sd(model) ** 2 + at.noise.diagonal())
    low, middle, high = (np.exp(at.values + sign * Z * sd) for sign in (-1.0, 0.0, 1.0))
    return middle, low, high


def _bars(one: Data) -> tuple[np.ndarray, np.ndarray]:
    """Return measured figures, shape (n,), and the lengths of their 95 % bars, shape (2, n).

    Row 0 has the lengths below the figures, and row 1 the lengths above.
    """
    y, sd = np.exp(one.y), np.sqrt(one.covariance.diagonal())
    ends = np.exp(one.y + Z * np.array([[-1.0], [1.0]]) * sd)
    return y, np.abs(ends - y)


def _arcs(axes: Axes, found: Calibrated, some: list[Data]) -> None:
    for one, colour in zip(some, COLOURS * len(some), strict=False):
        assert one.drawn is not None
        times, model = one.drawn
        middle, low, high = _band(found, model)
        axes.fill_between(times, low, high, color=colour, alpha=0.2, lw=0)
        axes.plot(times, middle, color=colour, lw=1.5)
        y, bars = _bars(one)
        axes.errorbar(one.at, y, bars, fmt="o", ms=5, capsize=3, lw=1, color=colour,
                      label=one.label)  # fmt: skip
    axes.set_ylim(bottom=0.0)
    style_axes(axes, "peening time, s", f"arc height of a {found.table.strips} (A), mm")
    axes.legend(fontsize=SMALL, frameon=False, loc="lower right")


def _coverage(axes: Axes, found: Calibrated, some: list[Data]) -> None:
    """Draw measured and predicted coverage against time t, where 1 - exp(-x t) is predicted."""
    for one, colour in zip(some, COLOURS * len(some), strict=False):
        times = np.linspace(0.0, 1.3 * float(one.at.max()), TIMES)
        middle, low, high = (-100.0 * np.expm1(-x[0] * times) for x in _band(found, one.model))
        axes.fill_between(times, low, high, color=colour, alpha=0.2, lw=0)
        axes.plot(times, middle, color=colour, lw=1.5)
        shown, bars = _bars(one)
        ends = np.array([shown - bars[0], shown + bars[1]])
        y = -100.0 * np.expm1(-shown * one.at)
        axes.errorbar(one.at, y, np.abs(-100.0 * np.expm1(-ends * one.at) - y), fmt="o", ms=5,
                      capsize=3, lw=1, color=colour, label=one.label)  # fmt: skip
    axes.set_ylim(0.0, 100.0)
    style_axes(axes, "peening time, s", "coverage, %")
    axes.legend(fontsize=SMALL, frameon=False, loc="lower right")


def _ratios(axes: Axes, found: Calibrated, some: list[Data]) -> None:
    """Draw the ratio of each measured figure to its prediction, on the band of the prediction."""
    names, place = [], 0
    for one in some:
        middle, low, high = _band(found, one.model)
        y, bars = _bars(one)
        for k in range(len(y)):
            axes.fill_between([place - 0.3, place + 0.3], low[k] / middle[k], high[k] / middle[k],
                              color=BLUE, alpha=0.2, lw=0)  # fmt: skip
            axes.errorbar(place, y[k] / middle[k], bars[:, k : k + 1] / middle[k], fmt="o", ms=5,
                          capsize=3, lw=1, color=BLACK)  # fmt: skip
            names.append(_name(one, k))
            place += 1
    axes.axhline(1.0, color=GREY, lw=0.8)
    axes.set_xticks(range(place), names, fontsize=SMALL)
    axes.set_xlim(-0.6, place - 0.4)
    style_axes(axes, "", "measured over predicted")


def _name(one: Data, k: int) -> str:
    if one.kind == "dent diameters":
        return "mean" if k == 0 else "90th percentile"
    if one.kind == "ball drops":
        return f"{one.label}\n{one.at[k]:g} m/s"
    return one.label or one.kind
