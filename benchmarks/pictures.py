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
    path: Path, tables: dict[str, Sequence[dict[str, Any]]], words: dict[str, tuple[str, str]]
) -> None:
    """A column for each table, a row for each quantity: all of it against the table's first column.

    Times have a line in proportion to the first column.

    Args:
        words: the quantity of a column, and its words where its row has several, by its name.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.ticker import NullFormatter

    quantities = list(dict.fromkeys(quantity for quantity, _ in words.values()))
    figure = Figure(figsize=(3.4 * len(tables), 8.6), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(
        len(quantities), len(tables), sharex="col", sharey="row", squeeze=False,
        height_ratios=[2, *[1] * (len(quantities) - 1)],
    )  # fmt: skip
    for column, (kind, rows) in zip(grid.T, tables.items(), strict=True):
        across, *others = rows[0]
        sizes = np.array([row[across] for row in rows])
        for axes, quantity in zip(column, quantities, strict=True):
            own = [name for name in others if words[name][0] == quantity]
            for name, colour, mark in zip(own, COLOURS, MARKS, strict=False):
                values = [row[name] for row in rows]
                label = words[name][1]
                axes.loglog(sizes, values, marker=mark, color=colour, lw=1.6, label=label)
            axes.grid(which="major", color="#dddddd", lw=0.7)
            axes.spines[["top", "right"]].set_visible(False)
            axes.set_visible(bool(own))
        low = min(rows[0][name] for name in others if words[name][0] == quantities[0])
        line = {"color": "#999999", "lw": 1, "ls": "--", "label": f"in proportion to {kind}"}
        column[0].loglog(sizes, low * sizes / sizes[0], **line)
        column[0].set_title(f"by number of {kind}", loc="left")
        column[0].legend(frameon=False, fontsize=8.5, loc="upper left")
        last = max(k for k, axes in enumerate(column) if axes.get_visible())
        column[last].set_xlabel(f"number of {across}")
        column[last].tick_params(labelbottom=True)
    for axes, quantity in zip(grid[:, 0], quantities, strict=True):
        low, high = np.log10(axes.get_ylim())
        axes.set_ylim(10 ** np.floor(low), 10 ** np.ceil(high))
        axes.yaxis.set_minor_formatter(NullFormatter())
        axes.set_ylabel(quantity)
    low, high = grid[0, 0].get_ylim()
    grid[0, 0].set_ylim(low, 30 * high)  # room for the legends
    figure.savefig(path)
