"""Where shot can come to rest, seen before anything runs: what faces up and neither vibrates nor turns."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.chamber.build import TAG_PART, TAG_SONOTRODE, TAG_WALL
from chamberopt.chamber.checks.place_names import around, mm2
from chamberopt.geometry.triangles import area_vectors

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design

LEVEL = 1e-9  # m: corners whose heights differ by less are level but for rounding
UPWARD = 1e-6  # of a triangle's area: what faces up by less is upright but for rounding
REMEDY = {
    TAG_PART: "turn it (effects.part_turn), tilt it (part.rotate_deg), or lower chamber.{key} to its top side",
    TAG_WALL: "make it slope towards the sonotrode",
}


class Ledge(NamedTuple):
    """What of part or wall faces up: one sentence, and whether enough of it is ``level`` for a ball to lie on."""

    said: str
    level: bool


def ledges(design: Design, chamber: Chamber) -> list[Ledge]:
    """Where balls can come to rest, on part and wall."""
    from sim_core import Rest

    if not design.effects.gravity:
        return []
    normal = -area_vectors(chamber.vertices, chamber.triangles)  # to the shot
    area = np.linalg.norm(normal, axis=1)
    upward = normal[:, 2] > UPWARD * area
    downward = normal[:, 2] < -UPWARD * area
    flat = upward & (np.hypot(normal[:, 0], normal[:, 1]) <= Rest().resistance * normal[:, 2])
    cross_section = np.pi / 4.0 * design.shot.diameter**2
    found = []
    for tag, name in ((TAG_PART, "part"), (TAG_WALL, "wall")):
        faces = upward & (chamber.tags == tag)
        if not faces.any() or (tag == TAG_PART and design.effects.part_turn is not None):
            continue
        level = bool(area[faces & flat].sum() >= cross_section)
        # where balls lie, rather than roll off
        shown = faces & flat if level else faces & _in_hollows(chamber, upward, downward)
        if not shown.any():
            continue
        much = mm2(area[shown].sum())
        where, how = (
            ("on", f"{much} of it are level")
            if level
            else ("in hollows of", f"{much} face up, none level")
        )
        found.append(
            Ledge(
                f"balls can come to rest {where} the {name}, which neither vibrates nor turns: {how}, "
                f"{_place(chamber, shown, area)}; {REMEDY[tag].format(key=design.chamber.ceiling_key)}",
                level,
            )
        )
    return found


def _in_hollows(chamber: Chamber, upward: np.ndarray, downward: np.ndarray) -> np.ndarray:
    """Which faces that go ``upward`` (k,), others ``downward``, are at the bottom of a hollow: every way leads up.

    A wall that leans out has its lowest points on the sonotrode, and off what faces down beside it a ball falls.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    count, height = len(chamber.vertices), chamber.vertices[:, 2]
    one, two = (
        chamber.triangles[:, [0, 1, 2, 1, 2, 0]].reshape(-1, 2, 3).transpose(1, 0, 2).reshape(2, -1)
    )
    alike = np.abs(height[one] - height[two]) <= LEVEL
    links = coo_array(
        (np.ones(alike.sum(), dtype=bool), (one[alike], two[alike])), shape=(count, count)
    )
    plateaus, plateau = connected_components(links, directed=False)
    bottom = np.ones(plateaus, dtype=bool)
    bottom[plateau[one[height[two] < height[one] - LEVEL]]] = (
        False  # each edge is there both ways round
    )
    bottom[plateau[chamber.triangles[downward | (chamber.tags == TAG_SONOTRODE)]]] = False
    return np.asarray(upward & bottom[plateau[chamber.triangles]].any(axis=1))


def _place(chamber: Chamber, faces: np.ndarray, area: np.ndarray) -> str:
    corners = chamber.vertices[chamber.triangles[faces]]
    low, high = 1e3 * corners[..., 2].min(), 1e3 * corners[..., 2].max()
    heights = f"z = {low:.4g} mm" if high - low < 0.01 else f"z = {low:.4g} to {high:.4g} mm"
    return f"around {around(corners.mean(axis=1), area[faces])}, at {heights}"
