"""What is said of the tolerances of a design."""

from __future__ import annotations

from typing import TYPE_CHECKING

from chamberopt.documents.document import Block, Chart, Items, Section, Sentence, Table
from chamberopt.documents.wording import Label, metric_label, plain
from chamberopt.pictures.charts.tolerances import TornadoBar, TornadoPanel, tornado_figure

if TYPE_CHECKING:
    from chamberopt.results.records import EffectEnds, TolerancesRecord, ToleratedFigureRecord

MAX_CHARTS = 3


def tolerated_figures(found: TolerancesRecord) -> list[tuple[Label, ToleratedFigureRecord]]:
    """Each figure with its label; the figure that the worst corner belongs to comes first."""
    names = sorted(found.figures, key=lambda name: name != found.worst_for)
    return [(metric_label(name), found.figures[name]) for name in names]


def tolerance_section(found: TolerancesRecord | None) -> Section | None:
    """The section on tolerances; None for a result without tolerances."""
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
