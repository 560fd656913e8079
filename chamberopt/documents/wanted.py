"""Text about intensity, coverage and time that are wanted, beside those that were simulated."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from chamberopt.common.estimate import NOT_RESOLVED, Estimate
from chamberopt.common.number_text import estimate_text
from chamberopt.coverage.metrics import tells_coverage
from chamberopt.design.intensity import (
    OUTSIDE,
    TOO_FEW,
    Comparison,
    PredictedIntensity,
    range_on_strips,
    strip_to_measure,
)
from chamberopt.documents.document import AnswerLine
from chamberopt.documents.ranges import groups_text, slow_end_is_late, time_at_slow_end
from chamberopt.documents.wording import metric_label, plain

if TYPE_CHECKING:
    from chamberopt.design.almen_strip import StripType
    from chamberopt.design.load import Design
    from chamberopt.results.load import Result

TIME = "time_to_98_s"
MET, NOT_MET, NOT_DECIDED = "met", "not met", "not decided"
ENOUGH = {MET: "Enough", NOT_MET: "Not enough", NOT_DECIDED: "Not certain to be enough"}
FULL = 0.98  # mean coverage from which on the target counts as covered
NEVER = "95 % of its area is never 98 % covered, however long it is peened"
UNKNOWN = "when it is covered is not resolved"


def intensity_text(design: Design) -> str:
    """Return the range of the wanted intensity, such as "0.15 to 0.2 mmA", or ""."""
    wanted = design.process.intensity_mmA
    return "" if wanted is None else range_on_strips(*wanted)


def strip_for(design: Design, metrics: Mapping[str, Estimate]) -> StripType:
    """Return the type of the strips that measure the wanted intensity, or else the expected one.

    Machines are calibrated by A strips.
    """
    wanted, calibration = design.process.intensity_mmA, design.calibration
    found = None
    if calibration is None or not calibration.has_strips:
        found = PredictedIntensity.of(metrics, calibration)
    return strip_to_measure(wanted, found)


def coverage_text(design: Design) -> str:
    """Return the wanted coverage, such as "200 %: 2 × the time to 98 %", or ""."""
    percent = design.process.coverage_percent
    if percent is None:
        return ""
    return f"{plain(percent)} %: {plain(percent / 100.0)} × the time to 98 %"


def time_text(design: Design, metrics: Mapping[str, Estimate]) -> str:
    """Return the peening time as a multiple of the time to 98 %, "" if that is not known.

    An example is "2.1 × the time to 98 % on 95 % of the target's area, 143 ± 5 s".
    """
    time, planned = metrics.get(TIME), design.process.treatment_time
    if time is None or time.in_words or not time.value > 0.0:
        return ""
    multiple, after = plain(planned / time.value, 2), metric_label(TIME).format(time)
    return f"{multiple} × the time to 98 % on 95 % of the target's area, {after}"


def coverage_standing(design: Design, metrics: Mapping[str, Estimate]) -> str:
    """Return whether the peening time is enough for the wanted coverage, by its whole interval."""
    time = metrics.get(TIME)
    if time is None or not time.has_number:
        return NOT_MET if time is not None and time.in_words == "never" else NOT_DECIDED
    return time_standing(design, time)


def time_standing(design: Design, time: Estimate) -> str:
    """Return whether the peening time is enough, for 98 % or for the wanted coverage.

    Args:
        time: the time to 98 % [s], with its whole interval.
    """
    planned, times = design.process.treatment_time, times_wanted(design)
    if planned >= times * time.high:
        return MET
    return NOT_MET if planned < times * time.low else NOT_DECIDED


def enough_time(
    design: Design,
    metrics: Mapping[str, Estimate],
    planned: float = 0.0,
    before: Mapping[str, Estimate] | None = None,
) -> float | None:
    """Return the least whole time [s] that is enough by `coverage_standing`; None if not known.

    A time that was planned for other metrics, with a margin for what is not calibrated, keeps this
    margin.

    Args:
        planned: that time [s].
        before: those metrics; None if there are none.
    """
    time, then = metrics.get(TIME), (before or {}).get(TIME)
    if time is None or time.in_words or not 0.0 < time.high < math.inf:
        return None
    enough = times_wanted(design) * time.high
    if then is not None and not then.in_words and 0.0 < then.high < math.inf:
        enough = max(enough, planned * time.value / then.value)
    return float(math.ceil(round(enough, 6)))


def times_wanted(design: Design) -> float:
    """Return the wanted coverage as a multiple of the time to 98 %; 1 if none is asked for."""
    percent = design.process.coverage_percent
    return 1.0 if percent is None else percent / 100.0


def multiple_in_words(design: Design) -> str:
    """Return the wanted coverage as a multiple of a time, such as "twice "; "" for the time."""
    times = times_wanted(design)
    return {1.0: "", 2.0: "twice "}.get(times, f"{plain(times)} times ")


def may_be_too_short(result: Result) -> bool:
    """Return whether a treatment time leaves the target bare, or is not certain to be enough."""
    return any(one.warns for one in time_lines(result)[:1])


def time_lines(result: Result) -> list[AnswerLine]:
    """Return whether the peening time is enough, for 98 % or for the coverage that is wanted.

    A second sentence warns if it is not enough at the slow end of what is not calibrated. There is
    none of them if too little is known of the coverage.
    """
    design, metrics = result.design, result.metrics
    time, mean = metrics.get(TIME), metrics.get("mean_coverage")
    if time is None or mean is None or not mean.has_number:
        return []
    planned = design.process.treatment_time
    bare = estimate_text(Estimate(1.0 - mean.value, mean.half_width), 100.0, "%")
    leaves = f"{plain(planned)} s leave {bare} of the target bare"
    if time.in_words:
        why = {"never": NEVER}.get(time.in_words, UNKNOWN)
        is_known = time.in_words == "never" or mean.high < FULL
        return [_of_process(f"Not enough: {leaves}; {why}.", True)] if is_known else []
    standing, asked = time_standing(design, time), coverage_text(design)
    text = f"{plain(planned)} s are {time_text(design, metrics)}"
    if standing == NOT_MET and mean.high < FULL:
        text = f"{leaves}; they are {time_text(design, metrics)}"
    text += f"; wanted are {asked}" if asked else ""
    is_short = time.value * times_wanted(design) > planned
    lines = [_of_process(f"{ENOUGH[standing]}: {text}.", is_short)]
    if time.value <= planned and result.record.ranges and slow_end_is_late(result):
        slow = (
            "It is not enough at the slow end of what is not calibrated "
            f"({groups_text(result.record.ranges)}): there 95 % of the target's area is 98 % "
            f"covered after {time_at_slow_end(result)}."
        )
        lines.append(_of_process(slow, True))
    return lines


def _of_process(text: str, warns: bool) -> AnswerLine:
    return AnswerLine("process", text, warns)


def intensity_lines(design: Design, metrics: Mapping[str, Estimate]) -> Iterator[AnswerLine]:
    """Yield a sentence on the intensity, beside the wanted one if there is one.

    It warns if it is outside, or if none is known because too little was simulated. With none
    wanted, one that strips tell is among the figures.
    """
    if design.process.intensity_mmA is not None:
        found = Comparison.of(design.process.intensity_mmA, metrics, design.calibration)
        wanted = f"Almen intensity wanted {intensity_text(design)}: {found.in_words}"
        text = f"{wanted}; predicted {found.predicted}."
        yield _of_process(text, found.standing == OUTSIDE)
    elif "almen_intensity" not in metrics and (
        one := PredictedIntensity.of(metrics, design.calibration)
    ):
        yield _of_process(f"Almen intensity: {one.in_words}.", False)
    elif design.calibration is None and _is_unresolved(metrics):
        yield _of_process(f"Almen intensity: not known: {TOO_FEW}.", True)


def _is_unresolved(metrics: Mapping[str, Estimate]) -> bool:
    strength = metrics.get("strength_um")
    return strength is not None and strength.in_words == NOT_RESOLVED


def not_told(metrics: Mapping[str, Estimate]) -> list[str]:
    """Return what too few dents were simulated to tell, in words."""
    time = metrics.get(TIME)
    is_unknown = {
        "the coverage": not tells_coverage(metrics),
        "the time to 98 %": time is not None and time.in_words == NOT_RESOLVED,
        "the peening strength": _is_unresolved(metrics),
    }
    return [name for name, is_so in is_unknown.items() if is_so]


def times_longer(result: Result) -> int:
    """Return how many times the simulated time tells what is not told; 1 if nothing is missing.

    Where the dents are enough for all but the strength, twice the time is a start, as the time
    that it needs is not known.
    """
    if not not_told(result.metrics):
        return 1
    needed, is_told = result.record.field.simulated_s_needed, tells_coverage(result.metrics)
    of_all = max(needed.p05_times_intensity or 0.0, 0.0 if is_told else needed.mean_and_std or 0.0)
    return max(2, math.ceil(of_all / result.record.simulated_time_s))


def wanted_rows(result: Result) -> Iterator[tuple[str, str]]:
    """Yield rows of the sheet: the time against 98 %, and what is wanted beside the predictions."""
    design, metrics = result.design, result.metrics
    if multiple := time_text(design, metrics):
        yield "that is", multiple
    if wanted := coverage_text(design):
        yield "coverage wanted", f"{wanted}; {coverage_standing(design, metrics)}"
    if design.process.intensity_mmA is not None:
        found = Comparison.of(design.process.intensity_mmA, metrics, design.calibration)
        wanted = f"{intensity_text(design)}, mean over the target"
        yield "intensity wanted", f"{wanted}; {found.in_words}"
        yield "intensity predicted", found.predicted
