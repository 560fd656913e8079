"""Lines for a terminal about a simulation, a study or a sweep, a line for each figure."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from chamberopt.common.number_text import counted, estimate_text, plain
from chamberopt.documents.ranges import at_ends_text, range_lines, range_texts
from chamberopt.documents.wanted import wanted_lines
from chamberopt.search.study.constraints import judge_zones

if TYPE_CHECKING:
    from chamberopt.common.estimate import Estimate
    from chamberopt.design.load import Design
    from chamberopt.peening.range_result import RangeResult, StudyRanges
    from chamberopt.search.run_study import StudyResult
    from chamberopt.search.run_sweep import SweepResult
    from chamberopt.simulation.evaluation import Evaluation


def estimate_line(name: str, estimate: Estimate) -> str:
    """Return a line with the name of a metric or objective, its estimate and interval."""
    return f"{name:34}{estimate_text(estimate)}"


def evaluation_lines(evaluation: Evaluation, ranges: RangeResult | None = None) -> list[str]:
    """Return a line for the objective and each metric, with their 95 % intervals.

    Behind the interval stands the range of what is not calibrated, if it is given. The last line
    gives the area of the windows, the discs in which coverage is measured.
    """
    rows = {evaluation.objective_name: evaluation.objective, **evaluation.metrics}
    beside = range_texts(ranges)
    lines = [
        f"{estimate_line(name, one):56}{beside.get(name, '')}".rstrip()
        for name, one in rows.items()
    ]
    found = evaluation.resolution
    return [
        *lines,
        f"{'gauge_mm2':34}{plain(evaluation.gauge_mm2)}: area of the windows; the median window "
        f"has {counted(found.dents, 'dent')}",
    ]


def zone_limit_lines(design: Design, evaluation: Evaluation) -> list[str]:
    """Return a line for each limit of each zone that says whether it is met."""
    return [
        f"zone {zone}: {row['key']} {row['limit']:g}: {row['standing']} "
        f"({row['metric']} {estimate_text(evaluation.metrics[row['metric']])})"
        for zone, rows in judge_zones(design, evaluation.metrics).items()
        for row in rows
    ]


def process_lines(design: Design, evaluation: Evaluation) -> list[str]:
    """Return a line on the wanted intensity and on the wanted coverage, if there are any."""
    lines = wanted_lines(design, evaluation.metrics)
    return [f"warning: {one.text}" if one.warns else one.text for one in lines]


def note_lines(notes: Iterable[str]) -> list[str]:
    """Return a line for each note, with the word "note" before it."""
    return [f"note: {note}" for note in notes]


def replicas_text(design: Design) -> str:
    """Return a text that says how many replicas a design asks for."""
    accuracy = design.process.accuracy
    if accuracy.objective_half_width is not None:
        return f"as many replicas as give ± {accuracy.objective_half_width:g}"
    return f"{accuracy.replicas} replicas of {design.process.recorded_time:g} s"


def study_lines(result: StudyResult, ranges: StudyRanges | None = None) -> list[str]:
    """Return lines on a study: start and best design with parameters and figures, gain, effort.

    Args:
        ranges: ranges of what is not calibrated; None if they were not simulated.
    """
    study, start, best = result.study, result.start, result.best
    lines = [f"{'parameter':34}{'start':>12}{'best':>12}"]
    for name in study.vary:
        values = (f"{plain(one.parameters[name], 6):>12}" for one in (start, best))
        lines.append(f"{name:34}{''.join(values)}")
    of_both = (ranges.start, ranges.best) if ranges else (None, None)
    for title, one, found in zip(("start", "best"), (start, best), of_both, strict=True):
        limits = process_lines(one.design, one.evaluation)
        limits += zone_limit_lines(one.design, one.evaluation)
        lines += ["", title, *evaluation_lines(one.evaluation, found), *range_lines(found), *limits]
    verdict = "better than the start" if result.improved else "within the noise of the start"
    if result.gain.in_words:
        verdict = "the objective of the start or of the best design is not known"
    lines += ["", f"{estimate_line('gain', result.gain)}: {verdict}"]
    lines += [at_ends_text(one) for one in ranges.rivals] if ranges else []
    if result.sensitivity:
        lines += ["", *result.sensitivity.sentences(), ""]
    if study.objective.pareto:
        names = " and ".join(study.objective.pareto)
        lines += [f"the Pareto front of {names}: pareto.csv, pareto.png", ""]
    counts = dict.fromkeys(one.evaluation.replicas for one in (start, best))
    replicas, seconds = " and ".join(map(str, counts)), study.design.process.recorded_time
    effort = replicas_text(study.at_search_accuracy(study.design))
    if result.ended_early:
        effort += f"; {study.first_look} where more would have told nothing"
    return [
        *lines,
        f"± 95 % intervals; start and best: {replicas} replicas of {seconds:g} s with seeds of "
        f"their own; candidates of the search in history.csv: {effort}",
    ]


def sweep_lines(result: SweepResult) -> list[str]:
    """Return lines with a sweep's number of candidates and run time, and its best candidate."""
    study, best = result.study, result.best
    effort = replicas_text(study.at_search_accuracy(study.design))
    lines = [f"{len(result.trials)} candidates in {result.seconds:.0f} s, {effort} each"]
    if best is not None and best.objective is not None:
        lines += ["", f"best, number {best.number + 1}"]
        lines += [f"{name:34}{plain(value, 5):>12}" for name, value in best.parameters.items()]
        estimates = {study.objective.goals[0]: best.objective, **best.metrics}
        lines += [estimate_line(name, estimate) for name, estimate in estimates.items()]
    return lines
