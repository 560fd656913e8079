"""Draw the residual stress under a surface, with its interval and the band of the law."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from chamberopt.coverage.stress_knowledge import band_of_profile
from chamberopt.pictures.charts.colours import BLUE, DARK_GREY, GREEN, ORANGE
from chamberopt.pictures.charts.coverage import NARROW
from chamberopt.pictures.charts.figure_style import SMALL, literal, new_figure, style_axes

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure

    from chamberopt.results.records import ProfileRecord

START_COLOUR, COLOUR = ORANGE, {True: GREEN, False: BLUE}


def stress_figure(profiles: Mapping[str, ProfileRecord], bands: Mapping[str, float]) -> Figure:
    """Return a chart of stress [MPa] over depth [µm]: lines, intervals, and the law's wide band.

    Args:
        profiles: by "result", or by "start" and "best". The last has the band.
        bands: factors by which the law may be wrong, by the name of the figure.
    """
    figure = new_figure(*NARROW)
    axes = figure.subplots()
    *_, last = profiles
    depth, stress = (np.array(x) for x in (profiles[last].depth_um, profiles[last].stress_MPa))
    # the law may be deeper than the profile
    longer = np.append(depth, depth[1:] + depth[-1])
    padded = np.append(stress, np.full(len(depth) - 1, stress[-1]))
    low, high = band_of_profile(longer, padded, bands)
    colours = {name: COLOUR[len(profiles) > 1] for name in profiles} | {"start": START_COLOUR}
    label = "what the law is good for, 95 %"
    axes.fill_between(longer, low, high, color=DARK_GREY, alpha=0.15, lw=0, label=label)
    for name, one in profiles.items():
        colour, dashes = colours[name], "--" if name == "start" else "-"
        axes.plot(
            one.depth_um, one.stress_MPa, color=colour, ls=dashes, lw=1.8, label=literal(name)
        )
        if one.half_width_MPa:
            middle, half = np.array(one.stress_MPa), np.array(one.half_width_MPa)
            axes.fill_between(
                one.depth_um, middle - half, middle + half, color=colour, alpha=0.3, lw=0
            )
    axes.axhline(0.0, color=DARK_GREY, lw=0.8)
    axes.set_xlim(0.0, 1.6 * depth[-1])
    axes.legend(fontsize=SMALL, frameon=False, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3)
    style_axes(axes, "depth [µm]", "residual stress [MPa]")
    return figure
