"""Draw where the energy of the shot goes: its shares by surface, and maps of sonotrode and wall."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.pictures.charts.colours import BLUE, ORANGE
from chamberopt.pictures.charts.figure_style import new_figure, save_picture, style_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from chamberopt.results.impact_energy import EnergyMap, ImpactEnergy

MW_PER_CM2 = 0.1  # one W/m² in mW/cm²
COLUMNS = 2
BRIGHTEST = 99.0  # percentile of the bins at which the colours end


def energy_picture(path: Path, found: ImpactEnergy) -> None:
    """Write a chart of shares by surface and maps of power over area, two in a row, as .png."""
    count = 1 + len(found.maps)
    rows, columns = -(-count // COLUMNS), min(count, COLUMNS)
    figure = new_figure(5.0 * columns, 4.4 * rows)
    panels = np.atleast_1d(figure.subplots(rows, columns)).ravel()
    for axes in panels[count:]:
        axes.set_visible(False)
    _shares(panels[0], found)
    for axes, one in zip(panels[1:], found.maps, strict=False):
        _map(axes, one)
    save_picture(figure, path)


def _shares(axes: Axes, found: ImpactEnergy) -> None:
    total = found.lost
    rows = found.surfaces[::-1]
    shares = [100.0 * one.lost_power.value / total for one in rows]
    widths = [100.0 * one.lost_power.half_width / total for one in rows]
    places = np.arange(len(rows))
    axes.barh(places, shares, xerr=widths, color=BLUE, ecolor=ORANGE, height=0.6)
    axes.set_yticks(places, [one.name.removeprefix("the ") for one in rows])
    axes.set_xlim(left=0.0)
    style_axes(axes, "share of what rebounds lose [%]")


def _map(axes: Axes, one: EnergyMap) -> None:
    shown = MW_PER_CM2 * one.power
    known = shown[np.isfinite(shown)]
    top = float(np.percentile(known, BRIGHTEST)) if len(known) else 1.0
    across = one.across if one.is_unrolled else 1e3 * one.across
    image = axes.pcolormesh(across, 1e3 * one.up, shown.T, cmap="inferno", vmin=0.0, vmax=top)
    if one.is_unrolled:
        style_axes(axes, "angle about the axis [degrees]", "height [mm]")
    else:
        axes.set_aspect("equal")
        style_axes(axes, "x [mm]", "y [mm]")
    axes.set_title(one.title, fontsize=9)
    axes.figure.colorbar(image, ax=axes, shrink=0.8, label="energy of impacts [mW/cm²]")
