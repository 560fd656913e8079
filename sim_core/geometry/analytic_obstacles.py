"""An analytical cavity as the centre of a ball sees it: one obstacle a surface, moved in by the ball's radius."""

import numpy as np

from sim_core.geometry.analytic import FLOOR, SIDE, AnalyticCavity
from sim_core.geometry.obstacles import FACE, NUMBERS, ROUND, WAVING_FACE, Bore, Obstacles, seam


def bore_of(cavity: AnalyticCavity) -> Bore | None:
    """The axis of a cylinder, relative to the middle; None for a prism."""
    return (
        None
        if cavity.radius is None
        else Bore(*(float(x) for x in (cavity.centre - cavity.middle[:2])))
    )


def analytic_obstacles(
    cavity: AnalyticCavity, radius: float, waving_tag: int, swing: float
) -> Obstacles:
    """Obstacles for balls of one radius [m], relative to the cavity's middle; the floor vibrates by ``swing`` [m] if it
    has the ``waving_tag``.

    A plane is a face without borders: of a convex cavity no ball gets to what lies beyond. All boxes are the cavity's
    own but for floor and ceiling, which are flat.
    """
    count, middle = len(cavity.tags), cavity.middle
    normals, offsets = cavity.planes
    numbers = np.zeros((count, NUMBERS))
    numbers[: len(normals), 0:3] = normals
    numbers[: len(normals), 3] = offsets - normals @ middle + radius
    kinds = np.full(count, FACE, dtype=np.uint8)
    kinds[:SIDE][cavity.tags[:SIDE] == waving_tag] = WAVING_FACE
    if cavity.radius is not None:
        kinds[SIDE], numbers[SIDE, 3] = ROUND, cavity.radius - radius
    low, high = (np.tile(corner - middle, (count, 1)) for corner in cavity.bounds)
    low[:, 2] -= swing
    high[FLOOR, 2] = numbers[FLOOR, 3] + swing
    low[FLOOR + 1, 2] = -numbers[FLOOR + 1, 3]
    if cavity.radius is None:
        for side, (start, end) in enumerate(
            zip(cavity.outline, np.roll(cavity.outline, -1, axis=0), strict=True), SIDE
        ):
            ends = np.stack([start, end]) - middle[:2]
            moved = np.concatenate([ends, ends + radius * normals[side, :2]])
            low[side, :2], high[side, :2] = moved.min(axis=0), moved.max(axis=0)
    grow = seam(radius)
    triangles = np.repeat(np.arange(count, dtype=np.int32)[:, None], 2, axis=1)
    return Obstacles(numbers, kinds, triangles, low - grow, high + grow)
