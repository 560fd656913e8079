"""Find the holes of a part outside of its chamber through which screws may hold it."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.chamber.layout.arbor import find_bores
from chamberopt.common.number_text import typeset_plain as plain

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber

FEWEST = 2  # holes of one size: one alone lets the part turn


def holes_for_screws(chamber: Chamber) -> str:
    """Return in words which holes outside of a chamber take screws, "" for none.

    An example is "4 holes of 9 mm".
    """
    file = chamber.part.file
    if file is None:
        return ""
    mesh = file.as_read
    low, high = (end(chamber.vertices, axis=0) for end in (np.min, np.max))
    posed = mesh.vertices @ file.rotation.T + file.shift
    sizes: Counter[str] = Counter()
    nothing = np.zeros(len(mesh.triangles), dtype=bool)  # what is outside is not peened
    for bore in find_bores(mesh, nothing, for_arbor=False):
        corners = posed[mesh.triangles[bore.triangles]]
        if ((corners < low) | (corners > high)).any(axis=2).all():
            sizes[plain(2e3 * bore.radius, 3)] += 1
    found = [f"{count} holes of {size} mm" for size, count in sizes.items() if count >= FEWEST]
    return " or ".join(found)
