"""Find where holders and openings are in a chamber, by their middles and axes, for dimensions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.chamber.checks.openings import axes_along, find_openings
from chamberopt.design.shape_surface import TAG_PART
from chamberopt.pictures.drawing.cuts import SAME
from chamberopt.pictures.drawing.openings import round_of

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.chamber.checks.openings import Opening
    from chamberopt.chamber.fixture import Fixture

SQUARE = 0.999  # cosine between a way and an axis from which on it goes along the axis
OFF = 0.05  # mm: what is no farther off the chamber's axis or another dimension is not dimensioned


class Centre(NamedTuple):
    """The middle of a holder, or of an opening of a wall, whose way out is along an axis."""

    axis: int  # 0, 1 or 2
    outwards: int  # 1 or -1, along that axis
    place: tuple[float, float, float]  # [mm]


def centres(chamber: Chamber) -> list[Centre]:
    """Return the middles of holder and openings, but of walls that lean or end on the part."""
    found = []
    if (holder := chamber.fixtures.get("holder")) is not None:
        found += [*_of_holder(holder)]
    for one in find_openings(chamber):
        axis = int(np.abs(one.way).argmax())
        if not one.is_end and abs(one.way[axis]) > SQUARE:
            x, y, z = (1e3 * place for place in _middle(one))
            found.append(Centre(axis, 1 if one.way[axis] > 0.0 else -1, (x, y, z)))
    return found


def _middle(one: Opening) -> tuple[float, ...]:
    """Return the middle of an opening [m]: of its round if it has one, else of the box round it."""
    circle = None if one.outline is None or one.form != "other" else round_of(one.outline)
    if circle is None:
        return one.place
    return tuple(np.asarray(one.place) + circle[0] @ axes_along(one.wall, np.array(one.way)))


def _of_holder(holder: Fixture) -> Iterator[Centre]:
    """Yield the middle of a holder that goes out along an axis, by which it is as long as it is."""
    if holder.place is None:
        return
    low, high = holder.vertices.min(axis=0), holder.vertices.max(axis=0)
    for axis, start in enumerate(holder.place):
        for outwards, length in ((1, high[axis] - start), (-1, start - low[axis])):
            if abs(1e3 * (length - holder.length)) < SAME:
                x, y, z = (1e3 * place for place in holder.place)
                yield Centre(axis, outwards, (x, y, z))
                return


def gaps(chamber: Chamber, axis: int) -> list[tuple[float, float]]:
    """Return from where to where [mm] there is room beside the part along a horizontal axis.

    There is none where the part goes out of the room. In the middle of it there are two, of which
    one is dimensioned only along the axis of what holds the part.
    """
    room = 1e3 * chamber.vertices[:, axis]
    part = 1e3 * chamber.part.vertices[:, axis]
    inside = 1e3 * chamber.vertices[chamber.triangles[chamber.tags == TAG_PART], axis]
    part = np.r_[np.clip(part, room.min(), room.max()), inside.reshape(-1)]
    below = float(room.min()), float(part.min())
    above = float(part.max()), float(room.max())
    wide = [one for one in (below, above) if one[1] - one[0] > OFF]
    holder = chamber.fixtures.get("holder")
    is_held = holder is not None and any(one.axis == axis for one in _of_holder(holder))
    if len(wide) == 2 and abs(np.ptp(below) - np.ptp(above)) < 2.0 * OFF and not is_held:
        return []
    return wide[:1]


def distinct(values: Sequence[float], known: Sequence[float] = ()) -> list[float]:
    """Return values [mm] in rising order, each once, without those that are known."""
    found: list[float] = []
    for one in sorted(values):
        if all(abs(one - other) > OFF for other in (*known, *found)):
            found.append(one)
    return found
