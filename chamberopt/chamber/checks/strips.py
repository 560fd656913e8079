"""Find of which strip of the target a design is, where a part is peened a strip at a time."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.chamber.part import of_target

if TYPE_CHECKING:
    from chamberopt.chamber.part import Part
    from chamberopt.design.design import Design

SAME = 1e-5  # m: places that differ by less are one, as files have them to the micrometre
# Of the target's length: a longer piece leaves out an end, by which the part is held.
MOST = 0.7
LEAST = 0.02  # of a strip: what is left over at an end is none of its own below this share


class StripOfTarget(NamedTuple):
    """A strip of a target, between two planes across an axis of the part's file."""

    axis: int  # 0, 1 or 2
    low: float  # [m]
    high: float  # [m]
    first: float  # lowest place of the whole target on the axis [m]
    last: float  # highest place [m]

    @property
    def before(self) -> int:
        """Number of strips of this length that the target has below this one."""
        return self._strips(self.low - self.first)

    @property
    def settings(self) -> int:
        """Number of settings in which all of the target is peened, each a strip of this length."""
        return self.before + 1 + self._strips(self.last - self.high)

    def _strips(self, length: float) -> int:
        return max(math.ceil(length / (self.high - self.low) - LEAST), 0)


def strip_of_target(design: Design, part: Part) -> StripOfTarget | None:
    """Return the strip of the target that a design peens; None if it peens all of the target.

    The strip is what is left of the target between two sides of a box at which it is cut. It is
    None too where only an end is left out, and where the target is named by the part's file, of
    which a result keeps no names.
    """
    target, file = design.part.target, part.file
    named = target.surface != ("all",)
    if target.box_mm is None or not target.cut or named or file is None:
        return None
    mesh = file.as_read
    whole = target.model_copy(update={"box_mm": None, "cut": False, "reachable": False})
    places = mesh.vertices[np.unique(mesh.triangles[of_target(mesh, whole)])]
    first, last = places.min(axis=0), places.max(axis=0)
    low, high = 1e-3 * np.array(target.box_mm)
    cut = np.flatnonzero((low > first + SAME) | (high < last - SAME))
    if len(cut) != 1:
        return None
    axis = int(cut[0])
    ends = max(low[axis], first[axis]), min(high[axis], last[axis])
    if ends[1] - ends[0] > MOST * (last[axis] - first[axis]):
        return None
    return StripOfTarget(axis, *map(float, (*ends, first[axis], last[axis])))
