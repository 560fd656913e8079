"""Text about the tolerances of a design: how far coverage etc. may be off if its numbers are off.

A ToleratedFigure has several values with intervals, such as its 5 % quantile. Each is a column of
the tables here and of the CSV table. COLUMNS has the headings. A value without an entry has its own
name as heading.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

from chamberopt.common.errors import InputError
from chamberopt.common.estimate import Estimate
from chamberopt.common.key_words import title_with_unit
from chamberopt.common.number_text import estimate_text
from chamberopt.common.number_text import plain as ascii_number
from chamberopt.documents.document import Block, Chart, Items, Section, Sentence, Table
from chamberopt.documents.wording import Label, metric_label, named_value, plain
from chamberopt.pictures.charts.tolerances import TornadoBar, TornadoPanel, tornado_figure

if TYPE_CHECKING:
    from chamberopt.peening.tolerance_result import ToleranceResult, ToleratedFigure
    from chamberopt.results.load import Result

MAX_CHARTS = 3
MOST_ON_SHEET = 3  # figures
ON_SHEET = "almen_intensity", "mean_coverage"  # beside the figure of the worst corner


class Column(NamedTuple):
    """The headings of a value in the report, on the terminal and on the process sheet.

    An empty heading leaves the value out.
    """

    page: str
    terminal: str
    sheet: str


COLUMNS = {
    "nominal": Column("as designed", "as designed", ""),
    "q05": Column("5 %", "q05", "5 % below"),
    "q95": Column("95 %", "q95", "5 % above"),
    "lowest": Column("", "", ""),
    "highest": Column("", "", ""),
    "worst_corner_simulated": Column("worst corner", "in the worst corner", "worst"),
    "worst_corner_predicted": Column("the same to first order", "", ""),
}


def _columns(found: ToleranceResult) -> dict[str, Column]:
    """Return the headings of each value of the figures, by the name of the value, such as "q05"."""
    names = dict.fromkeys(name for one in found.figures.values() for name in one.intervals)
    return COLUMNS | {name: Column(name, name, name) for name in names if name not in COLUMNS}


def _labelled(found: ToleranceResult) -> list[tuple[Label, ToleratedFigure]]:
    """Return each figure over the tolerances with its label.

    The first figure is the figure by which the worst corner of the tolerances was chosen.
    """
    names = sorted(found.figures, key=lambda name: name != found.worst_for)
    return [(metric_label(name), found.figures[name]) for name in names]


def tolerance_section(result: Result) -> Section | None:
    """Return the report's section on tolerances, or None for a result without tolerances."""
    found = result.record.tolerances
    if not found:
        return None
    text = (
        "Here every number below lies anywhere in its range, each value as likely. One part in "
        "twenty has less than the 5 % column, and one in twenty more than the 95 % column. The "
        "worst corner is one more simulation, with each number at the end that hurts most."
    )
    ranges = Table(
        "The tolerances",
        ("", "low", "as designed", "high", "worst corner"),
        [
            (
                title_with_unit(name),
                *map(plain, (one.low, one.nominal, one.high)),
                plain(found.corner[name]) if found.corner else "",
            )
            for name, one in found.box.items()
        ],
    )
    figures = _labelled(found)
    shown = {name: column.page for name, column in _columns(found).items() if column.page}
    rows = [
        (
            label.with_unit,
            *(label.number(one) if one else "" for one in map(figure.intervals.get, shown)),
        )
        for label, figure in figures
    ]
    table = Table("± 95 % intervals", ("", *shown.values()), rows)
    content: list[Block] = [Sentence(text), ranges, table]
    charted = [pair for pair in figures if any(e.is_resolved for e in pair[1].effects.values())]
    if charted:
        caption = (
            "What each tolerance alone changes: orange at its low end, blue at its high end, with "
            "95 % intervals; grey is in the noise."
        )
        panels = [_panel(label, one) for label, one in charted[:MAX_CHARTS]]
        content.append(Chart("tolerances", tornado_figure(panels), caption))
    return Section("Tolerances", [*content, Items(found.notes)])


def _panel(label: Label, figure: ToleratedFigure) -> TornadoPanel:
    bars = {
        name: TornadoBar(title_with_unit(name), label.scale(ends.low), label.scale(ends.high))
        for name, ends in figure.effects.items()
    }
    return TornadoPanel(label.text, Label("change", label.unit).with_unit, bars)


def sheet_rows(found: ToleranceResult) -> Iterator[tuple[str, str]]:
    """Yield rows (name, text) of the process sheet: the main figures over all tolerances."""
    wanted = [metric_label(name) for name in ON_SHEET]
    first, *others = _labelled(found)
    shown = {name: column.sheet for name, column in _columns(found).items() if column.sheet}
    for label, figure in [first, *(pair for pair in others if pair[0] in wanted)][:MOST_ON_SHEET]:
        known = figure.intervals
        texts = [f"{shown[name]} {label.number(known[name])}" for name in shown if name in known]
        yield label.with_unit, "; ".join(texts)


def tolerance_sentences(found: ToleranceResult) -> Iterator[str]:
    """Yield sentences on the main figures over all tolerances, and on the worst corner."""
    yield from (f"Over the tolerances, {name}: {text}." for name, text in sheet_rows(found))
    if found.corner:
        place = ", ".join(named_value(name, value) for name, value in found.corner.items())
        yield f"Worst corner, for the {metric_label(found.worst_for).text}: {place}."


def table_rows(result: Result) -> Iterator[dict[str, object]]:
    """Yield the rows of the CSV table: one row per pair of a figure and a number with a tolerance.

    Raises InputError for a result without tolerances.
    """
    found = result.record.tolerances
    if not found:
        remedy = "simulate a design that has [tolerances] with --tolerances"
        raise InputError(f"{result.folder}: this result is without tolerances; {remedy}")
    columns = _columns(found)
    for figure_name, figure in found.figures.items():
        for number, ends in figure.effects.items():
            box = found.box[number]
            row: dict[str, object] = {"figure": figure_name, "number": number}
            row |= {"low": box.low, "high": box.high}
            changes = {"change_at_low": ends.low, "change_at_high": ends.high}
            known: dict[str, Estimate] = changes | figure.intervals
            for name in (*changes, *columns):
                one = known.get(name)
                row |= {name: one and one.value, f"{name}_half_width": one and one.half_width}
            yield row


def tolerance_lines(found: ToleranceResult) -> list[str]:
    """Return lines for a terminal about the tolerances of a design.

    The lines give all figures over all tolerances and in the worst corner, and the effect of each
    tolerance, by their names in files.
    """
    shown = {name: column.terminal for name, column in _columns(found).items() if column.terminal}
    rows = [["over the tolerances", *shown.values()]]
    for name, figure in found.figures.items():
        known = map(figure.intervals.get, shown)
        rows.append([name, *(estimate_text(one) if one else "" for one in known)])
    lines = [f"{name:34}{''.join(f'{one:19} ' for one in ends)}".rstrip() for name, *ends in rows]
    lines.append("")
    for name, figure in found.figures.items():
        lines.append(f"{name}: change at the low and at the high end of")
        small, none = [], []
        for number, ends in figure.effects.items():
            box = found.box[number]
            if ends.is_resolved:
                low, high = (estimate_text(end, sign=True) for end in (ends.low, ends.high))
                span = f"{number} {ascii_number(box.low)} .. {ascii_number(box.high)}"
                lines.append(f"    {span:50}{low:21} {high}")
            elif ends.low.half_width == ends.high.half_width == 0.0:
                none.append(number)
            else:
                small.append(number)
        lines += [f"    not resolved: {', '.join(small)}"] if small else []
        lines += [f"    does not depend on: {', '.join(none)}"] if none else []
    return lines
