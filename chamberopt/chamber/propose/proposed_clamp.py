"""Clamp a proposed part where it stands out of its chamber, through a bore in the wall."""

from __future__ import annotations

import math

import numpy as np

from chamberopt.chamber.checks.openings import find_openings, mounting
from chamberopt.chamber.checks.place_names import CEILING, surface_names
from chamberopt.chamber.layout.end import DEEP
from chamberopt.chamber.layout.floor import Floor
from chamberopt.chamber.layout.grip import Clamp, free_outside, outside_clamp, sides_out
from chamberopt.chamber.layout.screws import holes_for_screws
from chamberopt.chamber.layout.target import apart, area_in_mm2, named_or_all
from chamberopt.chamber.matters import MatterKind
from chamberopt.chamber.part import turning_axis
from chamberopt.chamber.propose.proposal import Proposal, checked, with_table
from chamberopt.chamber.propose.proposed_mask import rows_of
from chamberopt.chamber.shop import Shop
from chamberopt.design.fixture import WIDEST_GAP, tight_gap_mm
from chamberopt.geometry.outline import frame_along

MILLED_MM = 0.2  # between a part and a wall that is milled or printed round it
ROUNDING = 1e-9  # of a clearance over its step
MOST_JAWS, JAW_SHARE = 2, 0.05  # surfaces named to clamp a part by; least area over the largest
# Of a part that turns: ball diameters between it and the walls, so that no ball is jammed there,
# and m between its axis and the middle of an opening.
FREE, OFF_AXIS = 1.0, 2e-4


def clamped_outside(made: Proposal, floor: Floor, shop: Shop | None) -> Proposal:
    """Return a proposal whose part, which goes out of the chamber, is held where it does."""
    clearance_mm = bore_clearance_mm(made.design.shot.diameter)
    keys = {"kind": "bore", "clearance_mm": clearance_mm}
    tables = with_table(made.tables, "sonotrode", "holder", keys)
    by = f" by {clamp.text}" if (clamp := _clamp(made)).text else ""
    if not _turns(made):
        holes = holes_for_screws(made.chamber)
        by += f", or by screws through its {holes} there" if holes else ""
    holds = "turned" if _turns(made) else "clamped"
    sides = ", ".join(sides_out(made.chamber))
    text = (
        f"{holds} where it stands out of the chamber at {sides}{by}; the "
        f"wall, cut out {clearance_mm:g} mm round it so that no ball passes, "
        f"{_mounting(made, 1e-3 * clearance_mm)}"
    )
    if _is_cut_all_round(made):
        text += (
            f"; {MatterKind.CUT_ALL_ROUND}: the part goes out through walls that do not lie "
            "opposite, so that its openings are long and the room is narrow: give the whole part a "
            "room (by a larger sonotrode, or --pose standing), or take another target"
        )
    reasons = {**made.reasons, "holder.kind": text}
    return checked(tables, reasons, floor, made.known, made.mesh, shop)


def _turns(made: Proposal) -> bool:
    """Return whether a drive turns the part."""
    return made.design.effects.part_turn is not None


def why_not_turned(made: Proposal) -> str:
    """Return why a part cannot turn by its own ends in a chamber; "" if it can.

    What goes out through a wall has to be round about the axis there, and as long as a chuck grips.
    What is in the room has to clear walls and ceiling by a ball as it turns.
    """
    chamber, ball = made.chamber, max(made.design.shot.diameters)
    line = turning_axis(made.design, chamber.part)
    if line is None:
        return "no axis is given"
    (point, axis), openings = line, find_openings(chamber)
    frame = frame_along(axis)
    for one in openings:
        away = float(np.linalg.norm(((one.place - point) @ frame.T)[:2]))
        if one.form != "round" or away > OFF_AXIS:
            return "it is not round about that axis where it goes out through a wall"
    if max((one.beyond for one in openings), default=0.0) < DEEP:
        return "none of its ends stands out of the room to be turned by"
    low, high = chamber.vertices.min(axis=0), chamber.vertices.max(axis=0)
    ends = np.sort([(corner - point) @ axis for corner in (low, high)])
    places = (chamber.part.vertices - point) @ frame.T
    inside = (places[:, 2] > ends[0]) & (places[:, 2] < ends[1])
    reach = float(np.linalg.norm(places[inside, :2], axis=1).max(initial=0.0)) + FREE * ball
    across = np.abs(axis) < 0.5
    room = min(float((point - low)[across].min()), float((high - point)[across].min()))
    return "" if reach <= room else "it would come nearer to a wall than a ball as it turns"


def _mounting(made: Proposal, clearance: float) -> str:
    """Return how a part gets into the walls through which it goes out.

    Args:
        clearance: room between part and wall [m].
    """
    chamber = made.chamber
    ways = {mounting(chamber.part, one, clearance) for one in find_openings(chamber)}
    if "lies on it" in ways and "split" not in ways:
        return "is in one piece there: the part is laid on it from above"
    side = "above" if sides_out(made.chamber) == ["+z"] else "outside"
    if "split" in ways or not ways:
        return "is split there"
    how = f"the part goes in from {side}"
    if "wall goes over" in ways:
        how = f"it is put over the part from {side}"
    return f"is in one piece there: {how}"


def grips_poorly(made: Proposal) -> bool:
    """Return whether a part that goes out of its chamber is cut all round, or held by a rim.

    So is one whose holder grips little of an end.
    """
    holder = made.design.holder
    if holder is None:
        return False
    if holder.kind == "bore":
        return _is_cut_all_round(made) or _clamp(made).is_shallow
    return holder.grip_mm is not None and holder.grip_mm < 1e3 * DEEP


def _is_cut_all_round(made: Proposal) -> bool:
    """Return whether a part goes out through side walls of which none lies opposite.

    A wall that a face of the part closes does not count: a plate is cut out round it anyway. Nor is
    a part cut that lies on the walls as a lid.
    """
    if "z" in made.closed or not (surface_names(made.chamber) == CEILING).any():
        return False
    closed = {f"+{one}".replace("+-", "-") for one in made.closed}
    through = {side[-1] for side in sides_out(made.chamber) if side not in closed}
    return {"x", "y"} <= through


def bore_clearance_mm(ball: float) -> float:
    """Return the clearance of a bore [mm] in which no ball of a diameter [m] wedges.

    It is no wider than a sheet allows of joints. As the part may lie against one side of its bore,
    it is a quarter of a ball at most, which is less for the finest balls alone.
    """
    most = min(tight_gap_mm(1e3 * ball), 500.0 * WIDEST_GAP * ball)
    return min(MILLED_MM, math.floor(20.0 * most + ROUNDING) / 20.0)


def _clamp(made: Proposal) -> Clamp:
    """Return what a part that stands out of its chamber is clamped by there.

    It is what `outside_clamp` finds, or else surfaces by name.
    """
    if (found := outside_clamp(made.chamber, _turns(made))).text:
        return found
    outside = free_outside(made.chamber)
    known = [
        (one, np.where(rows_of(made.design, one.keys), outside, 0.0))
        for one in named_or_all(made.known)
    ]
    areas = apart([(one, float(each.sum()), each) for one, each in known if each.any()])
    most = [(one, area) for one, area in areas if area > JAW_SHARE * areas[0][1]]
    named = [f"{one.name} ({area_in_mm2(area)} of it)" for one, area in most[:MOST_JAWS]]
    return Clamp(f"{', '.join(named)}, in jaws of that form or potted" if named else "")
