"""Leave an end of a part out of its target, to hold it there, where all of it would be peened.

A part without names and without sharp edges, such as a scan or an implant, has one face. Its target
is all of it, and no fixture could hold it. The broad sides of a leaf spring reach both of its ends.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from chamberopt.chamber.propose.pose import Turns, turns_down
from chamberopt.chamber.propose.proposed_target import Target
from chamberopt.design.shapes.outlines import area_inside
from chamberopt.geometry.meshes.part_mesh import PartMesh
from chamberopt.geometry.outline import convex_hull
from chamberopt.geometry.triangles import areas, rotation_matrix, sides_of

NEARLY_ALL = 0.95  # share of the part's area from which on its target is all of it
END, LONG_END = 0.15, 0.25  # length of the end over the part's, the latter if no end is straight
TIP, STRAIGHT = 0.25, 0.8  # of an end: near its tip, and width there over that where it begins
ALIKE = 0.05  # difference of that from which on it decides which end is held
UPRIGHT = 0.999  # cosine from which on an axis of the part's file is one of the chamber's
SLIMMER = 0.8  # area of the lower end over the upper one's, below which the part is turned over
MARGIN_MM = 1.0  # of boxes round the part


class HeldEnd(NamedTuple):
    """An end of a part that is left out of its target, and a pose in which the part is held by it.

    The end points up in the pose that is proposed with it.
    """

    target: Target  # the rest
    turns: Turns
    axis: np.ndarray  # unit vector of the part's file along which the end points, (3,)
    at: dict[str, Any]  # keys that choose the end
    triangles: np.ndarray  # marks those of the end, (m,)


def held_end(mesh: PartMesh, target: Target, turns: Turns, of_any: bool = False) -> HeldEnd | None:
    """Return the straighter or slimmer end of a part, if all of it would be peened, else None.

    Args:
        target: the target that was proposed.
        of_any: true to return it also if not all of the part would be peened.
        turns: the pose that was proposed for it [degrees]. No end is chosen where no axis of the
            part's file is upright in it.
    """
    area, up = areas(mesh.vertices, mesh.triangles), rotation_matrix(turns)[2]
    axis = int(np.abs(up).argmax())
    is_whole = area[target.triangles].sum() > NEARLY_ALL * area.sum()
    if not (is_whole or of_any) or abs(up[axis]) < UPRIGHT:
        return None
    places = mesh.vertices[:, axis] * np.sign(up[axis])
    length = float(np.ptp(places))

    def straight(way: float, share: float) -> float:
        """Width of an end near its tip over that where it begins, from 0 to 1."""
        tip = float((way * places).max())
        near, far = (
            _width(mesh, way * places, tip - part * share * length, axis) for part in (TIP, 1.0)
        )
        return min(near / far, 1.0) if far > 0.0 else 0.0

    def size(way: float) -> float:
        """Area of an end as it is seen along the axis [m²]."""
        inside = way * places > (way * places).max() - END * length
        hull = convex_hull(np.delete(mesh.vertices[inside], axis, axis=1))
        return 0.0 if hull is None else area_inside(hull)

    # A straight end is held better than one that narrows to its tip, and a slim one better still.
    share = END if max(straight(1.0, END), straight(-1.0, END)) > STRAIGHT else LONG_END
    upper, lower = (straight(way, share) for way in (1.0, -1.0))
    slimmer = size(-1.0) < SLIMMER * size(1.0)
    if slimmer if abs(upper - lower) < ALIKE else lower > upper:
        up = -up
        turns = turns_down(-np.sign(up[axis]) * np.eye(3)[axis])
    is_top, own = bool(up[axis] > 0.0), mesh.vertices[:, axis]
    cut = 1e3 * float(own.max() - share * length if is_top else own.min() + share * length)
    middle = 1e3 * mesh.vertices[mesh.triangles].mean(axis=1)[:, axis]
    of_end = middle > cut if is_top else middle < cut
    keys = {**target.keys, "box_mm": box_beyond(mesh, axis, not is_top, cut)}
    reason = (
        f"{target.reason}; but for an end, {share:.0%} of its length, to hold it by: turn the part "
        "end for end for it, or leave it bare"
    )
    left = Target(keys, target.triangles & ~of_end, reason)
    points = np.eye(3)[axis] * (1.0 if is_top else -1.0)
    return HeldEnd(left, turns, points, {"box_mm": box_beyond(mesh, axis, is_top, cut)}, of_end)


def box_beyond(mesh: PartMesh, axis: int, is_top: bool, cut: float) -> list[list[float]]:
    """Return the box [mm], as designs have it, round what of a part lies beyond a cut.

    Args:
        axis: axis of the part's file across which the cut goes.
        is_top: whether what has larger coordinates lies beyond it.
        cut: its coordinate [mm].
    """
    box = 1e3 * np.array([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)])
    box += MARGIN_MM * np.array([[-1.0], [1.0]])
    box[1 - int(is_top), axis] = cut
    return [[float(x) for x in corner] for corner in np.round(box, 3)]


def _width(mesh: PartMesh, places: np.ndarray, at: float, axis: int) -> float:
    """Return the width [m] of the section of a part in a plane across an axis of its file.

    Args:
        places: place of each vertex along the axis [m], (n,).
        at: place of the plane [m].
    """
    one, two = sides_of(mesh.triangles).T
    cut = (places[one] < at) & (places[two] >= at)
    one, two = one[cut], two[cut]
    share = ((at - places[one]) / (places[two] - places[one]))[:, None]
    points = mesh.vertices[one] + share * (mesh.vertices[two] - mesh.vertices[one])
    return float(np.ptp(np.delete(points, axis, axis=1), axis=0).min()) if len(points) else 0.0
