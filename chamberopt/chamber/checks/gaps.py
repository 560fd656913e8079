"""What keeps the shot from the surface: gaps too narrow for a ball or wedges that hold one, pockets behind a narrow
mouth, hollows sharper than a ball; each in a sentence with its place and what to do.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from chamberopt.chamber.checks.place_names import (
    CEILING,
    SONOTRODE,
    around,
    mm2,
    on_target,
    one_of,
    surface_names,
)
from chamberopt.chamber.reach.largest_ball import Touches
from chamberopt.chamber.reach.reach import FORGIVEN

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.chamber.reach.reach import Reach

# Two faces hold a ball by friction, however hard it is pushed in, if half the angle between them has a tangent below
# the coefficient, here that of dry steel: then they count as facing each other. Hollows that open wider are roots.
FRICTION = 0.3
FACING = -(1.0 - FRICTION**2) / (1.0 + FRICTION**2)  # cosine between their normals
PASSING = 0.1  # a width that goes through the ball's diameter is seen this near to it on both sides
MOST_SAID = 4
COMPLETE = 0.995  # share of the target beyond which what is left is not worth a word


def gap_warnings(reach: Reach, chamber: Chamber, largest: float, turns: bool = False) -> list[str]:
    """Gaps narrower than a ball, those of most area first; ``largest`` [m]: diameter of the largest ball; ``turns``:
    the part does.
    """
    found = reach.touches
    facing = (found.against >= 0) & (found.opposite < FACING)
    narrow = facing & (found.radius < 0.5 * largest)
    entrance = found.only(
        facing & reach.reached & ~narrow & (found.radius < 0.5 * (1.0 + PASSING) * largest)
    ).centre
    inside, names = found.only(narrow), surface_names(chamber)
    alike: dict[tuple[str, str, bool], list[Touches]] = {}
    for members in _clusters(inside.centre, 2.0 * reach.spacing):
        gap = inside.only(members)
        if gap.area.sum() > (0.5 * largest) ** 2:
            wedge = _meets(gap, entrance, largest, 2.0 * reach.spacing)
            alike.setdefault((*_sides(gap, names), wedge), []).append(gap)
    largest_first = sorted(alike.items(), key=lambda item: -sum(gap.area.sum() for gap in item[1]))[
        :MOST_SAID
    ]
    return [_said(*kind, gaps, reach.diameter, largest, turns) for kind, gaps in largest_first]


def pocket_warnings(reach: Reach, chamber: Chamber) -> list[str]:
    """Rooms that would hold a ball but that none gets into, those of most area first."""
    found, shut = reach.touches, reach.fits & ~reach.reached
    target = on_target(chamber)[found.triangle]
    said = []
    for room in np.unique(reach.room[shut]):
        own = shut & (reach.room == room)
        area, wanted = float(found.area[own].sum()), float(found.area[own & target].sum())
        if room < len(reach.room_volume) and reach.room_volume[room] > 0.0:
            much = f", though {mm2(wanted)} of the target are in it" if wanted else ""
            said.append(
                (
                    area,
                    f"a pocket around {around(found.point[own], found.area[own])} would hold a ball of "
                    f"{1e3 * reach.diameter:g} mm but has no way in for one{much}; widen its mouth, close it, or use "
                    "smaller balls",
                )
            )
    return [text for _, text in sorted(said, key=lambda one: -one[0])[:MOST_SAID]]


def target_warnings(reach: Reach, chamber: Chamber, only_reachable: bool = False) -> list[str]:
    """What of the target no process could cover, as no ball can touch it; ``only_reachable``: as part.target says."""
    found = reach.touches
    own = on_target(chamber)[found.triangle]
    whole, missed = float(found.area[own].sum()), own & ~reach.reached
    left = float(found.area[missed].sum())
    if not whole or left < (1.0 - COMPLETE) * whole:
        return []
    sharp = own & ~reach.fits
    place = one_of(found.point[missed], found.area[missed])
    remedy = "narrow [part.target]" + (
        "" if only_reachable else ", or set part.target.reachable = true"
    )
    if found.area[sharp].sum() > 0.5 * left:
        order = np.argsort(found.radius[own])
        beyond = np.cumsum(found.area[own][order]) > 0.5 * left
        fitting = 2e3 * float(found.radius[own][order][np.argmax(beyond)])
        remedy = f"balls of {fitting:.2g} mm would fit half of that; or {remedy}"
    return [
        f"{left / whole:.1%} of the target in the chamber ({mm2(left)}) cannot be touched by a ball of "
        f"{1e3 * reach.diameter:g} mm, whatever the process: e.g. at {place}; {remedy}"
    ]


def _clusters(centre: np.ndarray, near: float) -> list[np.ndarray]:
    """Members of each group of places that hang together in steps of ``near`` [m]."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    if not len(centre):
        return []
    pairs = KDTree(centre).query_pairs(near, output_type="ndarray")
    links = coo_array((np.ones(len(pairs), dtype=bool), tuple(pairs.T)), shape=(len(centre),) * 2)
    label = connected_components(links, directed=False)[1]
    order = np.argsort(label, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(label[order])) + 1)


def _meets(gap: Touches, entrance: np.ndarray, largest: float, near: float) -> bool:
    """Whether the gap begins as wide as a ball where one can come from, and narrows steadily from there."""
    from scipy.spatial import KDTree

    begins = gap.centre[gap.radius > 0.5 * (1.0 - PASSING) * largest]
    return bool(len(begins) and len(entrance) and KDTree(entrance).query(begins)[0].min() < near)


def _sides(gap: Touches, names: np.ndarray) -> tuple[str, str]:
    """The two surfaces that most of a gap lies between."""
    pairs = np.sort(np.c_[names[gap.triangle], names[gap.against]].astype(str), axis=1)
    sides, counts = np.unique(pairs, axis=0, return_counts=True)
    one, two = sides[counts.argmax()]
    return str(one), str(two)


def _said(
    one: str,
    two: str,
    wedge: bool,
    gaps: list[Touches],
    smallest: float,
    largest: float,
    turns: bool,
) -> str:
    """One sentence on gaps of a kind."""
    biggest = max(gaps, key=lambda gap: gap.area.sum())
    radius = np.concatenate([gap.radius for gap in gaps])
    low, high = (
        max(0.0, 1e3 * (2.0 * end - FORGIVEN * 0.5 * smallest))
        for end in (radius.min(), radius.max())
    )
    between = f"between {one} and {two}" if one != two else f"of {one}"
    where = f"at {one_of(biggest.centre, biggest.area)}"
    what = (
        f"the gap {between} {where}"
        if len(gaps) == 1
        else f"each of {len(gaps)} gaps {between}, one {where},"
    )
    ball = f"a ball of {1e3 * largest:g} mm"
    if wedge:
        caught = f"narrows from more than {ball} to {low:.3g} mm, so gently that friction holds it: it can wedge there"
    else:
        wide = f"{low:.3g} to {high:.3g}" if low < 0.98 * high else f"{high:.3g}"
        caught = f"is {wide} mm wide, narrower than {ball}: {_kept_out(high, smallest)}"
        if turns and "part" in one + two:
            caught += ", or one may be jammed as the part turns"
    return f"{what} {caught}; {_remedy({one, two})}"


def _kept_out(width_mm: float, smallest: float) -> str:
    return (
        "no ball gets in there"
        if width_mm < 1e3 * smallest
        else "only the smaller balls get in there"
    )


def _remedy(sides: set[str]) -> str:
    of_part = any("part" in side for side in sides)
    if of_part and SONOTRODE in sides:
        return "raise chamber.sonotrode_distance_mm"
    if of_part and CEILING in sides:
        return "raise chamber.height_mm or close the gap"
    if all("part" in side for side in sides):
        return "use smaller balls, or close it where it is not to be peened"
    if of_part:
        return "enlarge the chamber, check part.offset_mm, or close the gap"
    return "change the chamber's shape, or use smaller balls"
