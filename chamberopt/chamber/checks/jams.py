"""Find the gaps in which balls jam: they are held by friction, or rattle for long.

    D      diameter of a ball
    mu     coefficient of friction of a ball on a face (FRICTION)
    w      width of a gap: the diameter of the ball that touches both its faces there
    2 a    angle between the faces there, 0 if they are parallel

A ball that touches two faces is held by friction alone, however hard it is pressed in, if the
angle of friction of both contacts takes in the line between them: tan(a) < mu. A ball on the
sharp mouth of a slot touches both edges at cos(a) = w / D, so that it is held from
w / D = 1 / sqrt(1 + mu²) on: 0.958 for mu = 0.3, and 0.9 for mu = 0.48.
Between faces a little more than D apart a ball bounces to and fro, and moves along them slowly.
So a ball jams where faces with tan(a) < mu are 0.9 D to 1.15 D apart (JAM_BAND). A wedge has such a
place for every ball that is not larger than its mouth.

Source of the wedge's law: J. L. Meriam, L. G. Kraige, "Engineering Mechanics: Statics", section
on wedges (a wedge is self-locking if its angle is below twice the angle of friction).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.chamber.build import Chamber
from chamberopt.chamber.checks.place_names import surface_names
from chamberopt.chamber.largest_ball import TouchPoints
from chamberopt.chamber.reach import MEASURED_WIDTH, TOLERATED_OVERLAP, Reach, find_touches
from chamberopt.chamber.scene import chamber_mesh
from chamberopt.design.shape_surface import TAG_PART
from chamberopt.geometry.triangles import connected_pieces

if TYPE_CHECKING:
    from collections.abc import Sequence

FRICTION = 0.3  # of dry steel on steel
MAX_COSINE = -(1.0 - FRICTION**2) / (1.0 + FRICTION**2)  # between the normals of facing faces
JAM_BAND = (0.9, 1.15)  # ball diameters
MIN_AREA = 0.25  # ball diameters squared: of both faces, below which no ball finds the gap


class JamGap(NamedTuple):
    """A gap in which balls of one diameter jam."""

    sides: tuple[str, str]  # names of the surfaces beside most of it, as in warnings
    place: np.ndarray  # middle of a ball that would jam, in the chamber's frame [m], (3,)
    width: tuple[float, float]  # least and largest width within the jam band [m]
    area: float  # of both faces within the jam band [m²]
    target_share: float  # share of the target's area in the chamber that this takes
    # Diameters [m] of balls that do not jam in this gap: those below the first, and above the
    # second. The second is infinite if the gap is wider than was measured.
    free_below: float
    free_above: float
    rows: np.ndarray  # the touch points within the jam band


class Gaps(NamedTuple):
    """The gaps of a chamber's cavity: faces that face each other, at their touch points."""

    touches: TouchPoints  # all touch points of the cavity
    width: np.ndarray  # of the gap at each of them [m], (p,); infinite where there is none
    open: np.ndarray | None  # true where the shot's smallest ball gets, (p,); None if not known
    spacing: float  # largest distance between touch points [m]
    widest: float  # width up to which gaps are measured [m]


def find_gaps(
    chamber: Chamber,
    diameters: Sequence[float],
    beside_walls: bool = False,
    widest: float = MEASURED_WIDTH,
) -> Gaps:
    """Measure the gaps of a chamber for balls of some diameters [m], in a fraction of a second.

    It is not found whether a ball gets there at all, for which `shot_reach` takes seconds.

    Args:
        beside_walls: whether only gaps beside walls and sonotrode are wanted, not those of the part
            alone. They are measured from the walls: a ball between both faces touches both.
        widest: widest gap that is measured, over the largest diameter.
    """
    limit, mesh = widest * 0.5 * max(diameters), chamber_mesh(chamber)
    chosen = normals = None
    if beside_walls:  # which are as their facets
        chosen = mesh.tags != TAG_PART
    else:
        normals = chamber.normals
    touches, spacing = find_touches(mesh, min(diameters), limit, normals, chosen)
    return _gaps(touches, None, spacing, min(diameters))


def gaps_in_reach(reach: Reach) -> Gaps:
    """Return the gaps of a chamber whose reach is known already, at no further cost."""
    return _gaps(reach.touches, reach.reached, reach.spacing, reach.diameter)


def _gaps(touches: TouchPoints, open_: np.ndarray | None, spacing: float, smallest: float) -> Gaps:
    facing = (touches.obstacle >= 0) & (touches.cosine < MAX_COSINE)
    width = 2.0 * touches.radius - TOLERATED_OVERLAP * 0.5 * smallest
    widest = float(width.max(initial=0.0))
    return Gaps(touches, np.where(facing, width, np.inf), open_, spacing, widest)


def jam_gaps(chamber: Chamber, diameter: float, gaps: Gaps | None = None) -> list[JamGap]:
    """Return the gaps in which balls of a diameter [m] jam, those with the largest area first.

    A turning part is at rest.

    Args:
        gaps: the measured gaps, if they are known. They must have been measured for diameters of
            which none is larger than 1.25/1.15 of the largest, and none smaller than the smallest.
    """
    from scipy.spatial import KDTree

    gaps = find_gaps(chamber, [diameter]) if gaps is None else gaps
    touches, low, high = gaps.touches, *(share * diameter for share in JAM_BAND)
    facing = np.flatnonzero(np.isfinite(gaps.width))
    fits = (touches.radius >= 0.5 * diameter) & (True if gaps.open is None else gaps.open)
    if not (len(facing) and fits.any()):
        return []
    centre, names = touches.centre, surface_names(chamber)
    mouths = KDTree(centre[fits])
    on_target = chamber.on_target[touches.triangle]
    target_area = float(touches.area[on_target].sum())
    found = []
    for members in clusters(centre[facing], 2.0 * gaps.spacing):
        whole = facing[members]
        band = whole[(gaps.width[whole] >= low) & (gaps.width[whole] <= high)]
        area = float(touches.area[band].sum())
        if area < MIN_AREA * diameter**2:
            continue
        if mouths.query(centre[band])[0].min() > diameter + gaps.spacing:
            continue  # no ball gets near
        middle = np.average(centre[band], axis=0, weights=touches.area[band])
        nearest = np.linalg.norm(centre[band] - middle, axis=1).argmin()
        width, widest = gaps.width[band], float(gaps.width[whole].max())
        measured = widest < 0.99 * gaps.widest
        found.append(
            JamGap(
                sides_of_gap(touches.select(band), names),
                centre[band][nearest],
                (float(width.min()), float(width.max())),
                area,
                float(touches.area[band[on_target[band]]].sum()) / max(target_area, 1e-30),
                float(gaps.width[whole].min()) / JAM_BAND[1],
                widest / JAM_BAND[0] if measured else np.inf,
                band,
            )
        )
    return sorted(found, key=lambda gap: -gap.area)


def sides_of_gap(gap: TouchPoints, names: np.ndarray) -> tuple[str, str]:
    """Return the names of the two surfaces beside most of a gap.

    Args:
        names: name of the surface that each triangle is on, (k,).
    """
    pairs = np.sort(np.c_[names[gap.triangle], names[gap.obstacle]].astype(str), axis=1)
    sides, counts = np.unique(pairs, axis=0, return_counts=True)
    one, two = map(str, sides[counts.argmax()])
    return one, two


def clusters(centre: np.ndarray, near: float) -> list[np.ndarray]:
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
