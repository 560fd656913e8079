"""Tell on a process sheet why not to rely on it, its limits, and all that is warned of."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import TYPE_CHECKING

from chamberopt.chamber.matters import Urgency
from chamberopt.common.key_words import key_in_words, title_with_unit
from chamberopt.design.intensity import PredictedIntensity, WantedIntensity
from chamberopt.design.tolerances import USUAL, USUAL_IN_WORDS, tolerance_box
from chamberopt.documents.answer import answer_lines, shot_lines
from chamberopt.documents.report import SETTLED, open_matters, own_warnings
from chamberopt.documents.sheet.expected import expected_figures, shop_name
from chamberopt.documents.sheet.openings import FOLLOWS
from chamberopt.documents.sheet.rows import (
    Row,
    face_in_words,
    for_the_shop,
    is_unresolved,
    peak_to_valley,
    range_text,
)
from chamberopt.documents.sheet.settings import reference_limits
from chamberopt.documents.tolerances import sheet_rows
from chamberopt.documents.wanted import intensity_lines, time_lines
from chamberopt.documents.wording import keys_in_words, plain

if TYPE_CHECKING:
    from chamberopt.chamber.checks.openings import Opening
    from chamberopt.results.load import Result

WIDEST_FACE = 90.0  # mm: larger faces need slots or are several (chamber/usual_shop.toml)
# Factor beside the usual range up to which an intensity without strips counts as in it: those of
# pilots and of results differ by as much.
ROUGHLY = 1.33
OF_STRIPS = ("strength_um", "saturation_time_s", "compression_depth_um")


def alarms(result: Result) -> Iterator[str]:
    """Yield the reasons not to use the sheet as it stands.

    They are matters that are to be settled first, figures that are not resolved, balls that jam, a
    shot that had not settled, a time that leaves the target bare or is too short for the wanted
    coverage, and an intensity outside of its range.
    """
    if count := sum(_to_settle(result)):
        yield (
            f"{count} matter{'s are' if count > 1 else ' is'} to be settled before this is built: "
            f"see “{Urgency.BEFORE_BUILDING.in_words}”."
        )
    told = expected_figures(result)
    if result.design.calibration is None:  # without one they are rough, resolved or not
        told = [row for row in told if row.name not in OF_STRIPS]
    unresolved = [shop_name(row) for row in told if is_unresolved(row.result)]
    if unresolved:
        yield (
            f"Too few dents were simulated to resolve: {', '.join(unresolved)}. Simulate "
            "longer, or with more replicas, before this is built."
        )
    said = [*shot_lines(result), *time_lines(result)[:1]]
    said += intensity_lines(result.design, result.metrics)
    yield from (one.text for one in said if one.warns)


def _to_settle(result: Result) -> Iterator[bool]:
    """Yield for each open matter whether it is to be settled before the chamber is built."""
    return (one.urgency is Urgency.BEFORE_BUILDING for one in open_matters(result))


def wide_face(result: Result, face_mm: tuple[float, ...]) -> Iterator[str]:
    """Yield a sentence if the face is larger than usual, and its amplitude was not measured."""
    face = result.design.sonotrode.face
    widest = max(face_mm if face is None else face.block_mm)
    if widest > WIDEST_FACE and result.design.sonotrode.amplitude_profile is None:
        yield (
            f"The face, {face_in_words(face_mm)}, is larger than usual sonotrodes, and was "
            "simulated as one that moves alike all over. If yours is smaller, set several side by "
            "side or peen a strip at a time; if it has slots, measure its amplitude over the face."
        )


def unusual_intensity(result: Result, usual: WantedIntensity | None) -> Iterator[str]:
    """Yield a sentence if an intensity that nobody asked for is expected off the usual range."""
    design = result.design
    found = PredictedIntensity.of(result.metrics, design.calibration)
    if usual is None or found is None or design.process.intensity_mmA is not None:
        return
    off = usual.off(found.value)
    if abs(off) > (math.log(ROUGHLY) if design.calibration is None else 0.0):
        yield (
            f"The expected Almen intensity, {plain(found.value, 2)} mmA, is "
            f"{'below' if off < 0.0 else 'above'} {range_text(usual)}, {usual.text}: agree on it, "
            "or ask for another one."
        )


def cautions(result: Result) -> Iterator[str]:
    """Yield warnings for the operator.

    The warnings say how the simulation differs from the machine, and which goals are not reached.
    """
    yield from (one.text for one in time_lines(result)[1:])
    yield from (one.text for one in shot_lines(result) if not one.warns)
    if result.design.effects.friction is None:
        yield (
            "Simulated without friction, as asked. With it the shot was 22 to 47 % slower in a "
            "cylinder (mu 0.1 to 0.5), and coverage takes longer: rely on these times only once "
            "the coverage measured first agrees."
        )
    if result.record.chamber.facets_left:
        yield (
            "The part's file has coarse facets in the place of its rounds, which were not divided: "
            "coverage and times are those of the facets."
        )
    if result.record.chamber.pieces_in_air:
        yield "The part is held in the air: nothing holds it, a holder of the design would."
    study = result.study
    if ends := study.on_bounds if study and not study.keeps_start else []:
        yield (
            f"The search ended on its bounds of {', '.join(map(key_in_words, ends))}: a better "
            "chamber may lie beyond."
        )


def zone_rows(result: Result) -> Iterator[Row]:
    """Yield a row with a sentence for each zone. Zones with limits that are not met come first."""
    lines = [one for one in answer_lines(result) if one.about == "zone"]
    lines.sort(key=lambda line: not line.warns)
    yield from (("", one.text) for one in lines)


def tolerance_rows(result: Result, openings: Sequence[Opening] = ()) -> Iterator[Row]:
    """Yield rows with the tolerance range of each number of the design that has a tolerance.

    One that follows from another, as the part lies on the walls, has none of its own.

    If the tolerances were simulated, further rows give their effect on coverage etc.
    """
    box = tolerance_box(result.design)
    follows = reference_limits(result, openings)
    for name, (low, high) in box.items():
        designed = plain(result.design.value(name))
        if reference := follows.get(name.removeprefix("chamber.")):
            yield title_with_unit(name), f"({plain(reference[1])}): {FOLLOWS}"
            continue
        yield title_with_unit(name), f"{plain(low)} to {plain(high)}, as designed {designed}"
    found = result.record.tolerances
    if result.design.tolerances is None:
        low, high = (peak_to_valley(result) + sign * USUAL["amplitude_pv_um"] for sign in (-1, 1))
        usual = f"{plain(low)} to {plain(high)} µm, {USUAL_IN_WORDS}"
        yield "", f"Amplitude: {usual}. The design states no tolerances: others are not known."
    elif found is None:
        yield "", "What they cost was not simulated."
    else:
        yield from sheet_rows(found)


def matter_tables(result: Result) -> Iterator[tuple[str, Iterator[Row]]]:
    """Yield title and rows of a table with the matters of each urgency, and what is settled."""
    for urgency, found in groupby(open_matters(result), lambda one: one.urgency):
        texts = [for_the_shop(keys_in_words(one.sentence)) for one in found]
        yield urgency.in_words, (("", text) for text in texts)
    if settled := result.design.settled:
        yield SETTLED, (("", for_the_shop(keys_in_words(one))) for one in settled)


def warning_rows(result: Result) -> Iterator[Row]:
    warnings = result.record.warnings
    if warnings is None:
        yield "", "The design was not checked, so that its warnings are not known."
    elif not (left := own_warnings(result)):
        beside = " beside what is to be settled" if any(_to_settle(result)) else ""
        yield "", f"There are none{beside}."
    else:
        yield from (("", for_the_shop(keys_in_words(text))) for text in left)
