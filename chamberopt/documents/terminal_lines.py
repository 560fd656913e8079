"""Text for a terminal at the end of a simulation, study, sweep or strip: a sentence and a table.

The table has the main figures in words. With --verbose, all figures follow by the names that files
have for them, and all notes.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain, zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, get_args

from chamberopt.common.key_words import title_with_unit
from chamberopt.common.number_text import counted, estimate_text
from chamberopt.common.number_text import plain as ascii_number
from chamberopt.documents.answer import answer, answer_lines
from chamberopt.documents.coverage import (
    Figure,
    figures,
    figures_table,
    labels_of,
    main_figures,
    with_ranges,
)
from chamberopt.documents.document import About, Table
from chamberopt.documents.ranges import range_lines, range_texts
from chamberopt.documents.stress import stress_sentence
from chamberopt.documents.study import influence_sentences, influences, tried_sentence
from chamberopt.documents.tolerances import tolerance_lines, tolerance_sentences
from chamberopt.documents.wording import objective_label, plain
from chamberopt.pictures.charts.strip import MULTIPLE_NAMES, fit_text
from chamberopt.results.command_records import FIT_NAMES
from chamberopt.results.load import load_result, load_start, load_trials

if TYPE_CHECKING:
    from chamberopt.common.estimate import Estimate
    from chamberopt.design.load import Design
    from chamberopt.peening.virtual_strip import VirtualStrip
    from chamberopt.results.load import Result
    from chamberopt.search.run_sweep import SweepResult

MOST_NOTES = 3  # shown without --verbose
RANK: tuple[str, ...] = get_args(About)  # of the sentences: what the process is asked for first


def result_end(folder: Path, verbose: bool) -> list[Table | str]:
    """Return the end of the command that made a result: its answer, main figures and notes.

    A study's table has its parameters too, of the start and of the best design, and a sentence says
    what became of all candidates.

    Raises:
        InputError: the folder has no usable result of a simulation or study.
    """
    result = load_result(folder)
    start, study, record = load_start(result), result.study, result.record
    all_figures = figures(result, start)
    lines = sorted(answer_lines(result, start), key=lambda one: (one.warns, RANK.index(one.about)))
    said = [f"warning: {one.text}" if one.warns else one.text for one in lines]
    notes, content = [one.said for one in record.effects or ()], [answer(result, start), ""]
    if study and start:
        parameters = {
            name: [plain(value, 6), plain(study.best.parameters[name], 6)]
            for name, value in study.start.parameters.items()
        }
        table = _table(("start", "best"), parameters, all_figures)
        said.append(f"Candidates: {tried_sentence(load_trials(folder))}")
        if study.front:
            names = " and ".join(objective_label(name).text for name in study.front[0].objectives)
            said.append(f"The Pareto front of {names}: pareto.csv, pareto.png.")
    else:
        table = figures_table(main_figures(all_figures))
    said += filter(None, [stress_sentence(result)])
    if record.tolerances:
        said += tolerance_sentences(record.tolerances)
        notes = [*record.tolerances.notes, *notes]
    of_study = study.notes if study else []
    both = chain.from_iterable(zip_longest(of_study, result.notes))  # the first of each matter most
    told = list(note_lines([*filter(None, both), *notes], verbose))
    more = list(_all_figures(result, start)) if verbose else []
    return [*content, table, "", *said, *told, *more]


def sweep_end(result: SweepResult, notes: Iterable[str], verbose: bool) -> list[Table | str]:
    """Return the end of a sweep: a sentence, its best candidate and what became of all."""
    study, best, count = result.study, result.best, len(result.trials)
    effort = replicas_text(study.at_search_accuracy(study.design))
    tried = f"{count} candidates in {result.seconds:.0f} s, {effort} each: "
    last = [tried + tried_sentence(result.trials), *note_lines(notes)]
    if best is None or best.objective is None:
        return [f"None of {count} candidates meets the constraints.", *last]
    name = study.objective.goals[0]
    found = {**best.metrics, name: best.objective}
    labels = labels_of(name, best.metrics)
    shown, label = [Figure(one, labels[one], found[one]) for one in labels], labels[name]
    parameters = {name: [plain(value, 5)] for name, value in best.parameters.items()}
    sentence = (
        f"The best of {count} candidates, number {best.number + 1}, has this {label.text}: "
        f"{label.format(best.objective)} (95 % interval)."
    )
    table = _table(("best",), parameters, shown)
    more = ["", *map(_line, found, found.values())] if verbose else []
    return [sentence, "", table, "", *last, *more]


def note_lines(notes: Iterable[str], verbose: bool = True) -> Iterator[str]:
    """Yield a line for each note. Unless `verbose`, the first three, and how many there are more.

    The notes begin with the most important.
    """
    every = [f"note: {note}" for note in notes]
    shown = every if verbose else every[:MOST_NOTES]
    yield from shown
    if left := len(every) - len(shown):
        yield f"and {counted(left, 'more note')}: --verbose shows all"


def replicas_text(design: Design) -> str:
    """Return a text that says how many replicas a design asks for."""
    accuracy = design.process.accuracy
    if accuracy.objective_half_width is not None:
        return f"as many replicas as give ± {accuracy.objective_half_width:g}"
    return f"{accuracy.replicas} replicas of {design.process.recorded_time:g} s"


def _table(
    head: Sequence[str], parameters: Mapping[str, Sequence[str]], shown: Sequence[Figure]
) -> Table:
    """Return a table of parameters and main figures, with a column for each design of `head`.

    A last column has the ranges of the last design over what is not calibrated, if they are known.
    """
    rows = [(title_with_unit(name), *values) for name, values in parameters.items()]
    rows += [
        (one.label.with_unit, *map(one.label.number, filter(None, (one.start, one.result))))
        for one in main_figures(shown)
    ]
    return with_ranges(Table("", ("", *head), rows), shown)


def _all_figures(result: Result, start: Result | None) -> Iterator[str]:
    """Yield lines with all figures of a result by their names in files, and of its start."""
    if result.study:
        label = objective_label(result.objective_name)
        yield from ("", *influence_sentences(result.study, influences(result.study, label), label))
    for title, one in (("start", start), ("best", result)):
        if one is None:
            continue
        yield from ("", title) if start else ("",)
        beside = range_texts(one.record.ranges)
        for name, value in {one.objective_name: one.objective, **one.metrics}.items():
            yield f"{_line(name, value):56}{beside.get(name, '')}".rstrip()
        field = one.record.field
        yield (
            f"{'gauge_mm2':34}{ascii_number(field.gauge_mm2)}: area of the windows; the median "
            f"window has {counted(field.dents_in_median_window, 'dent')}"
        )
        yield from range_lines(one.record.ranges)
    if result.record.tolerances:
        yield from ("", *tolerance_lines(result.record.tolerances))


def _line(name: str, estimate: Estimate) -> str:
    """Return a line with the name of a metric or objective, its estimate and interval."""
    return f"{name:33} {estimate_text(estimate)}"


def strip_end(strip: VirtualStrip, notes: Iterable[str], verbose: bool) -> list[Table | str]:
    """Return the end of the command `strip`: a sentence, the five arc heights and notes.

    Args:
        notes: notes on the design, which come before those on the strip.
        verbose: the curves that were fitted to the arc heights follow, and all notes.
    """
    what, height = "peening strength S", "arc strength, not calibrated"
    if strip.is_calibrated:
        what, height = "Almen intensity I", f"arc height, {strip.unit}"
    sentence = (
        f"{strip.setting.type} strip, {strip.setting.place}: {what} "
        f"{estimate_text(strip.intensity, unit=strip.unit)}, saturation time T "
        f"{estimate_text(strip.time, unit='s')}."
    )
    rows = [
        (name, f"{ascii_number(float(time), 3)} s", estimate_text(arc, unit=strip.unit))
        for name, time, arc in zip(MULTIPLE_NAMES, strip.at, strip.heights, strict=True)
    ]
    fits = [
        f"fit of {name}: {fit_text(fit, strip)}"
        for name, fit in zip(FIT_NAMES, strip.fits, strict=True)
    ]
    table = Table("", ("after", "", height), rows)
    more = ["", *fits] if verbose else []
    return [sentence, "", table, *more, "", *note_lines([*notes, *strip.notes], verbose)]
