"""Tell on a process sheet what holds the part, where it goes out, and what masks it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.chamber.checks.openings import EDGE, PLATE, thin_ribs, walls_end_at
from chamberopt.chamber.checks.place_names import CEILING
from chamberopt.chamber.fixture import plugs_in_words, size_in_words
from chamberopt.design.fixture import OpeningCut, opening_cut, slit_mm
from chamberopt.documents.sheet.rows import MOST_ROWS, AsBuilt, Row, first_rows
from chamberopt.documents.wording import plain

if TYPE_CHECKING:
    from chamberopt.chamber.checks.openings import Mounting, Opening
    from chamberopt.design.fixture import Holder
    from chamberopt.results.load import Result

SQUARE = 0.999  # cosine between a wall's normal and an axis above which the wall is named by it
# m: jaws take what stands out so far; through one opening alone, in a thin wall at least.
CLAMPED, SHORT = 3e-3, 15e-3
CLAMP = "clamp it there"
# Of a part that turns: by its only end, and by one of several.
DRIVEN = "drive it there, stopped along its axis"
EITHER = (
    "drive it by one such end, the shop's choice, and guide it by the other in a bushing, stopped "
    "along its axis"
)
THROUGH = "; it goes on through the wall, fixed there, or in bearings and sealed"
FOLLOWS = "follows from the distance, as the walls end on the part"
FILLED = "balls go in and out there"
# By heart: no text on plugs was read.
PLUGS = (
    "usual, by heart: of polyamide, turned 0.1 mm larger than the hole, pressed in, which holds "
    "them, and pressed out from the other rim; count them after each part, new ones where they are "
    "worn. Simulated as hard as the walls"
)
MOUNTED: dict[Mounting, str] = {
    "part goes in": "the part goes in from outside",
    "wall goes over": "the wall goes over it from outside",
    "lies on it": "it lies on the wall",
    "split": "split the wall there",
}


def fixture_rows(result: Result, built: AsBuilt) -> Iterator[Row]:
    """Yield rows on what holds the part, where it goes out, and what masks it."""
    holder, openings = result.design.holder, built.openings
    turns = result.design.effects.part_turn is not None
    held = (DRIVEN if len(openings) < 2 else EITHER) if turns else CLAMP
    if holder is not None and holder.kind == "bore":
        play = "tight"
        if holder.clearance_mm:
            play = f"{plain(holder.clearance_mm)} mm of clearance all round, in the sizes below"
        how = "turned" if turns else "clamped"
        by = f"; {how} by {built.clamp.replace(' -', ' −')}" if built.clamp else ""
        if by and built.screws:
            by += f", or by screws through its {built.screws} there"
        yield "holder", f"the part itself, out through the wall, {play}{by}"
    mask = result.design.mask
    if holder is None and not result.record.chamber.pieces_in_air:
        padded = mask is not None and mask.axis is not None and not openings
        out = "the mask clamps it" if padded else "the part goes out through the wall"
        yield "holder", f"none: {out}{'' if padded else f'; {held}'}"
    rows = []
    for number, way in enumerate(openings):
        how = f"; {MOUNTED[built.mountings[number]]}" if built.mountings else ""
        beyond = _beyond(way, openings, held, how)
        cut = opening_in_words(way, clearance_of(result))
        beyond += _across(result, way)
        rows.append(("opening", f"{cut} at {place_of(way, openings)} mm; {beyond}"))
    yield from first_rows(rows, "openings")
    if clearance_of(result) and not all(one.is_end for one in openings):
        yield "cut to", _cut_in_words(result, openings)
    if ribs := thin_ribs(openings):
        between = " and ".join(
            f"{plain(1e3 * rib.width, 2)} mm between those in {_wall_of(rib.one)} and "
            f"{_wall_of(rib.other)}"
            for rib in ribs
        )
        yield "no rib", f"{between}: so little does not stand, cut these openings as one"
    faces = {"holder": holder.at if holder else None, "mask": mask.at if mask else None}
    for name, one in result.record.chamber.fixtures.items():
        size = size_in_words(one.kind, one.size_mm)
        if one.kind == "plugs":
            sizes = f"{plugs_in_words(built.plugs)}, " if built.plugs else ""
            size = f"{sizes}flush with both rims"
        text = f"{one.kind} {size or 'up to the wall'}"
        if one.length_mm:
            text += f", {plain(one.length_mm)} mm long"
        if one.place_mm and holder is not None:
            at, along = (
                ", ".join(plain(round(x, 3) + 0.0) for x in three)
                for three in (one.place_mm, holder.axis)
            )
            text += f", from ({at}) mm along ({along})"
        if holder is not None and name == "holder":
            text += _flanges(holder) + _grip(holder)
            text += THROUGH if holder.kind == "arbor" else ""
        chosen = faces[name]
        where = f" ({', '.join(chosen.surface)})" if chosen and chosen.surface != ("all",) else ""
        yield name, f"{text}, on {plain(one.covered_mm2, 3)} mm² of the part{where}"
        if one.kind == "plugs":
            yield "plugs", PLUGS


def _flanges(holder: Holder) -> str:
    """Return in words the flanges of an arbor, which mask the part's ends; "" without any."""
    if holder.kind != "arbor" or holder.diameter_mm is None or holder.thickness_mm is None:
        return ""
    ends = "flanges at both ends" if holder.both_sides else "a flange at the end"
    over = f", {plain(holder.grip_mm)} mm over it as a cup" if holder.grip_mm else ""
    size = f"Ø {plain(holder.diameter_mm)} × {plain(holder.thickness_mm)} mm"
    return f", with {ends} of the part, {size}{over}"


def _grip(holder: Holder) -> str:
    """Return in words how much of a collar or plate is round the part, and how it holds.

    The text is empty for other holders.
    """
    if holder.kind not in ("collar", "plate") or not holder.grip_mm:
        return ""
    return f"; {plain(holder.grip_mm)} mm of it round the part, in two halves that clamp it"


def _across(result: Result, one: Opening) -> str:
    """Return in words along which axes an opening of the ceiling is as long as the room."""
    chamber = result.design.chamber
    round_mm = getattr(chamber, "diameter_mm", None)
    sides = tuple(getattr(chamber, key, round_mm) for key in ("length_mm", "width_mm"))
    along = [
        axis
        for axis, side, size in zip("xy", sides, one.size, strict=True)
        if one.wall == CEILING and side is not None and 1e-3 * side - size < EDGE
    ]
    if not along:
        return ""
    axes = " and ".join(along)
    over = f"; along {axes} it is as long as the room: the part goes on over the walls"
    strips = _closing_strips(one, along, sides, clearance_of(result), round_mm)
    if not strips:
        return f"{over} there, and the ceiling is the pieces beside it"
    return f"{over} there, and the ceiling is {strips} of the room, each to go on over the walls"


def _closing_strips(
    one: Opening,
    along: Sequence[str],
    sides: Sequence[float | None],
    clear: float,
    round_mm: float | None,
) -> str:
    """Return in words the sizes of the strips of a ceiling beside an opening; "" without any.

    Args:
        along: the axes along which the opening is as long as the room.
        sides: of the room along x and y [mm].
        clear: clearance round the part [m].
        round_mm: diameter of a round room [mm], whose strips are segments of its circle.
    """
    if len(along) != 1:
        return ""
    k = "xy".index(along[0])
    across, long, words = sides[1 - k], sides[k], []
    if across is None or long is None:
        return ""
    for sign, name in ((-1.0, "−"), (1.0, "+")):
        edge = 1e3 * (sign * one.place[1 - k] + 0.5 * one.size[1 - k] + clear)
        wide = 0.5 * across - edge
        if wide < 1e3 * EDGE:
            continue
        if round_mm is not None:
            long = math.sqrt(max(round_mm**2 - 4.0 * edge**2, 0.0))
        length = f"{plain(round(long, 1))} × {plain(round(wide, 1))}"
        segment = "a segment of " if round_mm is not None else ""
        words.append(f"{segment}{length} mm at {name}{'xy'[1 - k]}")
    kind = "the strips" if len(words) > 1 else "the strip"
    return f"{kind} beside it, which close {' and '.join(words)}" if words else ""


def clearance_of(result: Result) -> float:
    """Return the clearance [m] round a part in the openings through which it goes out."""
    holder = result.design.holder
    return 0.0 if holder is None else holder.clearance


def cut_of(result: Result) -> OpeningCut:
    """Return how the openings through which the part goes out are cut."""
    return opening_cut(1e3 * clearance_of(result), 1e3 * min(result.design.ball_diameters))


def _cut_in_words(result: Result, openings: Sequence[Opening]) -> str:
    """Return in words how closely openings are cut, and how round their inner corners may be."""
    cut, corners = cut_of(result), ""
    if any(one.form == "rectangle" and not one.is_end for one in openings):
        corners = f"; inner corners at most R {plain(cut.corner_mm)} mm, so wire-cut or filed"
    widest = plain(slit_mm(1e3 * min(result.design.ball_diameters)))
    return (
        f"{cut.limits_in_words} mm on the sizes of openings, as balls wedge in gaps above {widest} "
        f"mm, half a ball{corners}"
    )


def lid_in_words(built: AsBuilt) -> str:
    """Return in words how the chamber opens: by its lid, the part, or where its walls are split."""
    openings, mountings = built.openings, built.mountings
    if "split" in mountings:
        return f"the split of its walls; {FILLED}"
    if built.is_ceiling or walls_end_at(openings) is not None:
        return f"the part, which lifts off; {FILLED}"
    if not any(one.wall == CEILING for one in openings):
        return f"the ceiling, which lifts off; {FILLED}"
    if "wall goes over" in mountings:
        return f"the ceiling, which lifts off over the part; {FILLED}"
    return f"the part, or the ceiling with it, which lifts off; {FILLED}"


def opening_in_words(one: Opening, clear: float = 0.0) -> str:
    """Return in words how large an opening is cut, and in which wall.

    Args:
        clear: clearance round the part [m]. Along the part's section it is told beside the outline.
    """
    wall, wider = _wall_of(one), 0.0 if one.form == "other" else 2.0 * clear
    if one.is_end:
        return f"{_side(max(one.size))} mm of {wall}, which ends on the part,"
    if one.form == "round":
        return f"round, Ø {_side(0.5 * sum(one.size) + wider)} mm, in {wall}, its middle"
    size = f"{' × '.join(_side(x + wider) for x in one.size)} mm"
    if one.form == "other":
        size += " without clearance" if clear else ""
        section = "along the part's section" if one.outline is None else "as on the last page"
        return f"{section}, within {size}, in {wall}, its middle"
    return f"{size} in {wall}, its middle"


def _side(length: float) -> str:
    """Return a length or a coordinate [m] in mm as text."""
    return plain(round(1e3 * length, 1) + 0.0)


def place_of(one: Opening, openings: Sequence[Opening]) -> str:
    """Return the middle of an opening [mm] as text.

    Its height is that of the walls where they end on the part, as that is what is built.

    Args:
        openings: all of the same chamber.
    """
    x, y, z = one.place
    end = walls_end_at(openings)
    at_end = end is not None and (one.is_end or one.wall == CEILING)
    return f"({', '.join(map(_side, (x, y, end if at_end and end else z)))})"


def _height_of(one: Opening) -> str:
    """Return in words where the middle of an opening is, from the sonotrode and the room's axis."""
    x, y, z = map(_side, one.place)
    beside = [f"{name} = {at}" for name, at in (("x", x), ("y", y))]
    if one.wall == CEILING:
        return f"at {' and '.join(beside)} mm from the room's axis"
    along = int(abs(one.way[1]) < abs(one.way[0]))
    return f"{z} mm above the sonotrode, at {beside[along]} mm"


def _wall_of(one: Opening) -> str:
    """Return in words in which wall an opening is."""
    level = np.hypot(*one.way[:2]) or 1.0  # walls may lean
    ways = zip("xy", (float(x / level) for x in one.way[:2]), strict=True)
    at = next((f" at {'+−'[x < 0.0]}{axis}" for axis, x in ways if abs(x) > SQUARE), "")
    return one.wall if one.wall == CEILING else f"{one.wall}{at}"


def outlines_in_words(cut: OpeningCut) -> str:
    """Return what the outlines of openings show, with what is cut beyond them."""
    wider, clear = "", cut.clearance_mm
    if clear:
        wider = f": cut it {plain(clear)} mm wider all round, {cut.limits_in_words} on its sizes"
    return (
        f"What the part fills of the wall, seen from outside, without clearance{wider}. Dashed: "
        "where it goes on over an edge of the wall. Small: corners, from the lower left."
    )


def drawn_openings(built: AsBuilt) -> list[tuple[str, Opening]]:
    """Return the openings that are cut along the part's section, each with its place in words."""
    return [
        (f"{_wall_of(one)}, middle\n{_height_of(one)}", one)
        for one in built.openings
        if one.form == "other" and one.outline is not None
    ][:MOST_ROWS]


def _beyond(one: Opening, openings: Sequence[Opening], held: str, mounted: str) -> str:
    """Return in words how far the part stands out of an opening, and how it is held and mounted."""
    if one.beyond < EDGE:
        return f"the part fills it{mounted}"
    farthest = max(other.beyond for other in openings)
    is_held = one.beyond >= min(CLAMPED, farthest) and walls_end_at(openings) is None
    clamp = f": {held}" if is_held else ""
    wider = ""
    if one.wider is not None:
        size = " × ".join(map(_side, one.wider))
        wider = f"; it widens to {size} mm within {plain(1e3 * PLATE)} mm outside"
    if clamp and held == CLAMP and one.beyond < SHORT and len(openings) == 1:
        clamp += ", so make the wall thin there"
    return f"the part stands out by {plain(1e3 * one.beyond, 2)} mm{clamp}{mounted}{wider}"
