"""Find gaps between part and chamber that no shop would build: balls jam, rattle or do not get in.

A search knows them from geometry alone, before it simulates a candidate.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from chamberopt.chamber.build import Chamber
from chamberopt.chamber.checks.jams import MIN_AREA, clusters, find_gaps, sides_of_gap
from chamberopt.chamber.checks.place_names import (
    CEILING,
    SIDE_WALL,
    SONOTRODE,
    one_of,
    surface_names,
)

# Narrowest gap through which balls fly, over the largest diameter. Under the ceiling of the gear's
# chamber the impacts of balls that rattled were 6.4 % of all at 1.25 diameters, 3.4 at 1.35, 1.1 at
# 1.5, and none at 1.75.
ROOM = 1.6
MEASURED = 1.1  # widest gap that is measured, over these


class TightGap(NamedTuple):
    """A gap beside a wall of the chamber that is narrower than balls pass freely."""

    sides: tuple[str, str]  # names of the surfaces beside most of it
    text: str  # what is wrong with it


def tight_gaps(chamber: Chamber, diameters: Sequence[float]) -> Iterator[TightGap]:
    """Yield the gaps beside ceiling, wall or sonotrode that the largest ball does not pass freely.

    A gap counts if balls get to its mouth and it is larger than a ball would notice. Gaps of the
    part alone are those of every chamber, and are left to `check`.

    Args:
        diameters: diameters of the balls [m].
    """
    from scipy.spatial import KDTree

    gaps, largest = find_gaps(chamber, diameters, True, MEASURED * ROOM), max(diameters)
    touches, names = gaps.touches, surface_names(chamber)
    tight = np.flatnonzero(gaps.width <= ROOM * largest)
    free = (touches.radius >= 0.5 * largest) & (gaps.width > ROOM * largest)
    if not (len(tight) and free.any()):
        return
    mouths, near = KDTree(touches.centre[free]), largest + gaps.spacing
    for members in clusters(touches.centre[tight], 2.0 * gaps.spacing):
        gap = touches.select(tight[members])
        sides = sides_of_gap(gap, names)
        small = 2.0 * gap.area.sum() < MIN_AREA * largest**2  # the wall is one of both faces
        if small or not {CEILING, SIDE_WALL, SONOTRODE}.intersection(sides):
            continue
        if np.isfinite(mouths.query(gap.centre, distance_upper_bound=near)[0]).any():
            low, high = (1e3 * end(gaps.width[tight[members]]) for end in (np.min, np.max))
            one, two = sides
            yield TightGap(
                sides,
                f"the gap between {one} and {two} at {one_of(gap.centre, gap.area)} in the "
                f"chamber's frame is {max(0.0, low):.3g} to {high:.3g} mm wide, where a ball of "
                f"{1e3 * largest:g} mm jams, rattles or does not get in",
            )
