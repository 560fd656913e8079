"""Hold a proposed part, and mask it: holders, arbors, pads and plugs that do no harm."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.checks.check import touched
from chamberopt.chamber.checks.gaps import resting_on_holder
from chamberopt.chamber.checks.place_names import PART, one_of
from chamberopt.chamber.checks.warning import WarningKind
from chamberopt.chamber.layout.arbor import Bore, way_through
from chamberopt.chamber.layout.end import HeldEnd
from chamberopt.chamber.layout.floor import Floor
from chamberopt.chamber.layout.grip import thin_grip
from chamberopt.chamber.layout.holder import HolderChoice, end_holder, holder_choices
from chamberopt.chamber.layout.sizes import LONG
from chamberopt.chamber.layout.target import CREASE_DEG, Target
from chamberopt.chamber.matters import MatterKind
from chamberopt.chamber.propose.proposal import (
    HarmError,
    Proposal,
    Tables,
    checked,
    faults,
    new_harm,
    touched_share,
    with_table,
)
from chamberopt.chamber.propose.proposed_mask import (
    are_holes,
    open_bores,
    pads,
    rows_of,
    to_be_masked,
    to_be_plugged,
)
from chamberopt.chamber.shop import Shop
from chamberopt.common.errors import InputError, UnreadableError
from chamberopt.common.progress import Progress
from chamberopt.design.fixture import USUAL_SHELL_MM
from chamberopt.geometry.face_shapes import hollow_edges

MOST_HOLDERS = 6  # that are tried
CLEAR = 1.5  # distance of a mask from the target, over the diameter of a ball
# Share of the target that a holder may keep from the balls; where no other holds the part.
HIDDEN, MOST_HIDDEN = 0.005, 0.03
LEAST_LEFT, MOST_LEFT = 0.005, 0.15  # share of the target that is left out if no ball touches it
# Sides of triangles that tell what no ball touches from what is beside it: share of a ball's
# diameter, and about how many there are at most.
FINE, MOST_TRIANGLES = 0.25, 30_000
NARROW = 2.0  # ball diameters: the radius of hollows that balls hardly touch, at most
MOSTLY, WHOLE = 0.5, 0.9  # share of what is left out, and of the target that names nothing of it
NO_PLACE = (
    "no flat face beside the target looks up or aside and has room for a holder: take a target "
    "that leaves an end, a bore or such a face free (--target), or give a holder by hand "
    "([holder])",
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
    like: Proposal | None = None,
) -> Proposal:
    """Return a proposal with the first holder that does no harm, or without one and the reason.

    Args:
        free: the proposal without a holder.
        end: an end that is left out of the target to hold the part by, if there is one.
        bores: bores that may take an arbor.
        like: a proposal whose holder is tried first.
    """
    diameter, turns = free.design.shot.diameter, free.design.part.rotate_deg
    choices = holder_choices(free.mesh, target.triangles, turns, diameter, bores)[:MOST_HOLDERS]
    if end is not None:
        one = end_holder(free.mesh, target.triangles, turns, diameter, end.triangles)
        choices = choices if one is None else [one.with_keys({"at": end.at})]
    why = "" if choices else NO_PLACE[bool(target.triangles.all())]
    choices = [one._replace(keys=keys) for one in choices for keys in (one.keys, *one.thinner)]
    if like is not None:
        choices.sort(key=lambda one: not _is_same(one.keys, like.tables.get("holder", {})))
    second: Proposal | None = None  # whose holder keeps some of the target from the balls
    for number, one in enumerate(choices):
        progress(number, len(choices), None)
        tables = with_table(free.tables, "sonotrode", "holder", one.keys)
        height = "sonotrode to ceiling; what holds the part goes on to the wall"
        reasons = {**free.reasons, "holder.kind": one.reason, "chamber.height_mm": height}
        if one.pins:
            tables = _with_mask(tables, {"plugs": True, "at": {"faces": list(one.pins)}})
            reasons["mask.plugs"] = "the pins that hold it fill these holes, flush with their rims"
        made, harm = _harmless(tables, reasons, floor, free, shop, MOST_HIDDEN)
        if made is not None and touched_share(free) - touched_share(made) <= HIDDEN:
            return _with_balls_on_holder(made)
        second = second or made
        why = why or _not_held(one, harm, len(choices))
    if second is not None:
        return _with_balls_on_holder(second)
    text = f"sonotrode to ceiling; {MatterKind.NOTHING_HOLDS}: {why}{_by_a_rod(free)}"
    return replace(free, reasons={**free.reasons, "chamber.height_mm": text})


def _by_a_rod(free: Proposal) -> str:
    """Return in words how a part is hung that no holder of a design holds; "" if it cannot be."""
    if (way := way_through(free.mesh)) is None:
        return ""
    along, width = way
    return (
        f". It goes all round a free way of {1e3 * width:.2g} mm along its {along}: hang it there "
        "on a thin rod through the chamber, which is not simulated, and shift it on the rod after "
        "half of the time, so that the shot gets to where they touched (no source read)"
    )


def _with_balls_on_holder(made: Proposal) -> Proposal:
    """Return a proposal whose holder's reason tells how many balls may come to rest on it."""
    count = resting_on_holder(made.design, made.chamber)
    if not count:
        return made
    of_all = f"{count} of the {made.design.shot.count:,} balls"
    told = f"{made.reasons['holder.kind']}; up to {of_all} can come to rest on its level places"
    return replace(made, reasons={**made.reasons, "holder.kind": told})


def _not_held(one: HolderChoice, harm: str, tried: int) -> str:
    """Return in words why the best holder is not taken, and what to do.

    Args:
        harm: that it does.
        tried: number of holders that were tried, none of which is taken.
    """
    kind = one.keys["kind"]
    what = f"{'an' if kind == 'arbor' else 'a'} {kind}"
    on = one.reason.partition("; ")[0].removeprefix(f"{what} ")
    others = f", and {tried - 1} further ways to hold it do harm too" if tried > 1 else ""
    comma = "," if "," in on else ""
    values = {key: json.dumps(value) for key, value in one.keys.items() if key != "at"}
    keys = ", ".join(f"{key} = {value}" for key, value in values.items())
    wrong = harm.partition("; ")[0]
    return (
        f"{what} {on}{comma} was tried, but then {wrong}{others}. Take another pose (--pose) or a "
        "target that leaves another place free (--target), or accept it and write the holder into "
        f"the design ([holder] {keys}, at these faces)"
    )


def _is_same(keys: dict[str, Any], others: dict[str, Any]) -> bool:
    """Return whether two holders are of one kind and at one place, whatever their sizes."""
    return all(keys.get(key) == others.get(key) for key in ("kind", "at", "axis"))


def nothing_holds(made: Proposal) -> bool:
    """Return whether a part floats in its chamber."""
    return "holder" not in made.tables and bool(made.chamber.pieces_in_air)


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


def is_held_thinly(made: Proposal) -> bool:
    """Return whether a holder grips an end that is too thin for what stands out of it."""
    holder, part = made.design.holder, made.chamber.part
    if holder is None or holder.grip_mm is None:
        return False
    axis = np.array(holder.axis, dtype=float)
    axis /= np.linalg.norm(axis)
    grip = 1e-3 * holder.grip_mm
    return thin_grip(part.vertices, part.triangles, axis, grip) is not None


def rests(made: Proposal) -> bool:
    """Return whether balls would come to rest on the part."""
    return any(one.kind is WarningKind.REST and PART in one.about for one in made.warnings)


def padded(
    made: Proposal, floor: Floor, target: Target, shop: Shop | None, like: Proposal | None = None
) -> Proposal:
    """Return a proposal with a pad on the level top of a part on which balls would come to rest.

    The pad goes up to the ceiling. It holds nothing: a part without a holder gets none. Where a pad
    would do harm, the proposal stays as it is.

    Args:
        like: a proposal whose pad is tried first.
    """
    if "mask" in made.tables or "holder" not in made.tables or not rests(made):
        return made
    diameter, turns = made.design.shot.diameter, made.design.part.rotate_deg
    places = pads(made.mesh, target.triangles, turns, diameter)
    if like is not None:
        places.sort(key=lambda at: at != like.tables.get("mask", {}).get("at"))
    for at in places:
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

    Holes are plugged, also those that a wall crosses and through which balls would leave. So are
    bores that are open to the shot, as what fits in them keeps its size. What runs in another part
    gets a sleeve that ends before the target. Where a mask would do harm, the surfaces stay bare
    and are named.

    Args:
        bores: round holes of the part, also those that do not go through.
    """
    fits, runs = to_be_masked(bare.design, bare.chamber, bare.known)
    holes = to_be_plugged(bare.design, bare.chamber, bores, fits)
    if "mask" in bare.tables or bare.design.effects.part_turn is not None:
        return bare
    is_of_holes = bool(holes) and are_holes(bare.mesh, bare.known, fits, holes)
    if is_of_holes or not (fits or runs):
        known = {one.at_mm for one in holes}
        opened = open_bores(bare.design, bare.chamber, bores)
        opened = [one for one in opened if one.at_mm not in known]
        if opened and (plugged := _plugged(bare, floor, shop, holes, opened, fits)):
            return plugged
    if is_of_holes:
        return _plugged(bare, floor, shop, holes, [], fits) or bare
    if runs:
        margin = 0.5 * math.ceil(2e3 * CLEAR * max(bare.design.shot.diameters))
        text = (
            f"a sleeve on {', '.join(runs + fits)}: runs or fits, by the name; it ends {margin:g} "
            "mm before the target, so that balls get to its border; in halves where it cannot be "
            "slid on"
        )
        keys: dict[str, Any] = {"margin_mm": margin, "thickness_mm": USUAL_SHELL_MM}
        keys["at"] = {"surface": runs + fits}
    elif fits or holes:
        text = f"a cap on {', '.join(fits)}: not to be peened, by the name"
        keys = {"thickness_mm": USUAL_SHELL_MM, "at": {"surface": fits}}
    else:
        return bare
    reasons = {**bare.reasons, f"mask.{next(iter(keys))}": text}
    return _harmless(_with_mask(bare.tables, keys), reasons, floor, bare, shop)[0] or bare


def _plugged(
    bare: Proposal,
    floor: Floor,
    shop: Shop | None,
    holes: Sequence[Bore],
    opened: Sequence[Bore],
    fits: Sequence[str],
) -> Proposal | None:
    """Return a proposal with plugs in holes; None where they do harm.

    Args:
        holes: those that must not be peened by their names, or that a wall crosses.
        opened: further ones, which are open to the shot.
        fits: these names.
    """
    words = []
    if holes:
        named = "not to be peened, or " if fits else ""
        words.append(
            f"{_of_sizes(holes)}, {named}which the wall crosses: flush with the rims, so that no "
            "ball leaves there"
        )
    if opened:
        words.append(
            f"{_of_sizes(opened)}, open to the shot and not to be peened: flush with the rims, so "
            "that what takes a pin or a screw keeps its size (leave the mask out where that does "
            "not matter)"
        )
    keys = {"plugs": True, "at": {"faces": [one.wall for one in (*holes, *opened)]}}
    reasons = {**bare.reasons, "mask.plugs": "; ".join(words)}
    return _harmless(_with_mask(bare.tables, keys), reasons, floor, bare, shop)[0]


def _of_sizes(holes: Sequence[Bore]) -> str:
    """Return in words how many plugs holes get, and of what diameters."""
    counts = Counter(f"{2e3 * one.radius:.3g}" for one in holes)
    sizes = ", ".join(f"{k} x {size}" if k > 1 else size for size, k in counts.items())
    return f"{'plugs in holes' if len(holes) > 1 else 'a plug in the hole'} of {sizes} mm"


def only_touched(made: Proposal, floor: Floor, shop: Shop | None) -> Proposal:
    """Return a proposal whose target leaves out what no ball touches, if that is little of it.

    The time until 95 % of the target is covered would be that of the few places beside it. Where
    it is much, the user is left to choose other balls or another target.
    """
    hidden = 1.0 - touched_share(made)
    if not LEAST_LEFT < hidden < MOST_LEFT:
        return made
    narrowed, left_out = _narrowed(made, floor, shop, {"reachable": True})
    if left_out < MOSTLY * hidden:  # its triangles are wider than what no ball touches
        area = float(made.chamber.part.area[made.chamber.part.target].sum())
        size = max(FINE * min(made.design.shot.diameters), math.sqrt(area / MOST_TRIANGLES))
        keys = {"reachable": True, "element_mm": float(f"{1e3 * size:.2g}")}
        with suppress(InputError):  # such as that a set-up keeps its triangles
            narrowed, left_out = _narrowed(made, floor, shop, keys)
    if left_out < LEAST_LEFT:  # specks, which stay in the target
        return made
    part, share = made.chamber.part, touched(made.design, made.chamber)
    left = np.where(part.target, (1.0 - share) * part.area, 0.0)
    place = one_of(part.vertices[part.triangles].mean(axis=1), left)
    text = (
        f"{MatterKind.PLACES_LEFT}, {left_out:.1%} of the target, {_where_left(made, left)}which "
        f"balls hardly touch here, such as at {place} in the chamber: agree on it, or take smaller "
        "balls (--ball-mm)"
    )
    if root := _sharp_root(made, left):
        text = (
            f"{MatterKind.SHARP_ROOTS}, {left_out:.1%} of the target, such as at {root} in the "
            "chamber, and no ball gets into them: draw the radius that the part has there, or "
            "agree on it"
        )
    if (radius := _narrow_fillets(made, left)) > 0.0:
        text = (
            f"{MatterKind.FILLETS_NOT_REACHED}, of about {1e3 * radius:.2g} mm, {left_out:.1%} of "
            f"the target, such as at {place} in the chamber: they are where parts fail: take balls "
            f"of less than {2e3 * radius:.2g} mm (--ball-mm), or agree on it"
        )
    return replace(narrowed, reasons={**narrowed.reasons, "part.target.reachable": text})


def _narrowed(
    made: Proposal, floor: Floor, shop: Shop | None, keys: dict[str, Any]
) -> tuple[Proposal, float]:
    """Return a proposal with further keys of its target, and the share that they leave out.

    Raises InputError if no chamber can be built with them.
    """
    tables = {**made.tables, "part.target": {**made.tables["part.target"], **keys}}
    narrowed = checked(tables, made.reasons, floor, made.known, made.mesh, shop)
    whole, left = (
        float(one.area[one.target].sum()) for one in (made.chamber.part, narrowed.chamber.part)
    )
    return narrowed, 1.0 - left / whole


def _where_left(made: Proposal, left: np.ndarray) -> str:
    """Return words for what most of that is which is left out: a surface, and whether it is hollow.

    Args:
        left: that of _narrow_fillets.
    """
    part, words, most = made.chamber.part, [], MOSTLY * left.sum()
    target = float(part.area[part.target].sum())
    found = []
    for one in made.known:
        rows = rows_of(made.design, one.keys)
        size = float(part.area[rows & part.target].sum())
        if left[rows].sum() > most and size < WHOLE * target:
            found.append((size, one.name))
    if found:
        words.append(f"on {min(found)[1]}")
    if part.hollow is not None and left[hollow := part.hollow > 0.0].sum() > most:
        radius = 1.0 / float(np.average(part.hollow[hollow], weights=left[hollow]))
        if radius < NARROW * max(made.design.shot.diameters):  # wider ones keep no ball out
            words.append(f"in hollows of about {1e3 * radius:.2g} mm")
    return f"mostly {' '.join(words)}, " if words else ""


def _sharp_root(made: Proposal, left: np.ndarray) -> str:
    """Return a place in words on a hollow edge without a radius, beside which balls are kept out.

    It is empty unless most of what is left out lies within a ball of such edges.

    Args:
        left: that of _narrow_fillets.
    """
    from scipy.spatial import cKDTree

    part, ball = made.chamber.part, min(made.design.shot.diameters)
    edges = hollow_edges(part.vertices, part.triangles, CREASE_DEG)
    if not len(edges):
        return ""
    long = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1)
    counts = np.ceil(long / (FINE * ball)).astype(int) + 1
    own = np.repeat(np.arange(len(edges)), counts)
    share = (np.arange(len(own)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[own]
    places = edges[own, 0] + share[:, None] * (edges[own, 1] - edges[own, 0])
    rows = np.flatnonzero(left > 0.0)
    corners = part.vertices[part.triangles[rows]].reshape(-1, 3)
    away, nearest = cKDTree(places).query(corners)
    near = away.reshape(-1, 3).min(axis=1) < ball
    if left[rows[near]].sum() <= MOSTLY * left.sum():
        return ""
    used = np.unique(nearest[away < ball])
    return one_of(places[used], np.ones(len(used)))


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
    hidden: float = HIDDEN,
) -> tuple[Proposal | None, str]:
    """Return a proposal with these tables in the place of one's own, or None and the harm they do.

    Harm is done if no chamber can be built with them somewhere in the ranges of the study, if they
    bring a warning, or if they keep the balls from some of the target.

    Args:
        hidden: share of the target that they may keep from the balls.
    """
    try:
        made = checked(tables, reasons, floor, before.known, before.mesh, shop, before)
        if (kept := touched_share(before) - touched_share(made)) > hidden:
            return None, f"the balls do not get to {kept:.1%} of the target"
        if harm := new_harm(made, before):
            return None, harm.beginning
        _build_at_extremes(made)  # last, as it takes as long as all the rest
    except UnreadableError:
        raise
    except HarmError as error:
        return None, error.warning.beginning
    except InputError as error:
        return None, str(error)
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


def _with_mask(tables: Tables, values: dict[str, Any]) -> Tables:
    after = "holder" if "holder" in tables else "sonotrode"
    return with_table(tables, after, "mask", values)


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
