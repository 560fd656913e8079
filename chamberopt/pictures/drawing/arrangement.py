"""Arrange the views of a chamber on a page, at the largest scale at which they fit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.common.number_text import typeset_plain as plain
from chamberopt.pictures.drawing.cuts import cut, inside
from sim_core import computed_once

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.pictures.drawing.cuts import SectionPlane
    from chamberopt.pictures.drawing.dimensions import Point

_STEPS = np.outer(10.0 ** np.arange(4), (1.0, 2.0, 5.0)).ravel()  # ISO 5455
SCALES = np.concatenate([_STEPS[::-1], 1.0 / _STEPS[1:]])  # from large to small
# Room on paper [mm] round a view for its dimensions: left and right, above, below.
BESIDE, ABOVE, BELOW = 11.0, 10.5, 12.0
FACE = 2.5  # mm on paper, thickness of the drawn sonotrode
WALL = 1.5  # mm on paper, thickness of the drawn walls, whatever it will be
# Of what is drawn of a part beside the chamber: how many lengths are tried, and how thick it is at
# least where it is broken off, over the most.
TRIED, THICK = 61, 0.95
MOST_OUTSIDE = 15.0  # mm on paper, most of the part that is drawn outside the chamber


class Arrangement(NamedTuple):
    """How the views of a chamber lie on a page.

    outside: how much of the part beyond the cavity is drawn in each section, to the left, to the
        right and upwards, on the page, (n, 3) [mm].
    needs: width and height of all views [mm].
    is_below: the plan is below the sections, not beside them.
    """

    scale: float
    outside: np.ndarray
    needs: np.ndarray
    is_below: bool


def arrangement(chamber: Chamber, planes: Sequence[SectionPlane], size: Point) -> Arrangement:
    """Return the arrangement with the largest scale at which sections and plan fit on a page.

    Args:
        planes: planes of the sections.
        size: width and height that the drawing may have [mm].
    """
    low, high = ends_of(chamber)
    cavity, part = high - low, 1e3 * chamber.part.vertices
    least, most = part.min(axis=0), part.max(axis=0)
    beyond = np.maximum(0.0, [
        (low[k] - least[k], most[k] - high[k], most[2] - high[2])
        for k in (one.right for one in planes)
    ])  # fmt: skip
    for scale in SCALES:
        outside = np.minimum(MOST_OUTSIDE, scale * beyond)
        outside[:, :2] = [
            scale * np.array(_in_one_piece(chamber, plane, *ends.tolist()))
            for plane, ends in zip(planes, outside / scale, strict=True)
        ]
        across = scale * sum(cavity[one.right] for one in planes) + outside[:, :2].sum()
        across += 2.0 * len(planes) * BESIDE
        plan = scale * cavity[0] + 2.0 * BESIDE
        tall, deep = scale * cavity[2] + outside[:, 2].max() + FACE, scale * cavity[1]
        for is_below, wide, rows in (
            (False, across + plan, max(tall, deep)),
            (True, max(across, plan), tall + deep + ABOVE + BELOW),
        ):
            found = Arrangement(
                float(scale), outside, np.array([wide, rows + ABOVE + BELOW]), is_below
            )
            if (found.needs <= np.asarray(size)).all():
                return found
    return found._replace(is_below=False)


@computed_once(64)
def _in_one_piece(
    chamber: Chamber, plane: SectionPlane, left: float, right: float, above: float
) -> tuple[float, float]:
    """Return how much of the part is drawn left and right of a chamber [mm].

    No piece of it in the section is by itself outside. Where it goes on beyond a hole, it is broken
    off before that, where it is still about as thick as before.

    Args:
        left, right, above: how much of it is drawn to each side and above at most [mm].
    """
    import shapely

    lines, _ = cut(chamber.part.vertices, chamber.part.triangles, 1 - plane.right, 1e-3 * plane.at)
    (low, bottom), (high, top) = (ends[[plane.right, 2]] for ends in ends_of(chamber))
    section = inside(1e3 * lines)
    (least, _, most, _) = section.bounds if not section.is_empty else (low, bottom, high, top)
    drawn = shapely.box(least, bottom, most, top + above)
    pieces = shapely.get_parts(section.intersection(drawn))
    is_alone = ~shapely.intersects(pieces, shapely.box(low, bottom, high, top))
    joined, found = shapely.union_all(pieces[~is_alone]), []
    for wall, way, out, end in ((low, -1.0, left, least), (high, 1.0, right, most)):
        beside = shapely.box(min(wall, end), bottom, max(wall, end), top + above)
        if out > 0.0 and shapely.intersects(pieces[is_alone], beside).any():
            tried = np.linspace(0.0, out, TRIED)
            upright = [[(x, bottom), (x, top + above)] for x in wall + way * tried]
            thick = shapely.length(shapely.intersection(shapely.linestrings(upright), joined))
            out = tried[thick >= THICK * thick.max()].max()
        found.append(float(out))
    return found[0], found[1]


def ends_of(chamber: Chamber) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest and the highest x, y and z of a cavity [mm], (3,) each."""
    mm = 1e3 * chamber.vertices
    return mm.min(axis=0), mm.max(axis=0)


def scale_in_words(scale: float) -> str:
    return f"{plain(scale)}:1" if scale >= 1.0 else f"1:{plain(1.0 / scale)}"
