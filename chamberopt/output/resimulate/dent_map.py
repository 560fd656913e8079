"""The part as one peening leaves it: each pixel of a picture is a point of the surface, and is looked up in all dents.

So a dent is as large and as round as it is, at any zoom, over triangles and round edges: the same rule that marks the
sample points of coverage (dents.py) says which pixels it holds.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.coverage.dent_marking import (
    mark_points,
    marked_share,
    points_in_dents,
    sample_points,
)
from chamberopt.coverage.dents import Dents, dents_on_part
from chamberopt.coverage.metrics import target_coverage
from chamberopt.design.process import MAX_SIMULATED_TREATMENT
from chamberopt.geometry.raycast import View, places, seen, view_of
from chamberopt.geometry.triangles import area_vectors

if TYPE_CHECKING:
    from collections.abc import Sequence

    from chamberopt.chamber.build import Chamber
    from chamberopt.output.resimulate.rebuild import Replica

PAIRS = 1_000_000  # of pixel and dent looked at together: 200 MB
MOST_DENTS = 20_000  # looked at together
NOTHING, REST, TARGET = 0, 1, 2
EDGE_ON = 1e-6
THINNEST = 4  # pixels of the picture's shorter side
FLAT = 0.9  # a target is seen face on where its mean normal is this long
ROUND = (
    (1.0, -1.4, -0.5),
    (-1.0, 1.4, 0.5),
)  # from near and a little below, where the shot comes from; and opposite


@dataclass(frozen=True)
class DentMap:
    """A part from one side, (rows, columns) each.

    ground: NOTHING, REST of the part, TARGET · dent int32: the last dent on the target there, -1 for none · off: how
    far from its middle, as a share of its radius · facing: cosine between surface and sight · area m²: of the surface
    in the pixel, 0 where it is seen edge on · triangle int32: of the part, -1 for none.
    """

    view: View
    ground: np.ndarray
    dent: np.ndarray
    off: np.ndarray
    facing: np.ndarray
    area: np.ndarray
    triangle: np.ndarray


def peened(replayed: Replica, time: float) -> Dents:
    """The dents of one peening of ``time`` [s], a replica simulated as far as that, beyond where the result ended, too.

    Raises InputError for a time too long to simulate, and sim_core.SimulationError.
    """
    from sim_core import simulate

    if not 0.0 < time <= MAX_SIMULATED_TREATMENT:
        raise InputError(
            f"--at-s: given {time:g}; a dent map simulates all of it: more than 0, at most {MAX_SIMULATED_TREATMENT:g} s are "
            "supported"
        )
    impacts = simulate(replace(replayed.scene, duration=time)).impacts
    return dents_on_part(replayed.booked(impacts), replayed.chamber, replayed.design)


def coverage(dents: Dents, chamber: Chamber, spacing: float) -> float:
    """The share of the target inside dents, what lies outside the cavity counted as bare; spacing [m] of the points."""
    samples = sample_points(chamber, spacing)
    first = mark_points(samples, dents.place, dents.normal, dents.radius, dents.time)
    share, weight = target_coverage(
        marked_share(samples, first, dents.time.max(initial=0.0), len(chamber.part.triangles)),
        chamber,
    )
    return float(share @ weight)


def default_views(chamber: Chamber) -> Sequence[tuple[float, float, float]]:
    """Directions of the eye: face on for a flat target, else from two opposite sides."""
    part = chamber.part
    normal = area_vectors(part.vertices, part.triangles[part.target]).sum(axis=0)
    if np.linalg.norm(normal) > FLAT * part.area[part.target].sum():
        x, y, z = normal / np.linalg.norm(normal)
        return ((x, y, z),)
    return ROUND


def dent_map(chamber: Chamber, dents: Dents, towards: Sequence[float], longest: int) -> DentMap:
    """The target and its dents from the direction of the eye, (3,); the picture's longer side in pixels.

    Raises InputError for a direction from which a flat target is a line.
    """
    part = chamber.part
    exposed = np.flatnonzero(chamber.source >= 0)
    corners = chamber.vertices[chamber.triangles[exposed]]
    # The part's own triangles are behind what the cavity has of them: there they are what is not exposed.
    everything = np.concatenate([corners, part.vertices[part.triangles]])
    on_target = part.target[chamber.source[exposed]]
    view = view_of(corners[on_target].reshape(-1, 3), np.asarray(towards), longest)
    if min(view.shape) < THINNEST:
        raise InputError("--view: from there the target is seen edge on; give another direction")
    which = seen(view, everything)
    row, column = np.nonzero(which >= 0)
    triangle = which[row, column]
    normal = np.cross(everything[:, 1] - everything[:, 0], everything[:, 2] - everything[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    blank = np.zeros(view.shape)
    facing = blank.copy()
    facing[row, column] = np.abs(normal[triangle] @ view.towards)
    ground = np.where(which >= 0, REST, NOTHING).astype(np.int8)
    own = triangle < len(exposed)
    own[own] = on_target[triangle[own]]
    row, column, triangle = row[own], column[own], triangle[own]
    ground[row, column] = TARGET
    last, distance = topmost(
        places(view, everything, triangle, row, column), normal[triangle], dents, view.pixel
    )
    dent, off, of_part = (
        np.full(view.shape, -1, dtype=np.int32),
        blank.copy(),
        np.full(view.shape, -1, dtype=np.int32),
    )
    dent[row, column], off[row, column] = last, distance
    of_part[row, column] = chamber.source[exposed[triangle]]
    area = np.divide(view.pixel**2, facing, out=blank.copy(), where=facing > EDGE_ON)
    return DentMap(view, ground, dent, off, facing, area, of_part)


def topmost(
    place: np.ndarray, normal: np.ndarray, dents: Dents, spacing: float
) -> tuple[np.ndarray, np.ndarray]:
    """The last dent that holds each point (p, 3), -1 for none, and how far off its middle, as a share of its radius.

    spacing [m] of the points: how many a dent holds. From the last dent back: a point that has one is out of the
    search, so a part that is covered many times over takes no longer than one that is covered.
    """
    from scipy.spatial import cKDTree

    last, off = np.full(len(place), -1, dtype=np.int32), np.zeros(len(place), dtype=np.float32)
    if not len(dents) or not len(place):
        return last, off
    left = np.arange(len(place))
    tree, facing = cKDTree(place), normal
    each = np.pi * (dents.radius.max() / spacing) ** 2
    step = int(np.clip(PAIRS / each, 1, MOST_DENTS))
    end = len(dents)
    while end and len(left):
        some = slice(max(0, end - step), end)
        point, dent, distance = points_in_dents(
            tree, facing, dents.place[some], dents.normal[some], dents.radius[some]
        )
        bare = last[left[point]] < 0
        point, dent, distance = left[point[bare]], some.start + dent[bare], distance[bare]
        np.maximum.at(last, point, dent.astype(np.int32))
        on_top = last[point] == dent
        off[point[on_top]] = distance[on_top]
        end = some.start
        bare = last[left] < 0
        if bare.sum() < 0.7 * len(left):
            left = left[bare]
            if len(left):
                tree, facing = cKDTree(place[left]), normal[left]
    return last, off
