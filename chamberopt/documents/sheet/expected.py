"""Tell on a process sheet what to expect, and what to measure first."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.common.estimate import Estimate
from chamberopt.common.number_text import estimate_text, rounded
from chamberopt.coverage.stress_knowledge import stress_bands
from chamberopt.design.calibration import why_no_intensity
from chamberopt.design.intensity import PredictedIntensity, WantedIntensity
from chamberopt.documents.answer import answer_lines
from chamberopt.documents.coverage import figures
from chamberopt.documents.document import Sentence, Table
from chamberopt.documents.ranges import time_at_slow_end
from chamberopt.documents.report import limits_of_intervals
from chamberopt.documents.sheet.rows import (
    Row,
    for_the_shop,
    is_unresolved,
    peak_to_valley,
    range_text,
    weighed_g,
    with_limits,
)
from chamberopt.documents.wanted import enough_time, may_be_too_short, strip_for, wanted_rows
from chamberopt.documents.wording import metric_label, plain
from chamberopt.results.load import load_start

if TYPE_CHECKING:
    from chamberopt.design.almen_strip import StripType
    from chamberopt.documents.coverage import Figure
    from chamberopt.peening.held_strip import HeldStrip
    from chamberopt.results.load import Result

TIME = "time_to_98_s"
LONG = 1.5  # times a time that is enough, from which on a time that nobody asked for is told
# The aim of searches, which nobody on the shop floor acts on.
UNIFORM = "uniform_coverage"
NO_INTENSITY = (
    "Almen intensity in mmA is not known before strips are peened here: see Measure first."
)
EXPECTED = (
    "mean_coverage",
    "p05_coverage",
    "time_to_98_s",
    "almen_intensity",
    "almen_intensity_p05",
    "almen_intensity_p95",
    "strength_um",
    "saturation_time_s",
    "compression_depth_um",
)
# What a shop calls figures that only the program has names for.
SHOP_NAMES = {"strength_um": "strength of the dents, to which mmA is proportional"}
# Of the expected saturation time, after which strips are peened: a curve has at least four points,
# one of them at twice that time or later (SAE J443).
STRIP_TIMES = (0.25, 0.5, 1.0, 2.0)
DROP_SPEED = 3.0  # m/s, the speed of a ball that falls 0.46 m; docs/how_to/calibrate.md
KINDS = ("arc heights", "coverage", "dent diameters", "ball drops", "amplitude", "impact rates")


def expected_rows(result: Result, usual: WantedIntensity | None) -> Iterator[Row]:
    """Yield rows (name, text) with the peening time and the expected coverage etc.

    Without a calibration, a row says why there is no intensity in mmA.
    """
    of_all = ", all steps together" if result.design.steps else ""
    time = f"{plain(result.design.process.treatment_time)} s{of_all}"
    time += " to start with, NOT YET SET: see 3 peen" if may_be_too_short(result) else ""
    yield "peening time", with_limits(result, "process.treatment_time_s", time)
    if shorter := _shorter(result):
        yield "shorter", shorter
    yield from wanted_rows(result)
    calibration = result.design.calibration
    shown = expected_figures(result)
    for row in shown:
        yield shop_name(row), _figure_text(row, result)
    if slow := time_at_slow_end(result):
        yield f"{metric_label(TIME).text}, at the slow end", slow
    wanted = result.design.process.intensity_mmA
    rough = PredictedIntensity.of(result.metrics, calibration)
    if wanted is None and rough is not None and "almen_intensity" not in result.metrics:
        near = f"about {plain(rough.value, 2)} mmA{rough.factor_in_words}"
        yield "Almen intensity, roughly", near
    if wanted is None and usual is not None:
        yield "Almen intensity, usual", f"{range_text(usual)}, {usual.text}"
    if wanted is None and why_no_intensity(calibration):
        yield "", NO_INTENSITY
    for one in answer_lines(result, load_start(result)):
        if one.about in ("best", "calibration", "ranges"):  # zones have their own block
            first, over, rest = for_the_shop(one.text).partition(" Over their ranges")
            yield "", first
            if rest:
                yield "", f"{over.strip()}{rest}"
    yield "", f"± 95 % intervals. {limits_of_intervals(result, has_groups=True)}"


def _shorter(result: Result) -> str:
    """Return in words which time is enough, where no coverage is asked for and far less would do.

    The time of a design that no pilot told is a start.
    """
    process, enough = result.design.process, enough_time(result.design, result.metrics)
    if process.coverage_percent is not None or result.design.steps or enough is None:
        return ""
    ranges = result.record.ranges
    known = None if ranges is None else ranges.figures.get(TIME)
    late = known.high.high if known is not None and known.is_resolved else 0.0
    if process.treatment_time < LONG * max(enough, late):
        return ""
    slow = time_at_slow_end(result)
    slow = f", or {slow} at the slow end of what is not calibrated" if slow else ""
    return (
        f"{plain(enough)} s are enough for 98 %{slow}. Peen longer only if the drawing asks for "
        "more, such as 200 %, twice as long"
    )


def _figure_text(row: Figure, result: Result) -> str:
    """Return a figure in words, with its range if it has one.

    One whose law may be wrong by a factor is told to two digits, with that factor. A range that is
    narrower is left out, as it would tell of more than is known.
    """
    band, known = stress_bands(result.design).get(row.name), row.result
    text = row.label.format(known)
    if band is not None and known.has_number:
        about = f"{rounded(row.label.scale(known).value, 2)} {row.label.unit}"
        text = f"about {about}, within a factor of {plain(band, 2)} by its law"
        ends = None if result.record.ranges is None else result.record.ranges.figures.get(row.name)
        if ends and known.value / band < ends.low.value <= ends.high.value < known.value * band:
            return text
    return f"{text}; range {row.range_with_unit}" if row.range_text else text


def shop_name(row: Figure) -> str:
    """Return what a shop calls a figure."""
    return SHOP_NAMES.get(row.name, row.label.text)


def expected_figures(result: Result) -> list[Figure]:
    """Return the figures that the sheet shows: the objective first, then those of EXPECTED.

    A mean coverage with a bound alone is left out, as among the main figures.
    Uniform coverage is none of them.
    """
    calibration, shown = result.design.calibration, figures(result, None)
    hidden = "strength_um" if calibration and calibration.has_strips else ""
    return [
        row
        for row in shown
        if (row is shown[0] or row.name in EXPECTED)
        and row.name not in (hidden, UNIFORM)
        and (row is shown[0] or not row.is_bound_mean)
    ]


def first_checks(result: Result, held: HeldStrip | None = None) -> Table:
    """Return the quantities to measure before production, each with its expected value.

    Args:
        held: how strips are held in the place of the part, if that is known.
    """
    rows = [(what, expected, "") for what, expected in _checks(result, held)]
    return Table("", ("Measure first", "expected", "measured"), rows, numbers=False)


def _checks(result: Result, held: HeldStrip | None) -> Iterator[Row]:
    design, calibration = result.design, result.design.calibration
    wanted = peak_to_valley(result)
    expected = f"{plain(wanted)} µm peak to valley"
    if calibration is not None:
        factor, sd = calibration.factor("amplitude"), 1.96 * calibration.log_sd("amplitude")
        low, middle, high = (plain(wanted * factor * np.exp(x), 3) for x in (-sd, 0.0, sd))
        expected = f"{middle} ({low} to {high}) µm peak to valley where {plain(wanted)} is set"
    yield "amplitude of the face, by laser or accelerometer", expected
    if calibration is None:
        laws = {name: getattr(design.materials, name) for name in ("sonotrode", "wall", "part")}
        what = f"ball drop: one ball at {plain(DROP_SPEED)} m/s, speed after over speed before"
        yield what, ", ".join(f"{k} {_restitution(x)}" for k, x in laws.items())
    curve, end = result.record.coverage_against_time, design.process.treatment_time
    # Measuring tells most near a mean coverage of 0.5. A part is peened no longer than it is to be.
    row = min(curve, key=lambda row: abs(row.mean_coverage - 0.5), default=None)
    share, after = result.metrics["mean_coverage"], f"the peening time, {plain(end, 3)} s"
    # If the mean coverage at the end is not resolved, its curve is not reliable either.
    if row and share.has_number:
        over = ""
        text = estimate_text(share, 100.0, "%")
        if row.time_s < end:
            share = Estimate(row.mean_coverage, row.half_width)
            over = _over_ranges(result, row.time_s)
            after = f"{plain(row.time_s, 3)} s"
            text = (
                f"{rounded(100.0 * share.value, 2)} %" if over else estimate_text(share, 100.0, "%")
            )
        yield f"mean coverage of the target after {after}", f"{text}{over}"
    intensity = result.metrics.get("almen_intensity")
    if intensity is None:
        rough = PredictedIntensity.of(result.metrics, calibration)
        kind, known = strip_for(design, result.metrics), "not known before: calibrates to mmA"
        if rough is not None:
            known = f"{rough.on_strips(kind)}{rough.factor_in_words}: the target's, not the strip's"
        calibrates = ", to calibrate by" if kind == "A" else ""  # others do not tell mmA closely
        strips = f"{_strips_in_words(kind, held)} {_strip_times(result)}{calibrates}"
        yield strips if held is None else _in_the_lid(strips, held), known
    else:
        text = metric_label("almen_intensity").format(intensity)
        own = calibration.own_strips if calibration else ""
        strips = f"intensity by {f'a {own}' if own else 'A strips'} {_strip_times(result)}"
        yield strips if held is None else _in_the_lid(strips, held, own), text
    masses = {plain(weighed_g(one.shot), 3): None for one in design.in_steps.values()}
    yield "mass of the shot, before and after", f"{' g, then '.join(masses)} g before"


def _strips_in_words(kind: StripType, held: HeldStrip | None) -> str:
    """Return in words which strips of a type are peened, or pieces of them."""
    is_cut = held is not None and held.size is not None and not held.is_whole
    cut = f"pieces of {held.size_in_words} of " if held is not None and is_cut else ""
    return f"{cut}{kind} strips"


def _in_the_lid(strips: str, held: HeldStrip, own: str = "") -> str:
    """Return in words where strips are peened, or that none has room in the lid.

    Args:
        strips: which, and after which times.
        own: what the machine was calibrated with in the place of whole strips, if so.
    """
    if held.size is None and not own:
        return "intensity: no strip has room in the lid; by a coupon, as under Acceptance"
    along = " along y," if held.along == "y" and not own else ""
    level = f"{plain(held.level_mm)} mm from the sonotrode, facing it"
    return f"{strips}; in the lid in place of the part,{along} {level}"


def _over_ranges(result: Result, time: float) -> str:
    """Return in words what the mean coverage after a time [s] may be before a calibration.

    The curve is that of the design, run through as much faster or slower as the mean exposure is at
    the ends of its range. The text is empty if there is none.
    """
    ranges, exposure = result.record.ranges, result.metrics.get("exposure")
    ends = None if ranges is None else ranges.figures.get("exposure")
    if ends is None or exposure is None or not exposure.value > 0.0:
        return ""
    curve = result.record.coverage_against_time
    times, shares = zip(
        (0.0, 0.0), *((one.time_s, one.mean_coverage) for one in curve), strict=True
    )
    low, high = (
        rounded(100.0 * float(np.interp(time * one.value / exposure.value, times, shares)), 2)
        for one in (ends.low, ends.high)
    )
    return f" as designed, {low} to {high} % before calibration"


def _strip_times(result: Result) -> str:
    """Return in words after which times strips are peened."""
    saturation = result.metrics.get("saturation_time_s")
    if saturation is None or not (saturation.has_number or _is_roughly_known(saturation)):
        return "at 4 or 5 times"
    *times, last = (rounded(share * saturation.value, 2) for share in STRIP_TIMES)
    about = "" if saturation.has_number else "about "
    return f"after {about}{', '.join(times)} and {last} s"


def _is_roughly_known(saturation: Estimate) -> bool:
    """Return whether a time that is not resolved suffices to choose the times of strips.

    Strips at half of the time or at twice it still tell where the curve saturates.
    """
    return is_unresolved(saturation) and 0.0 < saturation.bias < 0.5 * saturation.value


def calibrated_to(result: Result) -> Iterator[Sentence]:
    """Yield a sentence on the measurements by which the machine was calibrated.

    The sentence also names the kinds of measurement that are missing.
    """
    calibration = result.design.calibration
    kinds = {misfit.kind for misfit in calibration.misfits} if calibration else set()
    have, lacking = ([kind for kind in KINDS if (kind in kinds) is one] for one in (True, False))
    more = f" What it has not, and would make it surer: {', '.join(lacking)}." if lacking else ""
    if have:
        yield Sentence(f"The machine is calibrated by: {', '.join(have)}.{more}")


def _restitution(law: Any) -> str:
    from sim_core import restitution_at

    return plain(float(restitution_at(np.array(DROP_SPEED), law.restitution)), 2)
