"""Warnings about shapes that keep the shot from the surface, each with a position and a remedy.

Such shapes are gaps too narrow for a ball, wedges that hold a ball, pockets behind a narrow mouth,
and hollows sharper than a ball.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.chamber.build import TARGET, selection_of
from chamberopt.chamber.checks.place_names import (
    CEILING,
    SONOTRODE,
    around,
    mm2,
    one_of,
    surface_names,
)
from chamberopt.chamber.largest_ball import TouchPoints
from chamberopt.chamber.reach import TOLERATED_OVERLAP
from chamberopt.design.shape_surface import TAG_PART, TAG_SONOTRODE, TAG_WALL
from chamberopt.geometry.triangles import area_vectors, connected_pieces, sides_of

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.chamber.reach import Reach
    from chamberopt.design.load import Design

# Two faces hold a ball by friction, however hard it is pushed in, if the tangent of half the angle
# between them is below the coefficient of friction, here the value of dry steel. Such faces count
# as facing each other. Hollows that open wider count as roots.
FRICTION = 0.3
MAX_COSINE = -(1.0 - FRICTION**2) / (1.0 + FRICTION**2)  # between the normals of facing faces
WIDTH_TOLERANCE = 0.1  # share of the ball's diameter within which a gap is as wide as the ball
MAX_WARNINGS = 4  # of one kind
MIN_MISSED_SHARE = 0.005  # share of the target that is worth a warning

# The two surfaces beside a gap, and true if a ball can wedge in the gap.
GapKind = tuple[str, str, bool]


def gap_warnings(reach: Reach, chamber: Chamber, largest: float, turns: bool = False) -> list[str]:
    """Return warnings about gaps narrower than the largest ball, the largest areas first.

    Args:
        largest: diameter of the largest ball [m].
        turns: True if the part turns, so that a ball may be jammed beside it.
    """
    touches = reach.touches
    facing = (touches.obstacle >= 0) & (touches.cosine < MAX_COSINE)
    narrow = facing & (touches.radius < 0.5 * largest)
    almost_narrow = touches.radius < 0.5 * (1.0 + WIDTH_TOLERANCE) * largest
    entrance = touches.select(facing & reach.reached & ~narrow & almost_narrow).centre
    inside, names = touches.select(narrow), surface_names(chamber)
    gaps: dict[GapKind, list[TouchPoints]] = {}
    for members in _clusters(inside.centre, 2.0 * reach.spacing):
        gap = inside.select(members)
        if gap.area.sum() > (0.5 * largest) ** 2:
            pairs = np.sort(np.c_[names[gap.triangle], names[gap.obstacle]].astype(str), axis=1)
            sides, counts = np.unique(pairs, axis=0, return_counts=True)
            one, two = map(str, sides[counts.argmax()])  # the surfaces beside most of the gap
            wedge = _is_wedge(gap, entrance, largest, 2.0 * reach.spacing)
            gaps.setdefault((one, two, wedge), []).append(gap)
    kinds = sorted(gaps, key=lambda kind: -sum(gap.area.sum() for gap in gaps[kind]))[:MAX_WARNINGS]
    return [_gap_warning(kind, gaps[kind], reach.diameter, largest, turns) for kind in kinds]


def pocket_warnings(reach: Reach, chamber: Chamber) -> list[str]:
    """Return warnings about pockets that could hold a ball but let none in, largest areas first."""
    touches, closed = reach.touches, reach.fits & ~reach.reached
    target = chamber.on_target[touches.triangle]
    found: list[tuple[float, str]] = []
    for region in np.unique(reach.region[closed]):
        own = closed & (reach.region == region)
        if region < len(reach.region_volume) and reach.region_volume[region] > 0.0:
            in_target = float(touches.area[own & target].sum())
            loss = f", though {mm2(in_target)} of the target are in it" if in_target else ""
            text = (
                f"a pocket around {around(touches.point[own], touches.area[own])} in the "
                "chamber's frame would hold a "
                f"ball of {1e3 * reach.diameter:g} mm but has no way in for one{loss}; widen its "
                "mouth, close it, or use smaller balls"
            )
            found.append((float(touches.area[own].sum()), text))
    return [text for _, text in sorted(found, key=lambda one: -one[0])[:MAX_WARNINGS]]


def surface_warnings(
    reach: Reach, chamber: Chamber, name: str = TARGET, only_reachable: bool = False
) -> list[str]:
    """Return a warning if no ball can touch some of the target, however long it is peened.

    Args:
        chamber: the chamber with the named surface as its target.
        name: the surface, for the message: "the target" or "zone NAME".
        only_reachable: true if the design takes only the reachable surface for the target.
    """
    touches = reach.touches
    own = chamber.on_target[touches.triangle]
    whole, missed = float(touches.area[own].sum()), own & ~reach.reached
    left = float(touches.area[missed].sum())
    if not whole or left < MIN_MISSED_SHARE * whole:
        return []
    sharp = own & ~reach.fits
    place = one_of(touches.point[missed], touches.area[missed])
    remedy = f"narrow {selection_of(name)}"
    if name == TARGET and not only_reachable:
        remedy += ", or set part.target.reachable = true"
    if touches.area[sharp].sum() > 0.5 * left:
        order = np.argsort(touches.radius[own])
        second_half = np.cumsum(touches.area[own][order]) > 0.5 * left
        diameter_mm = 2e3 * float(touches.radius[own][order][np.argmax(second_half)])
        remedy = f"balls of {diameter_mm:.2g} mm would fit half of that; or {remedy}"
    return [
        f"{left / whole:.1%} of {name} in the chamber ({mm2(left)}) cannot be touched by a "
        f"ball of {1e3 * reach.diameter:g} mm, however long it is peened: e.g. at {place} in "
        f"the chamber's frame; {remedy}"
    ]


def _clusters(centre: np.ndarray, near: float) -> list[np.ndarray]:
    """Return the indices of the points in each group whose points are linked by steps of at most
    ``near`` [m].

    Args:
        centre: the points [m], (n, 3).
    """
    from scipy.spatial import KDTree

    if not len(centre):
        return []
    one, two = KDTree(centre).query_pairs(near, output_type="ndarray").T
    label = connected_pieces(one, two, len(centre))[1]
    order = np.argsort(label, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(label[order])) + 1)


def _is_wedge(gap: TouchPoints, entrance: np.ndarray, largest: float, near: float) -> bool:
    """True if a gap narrows steadily from an entrance as wide as a ball, which balls reach.

    Args:
        entrance: centres (n, 3) [m] of reached balls in gaps slightly wider than the largest ball.
        largest: diameter of the largest ball [m].
        near: largest distance from the gap to its entrance [m].
    """
    from scipy.spatial import KDTree

    begins = gap.centre[gap.radius > 0.5 * (1.0 - WIDTH_TOLERANCE) * largest]
    return bool(len(begins) and len(entrance) and KDTree(entrance).query(begins)[0].min() < near)


def _gap_warning(
    kind: GapKind, gaps: list[TouchPoints], smallest: float, largest: float, turns: bool
) -> str:
    """Return one warning about all gaps between the same two surfaces.

    Args:
        kind: names of both surfaces, and True if a ball can wedge in the gap.
        smallest, largest: diameters of the balls [m].
        turns: True if the part turns.
    """
    one, two, wedge = kind
    biggest = max(gaps, key=lambda gap: gap.area.sum())
    radius = np.concatenate([gap.radius for gap in gaps])
    low, high = (
        max(0.0, 1e3 * (2.0 * end - TOLERATED_OVERLAP * 0.5 * smallest))
        for end in (radius.min(), radius.max())
    )
    between = f"between {one} and {two}" if one != two else f"of {one}"
    where = f"at {one_of(biggest.centre, biggest.area)} in the chamber's frame"
    what = (
        f"the gap {between} {where}"
        if len(gaps) == 1
        else f"each of {len(gaps)} gaps {between}, one {where},"
    )
    ball = f"a ball of {1e3 * largest:g} mm"
    if wedge:
        fault = (
            f"narrows from more than {ball} to {low:.3g} mm, so gently that friction holds it: it "
            "can wedge there"
        )
    else:
        width = f"{low:.3g} to {high:.3g}" if low < 0.98 * high else f"{high:.3g}"
        balls = "no ball gets" if high < 1e3 * smallest else "only the smaller balls get"
        fault = f"is {width} mm wide, narrower than {ball}: {balls} in there"
        if turns and "part" in one + two:
            fault += ", or one may be jammed as the part turns"
    return f"{what} {fault}; {_remedy({one, two})}"


def _remedy(sides: set[str]) -> str:
    if not any("part" in side for side in sides):
        return "change the chamber's shape, or use smaller balls"
    if SONOTRODE in sides:
        return "raise chamber.sonotrode_distance_mm"
    if CEILING in sides:
        return "raise the ceiling or close the gap"
    if all("part" in side for side in sides):
        return "use smaller balls, or close it where it is not to be peened"
    return "enlarge the chamber, check part.offset_mm, or close the gap"


HEIGHT_TOLERANCE = 1e-9  # m: corners are level if their heights differ by less
AREA_TOLERANCE = 1e-6  # share of a triangle's area: a smaller upward component is rounding
REMEDY = {
    TAG_PART: "turn it (effects.part_turn), tilt it (part.rotate_deg), or lower chamber.{key} to "
    "its top side",
    TAG_WALL: "make it slope towards the sonotrode",
}


class Ledge(NamedTuple):
    """Surfaces of the part or of the wall that face up, so that balls can come to rest on them."""

    message: str
    level: bool  # true if enough of the surface is level for a ball to lie on


def find_ledges(design: Design, chamber: Chamber) -> list[Ledge]:
    """Return the surfaces of part and wall on which balls can come to rest, each with a message.

    These surfaces face up, and neither vibrate nor turn.
    """
    from sim_core import Rest

    if not design.effects.gravity:
        return []
    normal = -area_vectors(chamber.vertices, chamber.triangles)  # towards the shot
    area = np.linalg.norm(normal, axis=1)
    upward = normal[:, 2] > AREA_TOLERANCE * area
    downward = normal[:, 2] < -AREA_TOLERANCE * area
    flat = upward & (np.hypot(normal[:, 0], normal[:, 1]) <= Rest().resistance * normal[:, 2])
    cross_section = np.pi / 4.0 * design.shot.diameter**2
    found = []
    for tag, name in ((TAG_PART, "part"), (TAG_WALL, "wall")):
        faces = upward & (chamber.tags == tag)
        if not faces.any() or (tag == TAG_PART and design.effects.part_turn is not None):
            continue
        level = bool(area[faces & flat].sum() >= cross_section)
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
            f"{REMEDY[tag].format(key=design.chamber.ceiling_key)}"
        )
        found.append(Ledge(message, level))
    return found


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
