"""Draw the walls of a chamber round its room, as bands of no thickness in particular."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.design.shape_surface import TAG_WALL
from chamberopt.pictures.charts.colours import BLACK
from chamberopt.pictures.drawing.arrangement import WALL
from chamberopt.pictures.drawing.cuts import cut, inside
from chamberopt.pictures.drawing.view import View, fill

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from shapely.geometry.base import BaseGeometry

    from chamberopt.chamber.build import Chamber

# A corner of a wall is farther from its lines than its sides, by the root of 2.
CORNER = 1.5
TOUCHING = 1e-3  # mm, by which bodies are drawn larger, so that no gap of rounding is between them
LEAST = 0.05  # mm² on paper: smaller pieces of a wall are none
AT_TOP = 1e-3  # mm: walls this near to the highest place are a level ceiling
LOOK: dict[str, Any] = {"facecolor": "white", "edgecolor": BLACK, "lw": 0.5, "zorder": 0.6}
WALLS, LID = "\\" * 6, "/" * 6  # hatches, of opposite ways where two bodies meet


def draw_walls(axes: Axes, chamber: Chamber, view: View, axis: int, at: float) -> None:
    """Draw the walls in a section, and the lid on them where the ceiling is level.

    They end at the part, and at the level of the sonotrode's face.

    Args:
        axis: axis square to the plane of the section, 0, 1 or 2.
        at: place of that plane [m].
    """
    import shapely

    lines, row = cut(chamber.vertices, chamber.triangles, axis, at)
    cavity = inside(1e3 * lines)
    bodies = [(one.vertices, one.triangles) for one in chamber.fixtures.values()]
    bodies.append((chamber.part.vertices, chamber.part.triangles))
    *held, part = (inside(1e3 * cut(*one, axis, at)[0]) for one in bodies)
    on_wall = 1e3 * lines[chamber.tags[row] == TAG_WALL]
    thick = WALL / view.scale
    # The room is what the part and its holder leave of it, and these.
    room = shapely.union_all([
        one.buffer(TOUCHING, join_style="mitre")
        for one in (cavity, *held, part.intersection(cavity.convex_hull))
    ]).buffer(-TOUCHING, join_style="mitre")  # fmt: skip
    beside = shapely.union_all([_lines_of(on_wall), *(one.boundary for one in held)])
    band = room.buffer(thick, join_style="mitre").difference(room)
    band = band.difference(part.buffer(TOUCHING, join_style="mitre"))
    band = band.intersection(beside.buffer(CORNER * thick, cap_style="square"))
    pieces = [(band, WALLS)]
    if axis != 2:
        top = float(view.high[1])
        is_level = (np.abs(on_wall[..., 1] - top) < AT_TOP).all(axis=1).any()
        over = shapely.box(*(view.low - [2.0 * thick, 0.0]), *(view.high + 2.0 * thick))
        lid = shapely.box(*over.bounds[:1], top, *over.bounds[2:]) if is_level else None
        pieces = [(band.intersection(over if lid is None else over.difference(lid)), WALLS)]
        pieces += [] if lid is None else [(band.intersection(lid), LID)]
    for area, hatch in pieces:
        fill(axes, view, _large(area, LEAST / view.scale**2), hatch=hatch, **LOOK)


def _lines_of(ends: np.ndarray) -> BaseGeometry:
    """Return lines (n, 2, 2) as one geometry."""
    import shapely

    return shapely.multilinestrings(shapely.linestrings(ends)) if len(ends) else shapely.Polygon()


def _large(area: BaseGeometry, least: float) -> BaseGeometry:
    """Return the pieces of an area that are larger than `least`."""
    import shapely

    pieces: Sequence[BaseGeometry] = shapely.get_parts(area)
    return shapely.union_all([one for one in pieces if one.area > least])
