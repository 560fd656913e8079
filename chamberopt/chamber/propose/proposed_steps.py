"""Propose steps: the part turned over, or finer balls after coarse ones, if pilots speak for it.

A part that lies gets few balls on its upper side, until it is turned over. Balls that are large
enough for an intensity do not get into narrow fillets and slots; finer ones after them do, in the
same chamber, and leave a weaker intensity there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.chamber.checks.check import shot_reach
from chamberopt.chamber.checks.jams import gaps_in_reach, jam_gaps
from chamberopt.chamber.checks.warning import WarningKind
from chamberopt.chamber.layout.balls import (
    AS_GOOD,
    MANY,
    MISSED_FILLETS,
    MOSTLY,
    fit_sizes,
    reaches,
)
from chamberopt.chamber.layout.floor import of_blocks
from chamberopt.chamber.matters import MatterKind
from chamberopt.chamber.propose.proposal import (
    Proposal,
    faults,
    holding,
    new_harm,
    propose_charge,
    sonotrode_area,
    touched_area,
    touched_share,
    warned_again,
)
from chamberopt.chamber.propose.proposed_budget import (
    COVERED,
    UNEVEN,
    Budget,
    Measured,
    TooSlowError,
    in_turn,
    measured_budget,
    with_budget,
)
from chamberopt.chamber.propose.proposed_clamp import bore_clearance_mm
from chamberopt.chamber.propose.proposed_intensity import LARGER
from chamberopt.chamber.propose.proposed_mask import moved_openings
from chamberopt.chamber.propose.proposed_setting import setting_of
from chamberopt.chamber.propose.quicker import SLOW, turns
from chamberopt.common.errors import InputError
from chamberopt.common.number_text import plain, rounded
from chamberopt.geometry.triangles import rotation_matrix

WORTH = 2.0 / 3.0  # of the time in one pose, in which a second set-up, often with its own wall, is
RAISED = 1.0, 2.0, 3.0  # ball diameters by which a ceiling is raised for a second pose
# Where a second pose lifts the target above the ceiling by at most so much [m], this is raised over
# it by so many ball diameters. A target that goes out farther is long, and is peened from below.
MOST_CUT, BELOW = 15e-3, 2.0
# Level axes about which a part may be turned over, and their angle to the chamber's x [degrees].
OVER = {"x": 0.0, "y": 90.0, "the diagonal of x and y": 45.0, "the diagonal of x and -y": -45.0}
# When two sizes pay, by heart: coarse balls serve MOSTLY of the target, their intensity is so many
# times that of the finer ones, and these serve more of the target in less time. For fillets, where
# parts fail, and for what coarse balls leave bare, they pay in any case.
STRONGER = 1.5
NOT_OVER = "; not turned over after half of the time"
Steps = list[dict[str, Any]]
"""The [[steps]] of a design file."""
Values = Mapping[str, Mapping[str, Any]]
"""Values of a design file by table and key."""


def propose_second_pose(
    made: Proposal, found: Measured | None, measure: Callable[[Proposal, float], Measured | None]
) -> tuple[Proposal, Measured | None]:
    """Return a proposal with a second step, turned over, and its pilot, where that is worth it.

    It is tried where single places rule a slow treatment, or where balls cannot touch enough of the
    target in one pose. What holds the part must hold it in both poses.

    Args:
        found: what a pilot measured of the proposal; None if nothing.
        measure: simulates a proposal briefly; None if that cannot be done. Raises TooSlowError if
            the time to 98 % is longer than a given one [s].
    """
    if found is None or not is_worth_a_second_pose(made, found):
        return made, found
    is_hidden = _is_hidden(made, found)
    longest = math.inf if is_hidden else WORTH * found.time_to_98

    def dropped(why: str) -> tuple[Proposal, Measured | None]:
        reason = f"{made.reasons['part.rotate_deg']}{NOT_OVER}: {why}"
        return replace(made, reasons={**made.reasons, "part.rotate_deg": reason}), found

    try:
        two = turned_over(made)
    except InputError as error:
        return dropped(str(error))
    if harm := new_harm(two, made):
        return dropped(harm.beginning)
    try:
        after = measure(two, longest)
    except TooSlowError as error:
        return dropped(f"by a pilot {error} then, in one pose {found.in_words}")
    if after is None or not after.places:
        return dropped("no pilot resolved it")
    if after.time_to_98 > longest or (is_hidden and touched_share(two) < COVERED):
        return dropped(f"by a pilot {after.in_words} then, in one pose {found.in_words}")
    before = f"{touched_share(made):.0%} of the target is in reach" if is_hidden else found.in_words
    over = two.reasons[".steps"].partition(",")[0]
    reason = (
        f"{over}: by pilots with balls of {setting_of(made).ball_mm:g} mm {after.in_words}, in one "
        f"pose {before}"
    )
    return replace(two, reasons={**two.reasons, ".steps": reason}), after


def is_worth_a_second_pose(made: Proposal, found: Measured) -> bool:
    """Return whether a second step, turned over, is tried for a proposal.

    Args:
        found: what a pilot measured of it.
    """
    if turns(made) or made.design.steps:
        return False
    is_uneven = found.time_to_98 >= max(SLOW, UNEVEN * found.mean_time)
    return is_uneven or _is_hidden(made, found)


def _is_hidden(made: Proposal, found: Measured) -> bool:
    """Return whether balls cannot touch enough of the target in one pose."""
    return not found.places and touched_share(made) < COVERED


def turned_over(made: Proposal) -> Proposal:
    """Return a proposal with a second step, turned over, under a ceiling that suits both poses.

    It is turned about the first axis with which no more balls jam, best about one with which the
    walls have the same openings in both poses.

    Raises InputError if what holds the part does not hold it then.
    """
    moves: dict[str, bool] = {}
    for axis in OVER:
        with suppress(InputError):
            room = build_chamber(made.design.changed(_changes(*_over(made, axis))))
            moves[axis] = bool(moved_openings(room))
    found: list[tuple[int, Proposal, str]] = []
    for axis in sorted(moves, key=moves.__getitem__):
        with suppress(InputError):
            two = _turned_about(made, axis)
            found.append((faults(two)[0], two, axis))
            if found[-1][0] <= faults(made)[0]:
                break
    if not found:
        raise InputError("what holds it in this pose does not hold it turned over")
    _, two, axis = min(found, key=lambda one: one[0])
    if any(one.pieces_in_air for one in two.chamber.steps) and not made.chamber.pieces_in_air:
        raise InputError("nothing would hold it")
    over = f"turned over about {axis} after half of the time, as what looks up gets few dents"
    pose = two.reasons["part.rotate_deg"].partition(NOT_OVER)[0]  # with other balls it was not
    return replace(two, reasons={**two.reasons, "part.rotate_deg": pose, ".steps": over})


def _turned_about(made: Proposal, axis: str) -> Proposal:
    """Return a proposal turned over about an axis of OVER, under a ceiling that suits both poses.

    Raises InputError if the chamber cannot be built round the part in this pose.
    """
    two = _turned_over(made, axis)
    for balls in RAISED:  # under a ceiling that fits one pose, balls may jam in the other
        if _jams_more(two, made):
            two = min(two, _turned_over(made, axis, balls), key=faults)
    first, second = (_above_the_ceiling(one) for one in two.chamber.steps[:2])
    ball = made.design.shot.diameter
    if first <= -BELOW * ball < second <= MOST_CUT:
        with suppress(InputError):
            height = round(two.tables["chamber"]["height_mm"] - made.tables["chamber"]["height_mm"])
            higher = _turned_over(made, axis, (1e-3 * height + second) / ball + BELOW)
            if faults(higher) <= faults(two):
                return higher
    return two


def _above_the_ceiling(room: Chamber) -> float:
    """Return how far the target goes out above the ceiling of a chamber [m], below 0 if not."""
    part = room.part
    top = float(part.vertices[part.triangles[part.target], 2].max())
    return top - float(room.vertices[:, 2].max())


def _jams_more(made: Proposal, before: Proposal) -> bool:
    """Return whether the only new harm of a proposal is that balls jam in more gaps."""
    harm = new_harm(made, before)
    return harm is not None and harm.kind is WarningKind.JAM


def _turned_over(made: Proposal, axis: str, raised: float = 0.0) -> Proposal:
    """Return a proposal with a second step in which the part is turned over.

    Raises InputError if the chamber cannot be built round the part in this pose.

    Args:
        axis, raised: those of _over.
    """
    two = _with_values(made, *_over(made, axis, raised))
    if not raised:
        return two
    text = "high enough for both poses"
    reason = f"{made.reasons['chamber.height_mm']}; {text}"
    return replace(two, reasons={**two.reasons, "chamber.height_mm": reason})


def _over(made: Proposal, axis: str, raised: float = 0.0) -> tuple[Values, Steps]:
    """Return the height and the steps of a proposal in which the part is turned over.

    Args:
        axis: of OVER.
        raised: by how many diameters of a ball the ceiling is raised.
    """
    x, y, z = made.design.part.rotate_deg
    # Half a turn about the chamber's x after turns about x, y and z is one before them, with the
    # turns about y and z the other way. About an axis at an angle to x it is followed by a turn
    # about the vertical by twice the angle.
    angle = 2.0 * OVER[axis]
    turned = [(x + 180.0) % 360.0, -y + 0.0, (angle - z + 180.0) % 360.0 - 180.0]
    pose: dict[str, list[float]] = {"rotate_deg": turned}
    if any(made.design.part.offset_mm):
        over = rotation_matrix((180.0, 0.0, angle))[:2, :2]
        offset = over @ made.design.part.offset_mm
        pose["offset_mm"] = [round(float(one), 9) + 0.0 for one in offset]
    height = made.tables["chamber"]["height_mm"] + 1e3 * raised * made.design.shot.diameter
    steps: Steps = [{"name": "first"}, {"name": "turned_over", "part": pose}]
    return {"chamber": {"height_mm": round(height, 1)}}, steps


def with_finer_balls(
    coarse: Proposal,
    found: Measured | None,
    finer_mm: float,
    measure: Callable[[Proposal], Measured | None],
) -> tuple[Proposal | None, str]:
    """Return a proposal in which finer balls follow coarse ones, or None and why not.

    Each size peens until it has covered what it touches by itself.

    Args:
        coarse: a proposal whose balls give the intensity, and serve too little of the target.
        found: what a pilot measured of it; None if nothing.
        finer_mm: diameter of the balls that follow.
        measure: simulates a proposal briefly; None if that cannot be done.
    """
    coarse_mm = setting_of(coarse).ball_mm
    if found is None or found.intensity is None:
        return None, "no pilot resolved the coarse balls"
    if finer_mm >= coarse_mm:
        return None, "no smaller balls suit more"
    try:
        finer = _with_shot(coarse, finer_mm)
        fine, most = fit_sizes(finer.chamber.part, [1e-3 * finer_mm, 1e-3 * coarse_mm])
        shares = f"{coarse_mm:g} mm serve {most.served:.0%}, {finer_mm:g} mm {fine.served:.0%}"
        for_fillets = fine.fillets > most.fillets + MISSED_FILLETS
        gain = fine.served - most.served
        if most.served < MOSTLY and reaches(most):
            return None, ""
        if most.served < MOSTLY:
            return None, f"the larger ones suit too little ({shares})"
        if not (gain > AS_GOOD or for_fillets):
            return None, f"the smaller ones suit hardly more ({shares})"
        for balls in RAISED:  # a ceiling that suits the coarse balls may hold the finer ones
            if _jams_more(finer, coarse):
                coarse = _raised(coarse, balls * finer_mm)
                finer, found = _with_shot(coarse, finer_mm), None
        if harm := new_harm(finer, coarse):
            return None, harm.beginning
        found, after = found or measure(coarse), measure(finer)
        if found is None or found.intensity is None or after is None:
            return None, "no pilot resolved both sizes"
        weak = after.intensity
        if weak is not None and found.intensity.value < STRONGER * weak.value:
            return None, f"{plain(weak.value, 2)} mmA of {finer_mm:g} mm are hardly less"
        halves = [one._replace(room=0.5 * one.room) for one in (found, after)]
        budgets = [measured_budget(coarse, halves[0]), measured_budget(finer, halves[1])]
        left_bare = 1.0 - touched_area(coarse) / touched_area(finer)
        is_needed = for_fillets or left_bare > AS_GOOD
        if not is_needed and budgets[1].treatment >= budgets[0].treatment:
            longer = f"{rounded(budgets[1].treatment, 3)} s more for {gain:.0%} of the target"
            return None, f"{longer} do not pay: {shares}"
        two = _one_after_the_other(coarse, finer, budgets)
    except InputError as error:
        return None, str(error)
    first, second = (f"{rounded(one.treatment, 3)} s" for one in budgets)
    turned = ", half of each time turned over" if len(_steps(coarse)) > 1 else ""
    weaker = f", about {plain(after.intensity.value, 2)} mmA," if after.intensity else ""
    count, mass_g = finer.design.shot.count, finer.tables["shot"]["mass_g"]
    reason = (
        f"{coarse_mm:g} mm balls for {first}, then {finer_mm:g} mm for {second}{turned}: the first "
        f"for the intensity, about {plain(found.intensity.value, 2)} mmA on the {most.served:.0%} "
        f"of the target that they suit; the second, {count:,} balls ({mass_g:g} g){weaker} for "
        f"narrow places: they serve {fine.served:.0%}; each until it has covered by itself what it "
        f"touches; {MatterKind.TWO_INTENSITIES}: narrow places get that of the finer balls alone: "
        f"agree on it, or take one size (--ball-mm {finer_mm:g} or {coarse_mm:g})"
    )
    return replace(two, reasons={**two.reasons, ".steps": reason}), ""


def _raised(made: Proposal, by_mm: float) -> Proposal:
    """Return a proposal whose ceiling is higher [mm]. Raises InputError if it cannot be built."""
    height = round(made.tables["chamber"]["height_mm"] + by_mm, 1)
    higher = _with_values(made, {"chamber": {"height_mm": height}}, _steps(made))
    text = "high enough for both sizes of balls, so that none jams under the ceiling"
    reason = f"{made.reasons['chamber.height_mm'].removesuffix('; ' + text)}; {text}"
    return replace(higher, reasons={**made.reasons, "chamber.height_mm": reason})


def without_finer(coarse: Proposal, why: str) -> Proposal:
    """Return a proposal with coarse balls that tells why no finer ones follow, if it has such."""
    reason = coarse.reasons["shot.diameter_mm"]
    if not why or not reason.startswith(LARGER):
        return coarse
    reasons = {**coarse.reasons, "shot.diameter_mm": f"{reason}; no finer balls after them: {why}"}
    return replace(coarse, reasons=reasons)


def _with_shot(made: Proposal, ball_mm: float) -> Proposal:
    """Return a proposal with balls of another diameter [mm] in the same chamber and poses.

    Raises InputError if the chamber cannot be built with them.
    """
    ball_mass = made.design.shot.ball_mass * (ball_mm / setting_of(made).ball_mm) ** 3
    mass_g = propose_charge(sonotrode_area(made.chamber), 1e-3 * ball_mm, ball_mass).mass_g
    mass_g = min(mass_g, float(f"{1e3 * MANY * ball_mass:.2g}"))
    shot = {"shot": {"diameter_mm": ball_mm, "mass_g": mass_g}}
    return _with_values(made, {**shot, **_clearance_for(made, ball_mm)}, _steps(made))


def _clearance_for(made: Proposal, ball_mm: float) -> dict[str, dict[str, float]]:
    """Return the clearance of a bore that holds the part, if one does, as a value in its table."""
    if made.tables.get("holder", {}).get("kind") != "bore":
        return {}
    return {"holder": {"clearance_mm": bore_clearance_mm(1e-3 * ball_mm)}}


def _one_after_the_other(coarse: Proposal, finer: Proposal, budgets: Sequence[Budget]) -> Proposal:
    """Return a proposal with the steps of one with coarse balls, and after them finer ones.

    Args:
        budgets: of both, whose treatment times become the shares of their steps.
    """
    own = _steps(coarse) or [{"name": "coarse"}]
    shares = [one.treatment / len(own) for one in budgets]
    shot = {key: finer.tables["shot"][key] for key in ("diameter_mm", "mass_g")}
    names = [f"finer_{step['name']}" if len(own) > 1 else "finer" for step in own]
    steps = [{**step, "time_share": shares[0]} for step in own]
    for step, name in zip(own, names, strict=True):
        steps.append({**step, "name": name, "time_share": shares[1], "shot": shot})
    clearance = _clearance_for(coarse, setting_of(finer).ball_mm)
    two, why = _with_values(coarse, clearance, steps), {}
    if two.reasons["shot.diameter_mm"].startswith(LARGER):  # what they leave out is served after
        why["shot.diameter_mm"] = "chosen for the intensity"
    if "part.target.reachable" in two.reasons:
        why["part.target.reachable"] = "leaves out what balls of neither size touch here"
    if two.sonotrode_count > 1:
        why["sonotrode.face"] = of_blocks(finer.design.shot.diameter)
    two = replace(two, reasons={**two.reasons, **why})
    return with_budget(two, in_turn(budgets))


def _steps(made: Proposal) -> Steps:
    return list(made.tables.get("", {}).get("steps", []))


def _changes(values: Values, steps: Steps) -> dict[str, Any]:
    """Return what values and steps change in a design, by dotted name."""
    changes = {f"{name}.{key}": x for name, one in values.items() for key, x in one.items()}
    return {**changes, "steps": steps or None}


def _with_values(made: Proposal, values: Values, steps: Steps) -> Proposal:
    """Return a proposal with other values and steps in its tables, built and checked again.

    Raises InputError if the chamber cannot be built with them.
    """
    tables = {"": {}, **made.tables}
    for name, one in values.items():
        tables[name] = {**tables[name], **one}
    if steps:
        tables[""] = {**tables[""], "steps": steps}
    design = made.design.changed(_changes(values, steps))
    chamber = build_chamber(design)
    jams = (
        tuple(jam_gaps(room, one.shot.diameter, gaps_in_reach(shot_reach(one, room))))
        for one, room in zip(design.in_steps.values(), chamber.steps or (chamber,), strict=True)
    )
    return replace(
        made,
        design=design,
        tables={name: one for name, one in tables.items() if one or name},
        bounds=holding(made.bounds, design),
        chamber=chamber,
        jams=max(jams, key=len),
        warnings=warned_again(made, design, chamber),
    )
