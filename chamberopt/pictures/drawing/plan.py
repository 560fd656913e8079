"""Draw the plan of a chamber, with the planes of its sections and its sonotrode's rim."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.common.number_text import typeset_plain as plain
from chamberopt.design.shape_surface import TAG_PART, TAG_SONOTRODE, TAG_WALL
from chamberopt.geometry.triangles import border_edges
from chamberopt.pictures.charts.colours import BLACK, KINDS, SONOTRODE
from chamberopt.pictures.drawing.centres import OFF, centres, distinct, gaps
from chamberopt.pictures.drawing.cuts import SectionPlane, cut, face_size_mm, inside, outline_path
from chamberopt.pictures.drawing.dimensions import Limits, across_line, dimension, with_limits
from chamberopt.pictures.drawing.section import WIDER
from chamberopt.pictures.drawing.view import PART, View, draw_lines, label
from chamberopt.pictures.drawing.walls import draw_walls

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from chamberopt.chamber.build import Chamber
    from chamberopt.design.sonotrode import Face

# mm on paper, lower left and upper right of what is round a plan without words and dimensions
FREE = (-8.0, -8.0), (8.0, 2.0)
# mm on paper from the room to the first dimension of a place, and to each further one, and how many
# there are along each axis at most.
PLACES, ROWS, MOST_PLACES = 5.3, 4.2, 2
TARGET = KINDS["target"].colour


def draw_plan(
    axes: Axes, chamber: Chamber, view: View, planes: Sequence[SectionPlane], limits: Limits
) -> None:
    from matplotlib.collections import PolyCollection

    part, target = chamber.tags == TAG_PART, chamber.on_target
    for colour, rows in ((PART, part & ~target), (TARGET, target)):
        corners = view.place(1e3 * chamber.vertices[chamber.triangles[rows]][:, :, :2])
        seen = PolyCollection(list(corners), facecolors=colour, edgecolors=colour, lw=0.4)
        seen.set_rasterized(True)
        axes.add_collection(seen)
    halfway, row = cut(chamber.vertices, chamber.triangles, 2, 0.5 * chamber.height)
    draw_lines(axes, view, halfway[chamber.tags[row] == TAG_WALL], BLACK, 0.7)
    face = chamber.triangles[chamber.tags == TAG_SONOTRODE]
    draw_lines(axes, view, chamber.vertices[border_edges(face)][:, :, :2], SONOTRODE, 1.1)
    draw_walls(axes, chamber, view, 2, 0.5 * chamber.height)
    (left, bottom), (right, top) = view.place([view.low, view.high])
    x, y = view.place([0.0, 0.0])
    is_upright = False
    for name, plane in zip("AB", planes, strict=False):
        at_x, at_y = view.place([plane.at, plane.at])
        beside = plain(round(abs(plane.at), 1)) if abs(plane.at) > OFF else ""
        if plane.right == 0:
            across_line(axes, (left - 3.0, at_y), (right + 3.0, at_y), name=name)
            ends = (left, min(y, at_y)), (left, max(y, at_y))
            if beside:
                dimension(axes, *ends, 8.5, beside, upright=True)
        else:
            across_line(axes, (at_x, bottom - 3.0), (at_x, top + 3.0), name=name)
            ends = (min(x, at_x), top), (max(x, at_x), top)
            if beside:
                dimension(axes, *ends, -3.5, beside)
            is_upright = True
    if len(planes) == 1:  # the other axis, and the length that the section does not show
        across = planes[0].right
        if across == 0:
            across_line(axes, (x, bottom - 1.0), (x, top + 1.0))
        else:
            across_line(axes, (left - 1.0, y), (right + 1.0, y))
        length = float((view.high - view.low)[1 - across])
        text = with_limits(plain(length), length, limits, ("width_mm", "length_mm")[across])
        if len(face_size_mm(chamber)) > 1 and across == 0:
            dimension(axes, (right, bottom), (right, top), -9.5, text, upright=True)
        elif len(face_size_mm(chamber)) > 1:
            dimension(axes, (left, bottom), (right, bottom), 9.5, text)
    _draw_places(axes, chamber, view)
    label(axes, left, top + (6.6 if is_upright else 3.0), "plan: x to the right, y up")


def _draw_places(axes: Axes, chamber: Chamber, view: View) -> None:
    """Dimension where the part stands, and openings that are not in the middle, from a wall."""
    corner = view.place(view.low)
    for axis in (0, 1):
        spans = gaps(chamber, axis)
        wall = float(view.low[axis])
        beside = [one.place[axis] for one in centres(chamber) if one.axis != axis]
        ends = distinct([at for at in beside if abs(at) > OFF], [end for _, end in spans])
        spans += [(wall, at) for at in ends]
        for number, (low, high) in enumerate(spans[:MOST_PLACES]):
            start, end = np.array([view.low, view.low])
            start[axis], end[axis] = low, high
            (x1, y1), (x2, y2) = view.place([start, end])
            away = PLACES + number * ROWS
            text = plain(round(high - low, 1))
            if axis == 0:
                dimension(axes, (x1, y1), (x2, y2), away, text, before=low == wall)
            else:
                x = corner[0] + view.scale * float((view.high - view.low)[0])
                dimension(axes, (x, y1), (x, y2), -away, text, upright=True, before=low == wall)


def draw_face(axes: Axes, chamber: Chamber, view: View, face: Face) -> tuple[list[str], str]:
    """Draw the joints between blocks on the floor, and the rim of a face that goes beyond it.

    A rim that has no room round the plan is not drawn, and told instead.

    Returns:
        What was drawn, in words, and how far a face that is not drawn goes beyond the floor.
    """
    floor = chamber.triangles[chamber.tags == TAG_SONOTRODE]
    area = outline_path(inside(1e3 * chamber.vertices[border_edges(floor)][:, :, :2]))
    assert area is not None
    look: dict[str, Any] = {"ls": (0, (6, 2)), "lw": 0.8}
    for ends in 1e3 * face.joints_on(chamber.vertices, floor)[:, :, :2]:
        axes.plot(*view.place(ends).T, color=SONOTRODE, **look)
    found = ["the joints of the floor's blocks"] if face.count > 1 else []
    if not (np.array(face.sides_mm) > np.ptp(area.vertices, axis=0) + WIDER).any():
        return found, ""
    outline = 1e3 * face.outline[[*range(len(face.outline)), 0]]
    rim = view.place(outline)
    low, high = view.place(np.array([view.low, view.high])) + np.array(FREE)
    if ((rim > low) & (rim < high)).all():
        axes.plot(*rim.T, color=SONOTRODE, zorder=0.5, **look)  # below words
        return [*found, "the sonotrode's rim"], ""
    over = np.stack([view.low - outline.min(axis=0), outline.max(axis=0) - view.high])
    most = zip("xy", over.max(axis=0).tolist(), strict=True)
    told = (f"{plain(round(by, 1))} mm in {axis}" for axis, by in most if by > WIDER)
    return found, f"the sonotrode's face goes on beyond the walls by {' and '.join(told)}"
