"""Find a quicker way to peen a part whose treatment takes long, by pilot simulations.

A part that stands on one sonotrode is dented slowly at its upper end, as few balls get there. Lying
or on edge, over several sonotrodes if it is long, it may take a fifth of the time. A whole layer of
balls dents faster than half a layer in a roomy chamber, and slower where the balls are in each
other's way. A part that lies gets few balls on its upper side, until it is turned over. So all of
these are tried, and what is proposed was simulated itself.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.checks.check import shot_reach, warnings
from chamberopt.chamber.checks.jams import gaps_in_reach, jam_gaps
from chamberopt.chamber.propose.pose import AT_SIDE
from chamberopt.chamber.propose.proposal import (
    Proposal,
    Wanted,
    faults,
    new_warning,
    touched_share,
    with_charge,
)
from chamberopt.chamber.propose.proposed_balls import MOST_BALLS
from chamberopt.chamber.propose.proposed_budget import COVERED, LONG, UNEVEN, Measured
from chamberopt.common.errors import InputError
from chamberopt.common.number_text import rounded
from chamberopt.geometry.triangles import rotation_matrix

SLOW = 600.0  # s until 98 % of the target are dented, from which on other ways are tried
# Time over that of the way before, below which a way is taken: with more sonotrodes, or with as
# many, and where that time is LONG. Pilots know a time to 10 to 20 %.
DEARER, QUICKER = 0.6, 0.8
LAYER = 2.0  # over half a layer
RAISED = 1.0, 2.0, 3.0  # ball diameters by which a ceiling is raised for a second pose
SAME = 0.999  # cosine between the directions that point up, from which on a pose is no other one


class Way(NamedTuple):
    """A proposal, the wishes it follows from, and what a pilot measured of it; None if nothing."""

    made: Proposal
    wanted: Wanted
    found: Measured | None


def propose_quicker(
    first: Way, again: Callable[[Wanted], Proposal], measure: Callable[[Proposal], Measured | None]
) -> Way:
    """Return the way that is quickest by pilots, of those with no more faults than the first.

    Args:
        again: proposes the design for other wishes.
        measure: simulates a proposal briefly; None if that cannot be done.
    """
    best, tried = first, []
    if _is_slow(first) and first.wanted.pose is None and not _turns(first.made):
        for pose in AT_SIDE:
            wanted = replace(first.wanted, pose=pose)
            try:
                made = again(wanted)
            except InputError:
                continue
            if float(_up(made) @ _up(first.made)) > SAME:
                continue
            harm = _harm(made, first.made)
            one = Way(made, wanted, None if harm else measure(made))
            tried.append((one, harm))
            if not harm and _is_quicker(one, best):
                best = one
        best = _with_pose_told(best, first, tried)
    is_known = best.found is not None and best.found.places  # else a heavier one takes longer still
    if is_known and _is_slow(best) and 2 * best.made.design.shot.count <= MOST_BALLS:
        made = with_charge(best.made, LAYER)
        found = measure(made)
        if _is_quicker(Way(made, best.wanted, found), best):
            reason = (
                f"a whole layer of balls on the sonotrode: {made.design.shot.count}; by pilots "
                f"{_after(found)}, with half a layer {_after(best.found)}"
            )
            made = replace(made, reasons={**made.reasons, "shot.mass_g": reason})
            best = Way(made, best.wanted, found)
    return best


def propose_second_pose(
    made: Proposal, found: Measured | None, measure: Callable[[Proposal], Measured | None]
) -> tuple[Proposal, Measured | None]:
    """Return a proposal with a second step, turned over, and its pilot, where that is worth it.

    It is tried where single places rule a slow treatment, or where balls cannot touch enough of the
    target in one pose. What holds the part must hold it in both poses.

    Args:
        found: what a pilot measured of the proposal; None if nothing.
        measure: simulates a proposal briefly; None if that cannot be done.
    """
    if found is None or _turns(made):
        return made, found
    is_hidden = not found.places and touched_share(made) < COVERED
    if not is_hidden and found.time_to_98 < max(SLOW, UNEVEN * found.mean_time):
        return made, found

    def dropped(why: str) -> tuple[Proposal, Measured | None]:
        reason = f"{made.reasons['part.rotate_deg']}; not turned over after half of the time: {why}"
        return replace(made, reasons={**made.reasons, "part.rotate_deg": reason}), found

    try:
        two = _turned_over(made)
        for balls in RAISED:  # under a ceiling that fits one pose, balls may jam in the other
            if "jam in" in _new_harm(two, made):
                two = min(two, _turned_over(made, balls), key=faults)
    except InputError:
        return dropped("what holds it here does not hold it there")
    in_air = any(one.pieces_in_air for one in two.chamber.steps) and not made.chamber.pieces_in_air
    if in_air or (harm := _new_harm(two, made)):
        return dropped("nothing would hold it" if in_air else harm)
    after = measure(two)
    if after is None or not after.places:
        return dropped("no pilot resolved it")
    enough = after.time_to_98 <= QUICKER * found.time_to_98 or is_hidden
    if not enough or touched_share(two) < COVERED:
        return dropped(f"by a pilot {_after(after)} then too")
    before = f"{touched_share(made):.0%} of the target is in reach" if is_hidden else _after(found)
    reason = f"turned over after half of the time: by pilots {_after(after)}, in one pose {before}"
    return replace(two, reasons={**two.reasons, ".steps": reason}), after


def _turned_over(made: Proposal, raised: float = 0.0) -> Proposal:
    """Return a proposal with a second step in which the part is turned over.

    Raises InputError if the chamber cannot be built round the part in this pose.

    Args:
        raised: by how many diameters of a ball the ceiling is raised.
    """
    x, y, z = made.design.part.rotate_deg
    # Half a turn about the chamber's x after turns about x, y and z is one before them, with the
    # turns about y and z the other way.
    turned = [(x + 180.0) % 360.0, -y + 0.0, -z + 0.0]
    pose: dict[str, list[float]] = {"rotate_deg": turned}
    if any(made.design.part.offset_mm):
        along, across = made.design.part.offset_mm
        pose["offset_mm"] = [along, -across]
    steps = [{"name": "first"}, {"name": "turned_over", "part": pose}]
    shot = made.design.shot
    height = round(made.tables["chamber"]["height_mm"] + 1e3 * raised * shot.diameter, 1)
    design = made.design.changed({"chamber.height_mm": height, "steps": steps})
    chamber = build_chamber(design)
    (_, other), room = list(design.in_steps.values()), chamber.steps[1]
    diameter = other.shot.diameter
    jams = jam_gaps(room, diameter, gaps_in_reach(shot_reach(other, room)))
    reasons = made.reasons
    if raised:
        text = "high enough for both poses, so that no ball jams under the ceiling"
        reasons = {**reasons, "chamber.height_mm": f"{reasons['chamber.height_mm']}; {text}"}
    return replace(
        made,
        design=design,
        reasons=reasons,
        tables={"": {}, **made.tables}
        | {
            "": {**made.tables.get("", {}), "steps": steps},
            "chamber": {**made.tables["chamber"], "height_mm": height},
        },
        chamber=chamber,
        jams=max(made.jams, tuple(jams), key=len),
        warnings=tuple(warnings(design, chamber)),
    )


def _is_slow(way: Way) -> bool:
    return way.found is not None and way.found.time_to_98 > SLOW


def _turns(made: Proposal) -> bool:
    return made.design.effects.part_turn is not None


def _up(made: Proposal) -> np.ndarray:
    """Return the direction of the part's file that points up in a proposal, (3,)."""
    return np.asarray(rotation_matrix(made.design.part.rotate_deg)[2])


def _harm(made: Proposal, first: Proposal) -> str:
    """Return in words why another way is no choice; empty if it is one."""
    if made.chamber.pieces_in_air and not first.chamber.pieces_in_air:
        return "nothing would hold it"
    if faults(made) > faults(first):
        return _beginning(new_warning(made, first))
    return ""


def _new_harm(two: Proposal, made: Proposal) -> str:
    """Return in words the harm that only a proposal with two poses does; empty if there is none.

    A warning that holds in both poses, at another place in each, is no new one.
    """
    known = {_beginning(text) for text in made.warnings}
    of_steps = (_beginning(re.sub(r"^step \w+: ", "", text)) for text in two.warnings)
    new = [text for text in of_steps if text not in known]
    jams = "balls jam in a gap" if len(two.jams) > len(made.jams) else ""
    return next(iter(new), jams)


def _beginning(warning: str) -> str:
    """Return a warning up to its first comma or place."""
    return warning.partition(",")[0].partition(" at (")[0]


def _is_quicker(one: Way, other: Way) -> bool:
    """Return whether a way is worth taking instead of another one."""
    if one.found is None or other.found is None or one.found.places < other.found.places:
        return False
    is_dear = _sonotrodes(one.made) > _sonotrodes(other.made) and other.found.time_to_98 < LONG
    return one.found.time_to_98 < (DEARER if is_dear else QUICKER) * other.found.time_to_98


def _sonotrodes(made: Proposal) -> int:
    blocks = made.design.sonotrode.blocks
    return 1 if blocks is None else blocks.count


def _after(found: Measured | None) -> str:
    if found is None:
        return "no pilot"
    return f"98 % after about {rounded(found.time_to_98, 2)} s"


def _with_pose_told(best: Way, first: Way, tried: list[tuple[Way, str]]) -> Way:
    """Return the best way with the times of all poses in the reason for its pose."""

    def named(one: Way) -> str:
        return (one.wanted.pose or "evenly exposed").replace("-", " ")

    texts = []
    for one, harm in [(first, ""), *tried]:
        name = named(one)
        what = harm or _after(one.found)
        count = _sonotrodes(one.made)
        on, taken = f" on {count} sonotrodes" if count > 1 else "", " (taken)" * (one is best)
        texts.append(f"{name}{on} {what}{taken}")
    if len(texts) == 1:
        return best
    pose, _, why = best.made.reasons["part.rotate_deg"].rpartition(": ")
    ball = first.made.tables["shot"]["diameter_mm"]  # those of the proposal may be others
    tried_ones = f"poses tried by pilots with balls of {ball:g} mm: {', '.join(texts)}"
    reason = f"{pose}: {why}; {tried_ones}" if best is first else f"{pose}: {tried_ones}"
    reasons = {**best.made.reasons, "part.rotate_deg": reason}
    return best._replace(made=replace(best.made, reasons=reasons))
