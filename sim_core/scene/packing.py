"""Place balls at random, one after another, without overlaps, from the bottom of the chamber up.

The shot lies at the bottom of the chamber before peening.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from sim_core.effects.part_rotation import PartRotation
from sim_core.errors import SceneError
from sim_core.geometry.analytic import AnalyticCavity, periods_of
from sim_core.geometry.mesh import TriangleMesh
from sim_core.numerics.jit import jit
from sim_core.scene.invariants import (
    TurnedSurface,
    clearance,
    contained,
    triangles_near,
    turned_corners,
)

BATCH = 256  # positions tried at once
MAX_FAILURES = 40  # batches without a free place before the shot is refused
GROWTH = 1.3  # growth factor of the layer's height
FIRST_LAYER = 1.5  # height of the first layer in diameters
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
    """Return random positions of balls inside the cavity, without overlaps.

    Balls are placed from low z upwards, and the larger balls first.

    Args:
        mesh: the cavity.
        count: number of balls.
        diameter: one diameter [m] for all balls, or an array of shape (count,).
        rng: source of the random positions.
        clear: distance from every surface [m], at least the largest amplitude, if any.
        part_rotation: rotation of the part, which is placed by its phase at the start.
        floor: lowest height of a placed ball [m].

    Returns:
        Positions [m], shape (count, 3).

    Raises:
        SceneError: if the balls do not fit. Random placement reaches about 30 % of the volume that
            a ball can use.

    Example:
        >>> box = cylinder_cavity(diameter=0.1, bottom=0.0, top=0.1, tags=[0, 1, 2])
        >>> pack_balls(box, 20, 0.003, np.random.default_rng(seed=1)).shape
        (20, 3)
    """
    sizes = np.asarray(diameter, dtype=np.float64)
    shaped = sizes.shape in ((), (count,))
    if not (count >= 1 and count == int(count) and (sizes > 0.0).all() and shaped):
        raise SceneError(
            f"cannot place {count} balls of {diameter} m: give a whole number and a positive "
            "diameter, or one each"
        )
    each = np.broadcast_to(sizes, int(count))
    placed = _PlacedBalls(len(each), 2.0 * (0.5 * float(each.max()) + GAP), periods_of(mesh))
    select_free = _free_selector(mesh, part_rotation)
    positions = np.empty((int(count), 3))
    for size in np.unique(each)[::-1]:
        before = placed.count
        layer = _Layer(mesh, select_free, float(size), clear, floor)
        _place(placed, layer, int((each == size).sum()), rng)
        positions[each == size] = placed.points[before : placed.count]
    return positions


def _free_selector(
    mesh: TriangleMesh | AnalyticCavity, part_rotation: PartRotation | None
) -> Callable[[np.ndarray, float], np.ndarray]:
    """Return a function of points (n, 3) [m] and a distance [m] that selects the free points.

    A free point is inside the cavity and at least this distance away from every surface.
    """
    if isinstance(mesh, AnalyticCavity):
        return lambda points, reach: points[(mesh.gaps(points) >= reach).all(axis=1)]
    if part_rotation is None:

        def free(points: np.ndarray, reach: float) -> np.ndarray:
            near = mesh.corners[triangles_near(mesh, points, reach)]
            points = points[clearance(near, points, reach) >= reach]
            return np.asarray(points[contained(mesh, points)])

        return free
    surface = TurnedSurface(mesh, turned_corners(mesh, part_rotation))

    def free_of_turned(points: np.ndarray, reach: float) -> np.ndarray:
        near = surface.corners[surface.near(points, reach)]
        points = points[clearance(near, points, reach) >= reach]
        return np.asarray(points[surface.encloses(points)])

    return free_of_turned


class _Layer(NamedTuple):
    """The cavity, and the limits within it, in which balls of one size are placed."""

    mesh: TriangleMesh | AnalyticCavity  # the cavity
    # function that selects points inside the cavity and far enough from every surface
    select_free: Callable[[np.ndarray, float], np.ndarray]
    diameter: float  # diameter of the balls [m]
    clear: float  # distance from every surface [m]
    floor: float  # lowest height of a placed ball [m]


def _place(placed: "_PlacedBalls", layer: _Layer, count: int, rng: np.random.Generator) -> None:
    """Add ``count`` balls of one size to the placed balls. Raises SceneError if they do not fit."""
    mesh, diameter = layer.mesh, layer.diameter
    radius = 0.5 * diameter + GAP
    reach = radius + layer.clear
    reach_of_walls = np.where(periods_of(mesh) > 0.0, 0.0, reach)
    low, high = mesh.bounds[0] + reach_of_walls, mesh.bounds[1] - reach_of_walls
    low[2] = max(low[2], layer.floor + reach)
    if (high < low).any():
        raise SceneError(
            f"no ball of {diameter * 1e3:.3g} mm fits into the mesh: it is narrower than the ball; "
            "use smaller balls or a larger chamber"
        )
    failures, first = 0, placed.count
    top = min(low[2] + FIRST_LAYER * diameter, high[2])
    while placed.count - first < count:
        points = rng.uniform(low, [high[0], high[1], top], size=(BATCH, 3))
        before = placed.count
        placed.add(layer.select_free(points, reach), radius, first + count)
        # a layer that accepts fewer than one point in fifty is full
        failures = 0 if placed.count - before > BATCH // 50 else failures + 1
        if failures and top < high[2]:
            top = min(low[2] + GROWTH * (top - low[2]), high[2])
            failures = 0
        elif failures > MAX_FAILURES:
            raise SceneError(
                f"only {placed.count - first} of {count} balls of {diameter * 1e3:.3g} mm "
                f"find a free place in {mesh.volume * 1e6:.3g} cm³; use less shot, smaller balls "
                "or a larger chamber"
            )


class _PlacedBalls:
    """The balls placed so far. Balls whose grid cells have the same hash form a chain."""

    def __init__(self, most: int, edge: float, periods: np.ndarray) -> None:
        """Make room for ``most`` balls in cells of width ``edge`` [m], twice the largest radius.

        ``periods``: periodic side lengths of the room [m], else 0, (3,).
        """
        self.count, self.edge, self.periods = 0, edge, periods
        self.points, self.radii = np.zeros((most, 3)), np.zeros(most)
        self.newest = np.full(1 << most.bit_length(), -1)  # ball of each hash
        self.older = np.full(most, -1)  # the next ball of its chain

    def add(self, points: np.ndarray, radius: float, most: int) -> None:
        """Add a ball at each point (n, 3) where it overlaps no ball, up to ``most`` in all."""
        at = self.points, self.radii, self.newest, self.older
        grid = self.edge, self.periods
        self.count = _add(np.ascontiguousarray(points), radius, most, self.count, *grid, *at)


@jit
def _add(
    new: np.ndarray,
    radius: float,
    most: int,
    count: int,
    edge: float,
    periods: np.ndarray,
    points: np.ndarray,
    radii: np.ndarray,
    newest: np.ndarray,
    older: np.ndarray,
) -> int:
    """Add the balls ``new`` (n, 3) [m] that overlap no placed ball, until there are ``most`` balls.

    ``edge``, ``periods`` and the last four arrays are the attributes of `_PlacedBalls`.

    Returns: the number of balls afterwards.
    """
    for n in range(len(new)):
        if count == most:
            break
        is_free = True
        for image in range(9):
            east, north = image // 3 - 1, image % 3 - 1
            if (east != 0 and periods[0] == 0.0) or (north != 0 and periods[1] == 0.0):
                continue
            x, y, z = new[n, 0] + east * periods[0], new[n, 1] + north * periods[1], new[n, 2]
            i, j, k = math.floor(x / edge), math.floor(y / edge), math.floor(z / edge)
            for cell in range(27):
                a, b, c = cell // 9 - 1, cell // 3 % 3 - 1, cell % 3 - 1
                other = newest[_hash(i + a, j + b, k + c) & (len(newest) - 1)]
                while other >= 0 and is_free:
                    dx, dy, dz = x - points[other, 0], y - points[other, 1], z - points[other, 2]
                    apart = radius + radii[other]
                    is_free = dx * dx + dy * dy + dz * dz >= apart * apart
                    other = older[other]
        if is_free:
            x, y, z = new[n, 0], new[n, 1], new[n, 2]
            i, j, k = math.floor(x / edge), math.floor(y / edge), math.floor(z / edge)
            points[count, 0], points[count, 1], points[count, 2], radii[count] = x, y, z, radius
            own = _hash(i, j, k) & (len(newest) - 1)
            older[count], newest[own] = newest[own], count
            count += 1
    return count


@jit
def _hash(i: int, j: int, k: int) -> int:
    """Return the hash of grid cell (i, j, k), which three large primes spread over the integers.

    Source: M. Teschner et al., "Optimized spatial hashing for collision detection of deformable
    objects", Vision, Modeling and Visualization 2003.
    """
    return (i * 73856093) ^ (j * 19349663) ^ (k * 83492791)
