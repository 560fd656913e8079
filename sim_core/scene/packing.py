"""First positions without overlap: random sequential placement, from the bottom up.

The shot lies at the bottom of the chamber before peening.
"""

from collections.abc import Callable
from itertools import product
from typing import NamedTuple

import numpy as np

from sim_core.effects.part_rotation import PartRotation
from sim_core.errors import SceneError
from sim_core.geometry.analytic import AnalyticCavity
from sim_core.geometry.mesh import TriangleMesh
from sim_core.scene.invariants import clearance, contained, enclosed, turned_corners

BATCH = 256  # positions tried at once
MAX_FAILURES = 40  # batches without a free place before the shot is refused
GROWTH = 1.3  # of the layer's height
FIRST_LAYER = 1.5  # diameters
# m: distance between neighbours and from surfaces, so that rounding cannot make them overlap
GAP = 1e-6


def pack_balls(
    mesh: TriangleMesh | AnalyticCavity,
    count: int,
    diameter: float | np.ndarray,
    rng: np.random.Generator,
    clear: float = 0.0,
    part_rotation: PartRotation | None = None,
    floor: float = -np.inf,
) -> np.ndarray:
    """Positions of balls inside the cavity, no two overlapping.

    "Low" is along -z. The larger balls are placed first.

    Args:
        mesh: the cavity.
        count: number of balls.
        diameter: one number [m], or one for each ball, shape (count,).
        rng: source of the random positions.
        clear: distance from every surface [m]; at least the largest amplitude, if any.
        part_rotation: the part is placed as its phase at the start has it.
        floor: nothing is placed lower than this [m].

    Returns:
        Positions [m], shape (count, 3).

    Raises:
        SceneError: when they do not fit; random placement reaches about 30 % of the volume that a
            ball can use.
    """
    sizes = np.asarray(diameter, dtype=np.float64)
    shaped = sizes.shape in ((), (count,))
    if not (count >= 1 and count == int(count) and (sizes > 0.0).all() and shaped):
        raise SceneError(
            f"cannot place {count} balls of {diameter} m: give a whole number and a positive "
            "diameter, or one each"
        )
    each = np.broadcast_to(sizes, int(count))
    placed = _PlacedBalls(2.0 * (0.5 * float(each.max()) + GAP))
    select_free = _free_selector(mesh, part_rotation)
    positions = np.empty((int(count), 3))
    for size in np.unique(each)[::-1]:
        before = len(placed.points)
        layer = _Layer(mesh, select_free, float(size), clear, floor)
        _place(placed, layer, int((each == size).sum()), rng)
        positions[each == size] = placed.points[before:]
    return positions


def _free_selector(
    mesh: TriangleMesh | AnalyticCavity, part_rotation: PartRotation | None
) -> Callable[[np.ndarray, float], np.ndarray]:
    """A function of points (n, 3) [m] and a distance [m]: those inside, that far from surfaces."""
    if isinstance(mesh, AnalyticCavity):
        return lambda points, reach: points[(mesh.gaps(points) >= reach).all(axis=1)]
    corners = mesh.corners if part_rotation is None else turned_corners(mesh, part_rotation)

    def free(points: np.ndarray, reach: float) -> np.ndarray:
        points = points[clearance(corners, points, reach) >= reach]
        return points[
            contained(mesh, points) if part_rotation is None else enclosed(corners, points)
        ]

    return free


class _Layer(NamedTuple):
    """Where balls of one size are placed."""

    mesh: TriangleMesh | AnalyticCavity  # the cavity
    # selects points that are inside and far enough from every surface
    select_free: Callable[[np.ndarray, float], np.ndarray]
    diameter: float  # of the balls [m]
    clear: float  # distance from every surface [m]
    floor: float  # nothing is placed lower than this [m]


def _place(placed: "_PlacedBalls", layer: _Layer, count: int, rng: np.random.Generator) -> None:
    """Add ``count`` balls of one size."""
    mesh, diameter = layer.mesh, layer.diameter
    radius = 0.5 * diameter + GAP
    reach = radius + layer.clear
    low, high = mesh.bounds[0] + reach, mesh.bounds[1] - reach
    low[2] = max(low[2], layer.floor + reach)
    if (high < low).any():
        raise SceneError(
            f"no ball of {diameter * 1e3:.3g} mm fits into the mesh: it is narrower than the ball; "
            "use smaller balls or a larger chamber"
        )
    failures, first = 0, len(placed.points)
    top = min(low[2] + FIRST_LAYER * diameter, high[2])
    while len(placed.points) - first < count:
        points = rng.uniform(low, [high[0], high[1], top], size=(BATCH, 3))
        before = len(placed.points)
        for point in layer.select_free(points, reach):
            if len(placed.points) - first == count:
                break
            placed.add(point, radius)
        # a layer that accepts fewer than one point in fifty is full
        failures = 0 if len(placed.points) - before > BATCH // 50 else failures + 1
        if failures and top < high[2]:
            top = min(low[2] + GROWTH * (top - low[2]), high[2])
            failures = 0
        elif failures > MAX_FAILURES:
            raise SceneError(
                f"only {len(placed.points) - first} of {count} balls of {diameter * 1e3:.3g} mm "
                f"find a free place in {mesh.volume * 1e6:.3g} cm³; use less shot, smaller balls "
                "or a larger chamber"
            )


class _PlacedBalls:
    """Balls that do not overlap, found by the grid cell of their centre.

    The cells are ``edge`` [m] wide, twice the largest radius.
    """

    def __init__(self, edge: float) -> None:
        self.edge = edge
        self.points: list[np.ndarray] = []
        self.cells: dict[tuple[int, int, int], list[tuple[np.ndarray, float]]] = {}

    def add(self, point: np.ndarray, radius: float) -> None:
        """Add a ball unless it overlaps another."""
        i, j, k = (int(c) for c in np.floor(point / self.edge))
        for a, b, c in product((-1, 0, 1), repeat=3):
            for other, its_radius in self.cells.get((i + a, j + b, k + c), ()):
                if ((point - other) ** 2).sum() < (radius + its_radius) ** 2:
                    return
        self.points.append(point)
        self.cells.setdefault((i, j, k), []).append((point, radius))
