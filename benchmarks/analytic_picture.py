"""The picture of benchmarks/analytic.py: what hits the plate, and how the mesh converges."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.analytic_runs import BINS, FIGURES, INSCRIBED, PROFILES, Run, relative
from benchmarks.pictures import COLOURS
from chamberopt.common.estimate import estimate

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def picture(
    path: Path, exact: Run, meshed: dict[int, Run], facets: int, edges: dict[str, np.ndarray]
) -> None:
    """Draws the three profiles and how the figures of the mesh converge, two in a row.

    Below each profile stands the ratio of meshed to analytical.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 10.0), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(4, 2, height_ratios=[2.2, 1.0, 2.2, 1.0])
    for number, name in enumerate(PROFILES):
        row, column = 2 * (number // 2), number % 2
        axes = figure.add_subplot(grid[row, column])
        _profile(
            axes,
            figure.add_subplot(grid[row + 1, column], sharex=axes),
            exact,
            meshed[facets],
            name,
            edges[name],
        )
        if number == 0:
            axes.legend(frameon=False, labels=["analytical", f"meshed, {facets} facets"])
    _converges(figure.add_subplot(grid[2:, 1]), exact, meshed)
    for axes in figure.axes:
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(color="#dddddd", lw=0.7)
    figure.savefig(path)


def _profile(axes: Axes, below: Axes, exact: Run, mesh: Run, name: str, edges: np.ndarray) -> None:
    """Impacts per bin width above, meshed over analytical with 95 % intervals below.

    Impacts by distance are given per area instead.
    """
    area = name == "distance from the axis"
    size = np.pi * np.diff(edges**2) / 100.0 if area else np.diff(edges)
    middle = 0.5 * (edges[1:] + edges[:-1])
    both = [[estimate(run.shares[name][:, k]) for k in range(BINS)] for run in (exact, mesh)]
    for estimates, colour, shift, mark in zip(
        both, ("#000000", COLOURS[0]), (-0.06, 0.06), "os", strict=True
    ):
        value, half_width = (
            np.array([getattr(e, what) for e in estimates]) / size
            for what in ("value", "half_width")
        )
        axes.stairs(value, edges, color=colour, lw=1.2, ls="-" if mark == "o" else "--")
        axes.errorbar(
            middle + shift * np.diff(edges),
            value,
            half_width,
            color=colour,
            ls="none",
            marker=mark,
            ms=3,
        )
    axes.set_title(f"impacts by {name}", loc="left")
    axes.set_ylabel(
        f"share of impacts per {'cm²' if area else PROFILES[name].replace('degrees', 'degree')}"
    )
    axes.set_ylim(0.0)
    axes.tick_params(labelbottom=False)
    one, two = (np.array([e.value for e in estimates]) for estimates in both)
    spread = [
        np.hypot(a.half_width / a.value, b.half_width / b.value) for a, b in zip(*both, strict=True)
    ]
    below.errorbar(middle, two / one, spread, color=COLOURS[0], ls="none", marker="s", ms=3)
    below.axhline(1.0, color="#000000", lw=1.0)
    below.set_xlabel(f"{name}, {PROFILES[name]}")
    below.set_ylabel("meshed / analytical")


def _converges(axes: Axes, exact: Run, meshed: dict[int, Run]) -> None:
    """How far volume and figures are off, without sign, against the number of facets.

    Marks are open where the difference may be zero.
    """
    facets = np.array(list(meshed))
    off = np.array([1.0 - run.volume / exact.volume for run in meshed.values()])
    axes.loglog(facets, off, color="#000000", marker="o", label="volume (too small)")
    for shift, name, colour, mark in zip(
        (0.94, 1.0, 1.06), FIGURES, COLOURS[:3], "v^s", strict=True
    ):
        for n, run in meshed.items():
            value, half_width = relative(run, exact, name)
            fill = colour if abs(value) > half_width else "white"
            label = FIGURES[name].split(",")[0] if n == facets[0] else None
            axes.errorbar(
                shift * n,
                abs(value),
                half_width,
                color=colour,
                marker=mark,
                mfc=fill,
                ms=6,
                ls="none",
                label=label,
            )
    axes.plot(
        facets, -INSCRIBED / facets**2, color="#888888", ls=":", label=f"{-INSCRIBED:.2f} / n²"
    )
    axes.set_ylim(2e-4, 1.0)
    axes.set_xticks(facets, [str(n) for n in facets])
    axes.minorticks_off()
    axes.set_title("how far off (open: may be 0)", loc="left")
    axes.set_xlabel("facets of the cylinder, n")
    axes.legend(frameon=False)
