"""Tell on a process sheet by what a part is accepted or rejected."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.chamber.checks.fillets import OF_FILLET
from chamberopt.chamber.checks.place_names import CEILING
from chamberopt.chamber.propose.proposed_budget import UNEVEN
from chamberopt.common.estimate import NOT_PROVEN
from chamberopt.common.number_text import rounded
from chamberopt.coverage.metrics import FULL_COVERAGE, tells_coverage
from chamberopt.design.almen_strip import STRIPS
from chamberopt.documents.sheet.rows import AsBuilt, Row
from chamberopt.documents.wanted import (
    intensity_text,
    may_be_too_short,
    multiple_in_words,
    strip_for,
)
from chamberopt.documents.wording import per_cent, per_cent_closely, plain
from chamberopt.peening.held_strip import SCREW_MM

if TYPE_CHECKING:
    from chamberopt.results.load import Result
    from chamberopt.results.looked_places import LookedPlace

TIME = "time_to_98_s"
STRIP_WIDTHS_MM = "18.8 to 19.05"  # mm, of Almen strips (SAE J442, as shops quote it)
# By heart, as no text of the standard was read.
BLOCK = (
    "Usual, by heart, to be compared with SAE J442: hardened, ground flat, at least 10 mm thick "
    "under the strip"
)
LENS = "a magnifier of 10 to 30 times (SAE J2277)"
ASIDE = 0.35  # least share of a normal along an axis for a surface to be told to look that way
NEAR_END = 1.0 / 3.0  # share of half the target's length from which on a place is near its end
LEAST_SEEN = 0.2  # share of dents below which it is hard to see how large it is
MOST_TIMES = 2.0  # peening times in all after which a part counts as over-peened, a rule of thumb
LEAST_MISSED = 5e-3  # share of the target out of reach that is told
# SAE AMS 2580A allows it where no strip can be (as quoted in the forum of shotpeener.com).
COUPON = (
    "a coupon (SAE AMS 2580A), a flat piece of the part's metal, hardened as the part is, on which "
    "the dents' diameter or the stress by X-ray is agreed on"
)


def acceptance_rows(result: Result, built: AsBuilt) -> Iterator[Row]:
    """Yield rows on where and when to look, what to see there, and what intensity is accepted by.

    Args:
        built: with the places to look at; none where too few dents tell them apart.
    """
    places = built.places
    if places:
        kind = _kind(result, built)
        listed = "; ".join(
            f"{number} at {_place_mm(one)} mm, {_lies(one, kind)}"
            for number, one in enumerate(places, 1)
        )
        yield (
            "places to look at",
            f"{listed}; numbered under Coverage by place: where the "
            f"fewest dents are expected, off the edges; by {LENS}",
        )
        if text := _slowest(result, built):
            yield "slowest place", text
        if text := _first_part(result, built):
            yield "first part", text
    else:
        yield "places to look at", f"all of the target, by {LENS}: too few dents tell places apart"
    seen = f"each of places 1 to {len(places)}" if len(places) > 1 else "the target"
    missed = 1.0 - result.record.field.reachable_share
    bare = per_cent_closely(missed)
    but = f", but the {bare} that no ball can touch, brown under Coverage by place"
    yield (
        "ACCEPT or REJECT",
        f"ACCEPT coverage if dents lie on {per_cent(FULL_COVERAGE)} or more of {seen}, and nothing "
        f"else of the target is bare{but if missed > LEAST_MISSED else ''}. If not, peen the part "
        "for the same time once more and look again; REJECT it if it is still less. "
        f"{_over_peened(result)}",
    )
    yield "intensity", _intensity(result, built)


def _over_peened(result: Result) -> str:
    """Return in words for how long a part is peened at most."""
    planned, time = result.design.process.treatment_time, result.metrics.get(TIME)
    if may_be_too_short(result):
        most = "twice the peening time"
    else:
        most = f"{plain(MOST_TIMES * planned)} s"
        if time is not None and time.has_number and time.value > 0.0:
            most += f", {plain(MOST_TIMES * planned / time.value, 2)} × the time to 98 %"
    return (
        f"No part is peened for more than {most}, in all: REJECT it as over-peened, unless its "
        "drawing allows more."
    )


def _kind(result: Result, built: AsBuilt) -> str:
    """Return in words what surface a place to look at is on, as far as the target tells."""
    surface = result.design.part.target.surface
    if surface != ("all",) and len(surface) == 1:
        return f"on the surface {surface[0]}"
    return "on a fillet" if built.radii else "on a face"


def _place_mm(one: LookedPlace) -> str:
    return f"({', '.join(plain(round(1e3 * x, 1) + 0.0) for x in one.at.tolist())})"


def _lies(one: LookedPlace, kind: str) -> str:
    """Return in words where a place lies: which way its surface looks, and near which end."""
    ways = (("to −x", "to +x"), ("to −y", "to +y"), ("down", "up"))
    looks = [
        ways[axis][int(one.normal[axis] > 0.0)]
        for axis in np.argsort(-np.abs(one.normal)).tolist()
        if abs(one.normal[axis]) > ASIDE
    ]
    axis, share = one.along
    ends = ("−x end", "+x end"), ("−y end", "+y end"), ("lower end", "upper end")
    end = "the middle" if abs(share) < NEAR_END else f"the {ends[axis][int(share > 0.0)]}"
    return f"{kind} that looks {' and '.join(looks)}, near {end} of the target"


def _slowest(result: Result, built: AsBuilt) -> str:
    """Return in words how much longer the least covered place takes, and what shortens it.

    The text is empty where it takes hardly longer than the target on average.
    """
    exposure, place = result.metrics.get("exposure"), built.places[0]
    if exposure is None or not exposure.has_number or not place.density > 0.0:
        return ""
    longer = exposure.value * -math.log1p(-FULL_COVERAGE) / place.density
    if longer < UNEVEN:
        return ""
    ball = min(result.design.ball_diameters)
    narrow = [one for one in built.radii if OF_FILLET * one < ball]
    turns = result.design.effects.part_turn is not None or bool(result.design.steps)
    if narrow:
        what = (
            f"its fillet of {plain(1e3 * min(narrow))} mm is narrow for balls of "
            f"{plain(1e3 * ball)} mm: simulate balls of at most "
            f"{plain(1e3 * OF_FILLET * min(narrow), 2)} mm"
        )
    elif place.normal[2] > ASIDE and not turns:
        what = "it looks up: simulate the part turned over after half of the time, in two steps"
    elif abs(place.normal[2]) <= ASIDE and not turns:
        remedy = "it looks aside: simulate more room between it and the wall"
        if math.isfinite(place.to_part):
            apart = plain(round(1e3 * place.to_part, 1))
            remedy = f"the part itself is before it, {apart} mm away: simulate smaller balls"
        what = f"{remedy}, or a second pose in which it looks down, in two steps"
    else:
        what = "simulate more room beside it and a larger distance from the sonotrode"
    return (
        f"place 1 takes about {rounded(longer, 2)} times as long as the target on average, and the "
        f"time is for it. If that is too long: {what}"
    )


def _first_part(result: Result, built: AsBuilt) -> str:
    """Return in words after which time to stop the first part, and what to see there by then.

    It is half of the time to 98 %, where shares still tell a slow machine from a quick one, and no
    longer than the part is to be peened, nor than the coverage is told. The text is empty where
    hardly a dent is seen by then, or the part is peened in several steps.
    """
    planned, time = result.design.process.treatment_time, result.metrics.get(TIME)
    half = 0.5 * (planned if time is None or not time.has_number else time.value)
    is_told, curve = tells_coverage(result.metrics), result.record.coverage_against_time
    last = planned if is_told else max((row.time_s for row in curve), default=0.0)
    after = min(half, planned, last)
    what = "half of the time to 98 %" if after == half and half != 0.5 * planned else ""
    shares = [one.coverage(after / planned) for one in built.places]
    if result.design.steps or max(shares) < LEAST_SEEN:
        return ""
    told = ", ".join(f"{per_cent(x)} at {k}" for k, x in enumerate(shares, 1))
    ranges, exposure = result.record.ranges, result.metrics.get("exposure")
    ends = None if ranges is None else ranges.figures.get("exposure")
    more = ""
    if ends is not None and exposure is not None and exposure.value > 0.0:
        low, high = (
            100.0 * one.coverage(after / planned * end / exposure.value)
            for one, end in ((built.places[0], x) for x in (ends.low.value, ends.high.value))
        )
        more = f" ({rounded(low, 2)} to {rounded(high, 2)} % at 1 before calibration)"
    doubt = "" if is_told else f"; on how much of them after {plain(planned)} s is {NOT_PROVEN}"
    return (
        f"stop it after {plain(after, 2)} s{f', {what},' if what else ''} and look: dents are "
        f"expected on about {told}{more}{doubt}. Where fewer are seen, the machine peens more "
        "slowly than was simulated: peen on, twice as long each time, until no more dents are "
        "seen, and set "
        f"{multiple_in_words(result.design)}that time{_why_longer(result)}."
    )


def _why_longer(result: Result) -> str:
    """Return in words for which wanted coverage a time is multiplied; "" if it is not."""
    percent = result.design.process.coverage_percent
    if percent is None or not multiple_in_words(result.design):
        return ""
    return f", for the {plain(percent)} % that are wanted"


def strip_rows(built: AsBuilt) -> Iterator[Row]:
    """Yield rows on how an Almen strip is held in the place of the part, with its sizes."""
    held = built.held
    if held is None or held.size is None:
        return
    strip = STRIPS[held.type]
    sizes = f"{plain(1e3 * strip.length)} × {STRIP_WIDTHS_MM} × {plain(1e3 * strip.thickness)} mm"
    article = "a" if held.type == "C" else "an"
    cut = "" if held.is_whole else f"a piece of {held.size_in_words}, cut from "
    yield (
        "strip",
        f"{cut}{article} {held.type} strip, {sizes} (SAE J442): its middle on the room's axis, its "
        f"length along {held.along}, its peened face down, {plain(held.level_mm)} mm from the "
        "sonotrode's face",
    )
    is_aside = bool({one.wall for one in built.openings} - {CEILING})
    walls = "; those that the part leaves in the walls are closed flush" if is_aside else ""
    into = "flush with the ceiling"
    if held.block_mm:
        into = (
            f"{plain(held.block_mm)} mm below the ceiling, as the target is: there the block fills "
            "the room but for the gap of a joint"
        )
    yield (
        "block",
        f"of steel, in the place of the part: it closes the room and has no opening{walls}. Its "
        f"lower face, on which the strip lies, is {into}. {BLOCK}",
    )
    along, across = map(plain, held.screws_mm)
    yield (
        "screws",
        f"four, M{plain(SCREW_MM)}, at {along} mm along and {across} mm across from the strip's "
        "middle: their heads reach over its long edges",
    )


def _intensity(result: Result, built: AsBuilt) -> str:
    """Return in words what accepts the intensity, or that nothing does yet."""
    design, held = result.design, built.held
    wanted = intensity_text(design)
    is_told = "almen_intensity" in result.metrics
    not_by_dents = "not accepted by coverage"
    own = design.calibration.own_strips if is_told and design.calibration else ""
    kind = strip_for(design, result.metrics)
    if own or (held is not None and held.is_whole):
        strips = f"a {own}, with which the machine was calibrated," if own else f"{kind} strips"
        by = f"{strips} in the lid, {'after the times of' if is_told else 'as under'} Measure first"
        if is_told:
            aim = f"ACCEPT {wanted}" if wanted else "no range is asked for: record it"
            return f"{aim} by {by}"
        aim = f"ACCEPT {wanted}" if wanted else "agree on a range in mmA"
        return f"{not_by_dents}: {aim} by {by}"
    accept = f"ACCEPT {wanted}" if wanted else "ACCEPT the first part"
    if held is None or held.size is None:
        why = "no lid takes a strip here" if held is None else held.why_no_whole
        return (
            f"{not_by_dents}: {why}. {accept} by {COUPON}; held where the target is, facing as it "
            "does"
        )
    gauge = "; they are wide enough for the usual gauge" if held.is_on_gauge else ""
    walls = f"; or whole strips on the room's wall {held.walls}" if held.walls else ""
    return (
        f"{not_by_dents}, and no whole strip is held in the lid: {held.why_no_whole}. {accept} by "
        f"pieces of {held.size_in_words} cut from {kind} strips, held as under Strip holder, "
        f"once their arc heights are correlated with mm{kind} (peen some beside whole strips where "
        f"both fit, at three intensities or more{gauge}){walls}; or by {COUPON}"
    )
