"""Propose balls by the rules by which `check` warns: of fillets, slots and gaps in which they jam.

A ball of the diameter d serves a place of the target if it touches it, if it does not lie in a
fillet of less than 2 d radius (OF_FILLET) nor in a slot of less than 4 d (OF_SLOT), and if it is
not held there by a gap of 0.9 d to 1.15 d (JAM_BAND). A smaller ball serves all that a larger one
serves, but for gaps in which it jams: so a mix of two sizes serves no more than the better of them.
A gap has a tolerance: a size whose jam band is reached within it gives way to one that serves
nearly as much (NEARLY).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from chamberopt.chamber.checks.fillets import AS_DRAWN, OF_FILLET, OF_SLOT, inner_edges, too_narrow
from chamberopt.chamber.checks.jams import JAM_BAND, MAX_COSINE, MIN_AREA
from chamberopt.chamber.checks.usual import DEEPEST
from chamberopt.chamber.largest_ball import spread_points
from chamberopt.chamber.matters import MatterKind
from chamberopt.chamber.part import Part
from chamberopt.chamber.reach import TOLERATED_OVERLAP
from chamberopt.geometry.thickness import depth_below
from chamberopt.geometry.triangles import areas, interpolate, unit_vectors

POINTS = 8_000  # on the target, and as many on the rest of the part
MISSED = 0.05  # share of the target's area that a larger ball may fail to touch
AS_GOOD = 0.05  # share of the target's area within which two sizes serve alike
# Fillets are where parts fail, whatever share of the area they are. From this share on they count,
# which no noise of facets reaches; and a size may fail to touch so much of them.
LEAST_FILLETS, MISSED_FILLETS = 0.005, 0.1
# Share of the target that balls serve which an intensity takes, by heart: what geometry tells
# is sure, and an intensity that is not calibrated is known to a factor of 2.5.
MOSTLY = 0.85
# Share of the target, and of its narrow fillets, that balls touch which an intensity takes though
# they are larger than the rules of fillets and slots allow: these are of thumb, reach is known.
REACHED = 0.98
# Balls in the charge: of sizes that need more, the largest is taken that serves as well. Thousands
# of small balls make weak dents, are hard to get back from a chamber, and are slow to simulate.
MANY = 3000
THIN_SHARE = 0.05  # of a target that may be thin
OF_THIN = 1.5  # diameter of the largest balls over that depth, by heart
# How far a gap may be off its width, as of coils or a slot: over the width, and at most [m], which
# is that of ISO 2768-m up to 6 mm. Share of the target that a size may serve less than another
# whose balls would jam within it.
GAP_OFF, MOST_GAP_OFF, NEARLY = 0.15, 0.1e-3, 0.2
MOST_LISTED = 5  # sizes in a reason
LARGEST_BALL = 3e-3  # m: larger balls are in use, but they are few and slow to cover
MOST_BALLS = 10_000  # of a charge: more take hours to simulate
# Layers of balls in the charge, and share of a plane under a full layer. Twice a quarter of a layer
# peened 1.7 to 1.8 times as fast in pilots of three chambers, four times as much no faster still.
LAYER, PACKED = 0.5, 0.9069


@dataclass(frozen=True)
class SizeFit:
    """How balls of one size suit the target."""

    diameter: float  # [m]
    touched: float  # share of the target that the ball can touch from any side
    served: float  # share of the target that it serves
    suits: bool  # true if no fillet or slot is so small that `check` would warn
    jam: float  # width of a gap of the part in which the ball jams [m]; 0 if there is none
    count: int  # of balls in a charge under the part
    fillets: float = 1.0  # share that it can touch of fillets so narrow that the largest may not
    # Width of a gap in which the ball jams if the gap is as wide or as narrow as its tolerance
    # lets it be [m]; 0 if there is none.
    nearly_jam: float = 0.0

    @property
    def play(self) -> float:
        """Width of that gap less the ball's diameter [m]; below 0 if the ball is larger."""
        return self.nearly_jam - self.diameter


def charge_of(area: float, diameter: float) -> float:
    """Return the number of balls in the charge of a face [m²], for their diameter [m]."""
    return LAYER * PACKED * area / (math.pi / 4.0 * diameter**2)


def sizes_to_try(part: Part, stock_mm: Sequence[float]) -> list[float]:
    """Return the diameters [m], in ascending order, of which a ball for a posed part is chosen.

    Balls that are large beside the metal under thin places of the target would bend these.

    Args:
        stock_mm: diameters that there are [mm], in ascending order.
    """
    sides = np.sort(np.ptp(part.vertices, axis=0))[1:]
    least = math.sqrt(charge_of(float(sides.prod()), 1.0) / MOST_BALLS)
    sold = [1e-3 * one for one in stock_mm if 1e-3 * one <= LARGEST_BALL] or [1e-3 * stock_mm[0]]
    enough = [size for size in sold if size >= least] or sold[-1:]
    most = OF_THIN * thinnest(part)
    return [size for size in enough if size <= most] or enough[:1]


def thinnest(part: Part) -> float:
    """Return the depth of metal [m] than which a small share of a part's target has less."""
    return depth_below(part.vertices, part.triangles, part.target, THIN_SHARE, DEEPEST)


def fit_sizes(part: Part, diameters: Sequence[float]) -> list[SizeFit]:
    """Return how balls of each diameter [m] suit the target of a part, without its chamber.

    Inner edges without a fillet are left out, because no ball fits there.
    """
    from sim_core import TriangleMesh, largest_balls

    mesh = TriangleMesh(part.vertices, part.triangles, np.zeros(len(part.triangles), np.uint8))
    size = areas(part.vertices, part.triangles)
    spacing = np.empty(len(size))
    for rows in (part.target, ~part.target):
        spacing[rows] = np.sqrt(size[rows].sum() / POINTS)
    triangle, point, area = _thinned(
        *spread_points(part.vertices, part.triangles, spacing), spacing
    )
    corners = part.vertices[part.triangles[triangle]]
    normal = unit_vectors(interpolate(part.corner_normals[triangle], corners, point))
    edges = inner_edges(part.vertices, part.triangles, part.target, part.hollow)
    fillet = np.full(len(size), np.inf)  # radius of the smallest fillet at each triangle
    round_ = edges.radius > 0.0
    edge, side = np.nonzero(edges.in_fillet & round_[:, None])
    np.minimum.at(fillet, edges.triangles[edge, side], edges.radius[edge])
    on, whole = part.target[triangle], float(area[part.target[triangle]].sum())
    narrow = on & (fillet[triangle] < 0.5 * max(diameters))
    of_narrow = float(area[narrow].sum())
    fits, tolerance = [], 0.0
    for one in diameters:
        overlap = tolerated_overlap(one)
        if overlap != tolerance:  # another class of sizes begins
            tolerance = overlap
            widest = max(x for x in diameters if tolerated_overlap(x) == overlap) / OF_SLOT
            radius, obstacle, cosine = largest_balls(mesh, point, normal, 0.5 * widest, overlap)
            across = np.where((obstacle >= 0) & (cosine < MAX_COSINE), 2.0 * radius, np.inf)
            width = across - overlap
        in_slot = on & (across < one / OF_SLOT)
        small = round_ & too_narrow(edges, size, one)
        held = (width >= JAM_BAND[0] * one) & (width <= JAM_BAND[1] * one)
        jams = area[held].sum() >= MIN_AREA * one**2
        off = np.minimum(GAP_OFF * width, MOST_GAP_OFF)
        near = (width + off >= JAM_BAND[0] * one) & (width - off <= JAM_BAND[1] * one)
        may_jam = area[near & ~held].sum() >= MIN_AREA * one**2
        touched = on & (radius >= 0.5 * one - overlap)
        served = touched & ~in_slot & (OF_FILLET * fillet[triangle] >= AS_DRAWN * one)
        suits = area[in_slot].sum() < one**2 and edges.length[small].sum() < one
        jam = float(np.average(width[held], weights=area[held])) if jams else 0.0
        nearly = (
            float(np.average(width[near & ~held], weights=area[near & ~held])) if may_jam else 0.0
        )
        touch, serve = (float(area[rows].sum()) / whole for rows in (touched, served))
        count = round(charge_of(float(np.sort(np.ptp(part.vertices, axis=0))[1:].prod()), one))
        fillets = 1.0
        if of_narrow > LEAST_FILLETS * whole:
            fillets = float(area[touched & narrow].sum()) / of_narrow
        fits.append(SizeFit(one, touch, serve, bool(suits), jam, count, fillets, nearly))
    return fits


def _thinned(
    triangle: np.ndarray, point: np.ndarray, area: np.ndarray, spacing: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return of points on a fine mesh, each with its triangle and area, so many as are wanted.

    One is taken wherever the area of those before it has grown by what a point shall stand for.

    Args:
        triangle, point, area: of all points, (p,), (p, 3) [m] and (p,) [m²].
        spacing: wanted distance between points on each triangle [m], (m,).
    """
    for_each = spacing[triangle] ** 2
    taken = np.diff(np.floor(np.cumsum(area / for_each) + 0.5), prepend=0.0)
    rows = np.flatnonzero(taken)
    return triangle[rows], point[rows], (taken * for_each)[rows]


def tolerated_overlap(diameter: float) -> float:
    """Return how far a ball may reach into surfaces [m], for a diameter [m].

    It is that of the next smaller power of two of millimetres, so that few searches serve all
    sizes, and what a size serves does not depend on the sizes beside it.
    """
    class_mm = 2.0 ** math.floor(math.log2(1e3 * diameter) + 1e-9)
    return 0.5e-3 * TOLERATED_OVERLAP * class_mm


def serving_sizes(fits: Sequence[SizeFit]) -> list[float]:
    """Return the diameters [m] of the proposed ball, and of the smaller balls that serve as well.

    Sizes that take very many balls are left out.

    Args:
        fits: sizes in ascending order.
    """
    largest = propose_ball(fits)[0]
    best = next(one for one in fits if one.diameter == largest)
    return [
        one.diameter
        for one in fits
        if one.diameter <= largest
        and one.count <= max(MANY, best.count)
        and (bool(best.jam) or not one.jam)
        and (bool(best.nearly_jam) or not one.nearly_jam)
        and one.touched >= best.touched - MISSED
        and one.served >= best.served - AS_GOOD
    ]


def reaches(one: SizeFit) -> bool:
    """Return whether balls of a size touch nearly all of the target, and jam in no gap."""
    return min(one.touched, one.fillets) >= REACHED and not (one.jam or one.nearly_jam)


def larger_sizes(fits: Sequence[SizeFit]) -> list[SizeFit]:
    """Return the sizes larger than the proposed ball that an intensity may take.

    They serve MOSTLY of the target or touch nearly all of it, and do not jam.

    Args:
        fits: sizes in ascending order.
    """
    largest = propose_ball(fits)[0]
    return [
        one
        for one in fits
        if one.diameter > largest and ((one.served >= MOSTLY and not one.jam) or reaches(one))
    ]


def propose_ball(fits: Sequence[SizeFit]) -> tuple[float, str]:
    """Return the diameter [m] of the proposed ball, and the reason for it.

    It is the largest ball that jams in no gap of the part and suits all fillets and slots. If there
    is none, or it takes very many, it is the largest of those that serve about as much as any.

    Args:
        fits: sizes in ascending order.
    """
    free = [one for one in fits if not one.jam] or list(fits)
    best, text = _best_of(free, fits)
    sure = [one for one in free if not one.nearly_jam]
    if best.nearly_jam and not best.jam and sure:
        other, its_text = _best_of(sure, fits)
        if other.served >= best.served - NEARLY and other.fillets >= best.fillets - MISSED_FILLETS:
            text = f"{its_text}; {_mm(best)} may jam in a gap of {1e3 * best.nearly_jam:.3g} mm"
            best = other
        else:
            text += f"; {_of_play(best)}, or take {_mm(other)}, which suit {other.served:.0%}"
    elif best.nearly_jam and not best.jam:
        text += f"; {_of_play(best)}"
    blunt = [one for one in fits if one.diameter > best.diameter]
    if blunt and blunt[0].fillets < best.fillets - MISSED_FILLETS:
        text += "; larger ones do not get into its fillets, where parts fail"
    if best.jam:
        text += f"; {MatterKind.JAM} in gaps of {1e3 * best.jam:.4g} mm, as every size does"
    elif jammed := [number for number, one in enumerate(fits) if one.jam]:
        first, last = fits[jammed[0]], fits[jammed[-1]]
        listed = ", ".join(_mm(fits[number]) for number in jammed)
        if len(jammed) == jammed[-1] - jammed[0] + 1 > MOST_LISTED:
            listed = f"all sizes from {_mm(first)} to {_mm(last)}"
        text += f"; {listed} would jam in gaps of the part"
    return best.diameter, text


def _of_play(one: SizeFit) -> str:
    """Return what is to be settled of a gap in which balls jam within its tolerance."""
    gap, ball = f"{1e3 * one.nearly_jam:.2g} mm", 1e3 * one.diameter
    if one.play > 0.0:
        return (
            f"{MatterKind.PLAY} {1e3 * one.play:.2g} mm IN A GAP of {gap}: balls jam where it is "
            f"narrower than {JAM_BAND[1] * ball:.3g} mm: measure it"
        )
    return (
        f"{MatterKind.MAY_JAM} of {gap}, where it is wider than {JAM_BAND[0] * ball:.3g} mm: "
        "measure it"
    )


def _best_of(free: Sequence[SizeFit], fits: Sequence[SizeFit]) -> tuple[SizeFit, str]:
    """Return the best of some sizes, and what is said of it.

    Args:
        free: those that may be taken, in ascending order.
        fits: all sizes in ascending order.
    """
    touching = max(one.touched for one in free) - MISSED
    reach = [one for one in free if one.touched >= touching]
    in_fillets = max((one.fillets for one in reach if one.count <= MANY), default=0.0)
    reach = [one for one in reach if one.fillets >= in_fillets - MISSED_FILLETS]
    most = max(one.served for one in reach)
    as_good = [one for one in reach if one.served >= most - AS_GOOD][-1]
    suited = [one for one in reach if one.suits]
    if suited and (suited[-1].count <= MANY or suited[-1].diameter >= as_good.diameter):
        best = suited[-1]
        text = f"touches {best.touched:.0%} of the target as chosen"
        larger = [one for one in fits if one.diameter > best.diameter]
        if any(not one.suits for one in larger):
            text += ", at most half the radius of its fillets and a quarter of its slots"
        elif larger and larger[0].touched < touching:
            text += f", balls of {_mm(larger[0])} {larger[0].touched:.0%}"
    elif suited:
        best, small = as_good, suited[-1]
        text = (
            f"suits {best.served:.0%} of the target; {_mm(small)} would suit {small.served:.0%}, "
            f"but take {small.count / best.count:.2g} times as many"
        )
    else:
        best = as_good
        shown = sorted({*fits[:: max(1, len(fits) // MOST_LISTED)], best}, key=lambda x: x.diameter)
        shares = ", ".join(
            f"{1.0 - one.served:.0%} by balls of {_mm(one)}{' (taken)' if one is best else ''}"
            for one in shown
        )
        text = (
            f"{MatterKind.NO_SIZE} of the target. Missed are {shares}: these places are out of "
            f"reach, or in fillets of less than {1 / OF_FILLET:g} diameters' radius or slots of "
            f"less than {1 / OF_SLOT:g} diameters, which are peened slowly. Agree on them, or "
            "leave them out of the target"
        )
    return best, text


def _mm(one: SizeFit) -> str:
    return f"{1e3 * one.diameter:g} mm"
