"""Find a quicker way to peen a part whose treatment takes long, by pilot simulations.

A part that stands on one sonotrode is dented slowly at its upper end, as few balls get there. Lying
or on edge, over several sonotrodes if it is long, it may take a fifth of the time. A whole layer of
balls dents faster than half a layer in a roomy chamber, and slower where the balls are in each
other's way. So all of these are tried, and what is proposed was simulated itself. A part on whose
upper side balls come to rest, or few get to, is tried turned over after half of the time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np

from chamberopt.chamber.layout.balls import MOST_BALLS
from chamberopt.chamber.layout.floor import SEVERAL
from chamberopt.chamber.layout.pose import AT_SIDE, TURNING, Pose
from chamberopt.chamber.matters import MatterKind
from chamberopt.chamber.propose.held_proposal import rests
from chamberopt.chamber.propose.proposal import (
    PoseTrial,
    Proposal,
    Wanted,
    new_harm,
    touched_share,
    with_charge,
)
from chamberopt.chamber.propose.proposed_budget import COVERED, LONG, Measured, TooSlowError
from chamberopt.common.errors import InputError
from chamberopt.common.number_text import plain
from chamberopt.common.progress import Progress, untold
from chamberopt.geometry.triangles import rotation_matrix

SLOW = 600.0  # s until 98 % of the target are dented, from which on other ways are tried
# Time of all sonotrodes over that of the way before, below which a way is taken. Pilots know a time
# to 10 to 20 %. A way is no weaker than this share of the intensity before.
QUICKER, AS_STRONG, HALF = 0.8, 0.8, 0.5
# That are tried, beside one that is evenly exposed and one of a slender part that turns.
POSES: tuple[Pose, ...] = (*AT_SIDE, TURNING)
OF_TURNED: tuple[Pose, ...] = ("standing", *AT_SIDE)
LAYER = 2.0  # over half a layer
NOT_COMPARED = "not compared: its places are not resolved"
Measure = Callable[[Proposal, float], Measured | None]
Counted = Callable[[str, int], AbstractContextManager[Progress]]
SAME = 0.999  # cosine between the directions that point up, from which on a pose is no other one


class Way(NamedTuple):
    """A proposal, the wishes it follows from, and what a pilot measured of it; None if nothing."""

    made: Proposal
    wanted: Wanted
    found: Measured | None


def propose_quicker(
    first: Way,
    again: Callable[[Sequence[Wanted]], Sequence[Proposal | None]],
    turned_over: Callable[[Proposal], Proposal],
    measure: Measure,
    counted: Counted = lambda *_: nullcontext(untold),
    longer: Measure = lambda *_: None,
) -> Way:
    """Return the way that is quickest by pilots, of those with no more faults than the first.

    A slender part that turns first is taken in another pose only if that is clearly quicker.

    Args:
        again: proposes a design for each of some wishes; None where no chamber can be built.
        turned_over: adds a step in which the part is turned over.
        measure: simulates a proposal briefly; None if that cannot be done. Raises TooSlowError if
            the time to 98 % is longer than a given one [s].
        counted: begins a step that counts what is tried.
        longer: simulates a proposal for longer than `measure`, where that resolved no places.
    """
    best = first
    if _is_slow(first) and first.wanted.pose is None and not _turns_on_arbor(first.made):
        with counted("poses tried", len(POSES)) as progress:
            best = _best_pose(first, again, turned_over, (measure, longer), progress)
    is_known = best.found is not None and best.found.places  # else a heavier one takes longer still
    if is_known and _is_slow(best) and 2 * best.made.design.shot.count <= MOST_BALLS:
        made = with_charge(best.made, LAYER)
        found = None
        with suppress(TooSlowError):
            found = measure(made, _longest(made, best))
        if _is_quicker(Way(made, best.wanted, found), best):
            reason = (
                f"a whole layer of balls on the sonotrode: {made.design.shot.count}; by pilots "
                f"{_said(found)}, with half a layer {_said(best.found)}"
            )
            made = replace(made, reasons={**made.reasons, "shot.mass_g": reason})
            best = Way(made, best.wanted, found)
    return best


def _best_pose(
    first: Way,
    again: Callable[[Sequence[Wanted]], Sequence[Proposal | None]],
    turned_over: Callable[[Proposal], Proposal],
    pilots: tuple[Measure, Measure],
    progress: Progress,
) -> Way:
    """Return the quickest way over all poses, which tells them all; see `propose_quicker`.

    Args:
        pilots: `measure` and `longer` of `propose_quicker`.
    """
    measure, longer = pilots
    best = first = _resolved(first, math.inf, longer)
    tried: list[tuple[Way, str]] = []
    tries = OF_TURNED if turns(first.made) else POSES
    poses = dict(zip(tries, again([replace(first.wanted, pose=one) for one in tries]), strict=True))
    for pose, over in product(tries, (False, True)):
        progress(tries.index(pose), len(tries), None)
        if over and not (tried and _needs_both_sides(tried[-1][0], pose)):
            continue
        wanted = replace(first.wanted, pose=pose, turned_over=over)
        made = poses[pose]
        if over:
            try:
                made = turned_over(tried[-1][0].made)
            except InputError:
                continue
        if made is None:
            continue
        if float(_up(made) @ _up(first.made)) > SAME and not turns(made):
            continue
        harm, found = _harm(made, first.made), None
        try:
            found = None if harm else measure(made, _longest(made, best))
        except TooSlowError as error:
            harm = str(error)
        one = Way(made, wanted, found)
        tried.append((one, harm))
        if not harm and _is_quicker(one, best):
            best = one
    for number, (one, harm) in enumerate(tried):  # what is open is simulated for longer
        if harm or not _is_rough(one, best) or _time(one) >= _time(best):
            continue
        try:
            tried[number] = _resolved(one, _longest(one.made, best), longer), ""
        except TooSlowError as error:
            tried[number] = one, str(error)
            continue
        if _is_quicker(tried[number][0], best):
            best = tried[number][0]
    return _with_pose_told(best, first, tried)


def _resolved(one: Way, longest: float, longer: Measure) -> Way:
    """Return a way whose places a longer pilot resolves, where the first one did not.

    Where balls touch too little of the target, none would.

    Args:
        longest, longer: as of `measure` and of `propose_quicker`.
    """
    if one.found is None or one.found.places or touched_share(one.made) < COVERED:
        return one
    return one._replace(found=longer(one.made, longest) or one.found)


def _needs_both_sides(one: Way, pose: Pose) -> bool:
    """Return whether a way in a pose leaves out what looks up: balls rest there, or few come."""
    if turns(one.made):
        return False
    is_rough = one.found is not None and not one.found.places
    return one.wanted.pose == pose and (is_rough or rests(one.made))


def _longest(made: Proposal, best: Way) -> float:
    """Return the time to 98 % [s] of a setting from which on a way is not taken instead of one."""
    share = QUICKER if made.sonotrode_count >= best.made.sonotrode_count else 1.0
    return share * _time(best) / made.settings


def _is_slow(way: Way) -> bool:
    return way.found is not None and way.found.time_to_98 > SLOW


def turns(made: Proposal) -> bool:
    """Return whether the part of a proposal turns about an axis."""
    return made.design.effects.part_turn is not None


def _turns_on_arbor(made: Proposal) -> bool:
    """Return whether the part of a proposal turns on an arbor, not by its own ends."""
    return turns(made) and (made.stance is None or made.stance.spindle is None)


def _up(made: Proposal) -> np.ndarray:
    """Return the direction of the part's file that points up in a proposal, (3,)."""
    return np.asarray(rotation_matrix(made.design.part.rotate_deg)[2])


def _harm(made: Proposal, first: Proposal) -> str:
    """Return in words why another way is no choice; empty if it is one."""
    if made.chamber.pieces_in_air and not first.chamber.pieces_in_air:
        return "nothing would hold it"
    harm = new_harm(made, first)
    return harm.beginning if harm else ""


def _is_quicker(one: Way, other: Way) -> bool:
    """Return whether a way is worth taking instead of another one."""
    if one.found is None or other.found is None or one.found.places < other.found.places:
        return False
    return not _objection(one, one.found, other, other.found)


def _objection(one: Way, found: Measured, other: Way, of_other: Measured) -> str:
    """Return in words why a way is not worth taking instead of another one; empty if it is.

    What counts is the time of all settings in which the target is peened.
    A way on twice as many sonotrodes, which have to vibrate alike, has to take half of the time. Up
    to SEVERAL do if it takes half of a time that nobody would run. One on fewer has to take no
    longer.

    Args:
        found, of_other: what pilots measured of them.
    """
    now, then = found.intensity, of_other.intensity
    if now is not None and then is not None and now.value < AS_STRONG * then.value:
        return "weaker"
    time, other_time = _time(one), _time(other)
    if turns(other.made) and not turns(one.made) and time >= QUICKER * other_time:
        return "hardly quicker"
    if (
        of_other.time_to_98 > LONG
        and one.made.sonotrode_count <= SEVERAL
        and time < HALF * other_time
    ):
        return ""
    ratio = one.made.sonotrode_count / other.made.sonotrode_count
    if ratio * time < QUICKER * other_time and (ratio >= 1.0 or time <= other_time):
        return ""
    return "hardly quicker" if ratio <= 1.0 else "not quick enough for more sonotrodes"


def _time(one: Way) -> float:
    """Return the time to 98 % in all settings of a way by a pilot [s]; inf without one."""
    return math.inf if one.found is None else one.found.time_to_98 * one.made.settings


def _is_rough(one: Way, best: Way) -> bool:
    """Return whether a pilot told a way's time on average alone, but that of all places of best."""
    if one.found is None or best.found is None:
        return False
    return best.found.places and not one.found.places


def _said(found: Measured | None) -> str:
    if found is None:
        return "no pilot"
    weak = "" if found.intensity is None else f", {plain(found.intensity.value, 2)} mmA"
    return f"{found.in_words}{'' if found.places else ' on average, its places not resolved'}{weak}"


def _with_pose_told(best: Way, first: Way, tried: list[tuple[Way, str]]) -> Way:
    """Return the best way with the times of all poses in the reason for its pose."""

    def named(one: Way) -> str:
        over = " and turned over" if one.wanted.turned_over else ""
        pose = one.wanted.pose or (TURNING if turns(one.made) else "evenly exposed")
        return pose.replace("-", " ") + over

    trials = []
    for one, harm in [(first, ""), *tried]:
        outcome, found = harm, one.found
        if one is not best and one.found and best.found and one.found.places:
            why = _objection(one, one.found, best, best.found)
            if why and _time(one) < _time(best):
                outcome = why
        if _is_rough(one, best):
            outcome = outcome or NOT_COMPARED
        trials.append(
            PoseTrial(
                named(one),
                one.made.sonotrode_count,
                one.made.settings,
                found and found.time_to_98,
                found is not None and found.places,
                found and found.intensity,
                "taken" if one is best else outcome,
            )
        )
    if len(trials) == 1:
        return best
    reason = best.made.reasons["part.rotate_deg"]
    if best is not first:
        others = [one for one, harm in [(first, ""), *tried] if not (harm or _is_rough(one, best))]
        told = f"the quickest of {len(trials)} by pilots"
        if any(_time(one) < _time(best) for one in others):
            told = f"chosen of {len(trials)} by pilots, which tell what is against quicker ones"
        reason = f"{reason.rpartition(': ')[0]}: {told}"
    for one, harm in tried:
        if not harm and _is_rough(one, best) and _time(one) < HALF * _time(best):
            reason += (
                f"; {MatterKind.POSE}: {named(one)}, {_said(one.found)}, may be quicker than what "
                f"is proposed, {_said(best.found)}: propose it too (--pose), and simulate both"
            )
    reasons = {**best.made.reasons, "part.rotate_deg": reason}
    return best._replace(made=replace(best.made, reasons=reasons, poses=tuple(trials)))
