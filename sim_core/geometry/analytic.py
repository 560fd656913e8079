"""A cavity of exact surfaces in place of a mesh: upright, convex, a floor, a ceiling, and plane sides or one cylinder.

         ___________   1 ceiling           cylinder: 0 floor, 1 ceiling, 2 the round side
        /           \\
        |   cavity  |  2 ... sides         prism, of which a box is one: 0 floor, 1 ceiling, 2 ... n + 1 the sides,
        \\___________/                                                     in the order of the outline
            0 floor

The first system of Badreddine et al., "CAD based simulation of ultrasonic shot peening". Being convex it has no edge
that a ball could hit: its planes need no borders. All effects are simulated but contact mode and a turning part.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sim_core.errors import SceneError
from sim_core.geometry.mesh import MAX_TAGS

FLOOR, CEILING, SIDE = 0, 1, 2  # numbers of the surfaces; SIDE is the first of the sides
STRAIGHT = 1e-9  # sine of a corner's turn: less is a straight line with a corner too many
PARALLEL = -1.0 + 1e-9  # cosine of two sides' normals: as in pinches.py


@dataclass(frozen=True, eq=False)  # hashed by identity: what is built from it can be kept
class AnalyticCavity:
    """Made by ``cylinder_cavity`` or ``prism_cavity``; it takes the place of a TriangleMesh in a Scene.

    ``bottom``, ``top`` [m]; ``centre`` (2,) [m] and ``radius`` [m] of a cylinder, or of a prism (radius None) the
    ``outline`` (n, 2) [m], anticlockwise seen from above; ``tags`` (k,) uint8, one a surface.
    """

    bottom: float
    top: float
    tags: np.ndarray
    outline: np.ndarray
    centre: np.ndarray
    radius: float | None

    @property
    def bounds(self) -> np.ndarray:
        """Lowest and highest corner of the bounding box [m], (2, 3)."""
        flat = (
            self.outline
            if self.radius is None
            else self.centre + self.radius * np.array([[-1.0], [1.0]])
        )
        return np.column_stack(
            [np.stack([flat.min(axis=0), flat.max(axis=0)]), [self.bottom, self.top]]
        )

    @property
    def middle(self) -> np.ndarray:
        """Middle of the bounding box [m], (3,)."""
        return np.asarray(self.bounds.mean(axis=0))

    @property
    def volume(self) -> float:
        """Enclosed volume [m³]."""
        x, y = self.outline.T
        area = (
            0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1))
            if self.radius is None
            else np.pi * self.radius**2
        )
        return float(area * (self.top - self.bottom))

    @property
    def planes(self) -> tuple[np.ndarray, np.ndarray]:
        """Unit normals towards the shot (p, 3) and offsets (p,) [m] of the plane surfaces, by number."""
        edge = np.roll(self.outline, -1, axis=0) - self.outline
        inward = np.column_stack([-edge[:, 1], edge[:, 0]]) / np.hypot(*edge.T)[:, None]
        normals = np.concatenate(
            [[[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]], np.column_stack([inward, 0.0 * edge[:, 0]])]
        )
        offsets = [self.bottom, -self.top, *np.einsum("ij,ij->i", inward, self.outline)]
        return normals, np.array(offsets)

    @property
    def corners(self) -> np.ndarray:
        """A triangle [m] in each plane surface, wound as in a mesh, (k, 3, 3); of the round side one without area."""
        (x, y, z), (u, v, w) = self.bounds
        flat = [[[x, y, z], [x, v, z], [u, y, z]], [[x, y, w], [u, y, w], [x, v, w]]]
        ends = np.stack([self.outline, np.roll(self.outline, -1, axis=0)], axis=1)
        sides = [[[*a, z], [*b, z], [*b, w]] for a, b in ends] or [[[u, self.centre[1], z]] * 3]
        return np.array(flat + sides)

    def gaps(self, points: np.ndarray) -> np.ndarray:
        """Distance [m] of points (n, 3) [m] from each surface, (n, k); negative outside."""
        normals, offsets = self.planes
        flat = points @ normals.T - offsets
        if self.radius is None:
            return np.asarray(flat)
        return np.column_stack(
            [flat, self.radius - np.linalg.norm(points[:, :2] - self.centre, axis=1)]
        )

    def contains(self, points: np.ndarray, swing: float = 0.0) -> np.ndarray:
        """Which points (n, 3) [m] are inside, (n,) bool; also down to where a floor that swings so far [m] gets."""
        gaps = self.gaps(points)
        gaps[:, FLOOR] += swing
        return np.asarray((gaps > 0.0).all(axis=1))

    def narrowest(self) -> tuple[float, int, int]:
        """The least distance [m] between two opposite surfaces, and which; floor and ceiling left out."""
        if self.radius is not None:
            return 2.0 * self.radius, SIDE, SIDE
        normals, offsets = (values[SIDE:] for values in self.planes)
        apart = np.where(normals @ normals.T < PARALLEL, -offsets[:, None] - offsets, np.inf)
        one, two = np.unravel_index(apart.argmin(), apart.shape)
        return float(apart[one, two]), SIDE + int(one), SIDE + int(two)

    def touched(self, point: np.ndarray, reach: float, swing: float) -> list[str]:
        """Names of the surfaces within ``reach`` [m] of a point (3,) [m], nearest first.

        The floor moves by ``swing`` [m].
        """
        gaps = self.gaps(point[None])[0]
        gaps[FLOOR] -= swing
        return [self.name(int(surface)) for surface in np.argsort(gaps) if gaps[surface] <= reach]

    def name(self, surface: int) -> str:
        """E.g. "the floor", or "side 5"."""
        if surface < SIDE:
            return ("the floor", "the ceiling")[surface]
        return "the round side" if self.radius is not None else f"side {surface}"


def cylinder_cavity(
    diameter: float,
    bottom: float,
    top: float,
    tags: Sequence[int],
    centre: tuple[float, float] = (0.0, 0.0),
) -> AnalyticCavity:
    """An upright cylinder of ``diameter`` [m] between the heights ``bottom`` and ``top`` [m] about ``centre`` [m].

    ``tags``: of floor, ceiling and side. Raises SceneError for numbers that make no cylinder.
    """
    if not (np.isfinite(diameter) and diameter > 0.0):
        raise SceneError(f"cylinder_cavity: diameter is {diameter} m: it must be positive")
    middle = np.array(centre, dtype=np.float64)
    if middle.shape != (2,) or not np.isfinite(middle).all():
        raise SceneError(f"cylinder_cavity: centre is {centre}: give x and y [m]")
    return _cavity(bottom, top, tags, 1, np.zeros((0, 2)), middle, 0.5 * float(diameter))


def prism_cavity(
    outline: np.ndarray, bottom: float, top: float, tags: Sequence[int]
) -> AnalyticCavity:
    """An upright prism over the convex ``outline`` (n, 2) [m], anticlockwise seen from above; a box has n = 4.

    ``bottom``, ``top`` [m]; ``tags``: of floor, ceiling and sides, one for all sides or one each. Raises SceneError for
    an outline that is not convex, naming the corner, and for numbers that make no prism.
    """
    corners = np.array(outline, dtype=np.float64)
    if (
        corners.ndim != 2
        or corners.shape[1] != 2
        or len(corners) < 3
        or not np.isfinite(corners).all()
    ):
        raise SceneError(
            f"prism_cavity: outline must be finite numbers of shape (n, 2) with n >= 3, not {outline}"
        )
    edge = np.roll(corners, -1, axis=0) - corners
    back = np.roll(edge, 1, axis=0)
    length = np.hypot(*edge.T)
    turn = back[:, 0] * edge[:, 1] - back[:, 1] * edge[:, 0]
    bad = np.flatnonzero(~(turn > STRAIGHT * length * np.roll(length, 1)))
    if len(bad):
        raise SceneError(
            f"prism_cavity: corner {bad[0]} of the outline, {corners[bad[0]].tolist()} m, does not turn left: give a "
            "convex polygon, anticlockwise seen from above, without corners in the middle of a side"
        )
    if np.arctan2(turn, np.einsum("ij,ij->i", back, edge)).sum() > 3.0 * np.pi:
        raise SceneError("prism_cavity: the outline winds round more than once")
    return _cavity(bottom, top, tags, len(corners), corners, np.zeros(2), None)


def _cavity(
    bottom: float,
    top: float,
    tags: Sequence[int],
    sides: int,
    outline: np.ndarray,
    centre: np.ndarray,
    radius: float | None,
) -> AnalyticCavity:
    if not (np.isfinite([bottom, top]).all() and bottom < top):
        raise SceneError(f"an analytical cavity from {bottom} to {top} m: top must be above bottom")
    given = [*tags, *([tags[-1]] * (sides - 1) if len(tags) == SIDE + 1 else [])]
    if len(given) != SIDE + sides or not all(
        tag == int(tag) and 0 <= tag < MAX_TAGS for tag in given
    ):
        raise SceneError(
            f"an analytical cavity's tags are {tuple(tags)}: give floor, ceiling and sides, 0 to {MAX_TAGS - 1}"
        )
    numbers = np.array(given, dtype=np.uint8)
    for array in (outline, centre, numbers):
        array.flags.writeable = False
    return AnalyticCavity(float(bottom), float(top), numbers, outline, centre, radius)
