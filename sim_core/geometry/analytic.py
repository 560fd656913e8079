"""A cavity of exact surfaces in place of a mesh: upright and convex, with a floor and a ceiling.

         ___________   1 ceiling        cylinder: 0 floor, 1 ceiling, 2 the cylinder wall
        /           \\
        |   cavity  |  2 ... sides      prism, of which a box is one: 0 floor, 1 ceiling,
        \\___________/                   2 ... n + 1 the sides in the order of the outline
            0 floor

This is the first system of Badreddine et al., "CAD based simulation of ultrasonic shot peening".
A convex cavity has no edge that a ball could hit, so its planes need no borders. All effects are
simulated except a turning part.

A box may be periodic along x, y or both: it has no sides there, and a ball that leaves it on one
side comes in on the other (numerics/periodic_sides.py).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sim_core.errors import SceneError
from sim_core.geometry.mesh import MAX_TAGS, TriangleMesh
from sim_core.geometry.obstacles import (
    CYLINDER_WALL,
    FACE,
    NUMBERS,
    VIBRATING_FACE,
    ObstacleTable,
    face_overlap_of,
)

FLOOR, CEILING, SIDE = 0, 1, 2  # numbers of the surfaces; SIDE is the first side
# sine of the angle at an outline's corner; a smaller sine is a corner on a straight line
MIN_CORNER_SINE = 1e-9
# m: half width of the floor and ceiling of a periodic box. A ball at MAX_SPEED flies 2e4 m in a
# window.
UNBOUNDED = 1e5
# cosine between the normals of two opposite sides, as in narrow_gaps.py
MAX_OPPOSITE_COSINE = -1.0 + 1e-9


class CylinderAxis(NamedTuple):
    """Position ``x``, ``y`` [m] of the axis of an upright cylinder."""

    x: float
    y: float


@dataclass(frozen=True, eq=False)  # hashed by identity, so that objects built from it can be cached
class AnalyticCavity:
    """An upright cylinder or convex prism, in place of a TriangleMesh in a Scene.

    Use ``cylinder_cavity``, ``prism_cavity`` or ``periodic_box`` to make a cavity.

    Args:
        bottom: height of the floor [m].
        top: height of the ceiling [m].
        tags: surface tags, shape (k,) uint8.
        outline: corners of a prism [m], shape (n, 2), anticlockwise seen from above.
        centre: axis of a cylinder [m], shape (2,).
        radius: radius of a cylinder [m]; None for a prism.
        periodic: periodic axes of a box, 0 for x and 1 for y.
    """

    bottom: float
    top: float
    tags: np.ndarray
    outline: np.ndarray
    centre: np.ndarray
    radius: float | None
    periodic: tuple[int, ...] = ()

    @property
    def periods(self) -> np.ndarray:
        """Side lengths of a box along its periodic axes [m], 0 along the other axes, shape (3,)."""
        sides = np.ptp(self.bounds, axis=0)
        return np.where(np.isin(np.arange(3), self.periodic), sides, 0.0)

    def put_back(self, points: np.ndarray) -> np.ndarray:
        """Return points (..., 3) [m], moved back into a periodic box by whole side lengths."""
        if not self.periodic:
            return points
        sides = self.periods
        turns = np.floor((points - self.bounds[0]) / np.where(sides > 0.0, sides, np.inf))
        return np.asarray(points - sides * turns)

    @property
    def edges(self) -> np.ndarray:
        """Ends of the outline's edges that are walls [m], shape (s, 2, 2)."""
        ends = np.stack([self.outline, np.roll(self.outline, -1, axis=0)], axis=1)
        # the first edge of a periodic box is along x, the second along y, ...
        along = np.arange(len(ends)) % 2
        return ends[~np.isin(1 - along, self.periodic)]

    @property
    def bounds(self) -> np.ndarray:
        """Lowest and highest corner of the bounding box [m], shape (2, 3)."""
        flat = self.outline
        if self.radius is not None:
            flat = self.centre + self.radius * np.array([[-1.0], [1.0]])
        ends = np.stack([flat.min(axis=0), flat.max(axis=0)])
        return np.column_stack([ends, [self.bottom, self.top]])

    @property
    def middle(self) -> np.ndarray:
        """Middle of the bounding box [m], shape (3,)."""
        return np.asarray(self.bounds.mean(axis=0))

    @property
    def axis(self) -> CylinderAxis | None:
        """Axis of a cylinder relative to the middle of its bounding box; None for a prism."""
        if self.radius is None:
            return None
        return CylinderAxis(*(float(x) for x in (self.centre - self.middle[:2])))

    @property
    def volume(self) -> float:
        """Enclosed volume [m³]."""
        x, y = self.outline.T
        area = 0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1))
        if self.radius is not None:
            area = np.pi * self.radius**2
        return float(area * (self.top - self.bottom))

    @property
    def planes(self) -> tuple[np.ndarray, np.ndarray]:
        """Unit normals towards the shot (p, 3) of the plane surfaces, and their offsets (p,) [m].

        An offset is the distance from the origin along the normal.
        """
        start = self.edges[:, 0]
        edge = self.edges[:, 1] - start
        inward = np.column_stack([-edge[:, 1], edge[:, 0]]) / np.hypot(*edge.T)[:, None]
        ends = [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]
        normals = np.concatenate([ends, np.column_stack([inward, 0.0 * edge[:, 0]])])
        offsets = [self.bottom, -self.top, *np.einsum("ij,ij->i", inward, start)]
        return normals, np.array(offsets)

    @property
    def corners(self) -> np.ndarray:
        """Corners of one triangle on each of k surfaces [m], wound as in a mesh, shape (k, 3, 3).

        The triangle of a cylinder wall has no area.
        """
        (x, y, z), (u, v, w) = self.bounds
        flat = [[[x, y, z], [x, v, z], [u, y, z]], [[x, y, w], [u, y, w], [x, v, w]]]
        sides = [[[*a, z], [*b, z], [*b, w]] for a, b in self.edges]
        if self.radius is not None:
            sides = [[[u, self.centre[1], z]] * 3]
        return np.array(flat + sides)

    def gaps(self, points: np.ndarray) -> np.ndarray:
        """Return the distance [m] of points (n, 3) from each of k surfaces, shape (n, k).

        It is negative for a point beyond the surface.
        """
        normals, offsets = self.planes
        flat = points @ normals.T - offsets
        if self.radius is None:
            return np.asarray(flat)
        wall = self.radius - np.linalg.norm(points[:, :2] - self.centre, axis=1)
        return np.column_stack([flat, wall])

    def contains(self, points: np.ndarray, amplitude: float = 0.0) -> np.ndarray:
        """Return True for points (n, 3) inside, with a floor that is ``amplitude`` [m] lower."""
        gaps = self.gaps(points)
        gaps[:, FLOOR] += amplitude
        return np.asarray((gaps > 0.0).all(axis=1))

    def narrowest(self) -> tuple[float, int, int]:
        """Return the smallest distance [m] of two opposite sides, and the two surfaces' numbers.

        It is the diameter of a cylinder, and inf without sides.
        """
        if self.radius is not None:
            return 2.0 * self.radius, SIDE, SIDE
        normals, offsets = (values[SIDE:] for values in self.planes)
        if len(normals) == 0:
            return np.inf, SIDE, SIDE
        opposite = normals @ normals.T < MAX_OPPOSITE_COSINE
        distance = np.where(opposite, -offsets[:, None] - offsets, np.inf)
        one, two = np.unravel_index(distance.argmin(), distance.shape)
        return float(distance[one, two]), SIDE + int(one), SIDE + int(two)

    def touched(self, point: np.ndarray, reach: float, floor_shift: float) -> list[str]:
        """Return the names of the surfaces near a point, nearest first.

        Args:
            point: position [m], shape (3,).
            reach: largest distance that counts [m].
            floor_shift: present displacement of the floor [m].
        """
        gaps = self.gaps(point[None])[0]
        gaps[FLOOR] -= floor_shift
        return [self.name(int(surface)) for surface in np.argsort(gaps) if gaps[surface] <= reach]

    def name(self, surface: int) -> str:
        """Return the name of a surface for messages, e.g. "the floor" or "side 5"."""
        if surface < SIDE:
            return ("the floor", "the ceiling")[surface]
        return "the cylinder wall" if self.radius is not None else f"side {surface}"


def cylinder_cavity(
    diameter: float,
    bottom: float,
    top: float,
    tags: Sequence[int],
    centre: tuple[float, float] = (0.0, 0.0),
) -> AnalyticCavity:
    """Make an upright cylinder.

    Args:
        diameter: diameter of the cylinder [m].
        bottom: height of the floor [m].
        top: height of the ceiling [m].
        tags: tags of floor, ceiling and wall.
        centre: position x, y of the axis [m].

    Raises:
        SceneError: for numbers that do not describe a cylinder.
    """
    if not (np.isfinite(diameter) and diameter > 0.0):
        raise SceneError(f"cylinder_cavity: diameter is {diameter} m: it must be positive")
    middle = np.array(centre, dtype=np.float64)
    if middle.shape != (2,) or not np.isfinite(middle).all():
        raise SceneError(f"cylinder_cavity: centre is {centre}: give x and y [m]")
    return _cavity(bottom, top, _all_tags(tags, 1), np.zeros((0, 2)), middle, 0.5 * float(diameter))


def prism_cavity(
    outline: np.ndarray, bottom: float, top: float, tags: Sequence[int]
) -> AnalyticCavity:
    """Make an upright prism over a convex outline; a box has four corners.

    Args:
        outline: corners [m], shape (n, 2), anticlockwise seen from above.
        bottom: height of the floor [m].
        top: height of the ceiling [m].
        tags: tags of floor, ceiling and sides. Give one tag for all sides, or a tag for each side.

    Raises:
        SceneError: for an outline that is not convex, naming the corner, and for numbers that do
            not describe a prism.
    """
    corners = np.array(outline, dtype=np.float64)
    shaped = corners.ndim == 2 and corners.shape[1:] == (2,) and len(corners) >= 3
    if not (shaped and np.isfinite(corners).all()):
        raise SceneError(
            "prism_cavity: outline must be finite numbers of shape (n, 2) with n >= 3, "
            f"not {outline}"
        )
    edge = np.roll(corners, -1, axis=0) - corners
    back = np.roll(edge, 1, axis=0)
    length = np.hypot(*edge.T)
    turn = back[:, 0] * edge[:, 1] - back[:, 1] * edge[:, 0]
    bad = np.flatnonzero(~(turn > MIN_CORNER_SINE * length * np.roll(length, 1)))
    if len(bad):
        raise SceneError(
            f"prism_cavity: corner {bad[0]} of the outline, {corners[bad[0]].tolist()} m, does not "
            "turn left: give a convex polygon, anticlockwise seen from above, without corners in "
            "the middle of a side"
        )
    if np.arctan2(turn, np.einsum("ij,ij->i", back, edge)).sum() > 3.0 * np.pi:
        raise SceneError("prism_cavity: the outline winds round more than once")
    return _cavity(bottom, top, _all_tags(tags, len(corners)), corners, np.zeros(2), None)


def periodic_box(
    low: Sequence[float], high: Sequence[float], tags: Sequence[int], periodic: str = "xy"
) -> AnalyticCavity:
    """Make a box with floor and ceiling and periodic sides: a ball that leaves comes in again.

    Args:
        low: lowest corner [m], shape (3,).
        high: highest corner [m], shape (3,).
        tags: tags of floor and ceiling. With "x" or "y", also the tags of the two remaining walls.
        periodic: periodic axes: "xy", "x" or "y".

    Raises:
        SceneError: for corners that do not span a box, and for other axes.
    """
    try:
        corners = np.array([low, high], dtype=np.float64)
    except (TypeError, ValueError):
        corners = np.zeros((0, 3))
    if corners.shape != (2, 3) or not (
        np.isfinite(corners).all() and (corners[0] < corners[1]).all()
    ):
        raise SceneError(
            f"periodic_box: corners are {low} and {high}: give x, y and z [m] of the lowest and "
            "of the highest"
        )
    if periodic not in ("xy", "x", "y"):
        raise SceneError(f'periodic_box: periodic is {periodic!r}: give "xy", "x" or "y"')
    (x, y, z), (u, v, w) = corners
    outline = np.array([[x, y], [u, y], [u, v], [x, v]])
    axes = tuple("xy".index(axis) for axis in periodic)
    return _cavity(z, w, _all_tags(tags, 4 - 2 * len(axes)), outline, np.zeros(2), None, axes)


def periods_of(room: TriangleMesh | AnalyticCavity) -> np.ndarray:
    """Return the side lengths of a cavity along its periodic axes [m], 0 along other axes, (3,)."""
    return room.periods if isinstance(room, AnalyticCavity) else np.zeros(3)


def _all_tags(tags: Sequence[int], sides: int) -> np.ndarray:
    """Return the tag of each surface. A single tag for the sides goes to all ``sides`` sides."""
    each = [*tags, *([tags[-1]] * (sides - 1) if sides and len(tags) == SIDE + 1 else [])]
    valid = all(tag == int(tag) and 0 <= tag < MAX_TAGS for tag in each)
    if len(each) != SIDE + sides or not valid:
        raise SceneError(
            f"an analytical cavity's tags are {tuple(tags)}: give floor, ceiling and "
            f"{sides} sides, 0 to {MAX_TAGS - 1}"
        )
    return np.array(each, dtype=np.uint8)


def _cavity(
    bottom: float,
    top: float,
    tags: np.ndarray,
    outline: np.ndarray,
    centre: np.ndarray,
    radius: float | None,
    periodic: tuple[int, ...] = (),
) -> AnalyticCavity:
    """Return a cavity with read-only arrays. Raises SceneError unless top is above bottom."""
    if not (np.isfinite([bottom, top]).all() and bottom < top):
        raise SceneError(f"an analytical cavity from {bottom} to {top} m: top must be above bottom")
    for array in (outline, centre, tags):
        array.flags.writeable = False
    return AnalyticCavity(float(bottom), float(top), tags, outline, centre, radius, periodic)


def build_analytic_table(
    cavity: AnalyticCavity, radius: float, vibrating_tag: int, amplitude: float
) -> ObstacleTable:
    """Return the obstacles that centres of balls of one radius meet in a cavity, one a surface.

    Coordinates are relative to the cavity's middle. A plane is a face without borders, because no
    ball in a convex cavity gets beyond them. The bounding boxes of floor, ceiling and plane sides
    are flat. A cylinder wall has the cavity's bounding box.

    Args:
        cavity: the cavity.
        radius: radius of the balls [m].
        vibrating_tag: tag of the vibrating surface. The floor vibrates if it has this tag.
        amplitude: amplitude of the floor [m].
    """
    count, middle = len(cavity.tags), cavity.middle
    normals, offsets = cavity.planes
    numbers = np.zeros((count, NUMBERS))
    numbers[: len(normals), 0:3] = normals
    numbers[: len(normals), 3] = offsets - normals @ middle + radius
    kinds = np.full(count, FACE, dtype=np.uint8)
    kinds[:SIDE][cavity.tags[:SIDE] == vibrating_tag] = VIBRATING_FACE
    if cavity.radius is not None:
        kinds[SIDE], numbers[SIDE, 3] = CYLINDER_WALL, cavity.radius - radius
    low, high = (np.tile(corner - middle, (count, 1)) for corner in cavity.bounds)
    low[:, 2] -= amplitude
    high[FLOOR, 2] = numbers[FLOOR, 3] + amplitude
    low[CEILING, 2] = -numbers[CEILING, 3]
    for side, both in enumerate(cavity.edges - middle[:2], SIDE):
        moved = np.concatenate([both, both + radius * normals[side, :2]])
        low[side, :2], high[side, :2] = moved.min(axis=0), moved.max(axis=0)
    low[:, cavity.periodic], high[:, cavity.periodic] = -UNBOUNDED, UNBOUNDED
    grow = face_overlap_of(radius)
    triangles = np.repeat(np.arange(count, dtype=np.int32)[:, None], 2, axis=1)
    return ObstacleTable(numbers, kinds, triangles, low - grow, high + grow)
