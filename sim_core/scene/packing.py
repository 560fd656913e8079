"""First positions without overlap: random sequential placement, lowest in the chamber first, where the shot lies
before peening.
"""

from collections.abc import Callable

import numpy as np

from sim_core.effects.part_rotation import PartRotation
from sim_core.errors import SceneError
from sim_core.geometry.analytic import AnalyticCavity
from sim_core.geometry.mesh import TriangleMesh
from sim_core.scene.invariants import clearance, contained, enclosed, turned_corners

BATCH = 256  # positions tried at once
TRIES = 40  # batches without a free place before the layer is made higher (or the shot is refused)
GROWTH = 1.3  # of the layer's height
FIRST_LAYER = 1.5  # diameters
GAP = 1e-6  # m kept between neighbours and from surfaces, so that rounding of positions cannot overlap them


def pack_balls(
    mesh: TriangleMesh | AnalyticCavity,
    count: int,
    diameter: float | np.ndarray,
    rng: np.random.Generator,
    clear: float = 0.0,
    part_rotation: PartRotation | None = None,
    floor: float = -np.inf,
) -> np.ndarray:
    """Positions [m] of ``count`` balls inside the mesh, shape (count, 3), no two overlapping.

    ``diameter`` [m], of all or of each, (count,): the larger are placed first; ``clear`` [m] is kept from every surface
    (at least the largest amplitude, if any); ``part_rotation``: a part that turns is where its phase has it. "Low" is along
    -z, but nothing is placed lower than ``floor`` [m]. Raises SceneError when they do not fit: random placement reaches
    about 30 % of the volume a ball can use.
    """
    sizes = np.asarray(diameter, dtype=np.float64)
    if not (
        count >= 1 and count == int(count) and (sizes > 0.0).all() and sizes.shape in ((), (count,))
    ):
        raise SceneError(
            f"cannot place {count} balls of {diameter} m: give a whole number and a positive diameter"
        )
    each = np.broadcast_to(sizes, int(count))
    placed = _Placed(2.0 * (0.5 * float(each.max()) + GAP))
    free = _free_of(mesh, part_rotation)
    positions = np.empty((int(count), 3))
    for size in np.unique(each)[::-1]:
        before = len(placed.points)
        _place(placed, mesh, free, int((each == size).sum()), float(size), rng, clear, floor)
        positions[each == size] = placed.points[before:]
    return positions


def _free_of(
    mesh: TriangleMesh | AnalyticCavity, part_rotation: PartRotation | None
) -> Callable[[np.ndarray, float], np.ndarray]:
    """Those of points (n, 3) [m] that are inside and so far [m] from every surface, as a function of the two."""
    if isinstance(mesh, AnalyticCavity):
        return lambda points, reach: points[(mesh.gaps(points) >= reach).all(axis=1)]
    corners = mesh.corners if part_rotation is None else turned_corners(mesh, part_rotation)

    def free(points: np.ndarray, reach: float) -> np.ndarray:
        points = points[clearance(corners, points, reach) >= reach]
        return points[
            contained(mesh, points) if part_rotation is None else enclosed(corners, points)
        ]

    return free


def _place(
    placed: "_Placed",
    mesh: TriangleMesh | AnalyticCavity,
    free: Callable[[np.ndarray, float], np.ndarray],
    count: int,
    diameter: float,
    rng: np.random.Generator,
    clear: float,
    floor: float,
) -> None:
    """So many balls of one size more."""
    radius = 0.5 * diameter + GAP
    reach = radius + clear
    low, high = mesh.bounds[0] + reach, mesh.bounds[1] - reach
    low[2] = max(low[2], floor + reach)
    if (high < low).any():
        raise SceneError(
            f"no ball of {diameter * 1e3:.3g} mm fits into the mesh: it is narrower than the ball"
        )
    failures, first = 0, len(placed.points)
    top = min(low[2] + FIRST_LAYER * diameter, high[2])
    while len(placed.points) - first < count:
        tries = free(rng.uniform(low, [high[0], high[1], top], size=(BATCH, 3)), reach)
        before = len(placed.points)
        for point in tries:
            if len(placed.points) - first == count:
                break
            placed.add(point, radius)
        # a layer that takes under one try in fifty is full enough
        failures = 0 if len(placed.points) - before > BATCH // 50 else failures + 1
        if failures and top < high[2]:
            top = min(low[2] + GROWTH * (top - low[2]), high[2])
            failures = 0
        elif failures > TRIES:
            raise SceneError(
                f"only {len(placed.points) - first} of {count} balls of {diameter * 1e3:.3g} mm find a free place in "
                f"{mesh.volume * 1e6:.3g} cm³; use less shot, smaller balls or a larger chamber"
            )


class _Placed:
    """Points no two of which are nearer than their radii, found again by the cell they lie in, ``edge`` [m] wide: twice
    the largest radius.
    """

    def __init__(self, edge: float) -> None:
        self.edge = edge
        self.points: list[np.ndarray] = []
        self.cells: dict[tuple[int, int, int], list[tuple[np.ndarray, float]]] = {}

    def add(self, point: np.ndarray, radius: float) -> None:
        """Take the point in, unless it is too near to another."""
        i, j, k = (int(c) for c in np.floor(point / self.edge))
        for cell in (
            (i + a, j + b, k + c) for a in (-1, 0, 1) for b in (-1, 0, 1) for c in (-1, 0, 1)
        ):
            for other, its_radius in self.cells.get(cell, ()):
                if ((point - other) ** 2).sum() < (radius + its_radius) ** 2:
                    return
        self.points.append(point)
        self.cells.setdefault((i, j, k), []).append((point, radius))
