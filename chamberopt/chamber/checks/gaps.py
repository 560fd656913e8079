"""Warnings about shapes that keep the shot from the surface, each with a position and a remedy.

Such shapes are gaps in which balls jam, gaps too narrow for a ball, pockets behind a narrow mouth,
hollows sharper than a ball, and level faces and gutters on which balls come to rest.

A ball rests in a gutter between faces with unit normals n1 and n2 into the room if both carry it,
a n1 + b n2 = z with a and b above 0, and their common line is level. With c = n1 n2 that is
a = (n1z - c n2z) / (1 - c²), and b likewise. A ball of radius R touches each face at R / t from
where they would meet, t = sqrt((1 + c) / (1 - c)) the tangent of half the angle between them.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.chamber.build import TARGET, selection_of
from chamberopt.chamber.checks.jams import (
    MAX_COSINE,
    JamGap,
    clusters,
    gaps_in_reach,
    jam_gaps,
    sides_of_gap,
)
from chamberopt.chamber.checks.place_names import (
    CEILING,
    PART,
    PART_SIDES,
    SONOTRODE,
    around,
    mm2,
    one_of,
    surface_names,
)
from chamberopt.chamber.checks.warning import DesignWarning, WarningKind
from chamberopt.chamber.largest_ball import TouchPoints
from chamberopt.chamber.reach import TOLERATED_OVERLAP
from chamberopt.common.number_text import percent, plain
from chamberopt.design.shape_surface import TAG_PART, TAG_SONOTRODE, TAG_WALL
from chamberopt.geometry.triangles import (
    area_vectors,
    connected_pieces,
    sides_of,
    unit_normals,
    unit_vectors,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from chamberopt.chamber.build import Chamber
    from chamberopt.chamber.reach import Reach
    from chamberopt.design.load import Design

MAX_WARNINGS = 4  # of one kind
MIN_MISSED_SHARE = 0.005  # share of the target that is worth a warning

FACING = -0.7  # cosine between normals below which two faces make a gap, not a corner
MIN_FREE = 0.1  # ball diameters: smaller balls are no remedy
NEW_SHAPE, CLOSED = "change the chamber's shape", "close it where it is not to be peened"
Sides = tuple[str, str]  # the surfaces beside a gap


def gap_warnings(
    reach: Reach, chamber: Chamber, diameters: Sequence[float], turns: bool = False
) -> list[DesignWarning]:
    """Return warnings about gaps in which balls jam, and about narrower ones, by size.

    Args:
        diameters: those of the balls [m].
        turns: True if the part turns, so that a ball may be jammed beside it.
    """
    gaps, largest = gaps_in_reach(reach), max(diameters)
    jams = [(size, gap) for size in sorted(set(diameters)) for gap in jam_gaps(chamber, size, gaps)]
    jammed = np.unique(np.concatenate([gap.rows for _, gap in jams] or [np.zeros(0, dtype=int)]))
    inside = np.flatnonzero(np.isfinite(gaps.width) & (reach.touches.radius < 0.5 * largest))
    names = surface_names(chamber)
    narrow: dict[Sides, list[TouchPoints]] = {}
    for members in clusters(reach.touches.centre[inside], 2.0 * reach.spacing):
        gap = reach.touches.select(inside[members])
        in_jam = np.isin(inside[members], jammed).any()
        if gap.area.sum() > (0.5 * largest) ** 2 and not in_jam:
            narrow.setdefault(sides_of_gap(gap, names), []).append(gap)
    largest_first = sorted(narrow, key=lambda one: -sum(gap.area.sum() for gap in narrow[one]))
    return _jam_warnings(jams) + [
        _narrow_warning(sides, narrow[sides], reach.diameter, largest, turns)
        for sides in largest_first[:MAX_WARNINGS]
    ]


def pocket_warnings(reach: Reach, chamber: Chamber) -> list[DesignWarning]:
    """Return warnings about pockets that could hold a ball but let none in, largest areas first."""
    touches, closed = reach.touches, reach.fits & ~reach.reached
    target = chamber.on_target[touches.triangle]
    found: list[tuple[float, DesignWarning]] = []
    for region in np.unique(reach.region[closed]):
        own = closed & (reach.region == region)
        is_room = region < len(reach.region_volume) and reach.region_volume[region] > 0.0
        if is_room and _in_cavity(reach, touches.centre[own]).any():
            in_target = float(touches.area[own & target].sum())
            loss = f", though {mm2(in_target)} of the target are in it" if in_target else ""
            text = (
                f"a pocket around {around(touches.point[own], touches.area[own])} in the "
                "chamber's frame would hold a "
                f"ball of {1e3 * reach.diameter:g} mm but has no way in for one{loss}; widen its "
                "mouth, close it, or use smaller balls"
            )
            names = np.unique(surface_names(chamber)[touches.triangle[own]])
            beside = {PART if name in PART_SIDES else name for name in names}
            one = DesignWarning(WarningKind.POCKET, text, tuple(sorted(beside)))
            found.append((float(touches.area[own].sum()), one))
    return [one for _, one in sorted(found, key=lambda each: -each[0])[:MAX_WARNINGS]]


def _in_cavity(reach: Reach, places: np.ndarray) -> np.ndarray:
    """Mark the places (n, 3) [m] in the cavity, of some that are near its surface.

    A ball may reach into a surface a little, so that beside a crease in which two surfaces nearly
    meet one seems to fit on their other side, in the part.
    """
    from sim_core import closest_points

    found = closest_points(reach.mesh, places, 2.0 * reach.diameter)
    outward = area_vectors(reach.mesh.vertices, reach.mesh.triangles)[found.triangle]
    return np.asarray(np.einsum("ij,ij->i", places - found.point, outward) < 0.0)


def surface_warnings(
    reach: Reach, chamber: Chamber, name: str = TARGET, only_reachable: bool = False
) -> list[DesignWarning]:
    """Return a warning if no ball can touch some of the target, however long it is peened.

    Args:
        chamber: the chamber with the named surface as its target.
        name: the surface, for the message: "the target" or "zone NAME".
        only_reachable: true if the design takes only the reachable surface for the target.
    """
    if name == TARGET and only_reachable:
        return []  # triangles that are touched by halves are left
    touches = reach.touches
    own = chamber.on_target[touches.triangle]
    whole, missed = float(touches.area[own].sum()), own & ~reach.reached
    left = float(touches.area[missed].sum())
    if not whole or left < MIN_MISSED_SHARE * whole:
        return []
    sharp = own & ~reach.fits
    place = one_of(touches.point[missed], touches.area[missed])
    remedy, where = f"narrow {selection_of(name)}", ""
    if name == TARGET:
        remedy += ", or set part.target.reachable = true"
    if touches.area[sharp].sum() > 0.5 * left:
        order = np.argsort(touches.radius[own])
        second_half = np.cumsum(touches.area[own][order]) > 0.5 * left
        diameter_mm = 2e3 * float(touches.radius[own][order][np.argmax(second_half)])
        remedy = f"balls of {diameter_mm:.2g} mm would fit half of that; or {remedy}"
        faces = touches.area[sharp & (touches.cosine < FACING)].sum()
        what = "gaps" if faces > 0.5 * touches.area[sharp].sum() else "corners or fillets"
        where = f", most of it in {what} narrower than a ball"
    text = (
        f"{left / whole:.1%} of {name} in the chamber ({mm2(left)}{where}) cannot be touched by a "
        f"ball of {1e3 * reach.diameter:g} mm, however long it is peened: e.g. at {place} in the "
        f"chamber's frame; {remedy}"
    )
    return [DesignWarning(WarningKind.UNTOUCHED, text, (name,))]


def _jam_warnings(jams: list[tuple[float, JamGap]]) -> list[DesignWarning]:
    """Return warnings about gaps in which balls jam, one for all between the same two surfaces.

    Args:
        jams: diameter of the balls [m], and the gap.
    """
    kinds: dict[tuple[float, Sides], list[JamGap]] = {}
    for diameter, gap in jams:
        kinds.setdefault((diameter, gap.sides), []).append(gap)
    first = sorted(kinds, key=lambda kind: -sum(gap.area for gap in kinds[kind]))[:MAX_WARNINGS]
    return [_jam_warning(diameter, kinds[diameter, sides]) for diameter, sides in first]


def _jam_warning(diameter: float, gaps: list[JamGap]) -> DesignWarning:
    """Return one warning about all gaps between the same surfaces in which such balls [m] jam."""
    low, high = min(gap.width[0] for gap in gaps), max(gap.width[1] for gap in gaps)
    share = sum(gap.target_share for gap in gaps)
    target = f", on {percent(share)} of the target" if share else ""
    below, above = min(gap.free_below for gap in gaps), max(gap.free_above for gap in gaps)
    ends = [
        f"below {math.floor(1e5 * below) / 100:g} mm" * (below > MIN_FREE * diameter),
        f"above {math.ceil(1e5 * above) / 100:g} mm" if math.isfinite(above) else "",
    ]
    free = " or ".join(end for end in ends if end)
    remedy = f"use balls {free}, or " if free else ""
    sides = gaps[0].sides
    text = (
        f"balls of {1e3 * diameter:g} mm can jam in {_where(sides, len(gaps))} at "
        f"{around(gaps[0].place[None])} in the chamber's frame, {_width(low, high)} wide there"
        f"{target}; {remedy}{_change(set(sides))}"
    )
    return DesignWarning(WarningKind.JAM, text, sides)


def _narrow_warning(
    sides: Sides, gaps: list[TouchPoints], smallest: float, largest: float, turns: bool
) -> DesignWarning:
    """Return one warning about all narrow gaps between the same two surfaces.

    Args:
        sides: names of both surfaces.
        smallest, largest: diameters of the balls [m].
        turns: True if the part turns.
    """
    biggest = max(gaps, key=lambda gap: gap.area.sum())
    radius = np.concatenate([gap.radius for gap in gaps])
    low, high = (
        max(0.0, 2.0 * end - TOLERATED_OVERLAP * 0.5 * smallest)
        for end in (radius.min(), radius.max())
    )
    where = f"at {one_of(biggest.centre, biggest.area)} in the chamber's frame"
    balls = "no ball gets" if high < smallest else "only the smaller balls get"
    ball = f"a ball of {1e3 * largest:g} mm"
    jam = ", or one may be jammed as the part turns" * (turns and not PART_SIDES.isdisjoint(sides))
    change = _change(set(sides))
    if change in (NEW_SHAPE, CLOSED):
        change += ", or use smaller balls"
    text = (
        f"{_where(sides, len(gaps))} {where} is {_width(low, high)} wide, narrower than {ball}: "
        f"{balls} in there{jam}; {change}"
    )
    return DesignWarning(WarningKind.NARROW_GAP, text, sides)


def _where(sides: Sides, count: int) -> str:
    one, two = sides
    between = f"between {one} and {two}" if one != two else f"of {one}"
    return f"the gap {between}" if count == 1 else f"each of {count} gaps {between}, one"


def _width(low: float, high: float) -> str:
    """Return the widths [m] of a gap as text."""
    one, two = (f"{1e3 * width:.3g}" for width in (low, high))
    return f"{one} to {two} mm" if low < 0.98 * high else f"{two} mm"


def _change(sides: set[str]) -> str:
    """Return what to change of the chamber so that a gap between these surfaces is no more."""
    for name in ("holder", "mask"):
        if f"the {name}" in sides:
            return f"change [{name}] or close the gap"
    if not sides & PART_SIDES:
        return NEW_SHAPE
    if SONOTRODE in sides:
        return "raise chamber.sonotrode_distance_mm"
    if CEILING in sides:
        return "raise the ceiling or close the gap"
    if sides <= PART_SIDES:
        return CLOSED
    return "enlarge the chamber, check part.offset_mm, or close the gap"


HEIGHT_TOLERANCE = 1e-9  # m: corners are level if their heights differ by less
FEW = 0.05  # share of the balls that may find room on part, holder or mask without a warning
AREA_TOLERANCE = 1e-6  # share of a triangle's area: a smaller upward component is rounding
REMEDY = {
    "part": "turn it (effects.part_turn), tilt it (part.rotate_deg), or lower chamber.{key} to "
    "its top side",
    "wall": "make it slope towards the sonotrode",
    "holder": "let it go up to the ceiling: leave out holder.thickness_mm",
    "mask": "mask.axis = [0, 0, 1] closes the room above it",
}


class Ledge(NamedTuple):
    """Surfaces of the part or of a wall that face up, so that balls can come to rest on them."""

    name: str  # such as "the part"
    message: str
    level: bool  # true if enough of the surface is level for a ball to lie on


def find_ledges(
    design: Design, chamber: Chamber, turned_down: np.ndarray | None = None
) -> list[Ledge]:
    """Return the surfaces of part and wall on which balls can come to rest, each with a message.

    These surfaces face up, and neither vibrate nor turn.

    Args:
        turned_down: marks the part's triangles that face down in another step, (m,). Balls on them
            do no harm: they fall off then, and the shot meets what lay under them.
    """
    from sim_core import Rest

    if not design.effects.gravity:
        return []
    normal = -area_vectors(chamber.vertices, chamber.triangles)  # towards the shot
    area = np.linalg.norm(normal, axis=1)
    upward = normal[:, 2] > AREA_TOLERANCE * area
    downward = normal[:, 2] < -AREA_TOLERANCE * area
    flat = upward & (np.hypot(normal[:, 0], normal[:, 1]) <= Rest().resistance * normal[:, 2])
    shot = design.shot
    cross_section = np.pi / 4.0 * shot.diameter**2
    found = []
    still = {name: chamber.on_fixture(name) for name in chamber.fixtures}
    wall = chamber.tags == TAG_WALL
    for own in still.values():
        wall &= ~own
    if design.effects.part_turn is None:
        of_part = chamber.tags == TAG_PART
        if turned_down is not None:
            of_part[of_part] = ~turned_down[chamber.source[of_part]]
        still = {"part": of_part, **still}
    for name, own in {**still, "wall": wall}.items():
        faces = upward & own
        if not faces.any():
            continue
        few = 0.0 if name == "wall" else FEW * shot.count * shot.diameter**2
        level = bool(area[faces & flat].sum() >= max(cross_section, few))
        # balls do not roll off these faces
        shown = faces & flat if level else faces & _in_hollows(chamber, upward, downward)
        if not shown.any():
            continue
        where = "on" if level else "in hollows of"
        extent = "of it are level" if level else "face up, none level"
        corners = chamber.vertices[chamber.triangles[shown]]
        low, high = 1e3 * corners[..., 2].min(), 1e3 * corners[..., 2].max()
        heights = f"{low:.4g} mm" if high - low < 0.01 else f"{low:.4g} to {high:.4g} mm"
        message = (
            f"balls can come to rest {where} the {name}, which neither vibrates nor turns: "
            f"{mm2(area[shown].sum())} {extent}, around "
            f"{around(corners.mean(axis=1), area[shown])} in the chamber's frame, "
            f"at z = {heights}; "
            f"{REMEDY[name].format(key=design.chamber.ceiling_key)}"
        )
        found.append(Ledge(f"the {name}", message, level))
    return found


def resting_on_holder(design: Design, chamber: Chamber) -> int:
    """Return how many balls have room on level places of the holder, as on a collar that is low.

    Few of them, of which there is no warning, still are no longer part of the shot. There are none
    on an arbor, which is round, nor on what turns.
    """
    from sim_core import Rest

    holder, turns = design.holder, design.effects.part_turn is not None
    if not design.effects.gravity or turns or "holder" not in chamber.fixtures:
        return 0
    if holder is not None and holder.kind == "arbor":
        return 0
    normal = -area_vectors(chamber.vertices, chamber.triangles)[chamber.on_fixture("holder")]
    flat = np.hypot(normal[:, 0], normal[:, 1]) <= Rest().resistance * normal[:, 2]
    area = float(np.linalg.norm(normal[flat & (normal[:, 2] > 0.0)], axis=1).sum())
    return int(area / design.shot.diameter**2)


# Of a gutter: balls up to so many times as large show where it is; least share of a ball's weight
# on each of its faces, as on a wall beside a face that falls to it by a degree; steepest slope.
GUTTER_BALLS, CARRIED, LEVEL_LINE = 1.3, 0.02, 0.02


def gutter_warnings(
    design: Design, chamber: Chamber, reach: Reach, turned_down: np.ndarray | None = None
) -> list[DesignWarning]:
    """Return a warning if balls can come to rest between the part and a wall beside it.

    Args:
        turned_down: as of `find_ledges`.
    """
    shot, touches = design.shot, reach.touches
    if not design.effects.gravity or design.effects.part_turn is not None:
        return []
    of_part = chamber.tags == TAG_PART
    wall = ~of_part & (chamber.tags != TAG_SONOTRODE)
    if turned_down is not None:
        of_part[of_part] = ~turned_down[chamber.source[of_part]]
    radius = 0.5 * shot.diameter
    between = of_part[touches.triangle] & wall[touches.obstacle] & (touches.obstacle >= 0)
    between &= reach.reached & (touches.cosine > MAX_COSINE) & (touches.cosine < 0.0)
    between &= (touches.radius >= radius) & (touches.radius < GUTTER_BALLS * radius)
    rows = np.flatnonzero(between)
    corners = chamber.vertices[chamber.triangles[touches.obstacle[rows]]]
    one, two, cosine = touches.normal[rows], -unit_normals(corners), touches.cosine[rows]
    carried = np.minimum(one[:, 2] - cosine * two[:, 2], two[:, 2] - cosine * one[:, 2])
    line = unit_vectors(np.cross(one, two))[:, 2]
    rests = (carried > CARRIED * (1.0 - cosine**2)) & (np.abs(line) < LEVEL_LINE)
    rows, cosine = rows[rests], cosine[rests]
    wide = (GUTTER_BALLS - 1.0) * radius * np.sqrt((1.0 - cosine) / (1.0 + cosine))
    length = float((touches.area[rows] / wide).sum())
    if length < max(1.0, FEW * shot.count) * shot.diameter:
        return []
    name = surface_names(chamber)[touches.obstacle[rows[0]]]
    text = (
        f"balls can come to rest on the part in the gutter between it and {name}, where both fall "
        f"towards each other: about {plain(1e3 * length, 2)} mm long, one place at "
        f"{one_of(touches.centre[rows], touches.area[rows])} in the chamber's frame; lower the "
        "ceiling to it, turn the part (part.rotate_deg), or move the wall away from its slope"
    )
    return [DesignWarning(WarningKind.REST, text, (PART, name))]


def _in_hollows(chamber: Chamber, upward: np.ndarray, downward: np.ndarray) -> np.ndarray:
    """Mark the triangles (k,) that face up at the bottom of a hollow, from where all ways lead up.

    A wall that leans out is not a hollow: its lowest points are on the sonotrode. A face beside a
    downward face is not a hollow either, because a ball falls off there.
    """
    count, height = len(chamber.vertices), chamber.vertices[:, 2]
    one, two = sides_of(chamber.triangles).T
    level = np.abs(height[one] - height[two]) <= HEIGHT_TOLERANCE
    plateau = connected_pieces(one[level], two[level], count)[1]
    bottom = np.ones(plateau.max() + 1, dtype=bool)
    # Every edge occurs in both directions, so one comparison finds all lower neighbours.
    bottom[plateau[one[height[two] < height[one] - HEIGHT_TOLERANCE]]] = False
    bottom[plateau[chamber.triangles[downward | (chamber.tags == TAG_SONOTRODE)]]] = False
    return np.asarray(upward & bottom[plateau[chamber.triangles]].any(axis=1))
