"""Hold a proposed part, and mask it: holders, arbors, pads and plugs that do no harm."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.checks.check import touched
from chamberopt.chamber.checks.place_names import CEILING, PART, one_of, surface_names
from chamberopt.chamber.checks.warning import WarningKind
from chamberopt.chamber.propose.proposal import (
    Proposal,
    Tables,
    checked,
    faults,
    new_harm,
    touched_share,
)
from chamberopt.chamber.propose.proposed_arbor import Bore
from chamberopt.chamber.propose.proposed_end import DEEP, HeldEnd
from chamberopt.chamber.propose.proposed_floor import Floor
from chamberopt.chamber.propose.proposed_holder import end_holder, holder_choices
from chamberopt.chamber.propose.proposed_mask import (
    FLAT_DEG,
    are_holes,
    pads,
    rows_of,
    to_be_masked,
    to_be_plugged,
)
from chamberopt.chamber.propose.proposed_target import (
    LONG,
    Target,
    apart,
    area_in_mm2,
    named_or_all,
    nearest_axis,
)
from chamberopt.chamber.propose.shop import Shop
from chamberopt.common.errors import InputError, UnreadableError
from chamberopt.common.progress import Progress
from chamberopt.design.fixture import USUAL_SHELL_MM, WIDEST_GAP, tight_gap_mm
from chamberopt.geometry.faces import Faces
from chamberopt.geometry.outline import convex_hull, fitted_circle, frame_along, narrowest_rectangle
from chamberopt.geometry.triangles import unit_normals

MILLED_MM = 0.2  # between a part and a wall that is milled or printed round it
ROUNDING = 1e-9  # of a clearance over its step
SEEN_OUT = 1e-3  # m by which a part stands out of a side
MOST_JAWS, JAW_SHARE = 2, 0.05  # surfaces named to clamp a part by; least area over the largest
# Flat faces looked at for jaws; least area of each [m²]; of two, share of all that stands out, and
# how far apart they are over the part's size: no vice takes a shaft by its ends.
MOST_FLAT, LEAST_JAW, LEAST_OF_ALL, JAWS_OPEN = 20, 30e-6, 0.15, 0.8
SHALLOW = "SHALLOW GRIP"
ALL_ROUND = "CUT ON SEVERAL SIDES"
# Of a round face: how far its corners may be off a circle, over its radius, and the sum of its area
# vectors over its area.
OFF_ROUND, ALL_WAYS = 0.02, 0.2
MOST_HOLDERS = 6  # that are tried
CLEAR = 1.5  # distance of a mask from the target, over the diameter of a ball
# Share of the target that a holder may keep from the balls; where no other holds the part.
HIDDEN, MOST_HIDDEN = 0.005, 0.03
LEAST_LEFT, MOST_LEFT = 0.005, 0.15  # share of the target that is left out if no ball touches it
NO_PLACE = (
    "no flat face beside the target looks up or aside and has room for a holder",
    "all of it is to be peened; leave out of [part.target] the face to hold it by",
)


def held(
    free: Proposal,
    floor: Floor,
    target: Target,
    end: HeldEnd | None,
    bores: Sequence[Bore],
    shop: Shop | None,
    progress: Progress,
) -> Proposal:
    """Return a proposal with the first holder that does no harm, or without one and the reason.

    Args:
        free: the proposal without a holder.
        end: an end that is left out of the target to hold the part by, if there is one.
        bores: bores that may take an arbor.
    """
    diameter, turns = free.design.shot.diameter, free.design.part.rotate_deg
    choices = holder_choices(free.mesh, target.triangles, turns, diameter, bores)[:MOST_HOLDERS]
    if end is not None:
        one = end_holder(free.mesh, target.triangles, turns, diameter, end.triangles)
        choices = choices if one is None else [one._replace(keys={**one.keys, "at": end.at})]
    why = "" if choices else NO_PLACE[bool(target.triangles.all())]
    tried = [*product((HIDDEN, MOST_HIDDEN), choices)]
    for number, (hidden, one) in enumerate(tried):
        progress(number, len(tried), None)
        tables = _with_table(free.tables, "sonotrode", "holder", one.keys)
        height = "sonotrode to ceiling; what holds the part goes on to the wall"
        reasons = {**free.reasons, "holder.kind": one.reason, "chamber.height_mm": height}
        if one.pins:
            tables = _with_mask(tables, {"plugs": True, "at": {"faces": list(one.pins)}})
            reasons["mask.plugs"] = "the pins that hold it fill these holes, flush with their rims"
        made, harm = _harmless(tables, reasons, floor, free, shop, one.keys["kind"], hidden)
        if made is not None:
            return made
        why = why or harm
    text = f"sonotrode to ceiling; NOTHING HOLDS THE PART: {why}"
    return replace(free, reasons={**free.reasons, "chamber.height_mm": text})


def clamped_outside(made: Proposal, floor: Floor, shop: Shop | None) -> Proposal:
    """Return a proposal whose part, which goes out of the chamber, is held where it does."""
    keys = {"kind": "bore", "clearance_mm": bore_clearance_mm(made.design.shot.diameter)}
    tables = _with_table(made.tables, "sonotrode", "holder", keys)
    text = (
        f"clamped where it stands out of the chamber {_outside_in_words(made)}; the wall, cut out "
        f"{keys['clearance_mm']:g} mm round it so that no ball passes, is split there"
    )
    if _is_cut_all_round(made, floor):
        text += (
            f"; {ALL_ROUND}: the part goes out through walls that do not lie opposite, so that its "
            "openings are long and the room is narrow: give the whole part a room (by a larger "
            "sonotrode, or --pose standing), or take another target"
        )
    reasons = {**made.reasons, "holder.kind": text}
    return checked(tables, reasons, floor, made.known, made.mesh, shop)


def grips_poorly(made: Proposal) -> bool:
    """Return whether a part that goes out of its chamber is cut all round, or held by a rim.

    So is one whose holder grips little of an end.
    """
    reason, holder = made.reasons.get("holder.kind", ""), made.design.holder
    grip_mm = None if holder is None else holder.grip_mm
    is_little = grip_mm is not None and grip_mm < 1e3 * DEEP
    return is_little or ALL_ROUND in reason or SHALLOW in reason


def _is_cut_all_round(made: Proposal, floor: Floor) -> bool:
    """Return whether a part goes out through side walls of which none lies opposite.

    A wall that a face of the part closes does not count: a plate is cut out round it anyway. Nor is
    a part cut that lies on the walls as a lid.
    """
    if "z" in floor.sizes.closed or not (surface_names(made.chamber) == CEILING).any():
        return False
    closed = {f"+{one}".replace("+-", "-") for one in floor.sizes.closed}
    through = {side[-1] for side in _sides_out(made) if side not in closed}
    return {"x", "y"} <= through


def bore_clearance_mm(ball: float) -> float:
    """Return the clearance of a bore [mm] in which no ball of a diameter [m] wedges.

    It is no wider than a sheet allows of joints. As the part may lie against one side of its bore,
    it is a quarter of a ball at most, which is less for the finest balls alone.
    """
    most = min(tight_gap_mm(1e3 * ball), 500.0 * WIDEST_GAP * ball)
    return min(MILLED_MM, math.floor(20.0 * most + ROUNDING) / 20.0)


def _outside_in_words(made: Proposal) -> str:
    """Return in words at which sides a part stands out of its chamber, and with which surfaces."""
    chamber, part = made.chamber, made.chamber.part
    low, high = (end(chamber.vertices, axis=0) for end in (np.min, np.max))
    # What is buried in another body of the part, or under a mask, is not outside.
    corners = part.vertices[part.triangles]
    is_beyond = ((corners < low) | (corners > high)).any(axis=(1, 2))
    outside = np.where(is_beyond & ~part.target, part.area - chamber.exposed_area, 0.0)
    jaws = _flat_jaws(part.vertices, part.triangles, outside)
    if not jaws or SHALLOW in jaws:
        known = [
            (one, np.where(rows_of(made.design, one.keys), outside, 0.0))
            for one in named_or_all(made.known)
        ]
        # One round face is held better than many flanks, such as those of splines.
        axes = {"xyz".index(side[-1]) for side in _sides_out(made)}
        rounds = [
            (one, each)
            for one, each in known
            if not any("alike" in face for face in one.keys.get("faces", ()))
            and any(_is_round(corners, each, k) for k in axes)
        ]
        used = rounds or ([] if jaws else known)
        areas = apart([(one, float(each.sum()), each) for one, each in used if each.any()])
        most = [(one, area) for one, area in areas if area > JAW_SHARE * areas[0][1]]
        if most:
            jaws = ", ".join(
                f"{one.name} ({area_in_mm2(area)} of it)" for one, area in most[:MOST_JAWS]
            )
    return f"at {', '.join(_sides_out(made))}{f' by {jaws}' if jaws else ''}"


def _sides_out(made: Proposal) -> list[str]:
    """Return the sides at which a part stands out of its chamber, such as "+x", sorted."""
    chamber, part = made.chamber, made.chamber.part
    low, high = (end(chamber.vertices, axis=0) for end in (np.min, np.max))
    beyond = high - part.vertices.max(axis=0), part.vertices.min(axis=0) - low
    signs = zip(("+", "-"), beyond, strict=True)
    return sorted(
        f"{sign}{'xyz'[k]}" for sign, room in signs for k in range(3) if room[k] < -SEEN_OUT
    )


def _is_round(corners: np.ndarray, outside: np.ndarray, axis: int) -> bool:
    """Return whether what stands out of a surface is a round about an axis that a clamp holds.

    All of it is as far from the axis, it goes all round, it is no bore, and it is long enough.

    Args:
        corners: of all triangles of the part [m], (m, 3, 3).
        outside: area of each that belongs to the surface and may be clamped [m²], (m,).
        axis: number of the axis.
    """
    own = outside > 0.0
    if not own.any():
        return False
    across = np.delete(corners[own], axis, axis=2).reshape(-1, 2)
    middle, radius = fitted_circle(across)
    off = np.abs(np.linalg.norm(across - middle, axis=1) - radius).max()
    normal, area = np.delete(unit_normals(corners[own]), axis, axis=1), outside[own]
    is_even = np.linalg.norm(area @ normal) < ALL_WAYS * area.sum()
    aside = np.delete(corners[own].mean(axis=1), axis, axis=1) - middle
    is_outer = float(area @ (normal * aside).sum(axis=1)) > 0.0
    is_long = float(np.ptp(corners[own][..., axis])) >= DEEP
    return bool(off < OFF_ROUND * radius and is_even and is_outer and is_long)


def _flat_jaws(vertices: np.ndarray, triangles: np.ndarray, outside: np.ndarray) -> str:
    """Return in words the largest two flat faces, back to back, that stand out of a chamber.

    The text is empty where there are none as large as jaws take.

    Args:
        vertices, triangles: the posed part [m].
        outside: area of each triangle that may be clamped [m²], (m,).
    """
    faces = Faces(vertices, triangles, FLAT_DEG)
    free = np.where(
        faces.are_flat(FLAT_DEG), np.bincount(faces.of_triangle, outside, faces.count), 0.0
    )
    largest = np.argsort(-free, kind="stable")[:MOST_FLAT]
    best, text = (False, LEAST_JAW), ""
    longest = float(np.ptp(vertices, axis=0).max())
    for k, one in enumerate(largest):
        for other in largest[k + 1 :]:
            pair = [int(one), int(other)]
            area = float(min(free[one], free[other]))
            ways = faces.normal(int(one)), faces.normal(int(other))
            is_little = free[one] + free[other] < LEAST_OF_ALL * outside.sum()
            is_small = is_little or area <= LEAST_JAW
            if is_small or ways[0] @ ways[1] > -np.cos(np.radians(FLAT_DEG)):
                continue
            places = faces.place(int(one)), faces.place(int(other))
            apart_by = ways[0] @ (places[0] - places[1])
            if not 0.0 < apart_by < JAWS_OPEN * longest:  # the sides of a slot, or its far ends
                continue
            out = [vertices[triangles[(faces.of_triangle == k) & (outside > 0.0)]] for k in pair]
            depth = min(_depth(*each) for each in zip(out, ways, free[pair], strict=True))
            if (depth >= DEEP, area) <= best:
                continue
            best = depth >= DEEP, area
            text = "jaws on its flat faces that look to " + " and ".join(
                f"{nearest_axis(way)} ({area_in_mm2(float(free[face]))} of it)"
                for way, face in zip(ways, pair, strict=True)
            )
            if depth < DEEP:
                text += f"; {SHALLOW}, {1e3 * depth:.2g} mm of these faces: jaws need "
                text += f"{1e3 * DEEP:g} mm"
    return text


def _depth(corners: np.ndarray, way: np.ndarray, area: float) -> float:
    """Return how deep jaws reach over a piece of a flat face on the average [m].

    Args:
        corners: of its triangles, (k, 3, 3) [m].
        way: normal of the face, (3,).
        area: of the piece [m²].
    """
    hull = convex_hull(corners.reshape(-1, 3) @ frame_along(way)[:2].T)
    if hull is None:
        return 0.0
    long, short = narrowest_rectangle(hull)[1]
    return float(min(short, area / long))


def hangs_by_a_face(made: Proposal) -> bool:
    """Return whether a long part hangs by nothing but a holder that stands on one of its faces."""
    if is_firm(made):
        return False
    sides = np.ptp(made.chamber.part.vertices, axis=0)
    return bool(sides[2] > LONG * sides[:2].max())


def is_firm(made: Proposal) -> bool:
    """Return whether a holder holds the part by itself, as one that stands on a face does not."""
    holder = made.design.holder
    return holder is not None and (holder.kind in ("arbor", "bore") or holder.grip_mm is not None)


def rests(made: Proposal) -> bool:
    """Return whether balls would come to rest on the part."""
    return any(one.kind is WarningKind.REST and PART in one.about for one in made.warnings)


def padded(made: Proposal, floor: Floor, target: Target, shop: Shop | None) -> Proposal:
    """Return a proposal with a pad on the level top of a part on which balls would come to rest.

    The pad goes up to the ceiling. It holds nothing: a part without a holder gets none. Where a pad
    would do harm, the proposal stays as it is.
    """
    if "mask" in made.tables or "holder" not in made.tables or not rests(made):
        return made
    diameter, turns = made.design.shot.diameter, made.design.part.rotate_deg
    for at in pads(made.mesh, target.triangles, turns, diameter):
        tables = _with_mask(made.tables, {"axis": [0.0, 0.0, 1.0], "at": at})
        text = "a pad on the level top, up to the ceiling: no ball lies there"
        height = "sonotrode to ceiling; a pad on the part's top goes on to it"
        reasons = {**made.reasons, "mask.axis": text, "chamber.height_mm": height}
        other, _ = _harmless(tables, reasons, floor, made, shop)
        if other and not other.chamber.pieces_in_air and faults(other) < faults(made):
            return other
    return made


def masked(bare: Proposal, floor: Floor, bores: Sequence[Bore], shop: Shop | None) -> Proposal:
    """Return a proposal with a mask on what must not be peened, where that does no harm.

    Holes are plugged, also those that a wall crosses and through which balls would leave. What runs
    in another part gets a sleeve that ends before the target. Where a mask would do harm, the
    surfaces stay bare and are named.

    Args:
        bores: round holes of the part, also those that do not go through.
    """
    fits, runs = to_be_masked(bare.design, bare.chamber, bare.known)
    holes = to_be_plugged(bare.design, bare.chamber, bores, fits)
    if "mask" in bare.tables or bare.design.effects.part_turn is not None:
        return bare
    if holes and are_holes(bare.mesh, bare.known, fits, holes):
        counts = Counter(f"{2e3 * one.radius:.3g}" for one in holes)
        sizes = ", ".join(f"{k} x {size}" if k > 1 else size for size, k in counts.items())
        named = "not to be peened, or " if fits else ""
        what = "plugs in holes" if len(holes) > 1 else "a plug in the hole"
        text = (
            f"{what} of {sizes} mm, {named}which the wall crosses: from the rims up to the wall, "
            "so that no ball leaves there"
        )
        keys: dict[str, Any] = {"plugs": True, "at": {"faces": [one.wall for one in holes]}}
    elif runs:
        margin = 0.5 * math.ceil(2e3 * CLEAR * max(bare.design.shot.diameters))
        text = (
            f"a sleeve on {', '.join(runs + fits)}: runs or fits, by the name; it ends {margin:g} "
            "mm before the target, so that balls get to its border; in halves where it cannot be "
            "slid on"
        )
        keys = {"margin_mm": margin, "thickness_mm": USUAL_SHELL_MM}
        keys["at"] = {"surface": runs + fits}
    elif fits or holes:
        text = f"a cap on {', '.join(fits)}: not to be peened, by the name"
        keys = {"thickness_mm": USUAL_SHELL_MM, "at": {"surface": fits}}
    else:
        return bare
    reasons = {**bare.reasons, f"mask.{next(iter(keys))}": text}
    return _harmless(_with_mask(bare.tables, keys), reasons, floor, bare, shop)[0] or bare


def only_touched(made: Proposal, floor: Floor, shop: Shop | None) -> Proposal:
    """Return a proposal whose target leaves out what no ball touches, if that is little of it.

    The time until 95 % of the target is covered would be that of the few places beside it. Where
    it is much, the user is left to choose other balls or another target.
    """
    hidden = 1.0 - touched_share(made)
    if not LEAST_LEFT < hidden < MOST_LEFT:
        return made
    target = {**made.tables["part.target"], "reachable": True}
    tables = {**made.tables, "part.target": target}
    narrowed = checked(tables, made.reasons, floor, made.known, made.mesh, shop)
    part, share = made.chamber.part, touched(made.design, made.chamber)
    gone = part.area[part.target].sum() - part.area[narrowed.chamber.part.target].sum()
    left_out = float(gone / part.area[part.target].sum())
    if left_out < LEAST_LEFT:  # specks, which stay in the target
        return made
    left = np.where(part.target, (1.0 - share) * part.area, 0.0)
    place = one_of(part.vertices[part.triangles].mean(axis=1), left)
    text = (
        f"PLACES ARE LEFT OUT, {left_out:.1%} of the target, which balls hardly touch here, such "
        f"as at {place} in the chamber: agree on it, or take smaller balls (--ball-mm)"
    )
    if (radius := _narrow_fillets(made, left)) > 0.0:
        text = (
            f"FILLETS ARE LEFT OUT, of about {1e3 * radius:.2g} mm, {left_out:.1%} of the target, "
            f"such as at {place} in the chamber: they are where parts fail: take balls of less "
            f"than {2e3 * radius:.2g} mm (--ball-mm), or agree on it"
        )
    return replace(narrowed, reasons={**narrowed.reasons, "part.target.reachable": text})


def _narrow_fillets(made: Proposal, left: np.ndarray) -> float:
    """Return the radius [m] of the fillets that are most of what is left out; 0 if they are not.

    Args:
        left: area that no ball touches of each triangle of the part [m²], (m,).
    """
    hollow, ball = made.chamber.part.hollow, min(made.design.shot.diameters)
    if hollow is None:
        return 0.0
    narrow = hollow * 0.5 * ball > 1.0
    if left[narrow].sum() < 0.5 * left.sum():
        return 0.0
    return float(1.0 / np.average(hollow[narrow], weights=left[narrow]))


def _harmless(
    tables: Tables,
    reasons: dict[str, str],
    floor: Floor,
    before: Proposal,
    shop: Shop | None,
    kind: str = "mask",
    hidden: float = HIDDEN,
) -> tuple[Proposal | None, str]:
    """Return a proposal with these tables in the place of one's own, or None and the harm they do.

    Harm is done if no chamber can be built with them somewhere in the ranges of the study, if they
    bring a warning, or if they keep the balls from some of the target.

    Args:
        kind: what the tables add, for the words.
        hidden: share of the target that they may keep from the balls.
    """
    try:
        made = checked(tables, reasons, floor, before.known, before.mesh, shop)
        _build_at_extremes(made)
    except UnreadableError:
        raise
    except InputError as error:
        return None, str(error)
    if touched_share(before) - touched_share(made) > hidden:
        return None, "a holder would keep the balls from some of the target"
    if harm := new_harm(made, before):
        return None, f"with the {kind}: {harm.beginning}"
    return made, ""


def _build_at_extremes(made: Proposal) -> None:
    """Raise InputError if a chamber cannot be built somewhere in the ranges of the study."""
    # Where the part no longer goes out, or no plug is in the room, a study leaves a candidate out:
    # no reason against a mask.
    holder, mask = made.design.holder, made.design.mask
    free: dict[str, None] = {"holder": None} if holder and holder.kind == "bore" else {}
    free |= {"mask": None} if mask and mask.plugs else {}
    for extreme in _extremes(made.bounds):
        build_chamber(made.design.changed({**extreme, **free}))


def _with_table(tables: Tables, after: str, name: str, values: dict[str, Any]) -> Tables:
    """Return tables with one more after that of some name."""
    added: Tables = {}
    for key, one in tables.items():
        added |= {key: one, name: values} if key == after else {key: one}
    return added


def _with_mask(tables: Tables, values: dict[str, Any]) -> Tables:
    after = "holder" if "holder" in tables else "sonotrode"
    return _with_table(tables, after, "mask", values)


def _extremes(bounds: dict[str, dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the lowest room of a study with the part high in it, and the opposite."""
    ends = {
        name: sorted(one.get("choose", (one.get("low"), one.get("high"))))
        for name, one in bounds.items()
        if name.startswith("chamber.")
    }
    distance = "chamber.sonotrode_distance_mm"
    low, high = ({name: one[k] for name, one in ends.items()} for k in (0, -1))
    far, near = ({name: one[name] for name in one if name == distance} for one in (high, low))
    return [{**low, **far}, {**high, **near}]
