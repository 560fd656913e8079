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
from chamberopt.geometry.triangles import areas, rotation_matrix

NEARLY_ALL = 0.95  # share of the part's area from which on its target is all of it
END = 0.15  # length of the end over the part's
UPRIGHT = 0.999  # cosine from which on an axis of the part's file is upright
SLIMMER = 0.8  # area of the lower end over the upper one's, below which the part is turned over
MARGIN_MM = 1.0  # of boxes round the part


class HeldEnd(NamedTuple):
    """An end of a part that is left out of its target, and the pose in which it points up."""

    target: Target  # the rest
    turns: Turns
    at: dict[str, Any]  # keys that choose the end
    triangles: np.ndarray  # marks those of the end, (m,)


def held_end(mesh: PartMesh, target: Target, turns: Turns, of_any: bool = False) -> HeldEnd | None:
    """Return the slimmer end of a part, if all of the part would be peened, else None.

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

    def size(rows: np.ndarray) -> float:
        """Area of an end as it is seen along the axis [m²]."""
        hull = convex_hull(np.delete(mesh.vertices[rows], axis, axis=1))
        return 0.0 if hull is None else area_inside(hull)

    upper = places > places.max() - END * length
    lower = places < places.min() + END * length
    if size(lower) < SLIMMER * size(upper):
        up = -up
        turns = turns_down(-np.sign(up[axis]) * np.eye(3)[axis])
    box = 1e3 * np.array([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)])
    box += MARGIN_MM * np.array([[-1.0], [1.0]])
    is_top = int(up[axis] > 0.0)
    cut = box[is_top, axis] - (2 * is_top - 1) * (MARGIN_MM + 1e3 * END * length)
    rest, end = box.copy(), box.copy()
    rest[is_top, axis] = end[1 - is_top, axis] = cut
    middle = 1e3 * mesh.vertices[mesh.triangles].mean(axis=1)[:, axis]
    of_end = middle > cut if is_top else middle < cut
    keys = {**target.keys, "box_mm": np.round(rest, 3).tolist()}
    reason = f"{target.reason}; but for an end, {END:.0%} of its length, to hold it by"
    left = Target(keys, target.triangles & ~of_end, reason)
    return HeldEnd(left, turns, {"box_mm": np.round(end, 3).tolist()}, of_end)
