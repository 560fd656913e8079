"""Text about the residual stress under the peened surface, and how well it is known."""

from __future__ import annotations

from typing import TYPE_CHECKING

from chamberopt.chamber.build import TARGET
from chamberopt.coverage.stress_knowledge import DEPTH, OF_STRESS
from chamberopt.documents.document import Beside, Block, Chart, Section, Sentence, Table
from chamberopt.documents.wording import metric_label, plain
from chamberopt.pictures.charts.stress import stress_figure

if TYPE_CHECKING:
    from chamberopt.common.estimate import Estimate
    from chamberopt.results.load import Result
    from chamberopt.results.records import StressRecord

HOW_PEENED = {
    "one_side": "peened on one side and free to bend",
    "held_flat": "peened on one side and held flat",
    "both_sides": "peened on both sides",
}
WHAT_IT_IS = (
    "An estimate: the mean under the surface, by the law of docs/explanation/residual_stress.md. "
    "The law may be wrong by the factors of the last column, in all designs with this metal and "
    "shot alike, whose ratios are better known. A measured profile of the metal is needed to know "
    "more. Relaxation, cyclic softening and fatigue life are not told."
)


def part_text(found: StressRecord) -> str:
    """Return in words in which part the stress is."""
    if found.thickness_mm is None:
        return "in a thick part"
    return f"in a plate of {plain(found.thickness_mm)} mm, {HOW_PEENED[found.peened]}"


def band_text(figure: Estimate, band: float) -> str:
    """Return between which values the law leaves a figure, e.g. "×/÷ 1.5: −300 to −680"."""
    factor = f"×/÷ {plain(band, 3)}"
    if figure.in_words:
        return factor
    ends = sorted((figure.value / band, figure.value * band))
    return f"{factor}: {plain(ends[0], 2)} to {plain(ends[1], 2)}"


def stress_sentence(result: Result) -> str:
    """Return the stress under the target in one sentence, with what its law is good for.

    It is empty if the design asks for none, or none is told.
    """
    found = result.record.stress
    if found is None or TARGET not in found.profiles:
        return ""
    texts = []
    for name in OF_STRESS[:2]:
        label, one = metric_label(name), result.metrics[name]
        texts.append(f"{label.text} {label.format(one)}, {band_text(one, found.bands[name])}")
    return f"Residual stress {part_text(found)}, by a law that may be off: {'; '.join(texts)}."


def stress_section(result: Result, start: Result | None) -> Section | None:
    """Return the report's section on residual stress; None if the design does not ask for it.

    It has the figures of the target and of each zone, and a chart of each profile.
    """
    found = result.record.stress
    if found is None:
        return None
    zones = [zone.name for zone in result.record.zones]
    rows: list[tuple[str, str, str]] = []
    charts: list[Chart] = []
    for name in (TARGET, *zones):
        prefix = "" if name == TARGET else f"{name}."
        for figure in (*OF_STRESS, DEPTH):
            label, one = metric_label(f"{prefix}{figure}"), result.metrics.get(f"{prefix}{figure}")
            if one is not None and figure in found.bands:
                band = band_text(one, found.bands[figure])
                rows.append((label.with_unit, label.number(one), band))
        if name in found.profiles:
            before = start.record.stress if start else None
            curves = {"result" if start is None else "best": found.profiles[name]}
            if before is not None and name in before.profiles:
                curves = {"start": before.profiles[name], **curves}
            caption = f"Residual stress under {'zone ' if prefix else ''}{name}, {part_text(found)}"
            figure_of = stress_figure(curves, found.bands)
            charts.append(Chart(f"stress-{len(charts)}", figure_of, f"{caption}."))
    columns: list[list[Block]] = [[chart] for chart in charts]
    head = ("", "± 95 % interval", "the law is good to")
    content: list[Block] = [Sentence(WHAT_IT_IS), Table(part_text(found), head, rows)]
    return Section("Residual stress", [*content, *([Beside(columns)] if columns else [])])
