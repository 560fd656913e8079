"""Arrange the views of a chamber on a page, at the largest scale at which they fit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.common.number_text import typeset_plain as plain

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.pictures.drawing.cuts import SectionPlane
    from chamberopt.pictures.drawing.dimensions import Point

_STEPS = np.outer(10.0 ** np.arange(4), (1.0, 2.0, 5.0)).ravel()  # ISO 5455
SCALES = np.concatenate([_STEPS[::-1], 1.0 / _STEPS[1:]])  # from large to small
# Room on paper [mm] round a view for its dimensions: left and right, above, below.
BESIDE, ABOVE, BELOW = 11.0, 9.0, 12.0
FACE = 2.5  # mm on paper, thickness of the drawn sonotrode
MOST_OUTSIDE = 15.0  # mm on paper, most of the part that is drawn outside the chamber


class Arrangement(NamedTuple):
    """How the views of a chamber lie on a page.

    outside: how much of the part beyond the cavity is drawn in each section, to a side and upwards,
        on the page, (n, 2) [mm].
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
        (max(low[k] - least[k], most[k] - high[k]), most[2] - high[2])
        for k in (one.right for one in planes)
    ])  # fmt: skip
    for scale in SCALES:
        outside = np.minimum(MOST_OUTSIDE, scale * beyond)
        sections = scale * sum(cavity[one.right] for one in planes) + 2.0 * outside[:, 0].sum()
        sections += 2.0 * len(planes) * BESIDE
        plan = scale * cavity[0] + 2.0 * BESIDE
        high, deep = scale * cavity[2] + outside[:, 1].max() + FACE, scale * cavity[1]
        for is_below, wide, tall in (
            (False, sections + plan, max(high, deep)),
            (True, max(sections, plan), high + deep + ABOVE + BELOW),
        ):
            found = Arrangement(
                float(scale), outside, np.array([wide, tall + ABOVE + BELOW]), is_below
            )
            if (found.needs <= np.asarray(size)).all():
                return found
    return found._replace(is_below=False)


def ends_of(chamber: Chamber) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest and the highest x, y and z of a cavity [mm], (3,) each."""
    mm = 1e3 * chamber.vertices
    return mm.min(axis=0), mm.max(axis=0)


def scale_in_words(scale: float) -> str:
    return f"{plain(scale)}:1" if scale >= 1.0 else f"1:{plain(1.0 / scale)}"
