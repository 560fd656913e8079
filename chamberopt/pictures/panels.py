"""Draw the panels of a picture, views of a part: in its chamber, and its target from near."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from chamberopt.chamber.checks.openings import EDGE
from chamberopt.design.shape_surface import TAG_PART, TAG_WALL, is_sonotrode
from chamberopt.geometry.triangles import unit_normals
from chamberopt.pictures.actors import add_body, add_chamber
from chamberopt.pictures.camera import (
    cells_of,
    chamber_view,
    directions,
    near_directions,
    near_views,
    seen_area,
    view_frame,
)
from chamberopt.pictures.picture_page import Dimension, Mark, Panel
from chamberopt.pictures.view import View, render_view
from chamberopt.results.vtp_files import MM, Surface, fixture_body, fixture_marks

ROUND = (
    0.02  # a chamber is round whose vertices are this close to a circle, as shares of its radius
)


SIZE = 620, 620  # pixels of a view, at most
BORDER, BORDER_OF_CHAMBER = 25, 95  # pixels; the larger one has room for dimensions
WHOLE = 1.3  # longest part that is shown whole, over the length of its target
NEAR_CAPTIONS = "the target", "the target from another side"
ALIKE_CAPTION = "the target, alike from the other side"
ABOVE = 1e-3  # height over the surface from which a place is looked for, over the part's size
MARK = 30.0  # pixels between texts, and from the edge of a view
ALIKE = 3.0  # mean difference of two images, of 255, up to which they show the same
LEVEL = 1e-3  # mm by which the corners of a ceiling may lie below the highest point

Add = Callable[[Any], None]
"""Puts something into a plotter."""


def choose_views(
    parts: Sequence[tuple[Surface, Surface]], chambers: Sequence[Surface]
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Choose the directions to the eye from which all results are drawn.

    Args:
        parts: for each result the target, and the surface that may hide it.
        chambers: for each result the cavity's surface; cell data "tag" tells walls, sonotrodes and
            part apart.
    Returns:
        The direction that shows chambers, and one or two directions that show targets from near.
    """
    near, far = near_directions(parts[0][0]), directions(steep=False)
    seen = [seen_area(target, [rest], near) for target, rest in parts]
    seen_far = [
        seen_area(target, [rest, cells_of(chamber, is_sonotrode(np.asarray(chamber["tag"])))], far)
        for (target, rest), chamber in zip(parts, chambers, strict=True)
    ]
    return chamber_view(np.hstack(seen_far), far), near_views(np.hstack(seen), near)


def part_panels(
    add: Add,
    target: Surface,
    part: Surface,
    chamber: Surface,
    views: tuple[np.ndarray, Sequence[np.ndarray]],
    has_plugs: bool = False,
    finer: int = 1,
) -> list[Panel]:
    """Draw the part in its chamber with dimensions, and its target from near, as panels of a page.

    Args:
        add: function that adds the part to a plotter.
        target, part, chamber: surfaces that the views must hold.
        views: the direction to the eye that shows the chamber, and one or two directions that show
            the target from near.
        has_plugs: the mask is of plugs, which fill holes from near too. Others would hide the part.
        finer: that of View.
    """

    def add_plugged(plotter: Any) -> None:
        add(plotter)
        if has_plugs:
            add_body(plotter, chamber, "mask")

    eye, near = views
    whole = chamber_panel(add, part, chamber, eye, finer=finer)
    return [whole, *near_panels(add_plugged, target, part, near, finer)]


def chamber_panel(
    add: Add,
    part: Surface,
    chamber: Surface,
    eye: np.ndarray,
    caption: str = "in the chamber",
    finer: int = 1,
) -> Panel:
    """Draw the part in its chamber, with dimensions, as a panel of a page.

    Args:
        finer: that of View.
    """

    def add_both(plotter: Any) -> None:
        add(plotter)
        add_chamber(plotter, chamber)

    points = np.concatenate([part.points, chamber.points])
    view = render_view(add_both, eye, points, SIZE, BORDER_OF_CHAMBER, finer)
    return Panel(view, caption, chamber_dimensions(chamber, eye), points)


def without_twin(panels: Sequence[Panel]) -> list[Panel]:
    """Return panels of a target without the second if it shows the same as the first.

    So it is with both flanks of a slot that is alike on both sides.
    """
    if len(panels) == 2:
        one, other = (panel.view.image.astype(float) for panel in panels)
        # Seen from opposite sides, what is alike is also mirrored.
        both = (other, other[:, ::-1]) if one.shape == other.shape else ()
        if any(np.abs(one - seen).mean() < ALIKE for seen in both):
            return [panels[0]._replace(caption=ALIKE_CAPTION)]
    return [*panels]


def near_panels(
    add: Add, target: Surface, part: Surface, eyes: Sequence[np.ndarray], finer: int = 1
) -> list[Panel]:
    """Draw the target from near, from one or two directions, as panels (views with captions).

    Args:
        add: function that adds the part to a plotter.
        finer: that of View.
    """
    length, whole = (np.linalg.norm(np.ptp(one.points, axis=0)) for one in (target, part))
    is_cut = bool(whole > WHOLE * length)
    points = np.asarray((target if is_cut else part).points)
    return [
        Panel(render_view(add, eye, points, SIZE, BORDER, finer), caption, is_cut=is_cut)
        for eye, caption in zip(eyes, NEAR_CAPTIONS, strict=False)
    ]


def with_marks(
    panels: Sequence[Panel],
    marks: Sequence[tuple[str, np.ndarray]],
    part: Surface,
    chamber: Surface | None,
) -> list[Panel]:
    """Return panels with texts at places that are seen there on a part.

    Args:
        panels: of one pose; with a chamber the first one shows its holder and mask.
        marks: those of `seen_marks`.
    """
    bodies = () if chamber is None else fixture_marks(chamber)
    hiding = [part, *(fixture_body(chamber, name) for name in bodies)]
    return [
        one._replace(marks=seen_marks(marks, hiding[:1] if k else hiding, one.view))
        for k, one in enumerate(panels)
    ]


def seen_marks(
    marks: Sequence[tuple[str, np.ndarray]], hiding: Sequence[Surface], view: View
) -> list[Mark]:
    """Return texts at places that are seen on a part, each at the first such place of its own.

    Args:
        marks: texts, each with places [mm] and the normals there, (k, 6), the best place first.
        hiding: the part, and what else may hide a place.
    """
    size, eye, found, taken = (
        float(hiding[0].length),
        view.frame[2],
        list[Mark](),
        list[np.ndarray](),
    )
    high, wide = view.size
    for text, places in marks:
        for one in places:
            place, normal = one[:3], one[3:]
            at = view.pixels(place[None])[0]
            is_free = all(np.linalg.norm(at - other) > MARK for other in taken)
            if normal @ eye <= 0.0 or not is_free or not (MARK < at[0] < wide - MARK):
                continue
            start = place + ABOVE * size * normal
            end = start + 2.0 * size * eye
            is_hidden = any(len(one.ray_trace(start, end, first_point=True)[0]) for one in hiding)
            if not is_hidden and MARK < at[1] < high - MARK:
                found.append(Mark(place, text))
                taken.append(at)
                break
    return found


def chamber_dimensions(chamber: Surface, eye: np.ndarray) -> list[Dimension]:
    """Return the dimensions to write at a chamber.

    They are the chamber's size, and the distance from the sonotrode to the lowest point of the part
    in it.

    Args:
        chamber: surface of the cavity, with the tags of its triangles.
        eye: direction to the eye.
    """
    on_part = cells_of(chamber, np.asarray(chamber["tag"]) == TAG_PART)
    lowest = float(on_part.bounds[4])
    frame = view_frame(eye)
    low, high = np.reshape(chamber.bounds, (3, 2)).T
    middle, size = 0.5 * (low + high), high - low
    points = np.asarray(chamber.points, dtype=float)
    found, left = [], False
    radius = np.linalg.norm((points - middle)[:, :2], axis=1).max()
    if abs(size[:2] / (2.0 * radius) - 1.0).max() < ROUND:
        side = np.array([frame[0, 0], frame[0, 1], 0.0]) / np.linalg.norm(frame[0, :2])
        bottom = np.array([middle[0], middle[1], low[2]])
        feet = np.array([bottom - radius * side, bottom + radius * side])
        found.append(Dimension(feet, f"⌀ {2.0 * radius:.4g} mm"))
    else:
        for k in (0, 1):
            one = np.array([low, low])
            one[1, k] = high[k]
            if frame[1, 1 - k] < 0.0:  # takes the edge that is lower in the view
                one[:, 1 - k] = high[1 - k]
            found.append(Dimension(one, f"{size[k]:.4g} mm"))
            slope = (one[1] - one[0]) @ frame[:2].T
            # The nearly upright dimension is on this side, and heights are on the other side.
            if abs(slope[1]) > abs(slope[0]):
                left = bool((one.mean(axis=0) - middle) @ frame[0] > 0.0)
        feet = middle + 0.5 * size * np.array([(x, y, -1.0) for x in (-1, 1) for y in (-1, 1)])
    across = feet @ frame[0]
    foot = feet[across.argmin() if left else across.argmax()]
    found.append(_upright(foot, low[2], _walls_end(chamber), 1))
    if low[2] < lowest < high[2] - 1e-6 * size[2]:
        found.append(_upright(foot, low[2], lowest, 0))
    else:
        found[-1] = found[-1]._replace(row=0)
    return found


def _walls_end(chamber: Surface) -> float:
    """Return the height [mm] at which walls end: at the ceiling, or on a part just below it.

    A side wall ends on the part where all that it meets of it is just below the ceiling.
    """
    faces, tag = np.asarray(chamber.regular_faces), np.asarray(chamber["tag"])
    high, points = float(chamber.bounds[5]), np.asarray(chamber.points, dtype=float)
    heights, walls = points[:, 2], faces[tag == TAG_WALL]
    aside = walls[(heights[walls] < high - LEVEL).any(axis=1)]
    ways, number = np.unique(np.round(unit_normals(points[aside]), 3), axis=0, return_inverse=True)
    at_part = np.isin(np.arange(len(points)), faces[tag == TAG_PART])
    ends = [high]
    for k in range(len(ways)):
        corners = np.unique(aside[number.reshape(-1) == k])
        lowest = float(heights[corners[at_part[corners]]].min(initial=high))
        ends += [lowest] if lowest > high - EDGE * MM else []
    return min(ends)


def _upright(foot: np.ndarray, low: float, high: float, row: int) -> Dimension:
    """Return the vertical dimension between the heights `low` and `high` [mm].

    Args:
        foot: point in whose x and y the dimension is drawn.
        row: how far outside it is drawn; row 1 is farther out than row 0.
    """
    ends = np.array([foot, foot])
    ends[:, 2] = low, high
    return Dimension(ends, f"{high - low:.4g} mm", row)
