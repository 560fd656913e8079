"""What a report says of the tolerances of a design."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from chamberopt.common.estimate import Estimate
from chamberopt.documents.wording import Label, interval_text, metric_label, plain
from chamberopt.pictures.charts.figure_style import SMALL, new_figure, svg_text
from chamberopt.pictures.charts.tolerances import TornadoBar, draw_tornado
from chamberopt.printers import html

if TYPE_CHECKING:
    from chamberopt.results.records import TolerancesRecord, ToleratedFigureRecord

MAX_CHARTS = 3
COLUMNS = ("nominal", "q05", "q95")


def tolerance_contents(found: TolerancesRecord | None) -> dict[str, Any] | None:
    """Ranges and figures in the units shown, from the record of tolerances.

    The figure that the worst corner belongs to comes first.
    """
    if not found:
        return None
    names = sorted(found.figures, key=lambda name: name != found.worst_for)
    return {
        "box": [{"name": name, **one.model_dump()} for name, one in found.box.items()],
        "corner": found.corner,
        "worst_for": metric_label(found.worst_for).text if found.worst_for else "",
        "figures": [_figure(metric_label(name), found.figures[name]) for name in names],
        "notes": found.notes,
    }


def _figure(label: Label, one: ToleratedFigureRecord) -> dict[str, Any]:
    corner = one.corner
    return {
        "label": label.text,
        "unit": label.unit,
        "nominal": label.scale(one.nominal),
        "q05": label.scale(one.q05),
        "q95": label.scale(one.q95),
        "corner": corner
        and {
            "predicted": label.scale(corner.predicted),
            "simulated": label.scale(corner.simulated),
        },
        "effects": {
            name: {"low": label.scale(ends.low), "high": label.scale(ends.high)}
            for name, ends in one.effects.items()
        },
    }


def tolerance_section(contents: Mapping[str, Any] | None) -> str:
    """HTML of the section; nothing for a result without tolerances."""
    if not contents:
        return ""
    text = (
        "Here every number below lies anywhere in its range, each value as likely. One part in "
        "twenty has less than the 5 % column, and one in twenty more than the 95 % column. The "
        "worst corner is one more simulation, with each number at the end that hurts most."
    )
    ranges = html.table(
        "The tolerances",
        ("", "low", "as designed", "high", "worst corner"),
        (
            (row["name"], *(plain(row[key]) for key in ("low", "nominal", "high")),
             plain(contents["corner"][row["name"]]) if contents["corner"] else "")
            for row in contents["box"]
        ),
    )  # fmt: skip
    rows = []
    for figure in contents["figures"]:
        corner = figure["corner"] or {}
        ends = [figure[name] for name in COLUMNS]
        ends += [corner[name] for name in ("simulated", "predicted") if corner]
        named = Label(figure["label"], figure["unit"]).with_unit
        rows.append((named, *map(interval_text, ends)))
    head = ("", "as designed", "5 %", "95 %", "worst corner", "the same to first order")
    figures = html.table("± 95 % intervals", head, rows)
    charted = [one for one in contents["figures"] if any(map(_resolved, one["effects"].values()))]
    charts = ""
    if charted:
        caption = (
            "What each tolerance alone changes: orange at its low end, blue at its high end, with "
            "95 % intervals; grey is in the noise."
        )
        charts = html.chart("tolerances", tornado_chart(charted[:MAX_CHARTS]), caption)
    notes = html.items(contents["notes"])
    return html.section("Tolerances", html.paragraph(text), ranges, figures, charts, notes)


def tornado_chart(figures: list[dict[str, Any]]) -> str:
    """A tornado of each figure, one beside the other, in the order of the first."""

    def bar(figure: Mapping[str, Any], name: str) -> TornadoBar:
        ends = figure["effects"][name]
        return TornadoBar(name, ends["low"], ends["high"])

    def size(name: str) -> float:
        return max(abs(end.value) for end in bar(figures[0], name)[1:])

    names = sorted(figures[0]["effects"], key=size, reverse=True)
    drawn = new_figure(11.0 if len(figures) > 1 else 5.5, 1.3 + 0.35 * len(names))
    panels = drawn.subplots(1, len(figures), squeeze=False, sharey=True)[0]
    for axes, figure in zip(panels, figures, strict=True):
        bars = [bar(figure, name) for name in names]
        draw_tornado(axes, bars, Label("change", figure["unit"]).with_unit)
        axes.set_title(figure["label"], fontsize=SMALL, loc="right")
    return svg_text(drawn, "tolerances")


def _resolved(ends: Mapping[str, Estimate]) -> bool:
    return any(abs(one.value) > one.half_width for one in ends.values())
