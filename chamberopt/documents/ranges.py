"""Text about what nobody has measured: how far friction etc. may move the figures of a design.

The same words stand behind the intervals on the terminal, on the page and on the process sheet.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

from chamberopt.common import number_text
from chamberopt.common.key_words import title_with_unit
from chamberopt.documents.document import AnswerLine, Block, Fold, Section, Sentence, Table
from chamberopt.documents.wording import Label, metric_label, objective_label, per_cent, plain

if TYPE_CHECKING:
    from chamberopt.common.estimate import Estimate
    from chamberopt.peening.range_result import RangedFigure, RangeResult, RivalAtEnds
    from chamberopt.results.load import Result

WORDS = {
    "friction": "friction",
    "v0": "the least speed that dents",
    "slopes": "slopes of the faces",
}
MEASURED_BY = {
    "friction": "the rate of impacts on the part (chamberopt calibrate)",
    "v0": "ball drops at 3 m/s on each surface (chamberopt calibrate)",
    "slopes": "profiles of the faces, as slope_deg with narrower [ranges]",
}
TIME = "time_to_98_s"
HEADLINES = ("mean_coverage", TIME)
ENDS_HEAD = ("", "at the low end", "at the high end")


def range_texts(found: RangeResult | None) -> dict[str, str]:
    """Return the range of each figure as text for a terminal, by name; empty without ranges."""
    figures = found.figures if found else {}
    return {name: _text(Label(""), one) for name, one in figures.items()}


def range_beside(result: Result, name: str, label: Label) -> str:
    """Return the range of a result's figure as text for a page or sheet; "" if it has none."""
    found = result.record.ranges
    figure = found.figures.get(name) if found else None
    return number_text.typeset(_text(label, figure)) if figure else ""


def range_lines(found: RangeResult | None) -> list[str]:
    """Return lines for a terminal that say what the ranges of the figures are."""
    if not found:
        return []
    lines = [
        f"± 95 % of counting; behind it the range over what is not calibrated: {_groups(found)}; "
        f"{found.replicas} replicas at each end"
    ]
    known = (name for name in HEADLINES if name in found.figures)
    lines += [f"{metric_label(name).text}: {_narrowed(found.figures[name])}" for name in known]
    return [*lines, *_left_out(found)]


def cost_text(groups: Sequence[str], count: int, replicas: int, designs: int = 1) -> str:
    """Return a sentence on what the ranges cost.

    Args:
        count: number of replicas at each end of each group.
        replicas: number of replicas of a design itself.
        designs: number of designs whose ranges are simulated.
    """
    more = 2 * len(groups) * count
    each = "" if designs == 1 else f" of each of {designs} designs"
    return (
        f"{_list(groups)}: not calibrated, so {more} more replicas{each} are simulated at both "
        f"ends ({more / replicas:.2g} times the work of the figures); --no-ranges leaves them out"
    )


def at_ends_text(one: RivalAtEnds) -> str:
    """Return a sentence that says if a study's best design stays best at all ends."""
    rival = f"the {one.rival}"
    worse = [x for x in one.gains if x.gain.high < 0.0]
    unsure = [x for x in one.gains if x.gain.low <= 0.0 <= x.gain.high]
    groups = _list(dict.fromkeys(x.group for x in one.gains))
    if not worse and not unsure:
        return f"The best design stays better than {rival} at both ends of {groups}."
    if len(unsure) == len(one.gains):
        return f"Noise hides whether the best design or {rival} is better at the ends of {groups}."
    said = []
    if worse:
        said.append(f"{rival} is better at {_places((x.group, x.end) for x in worse)}")
    if unsure:
        at = _places((x.group, x.end) for x in unsure)
        said.append(f"noise hides which is better at {at}")
    if len(worse) + len(unsure) < len(one.gains):
        said.append("the best design is better at the other ends")
    text = "; ".join(said)
    return f"Best design and {rival} at the ends of {groups}: {text}."


def range_answer(result: Result) -> Iterator[AnswerLine]:
    """Yield the sentences of the answer on what is not calibrated."""
    found = result.record.ranges
    figure = found.figures.get(HEADLINES[0]) if found else None
    if found and figure:
        label = metric_label(HEADLINES[0])
        text = f"Not calibrated: {_groups(found)}. Over their ranges the {label.text} "
        if figure.is_resolved:
            between = _of(label, figure)
            told = with_its_unit(label, between)
            is_narrow = " to " not in between
            text += f"is {told}." if is_narrow else f"is {told}; {_narrowed(figure)}."
        else:
            text += f"is as above: {_narrowed(figure)}."
        yield AnswerLine("ranges", text, False)
    study = result.study
    for one in study.at_ends if study and not study.keeps_start else ():
        yield AnswerLine("ranges", at_ends_text(one), any(x.gain.low <= 0.0 for x in one.gains))


def range_section(result: Result) -> Section | None:
    """Return the report's section on what is not calibrated, or None without ranges."""
    found = result.record.ranges
    if not found:
        return None
    text = (
        f"Intervals say how well the figures are counted. Nobody has measured {_groups(found)}. "
        "A range is that of a figure while each of these lies anywhere in its own. Both ends of "
        f"each were simulated in {found.replicas} replicas, {found.cost:.2g} times the work of the "
        "figures themselves, and the changes were added in quadrature, without what noise adds."
    )
    rows: list[tuple[str, ...]] = []
    changes: dict[str, list[tuple[str, ...]]] = {group: [] for group in found.groups}
    for name, figure in found.figures.items():
        if name != result.objective_name and name not in result.metrics:
            continue  # a figure of another version, which this one does not know
        label = _label(result, name)
        if any(label.with_unit == row[0] for row in rows):
            continue  # the objective is a figure too
        rows.append(
            (
                label.with_unit,
                label.number(_estimate(result, name)),
                _of(label, figure),
                _most(figure),
            )
        )
        for group, own in changes.items():
            own.append((label.with_unit, *_ends(label, figure, group)))
    numbers = [
        (
            title_with_unit(name.removeprefix("effects.")),
            *(plain(x, 3) for x in (one.value, one.low, one.high)),
        )
        for group in found.groups.values()
        for name, one in group.items()
    ]
    head = ("", "± 95 % of counting", "range", "most of it by")
    tables = [
        Table(f"Changes by {WORDS.get(group, group)}, ± 95 % noise of its runs", ENDS_HEAD, own)
        for group, own in changes.items()
    ]
    content: list[Block] = [
        Sentence(text),
        Table("The figures and their ranges", head, rows),
        Fold("What each end changes", tables),
        Table("What is not calibrated", ("", "as designed", "low", "high"), numbers),
    ]
    content += [Sentence(one) for one in _left_out(found)]
    return Section("What is not calibrated", content)


def time_at_slow_end(result: Result) -> str:
    """Return the time to full coverage at the slow end of its range as text; "" if not known."""
    found = result.record.ranges
    figure = found.figures.get(TIME) if found else None
    if figure is None or not figure.is_resolved:
        return ""
    high = figure.high
    return metric_label(TIME).format(high)


def slow_end_is_late(result: Result) -> bool:
    """Return if the peening time is too short at the slow end of what is not calibrated."""
    found = result.record.ranges
    figure = found.figures.get(TIME) if found else None
    planned = result.design.process.treatment_time
    return figure is not None and figure.is_resolved and figure.high.value > planned


def groups_text(found: RangeResult) -> str:
    """Return the names of what is not calibrated, such as "friction and slopes of the faces"."""
    return _list(found.groups)


def _text(label: Label, figure: RangedFigure) -> str:
    """Return the range of a figure, without its unit, in the numbers of a label."""
    if figure.words:
        low, high = (
            one.in_words or number_text.plain(abs(label.factor) * one.value, 3)
            for one in (figure.low, figure.high)
        )
        return low if low == high else f"{low} to {high}"
    if not figure.is_resolved:
        return f"within noise, ± {number_text.plain(abs(label.factor) * figure.noise, 1)}"
    ends = sorted(label.factor * one.value for one in (figure.low, figure.high))
    return number_text.range_text(ends[0], ends[1])


def _of(label: Label, figure: RangedFigure) -> str:
    return number_text.typeset(_text(label, figure))


def with_its_unit(label: Label, text: str) -> str:
    """Return the text of a range with the unit of its label, if it ends in a number."""
    return f"{text} {label.unit}".rstrip() if text[-1:].isdigit() else text


def _label(result: Result, name: str) -> Label:
    return objective_label(name) if name == result.objective_name else metric_label(name)


def _estimate(result: Result, name: str) -> Estimate:
    return result.objective if name == result.objective_name else result.metrics[name]


def _ends(label: Label, figure: RangedFigure, group: str) -> tuple[str, str]:
    one = figure.effects[group]
    return label.number(one.low, sign=True), label.number(one.high, sign=True)


def _groups(found: RangeResult) -> str:
    """Return the groups with their factors, such as "friction (0.48 to 1.6 times)"."""
    words = []
    for name, numbers in found.groups.items():
        low = min(one.low / one.value for one in numbers.values())
        high = max(one.high / one.value for one in numbers.values())
        words.append(f"{WORDS.get(name, name)} ({plain(low, 3)} to {plain(high, 3)} times)")
    return _list(words, {})


def _most(figure: RangedFigure) -> str:
    """Return the groups that make most of a range, each with its share of the squared width."""
    if not figure.is_resolved or not figure.shares:
        return ""
    first = max(figure.shares, key=lambda one: figure.shares[one])
    return f"{WORDS.get(first, first)} {per_cent(figure.shares[first])}"


def _narrowed(figure: RangedFigure) -> str:
    """Return what would narrow the range of a figure most."""
    if not figure.is_resolved:
        return "no end changes it by more than the noise of these runs"
    if not figure.shares:
        return "what would narrow it most is not known"
    first = max(figure.shares, key=lambda one: figure.shares[one])
    share = per_cent(figure.shares[first])
    how = f", by {MEASURED_BY[first]}" if first in MEASURED_BY else ""
    return f"what would narrow it most is {WORDS.get(first, first)} ({share} of it){how}"


def _left_out(found: RangeResult) -> list[str]:
    said = []
    if found.calibrated:
        said.append(f"in the intervals, by the calibration: {_list(found.calibrated)}")
    if found.not_resolved:
        said.append(
            f"not resolved at the ends, so without a range: {', '.join(found.not_resolved)}"
        )
    return said


def _places(ends: Iterable[tuple[str, str]]) -> str:
    return _list([f"the {end} end of {WORDS.get(group, group)}" for group, end in ends], {})


def _list(names: Iterable[str], words: dict[str, str] | None = None) -> str:
    """Return names in words, with commas and a last "and"."""
    known = WORDS if words is None else words
    *others, last = [known.get(one, one) for one in names]
    return f"{', '.join(others)} and {last}" if others else last
