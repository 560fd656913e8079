"""Choose the balls and the amplitude that give a wanted Almen intensity, from pilot simulations."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from chamberopt.chamber.checks.usual import thickness_under_target
from chamberopt.chamber.layout.balls import (
    AS_GOOD,
    LARGEST_BALL,
    MANY,
    MISSED,
    MISSED_FILLETS,
    MOSTLY,
    OF_THIN,
    THIN_SHARE,
    fit_sizes,
    thinnest,
)
from chamberopt.chamber.matters import MatterKind
from chamberopt.chamber.propose.proposal import BallTrial, Proposal, Wanted
from chamberopt.chamber.propose.proposed_budget import Measured
from chamberopt.chamber.propose.proposed_setting import (
    AMPLITUDE_POWER,
    BALL_POWER,
    Setting,
    Settings,
    amplitudes_of,
    choose,
    expected_intensity,
    setting_of,
    settings_of,
    with_amplitude,
)
from chamberopt.chamber.shop import usual_shop
from chamberopt.common.errors import InputError
from chamberopt.common.number_text import plain
from chamberopt.design.almen_strip import usual_strip
from chamberopt.design.intensity import (
    THIN_MM,
    Comparison,
    PredictedIntensity,
    WantedIntensity,
    usual_intensity,
    why_none,
)
from chamberopt.design.materials import alloy

MOST_PILOTS = 5
INTENSITY = "process.intensity_mmA"  # whose reason stands in a design without a wish too
# Factor into its range by which an intensity is aimed at, as a pilot of other balls tells another.
INSIDE = 1.15
MOST_TRIED = 3  # larger sizes that pilots compare
FURTHER = 2.0  # times as large as the proposed balls, where no intensity says how far
LARGER = f"{MatterKind.LARGER_BALLS}"
# Larger balls in the place of more than MANY, by heart: at most so many of theirs, share of the
# target that they serve less, and time over theirs, which pilots know to 10 to 20 %.
FEWER, SERVED_LESS, AS_QUICK = 0.6, 0.15, 1.1


class IntensityPilot(NamedTuple):
    """What a pilot run tells of a proposal's intensity.

    Attributes:
        predicted: the intensity.
        dents: in the median window, which strength takes to be resolved in it.
    """

    predicted: PredictedIntensity
    dents: float


def propose_intensity(
    made: Proposal,
    wanted: Wanted,
    intensity: WantedIntensity,
    again: Callable[[Wanted], Proposal],
    simulate: Callable[[Proposal], IntensityPilot | None],
    by_rule: tuple[float, str] | None = None,
) -> Proposal:
    """Return a proposal with balls and an amplitude for a wanted intensity, and the reasons.

    Where all balls that serve the target as well as any are too weak, larger ones are taken that
    serve most of it or touch nearly all, and what this costs is told.

    Args:
        made: the proposal to begin with.
        again: proposes the design for other wishes.
        simulate: runs a pilot of a proposal; None if its intensity is not resolved.
        by_rule: diameter of the balls that geometry alone gives [mm], and the reason for them; by
            default those of `made`.
    Raises:
        InputError: no pilot resolved the strength.
    """
    calibration = made.design.calibration
    if calibration is not None and calibration.not_mmA:
        text = f"the calibration has arc heights of a {calibration.strips}, which are not mmA"
        raise InputError(f"--calibration: {text}; calibrate with whole strips")
    possible = settings_of(made, wanted)
    settings, larger = possible.serving, possible.larger
    by_ball = {setting_of(made).ball_mm: made}
    small, reason = by_rule or (setting_of(made).ball_mm, made.reasons["shot.diameter_mm"])
    found: dict[Setting, IntensityPilot] = {}
    chosen, pilots = setting_of(made), 0
    while chosen not in found:
        try:
            one = by_ball.get(chosen.ball_mm)
            one = one or again(replace(wanted, ball_mm=chosen.ball_mm))
        except InputError:  # no chamber with these balls
            settings = [one for one in settings if one.ball_mm != chosen.ball_mm]
            chosen = choose(intensity, settings, _values(found), possible.served)
            continue
        by_ball[chosen.ball_mm] = one
        one = with_amplitude(one, chosen)
        if setting_of(one) != chosen:  # another sonotrode carries the chamber for these balls
            settings = [setting_of(one), *(x for x in settings if x != chosen)]
            chosen = setting_of(one)
            if chosen in found:
                chosen = choose(intensity, settings, _values(found), possible.served)
                continue
        predicted, pilots = simulate(one), pilots + 1
        if predicted is None:
            if not found:
                text = "the shot hardly dents a strip in a pilot, so its intensity is not known"
                raise InputError(f"--intensity: {text}; give --ball-mm, or leave --intensity out")
            settings = [one for one in settings if one != chosen]
        else:
            found[chosen] = predicted
            simulated = _values(found)
            if all(intensity.off(expected_intensity(x, simulated)) < 0.0 for x in settings):
                settings, larger = [*settings, *larger], []
        left = settings if pilots < MOST_PILOTS else [*found]
        chosen = choose(intensity, left, _values(found), possible.served)
    one = by_ball[chosen.ball_mm]
    if chosen in possible.larger:
        reason = _of_larger(chosen, small, possible, _values(found))
        one = replace(one, reasons={**one.reasons, "shot.diameter_mm": reason})
    pilot = found[chosen]
    one = replace(one, strength_dents=pilot.dents, predicted=pilot.predicted)
    told = with_amplitude(one, chosen), intensity, pilot.predicted
    return _told(*told, small, reason)


def larger_balls(
    made: Proposal, wanted: Wanted, intensity: WantedIntensity, known: float
) -> tuple[float, str] | None:
    """Return the diameter [mm] of larger balls with which poses are compared, and the reason.

    None are needed unless all that suit the target are too weak for the intensity.

    Args:
        known: intensity of the proposal by a pilot [mmA].
    """
    now, possible = setting_of(made), settings_of(made, wanted)
    simulated = {now: known}
    larger = [one for one in possible.larger if one.amplitude_um == now.amplitude_um]
    if any(intensity.off(expected_intensity(x, simulated)) >= 0.0 for x in possible.serving):
        return None
    chosen = choose(intensity, [now, *larger], simulated, possible.served)
    if chosen == now:
        return None
    return chosen.ball_mm, _of_larger(chosen, now.ball_mm, possible, simulated)


def _of_larger(
    chosen: Setting, small: float, possible: Settings, simulated: Mapping[Setting, float]
) -> str:
    """Return in words why balls were chosen that serve less of the target than smaller ones do.

    Args:
        small: diameter of the balls that geometry alone would have given [mm].
        simulated: intensities of settings that were simulated [mmA].
    """
    of_small = [one for one in possible.serving if one.ball_mm == small]
    best = max(expected_intensity(one, simulated) for one in of_small)
    fit, of_rule = possible.fits[chosen.ball_mm], possible.fits[small]
    loses = of_rule.served - fit.served > AS_GOOD
    what = f"they suit {fit.served:.0%} of the target, and "
    if fit.served < MOSTLY:
        what = (
            f"they touch {fit.touched:.0%} of the target, though {1.0 - fit.served:.0%} of it lies "
            "in fillets of less than 2 or slots of less than 4 of their diameters, for which by a "
            "rule of thumb smaller ones are taken: "
        )
    return (
        f"{LARGER if loses else LARGER.lower()}: {what}{small:g} mm would suit "
        f"{of_rule.served:.0%}, with about {plain(best, 2)} mmA (--ball-mm {small:g} takes these)"
    )


def settings_beside(
    made: Proposal,
    wanted: Wanted,
    intensity: WantedIntensity | None,
    found: Measured | None,
    by_geometry: float,
) -> list[Setting]:
    """Return balls, each with an amplitude, that pilots compare with those of a proposal.

    They are the balls that geometry alone would give, and larger ones of the stock: up to those
    that give the intensity, or up to FURTHER times as large.

    Args:
        found: what a pilot measured of the proposal; None if nothing.
        by_geometry: diameter of the balls that geometry alone would give [mm].
    """
    if wanted.ball_mm is not None or found is None:
        return []
    now, known = setting_of(made), found.intensity
    off = intensity.off(known.value) if intensity and known else 0.0
    needed = now.ball_mm * (math.exp(-off / BALL_POWER) if off < 0.0 else FURTHER)
    stock = (wanted.shop or usual_shop()).stock_mm(made.tables["shot"]["material"])
    most = 1e3 * min(LARGEST_BALL, OF_THIN * thinnest(made.chamber.part))
    larger = [one for one in stock if now.ball_mm < one <= most]
    many = made.design.shot.count > MANY
    if many:
        fits = fit_sizes(made.chamber.part, [1e-3 * one for one in larger]) if larger else []
        larger = [one for one, fit in zip(larger, fits, strict=True) if not fit.jam]
    larger = larger[: sum(one < needed for one in larger) + 1]
    most_tried = MOST_TRIED if off < 0.0 or many else 2 if intensity is None else 1
    some = np.unique(np.linspace(len(larger) - 1, 0, most_tried).round().astype(int))
    sizes = {by_geometry, *(larger[k] for k in some if larger)} - {now.ball_mm}
    if intensity is not None and off >= 0.0 and by_geometry > now.ball_mm:
        sizes = {by_geometry}  # it is reached, and these tell what larger ones do

    def with_amplitude_for(ball: float) -> Setting:
        if intensity is None or known is None:
            return now._replace(ball_mm=ball)
        each = [Setting(ball, one) for one in amplitudes_of(made.sonotrode)[1]]
        return choose(intensity, each, {now: known.value})

    return [with_amplitude_for(ball) for ball in sorted(sizes)]


def gives(intensity: WantedIntensity | None, found: Measured | None) -> bool:
    """Return whether a pilot's intensity lies in a wanted range."""
    if intensity is None or found is None or found.intensity is None:
        return False
    return not intensity.off(found.intensity.value)


class Compared(NamedTuple):
    """A proposal with balls of one size, as it is compared with those of other sizes.

    Attributes:
        found: what a pilot measured of it; None if nothing.
        harm: why it is no choice, in words, so that no pilot ran; empty if it is one.
    """

    made: Proposal
    found: Measured | None
    harm: str = ""


def of_ball_sizes(all_of: Sequence[Compared]) -> tuple[BallTrial, ...]:
    """Return what is known of the balls of several proposals for one target, the smallest first."""
    ordered = sorted(all_of, key=lambda one: setting_of(one.made).ball_mm)
    sizes = [1e-3 * setting_of(one.made).ball_mm for one in ordered]
    return tuple(
        BallTrial(
            *setting_of(one.made),
            one.made.design.shot.count,
            one.made.sonotrode_count,
            fit,
            None if one.found is None else one.found.time_to_98,
            one.found is not None and one.found.places,
            None if one.found is None else one.found.intensity,
            one.harm,
        )
        for one, fit in zip(ordered, fit_sizes(all_of[0].made.chamber.part, sizes), strict=True)
    )


def with_time(
    trials: Sequence[BallTrial], ball_mm: float, found: Measured
) -> tuple[BallTrial, ...]:
    """Return trials in which balls of one size have the time that their last pilot tells."""
    return tuple(
        replace(one, time_to_98=found.time_to_98, is_of_places=found.places)
        if one.ball_mm == ball_mm
        else one
        for one in trials
    )


def larger_instead(
    now: Compared,
    others: Sequence[Compared],
    trials: Sequence[BallTrial],
    intensity: WantedIntensity | None,
) -> Compared | None:
    """Return the proposal with larger balls that is taken instead of one by geometry, if one is.

    They touch about as much, on no more sonotrodes. Either they give the intensity, which the
    others miss, and cover the target no later by pilots; or the others are very many, and these are
    far fewer, serve little less, and cover it about as soon with an intensity in its range.

    Args:
        now: the proposal whose balls fit fillets and slots by rule.
        others: proposals with other balls.
        trials: what is known of the balls of all of them.
        intensity: that is asked for; None for the usual one, if there is one.
    """
    if now.found is None or not others:
        return None
    here, fits = setting_of(now.made), {one.ball_mm: one.fit for one in trials}
    fit, count = fits[here.ball_mm], now.made.design.shot.count
    weak = intensity is not None and now.found.intensity is not None
    weak = weak and not gives(intensity, now.found)
    for one in sorted(others, key=lambda one: setting_of(one.made).ball_mm):
        there, found = setting_of(one.made), one.found
        if found is None or one.harm or there.ball_mm < here.ball_mm:
            continue
        other, its_count = fits[there.ball_mm], one.made.design.shot.count
        given = gives(intensity, found) if intensity else not is_off(one.made, found.intensity)
        if (
            not given
            or other.touched < fit.touched - MISSED
            or other.fillets < fit.fillets - MISSED_FILLETS
            or found.places < now.found.places
            or one.made.sonotrode_count > now.made.sonotrode_count
        ):
            continue
        ratio = found.time_to_98 / now.found.time_to_98
        kept = f"these touch {other.touched:.0%} of the target"
        if weak and ratio <= 1.0:
            reason = (
                f"{LARGER}: by pilots {here.in_words} are too weak, and {kept} and cover it no "
                f"later; {1.0 - other.served:.0%} of the target lies in fillets of less than 2 or "
                "slots of less than 4 of their diameters, "
                f"for which practice takes smaller ones (--ball-mm {here.ball_mm:g} takes these)"
            )
        elif (
            count > MANY
            and its_count <= FEWER * count
            and other.served >= fit.served - SERVED_LESS
            and ratio <= AS_QUICK
        ):
            reason = (
                f"{MatterKind.FEWER_BALLS}, decide: these, {its_count:,} of {there.ball_mm:g} mm, "
                f"are easier to weigh and sort, {kept.removeprefix('these ')}, suit "
                f"{other.served:.0%} and cover it about as soon by pilots as {count:,} of "
                f"{here.ball_mm:g} mm. Keep them unless what lies in narrow slots and fillets, "
                f"where these suit {fit.served:.0%}, is to be peened as soon as the rest: then "
                f"--ball-mm {here.ball_mm:g}"
            )
        else:
            continue
        made = one.made if intensity else with_expected_intensity(one.made, found.intensity)
        reasons = {**made.reasons, "shot.diameter_mm": reason}
        return one._replace(made=replace(made, reasons=reasons))
    return None


def usual_for(made: Proposal) -> WantedIntensity:
    """Return the Almen intensity that is usual for the alloy and thickness of a proposal's target.

    Raises InputError if none is.
    """
    metal = alloy(made.tables["materials"]["part"])
    thickness = thickness_under_target(made.chamber.part)
    found = usual_intensity(metal, thickness)
    if found is None:
        raise InputError(f"--intensity: given usual, but {why_none(metal, thickness)}")
    return found


def with_expected_intensity(made: Proposal, predicted: PredictedIntensity | None) -> Proposal:
    """Return a proposal that tells its expected intensity beside the usual one.

    Args:
        predicted: by a pilot; None if it is not known.
    """
    metal = alloy(made.tables["materials"]["part"])
    thickness = thickness_under_target(made.chamber.part)
    expected = "not known: the pilot left hardly a dent"
    if predicted is not None:
        expected = f"expected {_with_strip(predicted)}"
    usual = usual_intensity(metal, thickness)
    beside = f"{MatterKind.NO_USUAL}: {why_none(metal, thickness)}"
    now, least = setting_of(made), min(amplitudes_of(made.sonotrode)[1])
    if predicted is not None and 1e3 * thickness < THIN_MM and least < now.amplitude_um:
        weakest = expected_intensity(now._replace(amplitude_um=least), {now: predicted.value})
        beside += f"; at {least:g} µm, the least, about {plain(weakest, 2)} mmA, more slowly"
    if usual is not None:
        beside = f"{usual.low:g}-{usual.high:g}A are {usual.text}; to aim at it: --intensity usual"
        if predicted is not None and usual.off(predicted.value):
            beside = (
                f"{MatterKind.UNUSUAL}, {usual.low:g}-{usual.high:g}A, {usual.text}: agree on "
                "it, or aim at it: --intensity usual"
            )
        elif predicted is not None and not usual.low <= predicted.value <= usual.high:
            beside += ", though nothing but strips tells so small a difference"
    reasons = {**made.reasons, INTENSITY: f"{expected}; {beside}"}
    return replace(made, reasons=reasons, expected=predicted, usual=usual)


def with_usual_intensity(made: Proposal) -> Proposal:
    """Return a proposal without a pilot that tells the usual intensity of a stated alloy."""
    metal = alloy(made.tables["materials"]["part"])
    usual = usual_intensity(metal, thickness_under_target(made.chamber.part))
    if usual is None:
        return made
    text = (
        f"not estimated without a pilot; {usual.low:g}-{usual.high:g}A are {usual.text}, which "
        "balls that are small for a narrow slot or fillet may not give: leave out --no-pilot"
    )
    return replace(made, reasons={**made.reasons, INTENSITY: text})


def with_thin_places(made: Proposal) -> Proposal:
    """Return a proposal that names places of its target for which no intensity is usual."""
    thin = thinnest(made.chamber.part)
    if 1e3 * thin >= THIN_MM:
        return made
    text = (
        f"{MatterKind.THIN_PLACES}: {THIN_SHARE:.0%} of the target has {plain(1e3 * thin, 2)} mm "
        f"of metal or less under it, for which balls of at most {plain(1e3 * OF_THIN * thin, 2)} "
        "mm are proposed (a rule of thumb): agree on its intensity, or mask its edges"
    )
    reason = f"{made.reasons['shot.diameter_mm']}; {text}"
    return replace(made, reasons={**made.reasons, "shot.diameter_mm": reason})


def is_off(made: Proposal, predicted: PredictedIntensity | None) -> bool:
    """Return whether the expected intensity lies outside of the usual range, if there is one."""
    metal = alloy(made.tables["materials"]["part"])
    usual = usual_intensity(metal, thickness_under_target(made.chamber.part))
    return usual is not None and predicted is not None and usual.off(predicted.value) != 0.0


def as_no_wish(made: Proposal) -> Proposal:
    """Return a proposal for an intensity that nobody asked for, without that wish in its design."""
    reasons = dict(made.reasons)
    if INTENSITY not in reasons:  # no pilot told it
        return made
    reasons[INTENSITY] += "; to keep the largest amplitude: --intensity none"
    process = {k: one for k, one in made.tables["process"].items() if k != "intensity_mmA"}
    return replace(
        made,
        tables={**made.tables, "process": process},
        reasons=reasons,
        design=made.design.changed({"process.intensity_mmA": None}),
    )


def _with_strip(predicted: PredictedIntensity) -> str:
    """Return an intensity in words, also on the N strip where it is measured on one."""
    of_n = f" ({predicted.on_strips('N')})" if usual_strip(predicted.value) == "N" else ""
    return f"{plain(predicted.value, 2)} mmA{predicted.factor_in_words}{of_n}"


def with_prediction(
    made: Proposal, wanted: WantedIntensity, predicted: PredictedIntensity, more: str = ""
) -> Proposal:
    """Return a proposal with its wanted intensity, and in the reason the predicted one."""
    found = Comparison.with_prediction((wanted.low, wanted.high), predicted)
    text = f"predicted {found.predicted}; aimed at {wanted.low:g}-{wanted.high:g}A, {wanted.text}"
    if not wanted.off(predicted.value):
        text += f"; {found.in_words}"
    text += more
    reasons = {**made.reasons, INTENSITY: text}
    ends = {"intensity_mmA": [wanted.low, wanted.high]}
    tables = {**made.tables, "process": {**made.tables["process"], **ends}}
    design = made.design.changed({"process.intensity_mmA": (wanted.low, wanted.high)})
    return replace(
        made, tables=tables, reasons=reasons, design=design, expected=predicted, usual=wanted
    )


def _told(
    made: Proposal,
    wanted: WantedIntensity,
    predicted: PredictedIntensity,
    largest: float,
    by_geometry: str,
) -> Proposal:
    """Return a proposal with the reasons for its balls and its amplitude.

    Args:
        largest: diameter of the balls that geometry alone would have given [mm].
        by_geometry: reason for them.
    """
    key = amplitudes_of(made.sonotrode)[0]
    off, more = wanted.off(predicted.value), ""
    if off:
        aim = f"{wanted.low:g}-{wanted.high:g}A"
        inside = off + math.copysign(math.log(INSIDE), off)
        more = f"; {MatterKind.NO_BALLS} {aim}: {_needed(made, inside)}"
    reasons = dict(made.reasons)
    ball = "the nearest to the intensity" if off else "chosen for the intensity"
    reasons[f"sonotrode.{key}"] += f", {ball}"
    if made.reasons["shot.diameter_mm"] == by_geometry:
        ball = f"{by_geometry}; {ball}"
    else:
        ball += f"; by the target's form alone {largest:g} mm: {by_geometry}"
    reasons["shot.diameter_mm"] = ball
    return with_prediction(replace(made, reasons=reasons), wanted, predicted, more)


def _needed(made: Proposal, off: float) -> str:
    """Return in words what would bring an intensity into its range.

    Args:
        off: logarithm of the factor by which the intensity lies off.
    """
    now = setting_of(made)
    amplitude = now.amplitude_um * math.exp(-off / AMPLITUDE_POWER)
    ball = now.ball_mm * math.exp(-off / BALL_POWER)
    too_large = ", larger than the target's fillets and slots allow by rule" if off < 0.0 else ""
    return (
        f"it takes an amplitude of about {plain(amplitude, 2)} µm zero-to-peak, or balls of about "
        f"{plain(ball, 2)} mm{too_large} (--ball-mm takes others)"
    )


def _values(found: Mapping[Setting, IntensityPilot]) -> dict[Setting, float]:
    return {setting: one.predicted.value for setting, one in found.items()}
