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


def growth_picture(
    path: Path, tables: dict[str, Sequence[dict[str, Any]]], words: dict[str, str]
) -> None:
    """A panel for each table, two in a row: all columns against the first, and a line of slope 1.

    Args:
        words: what a column is, by its name.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    lines = -(-len(tables) // 2)
    figure = Figure(figsize=(10.0, 4.8 * lines), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(lines, 2, squeeze=False).ravel()
    for axes in panels[len(tables) :]:
        axes.set_visible(False)
    for axes, (kind, rows) in zip(panels, tables.items(), strict=False):
        across, *others = rows[0]
        sizes = np.array([row[across] for row in rows])
        for name, colour, mark in zip(others, COLOURS, MARKS, strict=False):
            label = words[name]
            values = [row[name] for row in rows]
            axes.loglog(sizes, values, marker=mark, color=colour, lw=1.6, label=label)
        low = min(rows[0][name] for name in others)
        line = {"color": "#bbbbbb", "lw": 1, "ls": "--", "label": "in proportion"}
        axes.loglog(sizes, low * sizes / sizes[0], **line)
        axes.set_title(f"Cost by number of {kind}", loc="left")
        axes.set_xlabel(f"number of {across}")
        axes.grid(which="major", color="#dddddd", lw=0.7)
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(
            frameon=False, fontsize=9, loc="upper left", bbox_to_anchor=(0.0, -0.12), ncols=2
        )
    figure.savefig(path)
