"""Name positions and surfaces of a chamber in words, for messages."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from chamberopt.design.shape_surface import TAG_PART, TAG_SONOTRODE, TAG_WALL, further_sonotrode_tag
from chamberopt.geometry.triangles import area_vectors, unit_vectors

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber

MIN_UPWARD = 0.5  # cosine to the vertical: a surface steeper than 60 degrees is a side
CEILING, SIDE_WALL, SONOTRODE, PART = "the ceiling", "the wall", "the sonotrode", "the part"
UPPER_SIDE, UNDERSIDE = "the part's upper side", "the part's underside"
PART_SIDE = "the part's side"
PART_SIDES = frozenset({UPPER_SIDE, UNDERSIDE, PART_SIDE})


def surface_names(chamber: Chamber) -> np.ndarray:
    """Return a name, such as "the ceiling", for the surface that each triangle is on, (k,)."""
    up = -unit_vectors(area_vectors(chamber.vertices, chamber.triangles))[:, 2]
    faces = [up > MIN_UPWARD, up < -MIN_UPWARD]
    on_part = np.select(faces, [UPPER_SIDE, UNDERSIDE], PART_SIDE)
    on_wall = np.select(faces, ["a ledge of the wall", CEILING], SIDE_WALL)
    words = np.where(chamber.tags == TAG_PART, on_part, on_wall).astype(object)
    words[chamber.tags == TAG_SONOTRODE] = SONOTRODE
    for name in chamber.fixtures:
        words[chamber.on_fixture(name)] = f"the {name}"
    for tag in np.unique(chamber.tags[chamber.tags > TAG_WALL]):
        words[chamber.tags == tag] = f"sonotrodes.{tag - further_sonotrode_tag(0)}"
    return words


def around(points: np.ndarray, weights: np.ndarray | None = None) -> str:
    """Return the weighted mean of points (n, 3) [m] as text, such as "(1.0, 2.0, 3.0) mm"."""
    middle = np.average(1e3 * points, axis=0, weights=weights)
    return f"({', '.join(f'{x:.1f}' for x in np.round(middle, 1) + 0.0)}) mm"


def mm2(area: float) -> str:
    """Return an area given in m² as text in mm², with three digits."""
    return f"{float(f'{1e6 * area:.3g}'):g} mm²"


def one_of(points: np.ndarray, weights: np.ndarray) -> str:
    """Return as text the point, among points (n, 3) [m], that is closest to their weighted mean.

    The mean itself may lie far from all points, as the middle of a ring does. Points without weight
    do not count.
    """
    middle = np.average(points, axis=0, weights=weights)
    points = points[weights > 0.0]
    return around(points[[np.linalg.norm(points - middle, axis=1).argmin()]])
