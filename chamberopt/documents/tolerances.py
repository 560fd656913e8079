"""Text about the tolerances of a design."""

from __future__ import annotations

from typing import TYPE_CHECKING

from chamberopt.common.number_text import estimate_text
from chamberopt.common.number_text import plain as ascii_number
from chamberopt.documents.document import Block, Chart, Items, Section, Sentence, Table
from chamberopt.documents.terminal_lines import note_lines
from chamberopt.documents.wording import Label, metric_label, plain
from chamberopt.pictures.charts.tolerances import TornadoBar, TornadoPanel, tornado_figure

if TYPE_CHECKING:
    from chamberopt.peening.tolerances import ToleranceResult
    from chamberopt.results.records import EffectEnds, TolerancesRecord, ToleratedFigureRecord

MAX_CHARTS = 3


def tolerated_figures(found: TolerancesRecord) -> list[tuple[Label, ToleratedFigureRecord]]:
    """Return each figure over the tolerances with its label.

    The figure that is lowest in the worst corner comes first.
    """
    names = sorted(found.figures, key=lambda name: name != found.worst_for)
    return [(metric_label(name), found.figures[name]) for name in names]


def tolerance_section(found: TolerancesRecord | None) -> Section | None:
    """Return the report's section on tolerances, or None for a result without tolerances."""
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
                name,
                *map(plain, (one.low, one.nominal, one.high)),
                plain(found.corner[name]) if found.corner else "",
            )
            for name, one in found.box.items()
        ],
    )
    figures = tolerated_figures(found)
    head = ("", "as designed", "5 %", "95 %", "worst corner", "the same to first order")
    rows = [(label.with_unit, *_columns(label, one)) for label, one in figures]
    content: list[Block] = [Sentence(text), ranges, Table("± 95 % intervals", head, rows)]
    charted = [pair for pair in figures if any(map(_is_resolved, pair[1].effects.values()))]
    if charted:
        caption = (
            "What each tolerance alone changes: orange at its low end, blue at its high end, with "
            "95 % intervals; grey is in the noise."
        )
        panels = [_panel(label, one) for label, one in charted[:MAX_CHARTS]]
        content.append(Chart("tolerances", tornado_figure(panels), caption))
    return Section("Tolerances", [*content, Items(found.notes)])


def _columns(label: Label, figure: ToleratedFigureRecord) -> list[str]:
    estimates = [figure.nominal, figure.q05, figure.q95]
    if figure.corner:
        estimates += [figure.corner.simulated, figure.corner.predicted]
    return [label.number(one) for one in estimates]


def _panel(label: Label, figure: ToleratedFigureRecord) -> TornadoPanel:
    bars = {
        name: TornadoBar(name, label.scale(ends.low), label.scale(ends.high))
        for name, ends in figure.effects.items()
    }
    return TornadoPanel(label.text, Label("change", label.unit).with_unit, bars)


def _is_resolved(ends: EffectEnds) -> bool:
    return any(abs(one.value) > one.half_width for one in (ends.low, ends.high))


def tolerance_lines(found: ToleranceResult) -> list[str]:
    """Return lines for a terminal about the tolerances of a design.

    They give the figures over all tolerances, the worst corner and the effect of each tolerance.
    """
    rows = [["over the tolerances", "as designed", "q05", "q95", "in the worst corner"]]
    for name, figure in found.figures.items():
        known = (figure.nominal, figure.q05, figure.q95, figure.simulated)
        rows.append([name, *(estimate_text(one) if one else "" for one in known)])
    lines = [f"{name:34}{''.join(f'{one:19} ' for one in ends)}".rstrip() for name, *ends in rows]
    if found.corner:
        place = ", ".join(f"{name} = {ascii_number(value)}" for name, value in found.corner.items())
        lines.append(f"worst corner, for {found.worst_for}: {place}")
    lines.append("")
    for name, figure in found.figures.items():
        lines.append(f"{name}: change at the low and at the high end of")
        small, none = [], []
        for number in found.numbers:
            effects = figure.effects[number.name]
            if any(abs(end.value) > end.half_width for end in effects):
                low, high = (estimate_text(end, sign=True) for end in effects)
                span = f"{number.name} {ascii_number(number.low)} .. {ascii_number(number.high)}"
                lines.append(f"    {span:50}{low:21} {high}")
            elif all(end.half_width == 0.0 for end in effects):
                none.append(number.name)
            else:
                small.append(number.name)
        lines += [f"    not resolved: {', '.join(small)}"] if small else []
        lines += [f"    does not depend on: {', '.join(none)}"] if none else []
    return [*lines, *note_lines(found.notes)]
