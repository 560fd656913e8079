"""Give the answer of a result in one sentence, with sentences on constraints and zones."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from chamberopt.chamber.checks.calibration import misfit_texts
from chamberopt.common.errors import one_line
from chamberopt.common.estimate import NOT_RESOLVED, Estimate
from chamberopt.common.number_text import percent
from chamberopt.coverage.metrics import tells_coverage
from chamberopt.documents.coverage import change, is_bound
from chamberopt.documents.document import AnswerLine
from chamberopt.documents.ranges import range_answer
from chamberopt.documents.wanted import intensity_lines, time_lines
from chamberopt.documents.wording import Label, metric_label, objective_label, plain
from chamberopt.documents.zones import step_lines, zone_lines
from chamberopt.results.load import load_result, load_start
from chamberopt.search.study.constraints import MET
from chamberopt.simulation.effort import Effort
from chamberopt.simulation.settling import SETTLED

if TYPE_CHECKING:
    from chamberopt.results.load import Result

JAMMED = 0.01  # least share of the shot's time, or of the impacts, in gaps that is told
MOSTLY = 0.95  # share of the target from which on balls count as getting to all of it


def answer_in(folder: Path) -> str:
    """Return the answer of the result of a study or simulation in a folder, in one sentence.

    Raises:
        InputError: the folder has no usable result.
    """
    result = load_result(folder)
    return answer(result, load_start(result))


def answer(result: Result, start: Result | None, tells_aim: bool = True) -> str:
    """Return the answer of a result in one sentence, with its uncertainty.

    For a study, the sentence gives the objective of the start design and of the best design, and
    whether the change is useful, and more than noise. For a simulation, the sentence gives the
    coverage.

    Args:
        tells_aim: also what a search would be after, where it is not the mean coverage.
    """
    label = objective_label(result.objective_name)
    if start is None:
        mean = metric_label("mean_coverage")
        treatment_time = result.design.process.treatment_time
        if not tells_coverage(result.metrics):
            share = result.record.field.reachable_share
            only = f"Balls get to {share:.0%} of the target. " if share < MOSTLY else ""
            return (
                f"{only}Too few dents were simulated to tell how much of the target is covered "
                f"after {plain(treatment_time)} s."
            )
        if is_bound(result.metrics["mean_coverage"]):
            # The bound of the mean follows from those 95 %, and is below their coverage.
            return (
                f"After {plain(treatment_time)} s {_least_covered(result)}, and more dents would "
                f"tell the mean (95 % intervals); {full_coverage(result)}."
            )
        text = (
            f"After {plain(treatment_time)} s the target is covered to "
            f"{mean.format(result.metrics['mean_coverage'])} on average"
        )
        if tells_aim and label.text != mean.text:
            text += f", and its {label.in_full} is {label.format(result.objective)}"
        return f"{text} (95 % intervals); {full_coverage(result)}."
    named = label.in_full
    before, after = label.format(start.objective), label.format(result.objective)
    study = result.study
    if study is not None and study.best.parameters == study.start.parameters:
        return (
            f"No better chamber than the start was found: its {named} is {before} (95 % interval)."
        )
    if NOT_RESOLVED in (start.objective.in_words, result.objective.in_words):
        return (
            "Too few dents were simulated to tell whether the best chamber found is better than "
            "the start."
        )
    values = f"from {before} at the start to {after}"
    gain = change(result.objective, start.objective, result, start)
    gained = label.format(gain, sign=True)
    intervals = "(95 % intervals, both simulated again with fresh seeds)"
    if study is not None and study.keeps_start:
        counts = label.format(Estimate(abs(study.counts), 0.0)).removeprefix("−")
        return (
            f"No useful difference: keep the start. The {named} goes {values}, a change of "
            f"{gained} {intervals}; less than {counts} does not count."
        )
    if gain.low > 0.0:
        return (
            f"The best chamber found changes the {named} {values}: a change of {gained} "
            f"{intervals}, which is more than noise."
        )
    return (
        f"No chamber was found that is certainly better: the {named} goes {values}, but the "
        f"change of {gained} is within the noise {intervals}."
    )


def stopped_text(result: Result) -> str:
    """Return a sentence on a simulation that its user stopped; "" for others."""
    if result.record.stopped_by != "user":
        return ""
    done, most = result.record.replicas, Effort.of(result.design.process.accuracy).most
    return f"Stopped after {done} of {most} replicas: its intervals are wider than those of all."


def on_average(result: Result) -> str:
    """Return a line on a result: the time to 98 %, and the mean coverage."""
    mean = result.metrics["mean_coverage"]
    if not tells_coverage(result.metrics):
        return f"{full_coverage(result)}; its mean coverage is not resolved"
    if is_bound(mean):
        return f"{full_coverage(result)}; {_least_covered(result)}"
    text = metric_label("mean_coverage").format(mean)
    return f"{full_coverage(result)}; covered to {text} on average"


def _least_covered(result: Result) -> str:
    known = result.metrics["p05_coverage"]
    least = metric_label("p05_coverage").format(known)
    or_more = "" if known.in_words else " or more"  # "more than 99.9 %" says so itself
    return f"95 % of the target's area is covered to {least}{or_more}"


def answer_lines(result: Result, start: Result | None = None) -> list[AnswerLine]:
    """Return sentences that qualify the answer.

    The sentences say whether the time is enough, the shot free and the wanted intensity there, how
    much less hard a study's best chamber peens than the start, what each step does, which limits of
    zones and constraints are met, and name doubts about the calibration.
    """
    lines = [*time_lines(result), *shot_lines(result), *range_answer(result)]
    lines += intensity_lines(result.design, result.metrics)
    if not any(one.warns for one in lines):
        lines += _unresolved_lines(result)
    lines += [
        *_ended_lines(result),
        *_softer_lines(result, start),
        *step_lines(result),
        *zone_lines(result),
        *_constraint_lines(result),
    ]
    calibration = result.design.calibration
    doubts = [*misfit_texts(calibration), calibration.not_mmA] if calibration else []
    return lines + [
        AnswerLine("calibration", f"{one[0].upper()}{one[1:]}.", True) for one in doubts if one
    ]


def _unresolved_lines(result: Result) -> Iterator[AnswerLine]:
    """Yield a warning where so few dents were simulated that the time cannot be judged."""
    time = result.metrics.get("time_to_98_s")
    if time is not None and time.in_words == NOT_RESOLVED:
        planned = plain(result.design.process.treatment_time)
        text = f"So few dents do not tell whether {planned} s are enough: simulate longer."
        yield AnswerLine("process", text, True)


def shot_lines(result: Result) -> Iterator[AnswerLine]:
    """Yield warnings of balls that jam, and of a shot that had not settled.

    A shot that had nearly settled is told without a warning, as its times are hardly too short.
    """
    trapped = result.record.trapped
    if trapped and max(trapped.rattling_time, trapped.rattling_impacts) >= JAMMED:
        place = f", e.g. {one_line(trapped.place)} in the chamber's frame" if trapped.place else ""
        text = (
            "Balls are held or rattle in gaps hardly wider than they are: "
            f"{percent(trapped.rattling_time)} of the shot at any time, and "
            f"{percent(trapped.rattling_impacts)} of the impacts on the part"
            f"{place}. Choose other balls, or close or widen the gap."
        )
        yield AnswerLine("process", text, True)
    if excess := result.record.first_half_excess:
        is_small = abs(excess) <= SETTLED
        more, longer = ("more", "longer") if excess > 0.0 else ("less", "shorter")
        remedy = "Simulate with a longer warm-up before this is built."
        if is_small:
            remedy = f"So times are about {percent(0.5 * abs(excess))} {longer} than told."
        text = (
            f"The shot had not {'quite ' if is_small else ''}settled when recording began: the "
            f"target was dented by {percent(abs(excess))} {more} in the first half of the "
            f"simulated time than in the second. {remedy}"
        )
        yield AnswerLine("process", text, not is_small)


def _ended_lines(result: Result) -> Iterator[AnswerLine]:
    """Yield a sentence on a search that ended before its evaluations were spent, and what to ask.

    It ends as soon as nothing within its bounds can be better by as much as counts.
    """
    study = result.study
    if study is None or study.ended_by != "gain" or study.possible_gain is None:
        return
    label, treatment = objective_label(result.objective_name), result.design.process.treatment_time
    most = label.format(Estimate(study.possible_gain, 0.0)).removeprefix("−")
    text = (
        f"The search ended after {study.evaluations} chambers: between its bounds none can be "
        f"better than the best by more than {most} (95 % sure)"
    )
    time = result.metrics.get("time_to_98_s")
    if time is not None and time.has_number and time.high < treatment:
        text += f"; all is covered within {plain(treatment)} s: ask for the shortest time instead"
    yield AnswerLine("best", f"{text}.", False)


def _softer_lines(result: Result, start: Result | None) -> Iterator[AnswerLine]:
    """Yield a sentence on intensity and speed that the best chamber surely has less than the start.

    A gain in time or evenness may cost them, which no limit of the study need tell.
    """
    if start is None:
        return
    strength = "almen_intensity" if "almen_intensity" in result.metrics else "strength_um"
    texts = []
    for name in (strength, "mean_normal_speed_m_s"):
        after, before = result.metrics.get(name), start.metrics.get(name)
        if after is None or before is None:
            continue
        lost = change(after, before, result, start)
        if not lost.in_words and lost.high < 0.0:
            label = metric_label(name)
            texts.append(
                f"the {label.text} goes from {label.format(before)} to {label.format(after)}"
            )
    if texts:
        yield AnswerLine("best", f"It peens less hard than the start: {', '.join(texts)}.", True)


def _constraint_lines(result: Result) -> Iterator[AnswerLine]:
    """Yield sentences on constraints violated by the best design, the start or a better candidate.

    Limits of the best design's zones are left out, because each zone has its own sentence.
    """
    limited = {limit.metric for zone in result.record.zones for limit in zone.limits}
    study, label = result.study, objective_label(result.objective_name)
    if study is None:
        return
    for one in study.confirmed:
        violations = one.violations
        about: Literal["best", "start", "other"] = "other"
        if one.parameters == study.best.parameters:
            about, whose = "best", "The best chamber found"
            violations = [found for found in violations if found.figure not in limited]
        elif one.parameters == study.start.parameters:
            about, whose = "start", "The start"
        elif one.objective.value > result.objective.value:
            whose = f"Another chamber, whose {label.text} is {label.format(one.objective)}"
        else:
            continue
        if violations:
            texts = ", ".join(found.text for found in violations)
            yield AnswerLine(about, f"{whose}: constraints {MET[one.standing]}: {texts}.", True)


def full_coverage(result: Result) -> str:
    """Return part of a sentence: the time after which 95 % of the target is 98 % covered."""
    time = result.metrics.get("time_to_98_s")
    if time is None:
        return "this older result does not say when it would be covered to 98 %"
    if time.in_words == "never":
        return "at this rate 95 % of its area would never be covered to 98 %"
    if time.in_words == NOT_RESOLVED:
        return "too few dents were simulated to tell when 95 % of its area is covered to 98 %"
    return f"95 % of its area is covered to 98 % after {Label('', 's').format(time)}"
