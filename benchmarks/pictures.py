"""Benchmark lines on logarithmic axes, in colours and marks that suit colour-blind readers."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

IMAGES = Path(__file__).parents[1] / "docs" / "images"
# Okabe and Ito's colours; the product is black
COLOURS = ("#D55E00", "#CC79A7", "#E69F00", "#009E73", "#56B4E9", "#0072B2", "#888888")
MARKS = "v^sPD*X"
MARGIN = 0.3  # decades beside a panel's lines


def lines_picture(
    path: Path,
    rows: Sequence[dict[str, Any]],
    panel: str,
    across: str,
    up: str,
    product: str,
    title: str,
) -> None:
    """Plots column ``up`` [ns] against column ``across``.

    There is a line for each structure and a panel for each value of ``panel``.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    panels, structures = (
        list(dict.fromkeys(row[column] for row in rows)) for column in (panel, "structure")
    )
    others = [structure for structure in structures if structure != product]
    looks = {name: (COLOURS[i], MARKS[i], 1.5) for i, name in enumerate(others)} | {
        product: ("#000000", "o", 2.6)
    }
    figure = Figure(figsize=(3.0 + 4.0 * len(panels), 5.4), dpi=130, layout="constrained")
    FigureCanvasAgg(figure)
    spans = [
        (min(numbers), max(numbers))
        for numbers in ([r[across] for r in rows if r[panel] == p] for p in panels)
    ]
    decades = [
        MARGIN + np.log10(last / first) for first, last in spans
    ]  # as wide in all panels: slopes compare
    grid = figure.subplots(1, len(panels), sharey=True, squeeze=False, width_ratios=decades)[0]
    for axes, name, span in zip(grid, panels, spans, strict=True):
        for structure in structures:
            points = [
                (row[across], row[up])
                for row in rows
                if (row[panel], row["structure"]) == (name, structure)
            ]
            colour, mark, width = looks[structure]
            axes.loglog(
                *zip(*points, strict=True), marker=mark, color=colour, lw=width, label=structure
            )
        axes.set_xlim(span[0] / 10 ** (MARGIN / 2), span[1] * 10 ** (MARGIN / 2))
        axes.set_title(name, loc="left")
        axes.set_xlabel(across)
        axes.grid(which="major", color="#dddddd", lw=0.7)
        axes.spines[["top", "right"]].set_visible(False)
    grid[0].set_ylabel(title)
    figure.legend(
        *grid[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False
    )
    figure.savefig(path)


def growth_picture(path: Path, tables: dict[str, Sequence[dict[str, Any]]]) -> None:
    """A panel for each table: all columns against the first, and a line of slope 1."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.2 * len(tables), 5.0), dpi=130, layout="constrained")
    FigureCanvasAgg(figure)
    for axes, (kind, rows) in zip(figure.subplots(1, len(tables), squeeze=False)[0],
                                  tables.items(), strict=True):  # fmt: skip
        across, *others = rows[0]
        sizes = np.array([row[across] for row in rows])
        for name, colour, mark in zip(others, COLOURS, MARKS, strict=False):
            label = name.replace("_", " ").replace("cpu s", "CPU s")
            values = [row[name] for row in rows]
            axes.loglog(sizes, values, marker=mark, color=colour, lw=1.6, label=label)
        low = min(rows[0][name] for name in others)
        axes.loglog(sizes, low * sizes / sizes[0], color="#bbbbbb", lw=1, ls="--", label="linear")
        axes.set_title(f"against {kind}", loc="left")
        axes.set_xlabel(across)
        axes.grid(which="major", color="#dddddd", lw=0.7)
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(frameon=False, fontsize=9)
    figure.savefig(path)
