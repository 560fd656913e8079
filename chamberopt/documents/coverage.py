"""Text about coverage: figures of the result and of the start design, with their change.

Figures are the objective and the metrics, such as mean coverage.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from chamberopt.common.estimate import (
    NOT_PROVEN,
    NOT_RESOLVED,
    Estimate,
    independent_difference,
    paired_difference,
)
from chamberopt.common.number_text import counted, typeset
from chamberopt.documents.document import (
    Beside,
    Block,
    Chart,
    Fold,
    Section,
    Sentence,
    Table,
    Tile,
    Tiles,
)
from chamberopt.documents.ranges import range_beside, with_its_unit
from chamberopt.documents.wording import Label, metric_label, objective_label, per_cent, plain
from chamberopt.pictures.charts.coverage import coverage_over_time_figure, histogram_figure

if TYPE_CHECKING:
    from chamberopt.pictures.part3d import PartScene
    from chamberopt.results.load import Result
    from chamberopt.results.records import CoverageAtTime, FieldRecord
    from chamberopt.simulation.evaluation import Evaluation

# The figures that a terminal shows besides the objective.
MAIN = (
    "mean_coverage",
    "p05_coverage",
    "time_to_98_s",
    "almen_intensity",
    "strength_um",
    "mean_normal_speed_m_s",
)


ROUNDING = 1e-6  # of a time
TELLS_APART = "The time to 98 % there tells places apart."


@dataclass(frozen=True)
class Figure:
    """A figure of the result in its stored unit, its value for the start design and the change.

    range_text: text of the result's range over what is not calibrated; "" if there is none.
    """

    name: str
    label: Label
    result: Estimate
    start: Estimate | None = None
    change: Estimate | None = None
    range_text: str = ""

    @property
    def is_bound_mean(self) -> bool:
        """Whether it is a mean coverage of which a bound alone is known."""
        return self.name == "mean_coverage" and is_bound(self.result)

    @property
    def range_with_unit(self) -> str:
        """The text of the range, with its unit if it ends in a number."""
        return with_its_unit(self.label, self.range_text)


def figures(result: Result, start: Result | None) -> list[Figure]:
    """Return the figures of a result: its objective, then its metrics.

    Metrics of zones and of single steps are left out, and so is a metric that is the objective.
    """
    goal = result.objective_name
    afters, befores = (
        {} if one is None else {**one.metrics, goal: one.objective} for one in (result, start)
    )
    labels = labels_of(goal, result.metrics)
    entries = [(name, label, afters[name], befores.get(name)) for name, label in labels.items()]
    return [
        Figure(
            name,
            label,
            _bound_in_words(after) if name == "mean_coverage" else after,
            before,
            change(after, before, result, start) if start and before else None,
            range_beside(result, name, label),
        )
        for name, label, after, before in entries
    ]


def labels_of(goal: str, metrics: Iterable[str]) -> dict[str, Label]:
    """Return the labels of an objective and of metrics, by their names, the objective first.

    Metrics of zones and of single steps are left out, and so is a metric that is the objective.

    Args:
        goal: the objective's name; empty for metrics alone.
    """
    first = {goal: objective_label(goal)} if goal else {}
    known = {label.text for label in first.values()}
    others = {name: metric_label(name) for name in metrics if "." not in name and name != goal}
    return first | {name: label for name, label in others.items() if label.text not in known}


def main_names(goal: str, names: Iterable[str]) -> list[str]:
    """Return those of some names that are the objective's or of main metrics.

    Where the Almen intensity is known, peening strength is none of them.
    """
    names = list(names)
    chosen = [name for name in MAIN if name != "strength_um" or "almen_intensity" not in names]
    return [name for name in names if name == goal or name in chosen]


def change(after: Estimate, before: Estimate, result: Result, start: Result) -> Estimate:
    """Return `after` - `before` with its interval: the change of a figure from start to result.

    Replicas are compared pair by pair if both results have the same seeds and their replicas
    correlate, else as independent.
    """
    if after == before:  # the start is the best: the change is exactly 0
        return Estimate(0.0, 0.0) if after.has_number else Estimate(0.0, 0.0).not_known("not known")
    same_seeds = result.seeds == start.seeds
    found = (paired_difference if same_seeds else independent_difference)(after, before)
    return found if after.has_number and before.has_number else found.not_known("not known")


def main_figures(shown: Sequence[Figure]) -> list[Figure]:
    """Return the objective and the main metrics, with the Almen intensity if it is known.

    Where it is not, the peening strength takes its place. A mean coverage with a bound alone is
    left out.
    """
    names = main_names(shown[0].name, (one.name for one in shown))
    return [
        one for one in shown if one.name in names and (one is shown[0] or not one.is_bound_mean)
    ]


def _bound_in_words(mean: Estimate) -> Estimate:
    """Return a mean coverage with words that tell why a bound alone is known of it, if it is so."""
    return replace(mean, in_words=f"{mean.in_words}: too few dents") if is_bound(mean) else mean


def is_bound(mean: Estimate) -> bool:
    """Return whether the least covered places tell that a mean coverage is more than a number.

    Too few dents tell it itself. Beside the coverage of those places, which is larger than that
    number, the two would read as a contradiction.
    """
    return math.isinf(mean.half_width) and mean.in_words not in ("", NOT_RESOLVED)


def tiles(shown: Sequence[Figure]) -> Tiles:
    """Return the objective and the main metrics as tiles: large numbers at the head of a report."""
    return Tiles(
        [
            Tile(
                one.label.text,
                one.label.format(one.result),
                one.label.format(one.start) if one.start is not None else "",
            )
            for one in main_figures(shown)
        ]
    )


def figures_table(shown: Sequence[Figure]) -> Table:
    """Return a table of figures with their intervals, and of start and change if there is one."""
    return _table(shown) if shown[0].start is None else _compared(shown)


def coverage_section(
    shown: Sequence[Figure], of: Mapping[str, Result], scenes: Mapping[str, PartScene]
) -> Section:
    """Return the report's section on coverage.

    It has the figures, the windows in which coverage is measured, and charts of coverage over area
    and over time.

    Args:
        shown: figures for the table.
        of: results by name: first the start design's, if there is one, then the result itself.
        scenes: parts in three dimensions, by the name of their result.
    """
    *_, result = of.values()
    has_start = len(of) > 1
    content: list[Block] = [figures_table(shown), *_windows(result.record.field)]
    charts: list[Block] = []
    drawn = {
        name: (scene.coverage, scene.area)
        for name, scene in scenes.items()
        if scene.coverage is not None
    }
    is_flat = all(scene.is_saturated for scene in scenes.values())
    if is_flat:
        text = "All of it would be one bar of a histogram, from 95 to 100 %"
        told = all(scene.tells_coverage for scene in scenes.values())
        text += f". {TELLS_APART}" if told else f", {NOT_PROVEN}."
        content.append(Sentence(text, "soft"))
    elif drawn:
        caption = (
            "How much of the target's area has which coverage at the end of the treatment, "
            "as the picture above shows it. Both are of single windows, where counted dents "
            "scatter: they look less even than the target is. The figures in the table are "
            "corrected for that."
        )
        charts.append(Chart("histogram", histogram_figure(drawn), caption))
    curves = {name: one.record.coverage_against_time for name, one in of.items()}
    if any(curves.values()):
        charts.append(_over_time(curves, result.design.process.treatment_time))
    content.append(Beside([[chart] for chart in charts]))
    if few := [name for name in scenes if name not in drawn]:
        which = f" of the {' and the '.join(few)}" if has_start else ""
        text = (
            f"How much of the area has which coverage is not drawn{which}: too few dents were "
            "simulated to tell single places apart."
        )
        content.append(Sentence(text, "soft"))
    return Section("Compared with the start" if has_start else "Coverage", content)


def _table(shown: Sequence[Figure]) -> Table:
    rows = [(one.label.with_unit, one.label.number(one.result)) for one in shown]
    return with_ranges(Table("± 95 % intervals", ("", "± 95 %"), rows), shown)


def with_ranges(table: Table, shown: Sequence[Figure]) -> Table:
    """Return a table of figures with a last column for their ranges, if any has one.

    Rows of other things, such as parameters, have no range.
    """
    if not any(one.range_text for one in shown):
        return table
    ranges = {one.label.with_unit: one.range_text for one in shown}
    rows = [(*row, ranges.get(row[0], "")) for row in table.rows]
    return Table(table.caption, (*table.head, "range"), rows)


def _compared(shown: Sequence[Figure]) -> Table:
    head = ("", "start", "best", "change", "more than noise")
    rows = [
        (
            one.label.with_unit,
            one.label.number(one.start),
            one.label.number(one.result),
            one.label.number(one.change, sign=True),
            _standing(one.label.scale(one.change)),
        )
        for one in shown
        if one.start is not None and one.change is not None
    ]
    return with_ranges(Table("± 95 % intervals", head, rows), shown)


def _standing(changed: Estimate) -> str:
    """Return if a change is real: "exact" without noise, "yes" beyond its interval, else "no"."""
    if changed.half_width == 0.0 and not changed.in_words:
        return "exact"
    return "yes" if abs(changed.value) > changed.half_width else "no"


def _over_time(curves: Mapping[str, Sequence[CoverageAtTime]], treatment_time: float) -> Chart:
    curves = {name: rows for name, rows in curves.items() if rows}
    caption = (
        "Coverage against peening time; 98 % counts as full. Bands are 95 % intervals, and "
        "often narrower than their line. The thin line is zero where more than 5 % of the "
        "target is out of reach."
    )
    end = min((rows[-1].time_s for rows in curves.values()), default=treatment_time)
    if end < (1.0 - ROUNDING) * treatment_time:
        ends = f"It ends at {plain(end, 3)} s" if end > ROUNDING * treatment_time else "It is empty"
        caption += f" {ends}, as later means take more simulated dents: simulate longer."
    return Chart("against-time", coverage_over_time_figure(curves, treatment_time), caption)


def _windows(field: FieldRecord) -> tuple[Sentence, Fold]:
    """Return a sentence on the areas, called windows, in which coverage is measured, and a table.

    The table has the metrics of coverage in windows of twice the radius. It is hidden until the
    reader opens it.
    """
    dents = typeset(counted(field.dents_in_median_window, "simulated dent"))
    text = (
        f"Coverage is the share dented in a window of {plain(field.gauge_mm2)} mm² round each "
        f"point of the target. The median window has {dents}. {per_cent(field.crease_share)} of "
        "the dented area is on sharp edges."
    )
    labels = {name: metric_label(name) for name in field.double_gauge}
    wide = [
        (labels[name].with_unit, labels[name].number(one))
        for name, one in field.double_gauge.items()
    ]
    caption = f"In windows of {plain(4.0 * field.gauge_mm2)} mm², twice as wide"
    return Sentence(text), Fold(caption, [Table("", ("", "± 95 %"), wide)])


def summary(evaluation: Evaluation | Result) -> str:
    """Return a line of text with the objective, and with mean and standard deviation of coverage.

    Each of these numbers has its interval.
    """
    mean, spread = (
        metric_label(name).format(evaluation.metrics[name])
        for name in ("mean_coverage", "std_coverage")
    )
    goal = objective_label(evaluation.objective_name)
    windows = f"in windows of {plain(evaluation.gauge_mm2)} mm²"
    return (
        f"{goal.text} {goal.format(evaluation.objective)}   mean {mean}   std {spread}   {windows}"
    )
