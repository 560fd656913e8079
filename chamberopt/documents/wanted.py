"""Text about the intensity and coverage that are wanted, beside those that were simulated."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from chamberopt.design.intensity import OUTSIDE, Comparison
from chamberopt.documents.document import AnswerLine
from chamberopt.documents.wording import metric_label, plain

if TYPE_CHECKING:
    from chamberopt.common.estimate import Estimate
    from chamberopt.design.load import Design
    from chamberopt.results.load import Result

TIME = "time_to_98_s"
MET, NOT_MET, NOT_DECIDED = "met", "not met", "not decided"


def intensity_text(design: Design) -> str:
    """Return the range of the wanted intensity, such as "0.15 to 0.2 mmA", or ""."""
    wanted = design.process.intensity_mmA
    return "" if wanted is None else f"{plain(wanted[0])} to {plain(wanted[1])} mmA"


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
    if time is None or time.in_words or not 0.0 < time.low < time.high < float("inf"):
        return ""
    multiple, after = plain(planned / time.value, 2), metric_label(TIME).format(time)
    return f"{multiple} × the time to 98 % on 95 % of the target's area, {after}"


def coverage_standing(design: Design, metrics: Mapping[str, Estimate]) -> str:
    """Return whether the peening time is enough for the wanted coverage, by its whole interval."""
    time, percent = metrics.get(TIME), design.process.coverage_percent
    if percent is None or time is None or not time.has_number:
        return NOT_MET if time is not None and time.in_words == "never" else NOT_DECIDED
    planned, times = design.process.treatment_time, percent / 100.0
    if planned >= times * time.high:
        return MET
    return NOT_MET if planned < times * time.low else NOT_DECIDED


def wanted_lines(design: Design, metrics: Mapping[str, Estimate]) -> list[AnswerLine]:
    """Return a sentence on the wanted intensity, and one on the wanted coverage, if there are any.

    A sentence warns if the intensity is outside of its range, or the time too short.
    """
    lines = []
    if design.process.intensity_mmA is not None:
        found = Comparison.of(design.process.intensity_mmA, metrics, design.calibration)
        wanted = f"Almen intensity wanted {intensity_text(design)}: {found.in_words}"
        text = f"{wanted}; predicted {found.predicted}."
        lines.append(AnswerLine("process", text, warns=found.standing == OUTSIDE))
    if wanted := coverage_text(design):
        standing = coverage_standing(design, metrics)
        known = time_text(design, metrics) or "a multiple that is not known of the time to 98 %"
        planned = plain(design.process.treatment_time)
        text = f"Coverage wanted {wanted}: {standing}; the peening time of {planned} s is {known}."
        lines.append(AnswerLine("process", text, warns=standing == NOT_MET))
    return lines


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
