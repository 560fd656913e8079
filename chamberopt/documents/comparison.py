"""Text and tables of a comparison: values that differ, figures, and which differences are real.

Figures are the objective and the metrics, such as mean coverage. A difference is real if it is more
than noise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from chamberopt.common.estimate import CONFIDENCE, Estimate
from chamberopt.common.key_words import title_with_unit
from chamberopt.common.number_text import estimate_text
from chamberopt.documents.answer import shot_lines
from chamberopt.documents.coverage import labels_of, main_names
from chamberopt.documents.document import Table
from chamberopt.documents.wording import Label, metric_label, plain
from chamberopt.results.compare.comparison import Comparison, coverage_after, require_comparable
from chamberopt.results.compare.difference import MAX_TIME_RATIO, Difference
from chamberopt.results.load import Result

HEADER = ("difference", "real", "to know: simulate")
MARK = " *"  # of a difference that is more than noise


def comparison_end(comparison: Comparison, verbose: bool) -> list[Table | str]:
    """Return the end of a comparison on a terminal: its summary, and where more is.

    Args:
        verbose: all figures follow, by their names in files, with what would prove a difference.
    """
    told = summary(comparison)
    content: list[Table | str] = [*told.answers, *told.doubts, "", told.table, ""]
    if verbose:
        return [*content, *comparison_lines(comparison)]
    return [*content, f"({told.legend} --verbose and compare.txt have every figure.)"]


class Summary(NamedTuple):
    """A comparison in short.

    answers: a sentence for each later candidate, and that no number differs if so.
    doubts: warnings of balls that jam, or of a shot that had not settled, of each result.
    table, legend: the main figures, and what their signs are.
    """

    answers: list[str]
    doubts: list[str]
    table: Table
    legend: str


def summary(comparison: Comparison) -> Summary:
    """Return a comparison in short."""
    first, *later = comparison.labels
    goal = comparison.results[0].objective_name
    goal = goal if goal in comparison.metrics else ""  # results of different objectives share none
    labels = labels_of(goal, comparison.metrics)
    shown = [(name, labels[name]) for name in main_names(goal, labels)]
    sentences = [_sentence(comparison, *shown[0], k) for k in range(len(later))] if shown else []
    if not comparison.parameters:
        sentences.append("No number of the designs differs: they were simulated again.")
    several = len(later) > 1
    rows = [
        [title_with_unit(name), *map(_shown, values), *[""] * (not several)]
        for name, values in comparison.parameters.items()
    ]
    for name, label in shown:
        gaps, (one, *others) = comparison.differences[name], comparison.metrics[name]
        marks = [MARK * (several and gap.real) for gap in gaps]
        cells = [f"{label.number(x)}{mark}" for x, mark in zip(others, marks, strict=True)]
        if not several:
            cells += [f"{label.number(gaps[0].estimate, sign=True)}{MARK * gaps[0].real}"]
        rows.append([label.with_unit, label.number(one), *cells])
    heads = ["", *comparison.labels, *[f"{later[0]} - {first}"] * (not several)]
    legend = f"±: 95 % intervals. *: differs from {first} by more than noise."
    named = zip(comparison.labels, comparison.results, strict=True)
    doubts = [f"{name}: {line.text}" for name, one in named for line in shot_lines(one)]
    return Summary(sentences, doubts, Table("", heads, rows, numbers=False), legend)


def _sentence(comparison: Comparison, name: str, label: Label, k: int) -> str:
    """Return in one sentence which is better, a later candidate or the first, and by how much.

    Args:
        name, label: of the figure, which is better the larger its stored value is.
        k: place of the candidate among the later ones.
    """
    names = comparison.labels[0], comparison.labels[1 + k]
    before, after = (comparison.metrics[name][one] for one in (0, 1 + k))
    return _which_is_better(names, label, (before, after), comparison.differences[name][k])


def _which_is_better(
    names: tuple[str, str], label: Label, values: tuple[Estimate, Estimate], gap: Difference
) -> str:
    """Return in one sentence which of two is better in a figure, and by how much.

    Args:
        names, values: of the first and the later one.
        label: of the figure.
        gap: the later value minus the first.
    """
    (first, later), (before, after) = names, values
    if not (before.has_number and after.has_number) or gap.in_words:
        lacking = [name for name, one in zip(names, values, strict=True) if not one.has_number]
        return (
            f"No difference is resolved between {later} and {first}: too few dents were simulated "
            f"to tell the {label.text} of {lacking[0] if len(lacking) == 1 else 'both'}."
        )
    if gap.value == 0.0 and gap.half_width == 0.0:
        return f"{later} is like {first}: the {label.text} of both is {label.format(after)}."
    change = label.format(gap.estimate, sign=True)
    if not gap.real:
        both = f"{label.format(after)} against {label.format(before)}; 95 % intervals"
        return (
            f"No difference is resolved between {later} and {first}: {change} in the {label.text} "
            f"is within the noise ({both})."
        )
    better, other, high, low = (later, first, after, before)
    if gap.value < 0.0:
        better, other, high, low = (first, later, before, after)
    side = "higher" if label.factor > 0.0 else "lower"
    return (
        f"{better} is better than {other}: the {label.text} is {side} by {change.lstrip('+−')} "
        f"({label.format(high)} against {label.format(low)}; 95 % intervals)."
    )


def after_shorter_time(results: Sequence[Result], names: Sequence[str]) -> list[str]:
    """Return sentences on two results of different treatment times: what can be compared of them.

    Raises InputError if their parts, targets, windows or calibrations differ.
    """
    require_comparable(results)
    seconds = min(one.design.process.treatment_time for one in results)
    before, after = (coverage_after(one, seconds) for one in results)
    label, both = metric_label("mean_coverage"), (names[0], names[1])
    if before is None or after is None:
        text = f"Too few dents were simulated to compare {both[1]} and {both[0]}."
    else:
        half_width = math.hypot(before.half_width, after.half_width)
        gap = Difference(after.value - before.value, half_width, paired=False)
        text = _which_is_better(both, label, (before, after), gap)
    times = " and ".join(plain(one.design.process.treatment_time) for one in results)
    return [
        f"{text[:-1]} after {plain(seconds)} s, the shorter of both treatment times.",
        f"They were peened for {times} s. The maps show both after one time, which the slider "
        "sets. To compare all figures, and the coverage place by place, give one the treatment "
        "time of the other, in the tab Numbers, and simulate it again.",
    ]


def comparison_lines(comparison: Comparison) -> list[Table | str]:
    """Return tables of the design values that differ, of the figures and differences, and a legend.

    For two candidates, figures and differences stand in a single table. For more candidates, a
    table of differences follows the table of figures.
    """
    first, *later = comparison.labels
    rows = [
        [name, *(_shown(value) for value in values)]
        for name, values in comparison.parameters.items()
    ]
    if not rows:
        rows = [["the designs do not differ"]]
    figures = {
        name: [estimate_text(estimate) for estimate in estimates]
        for name, estimates in comparison.metrics.items()
    }
    gaps = {
        name: [_cells(gap) for gap in several] for name, several in comparison.differences.items()
    }
    if len(later) == 1:
        heads = [f"{later[0]} - {first}", *HEADER[1:]]
        rows += [[name, *cells, *gaps[name][0]] for name, cells in figures.items()]
        tables = [Table("", ["", *comparison.labels, *heads], rows, numbers=False)]
    else:
        rows += [[name, *cells] for name, cells in figures.items()]
        tables = [Table("", ["", *comparison.labels], rows, numbers=False)]
        for k, label in enumerate(later):
            rows = [[name, *gaps[name][k]] for name in figures]
            tables.append(Table("", [f"{label} - {first}", *HEADER], rows, numbers=False))
    return [*(one for table in tables for one in (table, "")), *_legend(comparison)]


def _legend(comparison: Comparison) -> list[str]:
    """Return lines that explain the signs and terms in the tables."""
    first, *later = comparison.labels
    lines = [
        "(±: 95 % interval. real: the difference is larger than its interval, which holds for each "
        "figure alone."
    ]
    if any(gap.replicas for several in comparison.differences.values() for gap in several):
        lines.append(
            "to know: how many times as long to simulate, and replicas, if the difference is as "
            "large as it looks; even then it shows in one case of two."
        )
    if len(later) > 1:
        lines.append(
            f"Differences have intervals of {100.0 * comparison.confidence:.4g} %, so that all "
            f"{len(later)} of a figure hold together with {100.0 * CONFIDENCE:g} % (Bonferroni)."
        )
    for k, label in enumerate(later):
        paired = [several[k].paired for several in comparison.differences.values()]
        if comparison.results[k + 1].seeds == comparison.results[0].seeds:
            lines.append(
                f"{label} - {first}: on the same seeds. {sum(paired)} of {len(paired)} figures, "
                "whose replicas correlate, are compared replica by replica, others as independent."
            )
        else:
            lines.append(f"{label} - {first}: independent, on other seeds.")
    if any(gap.in_words for several in comparison.differences.values() for gap in several):
        lines.append(
            "not resolved: too few dents were simulated for this figure; notes of the results say "
            "how many it takes."
        )
    return [*lines[:-1], lines[-1] + ")"]


def _cells(gap: Difference) -> list[str]:
    """Return the three cells of a difference in a table.

    The cells are its value, whether it is more than noise, and the replicas that would prove it.
    """
    shown = estimate_text(Estimate(gap.value, gap.half_width, in_words=gap.in_words), sign=True)
    if gap.half_width == 0.0 and not gap.in_words:
        return [shown, "exact", ""]
    if gap.value == 0.0 or gap.in_words:
        return [shown, "no", ""]
    if gap.real:
        return [shown, "yes", ""]
    if gap.time_ratio is None or gap.replicas is None:
        return [shown, "no", f"more than {MAX_TIME_RATIO} × as long"]
    return [shown, "no", f"{_times(gap.time_ratio)} × as long, {gap.replicas} replicas"]


def _times(times: float) -> str:
    return f"{times:.1f}" if times < 10.0 else f"{math.ceil(times)}"


def _shown(value: object) -> str:
    if isinstance(value, list | tuple):
        return ", ".join(map(_shown, value))
    return "-" if value is None else f"{value:g}" if isinstance(value, float) else str(value)
