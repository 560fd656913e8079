"""Places where balls can come to rest: surfaces that face up and neither vibrate nor turn."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.chamber.checks.place_names import around, mm2
from chamberopt.design.shapes import TAG_PART, TAG_SONOTRODE, TAG_WALL
from chamberopt.geometry.triangles import area_vectors, connected_pieces, sides_of

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design

HEIGHT_TOLERANCE = 1e-9  # m: corners whose heights differ by less are level, except for rounding
AREA_TOLERANCE = 1e-6  # share of a triangle's area: a smaller upward part is rounding
REMEDY = {
    TAG_PART: "turn it (effects.part_turn), tilt it (part.rotate_deg), or lower chamber.{key} to "
    "its top side",
    TAG_WALL: "make it slope towards the sonotrode",
}


class Ledge(NamedTuple):
    """Surfaces of part or wall that face up."""

    message: str
    level: bool  # whether enough of them is level for a ball to lie on


def find_ledges(design: Design, chamber: Chamber) -> list[Ledge]:
    """The places on part and wall where balls can come to rest."""
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
        # balls stay here and do not roll off
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
    """Which upward faces are at the bottom of a hollow, from where every way leads up; (k,) bool.

    A wall that leans out is not a hollow: its lowest points are on the sonotrode. A face beside one
    that faces down is not one either, because a ball falls off there.
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
