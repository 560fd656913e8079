"""Find where the part goes out of its chamber: openings of walls, in which it is clamped.

Where a wall crosses a hole of the part, a piece of the wall stands in the hole.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from chamberopt.chamber.checks.place_names import CEILING, SIDE_WALL, surface_names
from chamberopt.design.shape_surface import TAG_PART, TAG_WALL
from chamberopt.geometry.outline import frame_along
from chamberopt.geometry.solids import passes_opening
from chamberopt.geometry.triangles import (
    area_vectors,
    connected_pieces,
    edge_keys,
    side_pairs,
    sides_of,
    unit_vectors,
)
from sim_core import computed_once

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.chamber.part import Part


THIN = 5e-5  # m: sides of openings below it are none
EDGE = 5e-4  # m: narrower openings are none to be cut, as the wall ends on the part
BEND_DEG = 30.0  # walls that turn by less into each other are one, as facets of a cylinder
LEAST_WAY = 0.05  # length of the mean unit normal below which a wall looks no way
# Mean cosine between the way to the middle and the normals of the part round a piece of the wall,
# from which on it stands in a hole: round a part that divides the room it is 0.
HOLLOW = 0.2
# m: an opening whose outline is nowhere farther from a rectangle or a circle is cut as such
AS_CUT = 1e-4
FACETED = 0.98  # least distance of a side's middle from that of a circle over the radius
AT_EDGE = 1e-5  # m: a line this near to the edge of a wall lies on it
PLATE = 0.01  # m outside a wall's inner face, in which the wall is, however thick

# Largest difference of a hole's sides over the longer one, with which it is called round.
ROUND_HOLE = 0.05
# m: of a wall between two openings, below which it does not stand, by rule of thumb; and between
# points along their sides, by which it is measured.
LEAST_RIB, RIM_STEP = 2e-3, 2.5e-4

Form = Literal["rectangle", "round", "other", "edge"]
"""How an opening is cut: as a rectangle, drilled, along the part's section, or the wall ends."""

Mounting = Literal["part goes in", "wall goes over", "lies on it", "split"]
"""How part and wall come together, from outside or from above: or the wall is in two pieces."""


class Opening(NamedTuple):
    """An opening of a wall, filled by the part that goes out through it."""

    wall: str  # "the ceiling" or "the wall"
    size: tuple[float, float]  # of the box round it in the wall, level side first [m]
    place: tuple[float, float, float]  # middle of that box, in the chamber's frame [m]
    beyond: float  # how far the part stands out, square to the wall [m]
    way: tuple[float, float, float]  # unit vector square to the wall, outwards
    form: Form = "rectangle"
    # Sides at which the part meets the wall, in it, from `place`, seen from outside [m], (k, 2, 2):
    # level and up, or x and y in a ceiling.
    outline: np.ndarray | None = None
    # Of the box round the part in the first PLATE outside, if that is wider than the opening [m].
    wider: tuple[float, float] | None = None

    @property
    def is_end(self) -> bool:
        """Whether its wall ends on the part there, so that nothing is cut."""
        return self.form == "edge" or min(self.size) < EDGE


def part_is_ceiling(chamber: Chamber) -> bool:
    """Return whether the part closes the room at its highest place, which has no other ceiling."""
    highest = chamber.vertices[chamber.triangles[chamber.tags == TAG_PART], 2].max()
    return bool(highest > chamber.height - THIN) and CEILING not in surface_names(chamber)


def walls_end_at(openings: Sequence[Opening]) -> float | None:
    """Return the height [m] at which side walls end on the part that lies on them; None if none do.

    There the room is as high as the walls, and the part begins.
    """
    ends = [one for one in openings if one.wall != CEILING and one.is_end]
    return min((one.place[2] - 0.5 * one.size[1] for one in ends), default=None)


def mounting(part: Part, opening: Opening, clear: float) -> Mounting:
    """Return how a part comes into an opening of a wall.

    A side wall that ends on the part carries it. Another one is split only if neither what is
    inside nor what is outside passes its opening.

    Args:
        clear: room between part and wall [m].
    """
    if walls_end_at([opening]) is not None:
        return "lies on it"
    frame = frame_along(np.array(opening.way))
    level = float(np.dot(opening.place, opening.way))
    inside, outside = passes_opening(part.vertices @ frame.T, part.triangles, level, clear)
    return "part goes in" if inside else "wall goes over" if outside else "split"


class Rib(NamedTuple):
    """What is left of the walls between two openings that nearly meet."""

    one: Opening
    other: Opening
    width: float  # [m]


def thin_ribs(openings: Sequence[Opening]) -> list[Rib]:
    """Return the ribs between openings that are too thin to stand, of each two their thinnest.

    Openings that meet at an edge of their walls leave none.
    """
    from scipy.spatial import cKDTree

    rims = [_points_of_rim(one) for one in openings]
    pairs = combinations([k for k, rim in enumerate(rims) if len(rim)], 2)
    found = ((i, j, float(cKDTree(rims[i]).query(rims[j])[0].min())) for i, j in pairs)
    return [
        Rib(openings[i], openings[j], width) for i, j, width in found if AS_CUT < width < LEAST_RIB
    ]


def _points_of_rim(opening: Opening) -> np.ndarray:
    """Return points along the sides of an opening in the chamber's frame [m], (n, 3)."""
    if opening.outline is None or not len(opening.outline):
        return np.empty((0, 3))
    start, end = opening.outline[:, 0], opening.outline[:, 1]
    steps = int(np.ceil(np.linalg.norm(end - start, axis=1).max() / RIM_STEP))
    shares = np.linspace(0.0, 1.0, steps + 1)[:, None, None]
    flat = (start + shares * (end - start)).reshape(-1, 2)
    return np.asarray(opening.place + flat @ axes_along(opening.wall, np.array(opening.way)))


class Joint(NamedTuple):
    """Sides of triangles of walls along which the part goes on."""

    ends: np.ndarray  # vertices at both ends of each side, in the order of its triangle, (j, 2)
    out: np.ndarray  # unit normal of its triangle, out of the cavity, (j, 3)

    def select(self, chosen: np.ndarray) -> Joint:
        """Return the chosen sides, marked by (j,) bool."""
        return Joint(self.ends[chosen], self.out[chosen])


class WallInHole(NamedTuple):
    """A piece of the wall that stands by itself in a hole of the part, round which is the part."""

    opening: Opening  # its place and size, like those of an opening
    beside: np.ndarray  # numbers of the part's triangles that it meets

    @property
    def size_in_words(self) -> str:
        """The hole's size in the wall, such as "12 mm" of a round one."""
        wide, narrow = sorted((1e3 * one for one in self.opening.size), reverse=True)
        is_round = wide - narrow <= ROUND_HOLE * wide
        return f"{wide:.3g} mm" if is_round else f"{wide:.3g} x {narrow:.3g} mm"


def find_walls_in_holes(chamber: Chamber) -> list[WallInHole]:
    """Return the pieces of a chamber's wall that stand in holes of the part, the largest first.

    A hole that a holder or a mask fills has none.
    """
    triangles, on_part = chamber.triangles, chamber.tags == TAG_PART
    one, two = side_pairs(triangles).T
    beside = ~on_part[one // 3] & ~on_part[two // 3]
    piece = connected_pieces(one[beside] // 3, two[beside] // 3, len(triangles))[1]
    # The wall round the room is in one piece with a sonotrode, or with what holds the part.
    is_other = on_part | (chamber.tags != TAG_WALL) | _on_fixtures(chamber)
    alone = ~np.isin(piece, piece[is_other])
    if not alone.any():
        return []
    off, on = _sides_at_part(one, two, on_part)
    off, on = off[alone[off // 3]], on[alone[off // 3]]
    names, vectors = surface_names(chamber), area_vectors(chamber.vertices, triangles)
    outward, ends = unit_vectors(vectors), sides_of(triangles)
    found = []
    for number in np.unique(piece[off // 3]):
        own = piece[off // 3] == number
        joint = Joint(ends[off[own]], outward[off[own] // 3])
        sides = chamber.vertices[joint.ends]
        along = np.linalg.norm(sides[:, 1] - sides[:, 0], axis=1)
        corners = sides.reshape(-1, 3)
        middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        to_middle = unit_vectors(middle - sides.mean(axis=1))
        # The part's faces round a hole look to its middle. Normals point out of the cavity.
        facing = -np.einsum("ij,ij->i", to_middle, outward[on[own] // 3])
        if along @ facing <= HOLLOW * along.sum():
            continue
        walls = np.flatnonzero(piece == number)
        largest = walls[np.linalg.norm(vectors[walls], axis=1).argmax()]
        opening = _opening(chamber, names[largest], joint)
        if opening is not None and min(opening.size) > THIN:
            found.append(WallInHole(opening, np.unique(chamber.source[on[own] // 3])))
    return sorted(found, key=lambda hole: -np.prod(hole.opening.size))


def part_at_wall(chamber: Chamber) -> np.ndarray:
    """Mark the part's triangles that meet the wall, but not those that a holder or mask meets."""
    one, two = side_pairs(chamber.triangles).T
    off, on = _sides_at_part(one, two, chamber.tags == TAG_PART)
    is_wall = (chamber.tags == TAG_WALL) & ~_on_fixtures(chamber)
    marked = np.zeros(len(chamber.part.triangles), dtype=bool)
    marked[chamber.source[on[is_wall[off // 3]] // 3]] = True
    return marked


def _sides_at_part(
    one: np.ndarray, two: np.ndarray, on_part: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the sides off the part at which it meets something else, and the sides on it there.

    Args:
        one, two: sides at each edge of the cavity's surface, (e,).
        on_part: marks its triangles on the part, (k,).
    """
    first, second = on_part[one // 3], on_part[two // 3]
    return (
        np.r_[one[~first & second], two[first & ~second]],
        np.r_[two[~first & second], one[first & ~second]],
    )


def _on_fixtures(chamber: Chamber) -> np.ndarray:
    """Mark the triangles of a chamber on its holder or its mask, (k,)."""
    fixed = np.zeros(len(chamber.triangles), dtype=bool)
    for name in chamber.fixtures:
        fixed |= chamber.on_fixture(name)
    return fixed


@computed_once(4)
def find_openings(chamber: Chamber) -> list[Opening]:
    """Return the openings of a chamber's walls through which the part goes out, the largest first.

    One that goes on over the edge between two walls is an opening of each. A hole of the part that
    a wall closes, as the bore of a pipe, is none.
    """
    vertices, triangles = chamber.vertices, chamber.triangles
    names, on_part = surface_names(chamber), chamber.tags == TAG_PART
    fixed = _on_fixtures(chamber)
    edges, outward = edge_keys(triangles), unit_vectors(area_vectors(vertices, triangles))
    filled = on_part  # with the plugs of its holes, which go out through the wall with it
    if (mask := chamber.fixtures.get("mask")) is not None and mask.kind == "plugs":
        filled = on_part | chamber.on_fixture("mask")
    meets = np.isin(edges, edges[np.repeat(filled, 3)])
    found: list[Opening] = []
    for wall in np.unique(names[~on_part & ~fixed & (chamber.source < 0)]):
        sides = np.flatnonzero(meets & np.repeat((names == wall) & ~on_part & ~fixed, 3))
        joint = Joint(sides_of(triangles)[sides], outward[sides // 3])
        on_wall = np.unique(triangles[names == wall])
        lines: dict[tuple[float, ...], list[Joint]] = {}  # by the direction of their wall
        for loop in _loops(joint):
            if _is_hole_of_part(vertices, loop):
                continue
            for own in _on_each_wall(loop):
                one = _opening(chamber, wall, own)
                if one is None:
                    continue
                if min(one.size) <= THIN or _crosses_wall(chamber, one, own, on_wall):
                    lines.setdefault(tuple(np.round(one.way, 3)), []).append(own)
                else:
                    found.append(one._replace(wider=_wider(chamber, one, own, on_wall)))
        for several in lines.values():
            one = _opening(chamber, wall, Joint(*map(np.concatenate, zip(*several, strict=True))))
            if one is not None and len(several) == 1:
                one = one._replace(form="edge")
            found += [] if one is None else [one]
    return sorted(found, key=lambda opening: -np.prod(opening.size))


def _loops(joint: Joint) -> Iterator[Joint]:
    """Yield the sides of a joint that hang together, as those round one opening."""
    used, numbers = np.unique(joint.ends, return_inverse=True)
    one, two = numbers.reshape(-1, 2).T
    count, piece = connected_pieces(one, two, len(used))
    yield from (joint.select(piece[one] == number) for number in range(count))


def _on_each_wall(loop: Joint) -> Iterator[Joint]:
    """Yield the sides of a loop on each wall: on one side of a box, or all round a cylinder."""
    ways, numbers = np.unique(np.round(loop.out, 6), axis=0, return_inverse=True)
    one, two = np.nonzero(ways @ ways.T > np.cos(np.radians(BEND_DEG)))
    count, wall = connected_pieces(one, two, len(ways))
    yield from (loop.select(wall[numbers.reshape(-1)] == number) for number in range(count))


def _is_hole_of_part(vertices: np.ndarray, loop: Joint) -> bool:
    """Return whether the wall lies inside a loop, and the part round it.

    The sides then go round the way out of the room by the right hand, as those of the triangles of
    the wall do. A loop that ends at the edge of its wall is closed by a straight line.
    """
    places, times = np.unique(loop.ends, return_counts=True)
    start = vertices[places[np.argmin(times)]]  # an end of an open one
    one, two = (vertices[loop.ends[:, k]] - start for k in (0, 1))
    length = np.linalg.norm(two - one, axis=1)
    inside = np.cross(one, two).sum(axis=0) @ (length @ loop.out)
    return bool(inside > THIN**2 * length.sum())


def _opening(chamber: Chamber, wall: str, own: Joint) -> Opening | None:
    """Return the opening of a wall round which some sides lie; None if they lie all round a room.

    Args:
        own: the sides of the wall's triangles where it meets the part.
    """
    points = chamber.vertices[own.ends.reshape(-1)]
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    out = own.out.mean(axis=0)
    if np.linalg.norm(out) < LEAST_WAY:
        return None
    out /= np.linalg.norm(out)
    sides = (points - middle) @ axes_along(wall, out).T
    low, high = sides.min(axis=0), sides.max(axis=0)
    outline = (sides - 0.5 * (low + high)).reshape(-1, 2, 2)
    wide, tall = (high - low).tolist()
    beyond = float(((chamber.part.vertices - middle) @ out).max())
    (x, y, z), (u, v, w) = middle.tolist(), out.tolist()
    form = _form(outline, 0.5 * (high - low))
    return Opening(wall, (wide, tall), (x, y, z), beyond, (u, v, w), form, outline)


def axes_along(wall: str, out: np.ndarray) -> np.ndarray:
    """Return the two axes along a wall in which its openings are given, (2, 3).

    Args:
        out: unit vector square to the wall, out of the room, (3,).
    """
    if wall != SIDE_WALL:
        return np.eye(3)[:2]
    level = np.array([-out[1], out[0], 0.0]) / np.hypot(out[0], out[1])
    return np.array([level, np.cross(out, level)])


def _form(outline: np.ndarray, half: np.ndarray) -> Form:
    """Return how an opening is cut. A rectangle may go on over the edge of its wall.

    Args:
        outline: as of `Opening`, from the middle of the box round it.
        half: half of that box's sides [m], (2,).
    """
    middles = outline.mean(axis=1)
    radius = float(half.mean())
    off_circle = np.abs(np.linalg.norm(outline, axis=2) - radius)
    is_square = float(np.ptp(half)) < AS_CUT
    inner = np.linalg.norm(middles, axis=1).min()
    if is_square and off_circle.max() < AS_CUT and inner > FACETED * radius:
        return "round"
    # A side that leaves the box round the opening leaves it in its middle, or at an end.
    places = np.concatenate([outline.reshape(-1, 2), middles])
    off_box = np.abs(np.abs(places) - half).min(axis=1)
    return "rectangle" if off_box.max() < AS_CUT else "other"


def _crosses_wall(chamber: Chamber, one: Opening, own: Joint, on_wall: np.ndarray) -> bool:
    """Return whether the part, as wide as a wall, ends it along some sides.

    They go from one edge of the wall to another, through the middle of it.

    Args:
        one: the opening as it would be if these sides went all round it.
        on_wall: vertices of the wall, (n,).
    """
    from shapely import LineString, MultiPoint

    places, times = np.unique(own.ends, return_counts=True)
    ends = chamber.vertices[places[times == 1]]
    if len(ends) != 2:
        return False
    out = np.array(one.way)
    frame = axes_along(one.wall, out)
    flat = np.abs((chamber.vertices[on_wall] - one.place) @ out) < AS_CUT
    points = chamber.vertices[on_wall[flat]] if flat.any() else ends
    edge = MultiPoint(points @ frame.T).convex_hull.boundary
    return bool(LineString(ends @ frame.T).centroid.distance(edge) > AT_EDGE)


def _wider(
    chamber: Chamber, one: Opening, own: Joint, on_wall: np.ndarray
) -> tuple[float, float] | None:
    """Return the sides of the box round the part in a flat wall, if it widens there; else None.

    What goes out over an edge of the wall is of the next wall's opening.

    Args:
        own: sides of the opening.
        on_wall: vertices of the wall, (n,).
    """
    out = np.array(one.way)
    frame = np.vstack([axes_along(one.wall, out), out])
    corners = (chamber.vertices[on_wall] - one.place) @ frame.T
    corners = corners[np.abs(corners[:, 2]) < AS_CUT]
    rim = (chamber.vertices[own.ends.reshape(-1)] - one.place) @ frame.T
    if np.abs(rim[:, 2]).max() > AS_CUT or not len(corners):
        return None
    rim_low, rim_high = rim[:, :2].min(axis=0), rim[:, :2].max(axis=0)
    sides = ((chamber.part.vertices - one.place) @ frame.T)[chamber.part.triangles]
    rows = np.flatnonzero((sides[..., 2].min(axis=1) < PLATE) & (sides[..., 2].max(axis=1) > 0.0))
    inside = np.zeros(len(sides), dtype=bool)
    inside[rows] = True
    first, second = (side_pairs(chamber.part.triangles) // 3).T
    together = inside[first] & inside[second]
    piece = connected_pieces(first[together], second[together], len(sides))[1]
    points = _clipped_sides(sides[rows], PLATE)
    numbers = np.repeat(piece[rows], 3)
    aside = np.abs(points[..., :2] - 0.5 * (rim_low + rim_high)) - 0.5 * (rim_high - rim_low)
    at_rim = (np.abs(points[..., 2]) < AT_EDGE) & (aside < AT_EDGE).all(axis=-1)
    points = points[:, np.isin(numbers, numbers[at_rim.any(axis=0)])].reshape(-1, 3)[:, :2]
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        return None
    wall_low, wall_high = corners[:, :2].min(axis=0), corners[:, :2].max(axis=0)
    low = np.where(rim_low < wall_low + AT_EDGE, rim_low, points.min(axis=0))
    high = np.where(rim_high > wall_high - AT_EDGE, rim_high, points.max(axis=0))
    wide, tall = (np.maximum(high, rim_high) - np.minimum(low, rim_low)).tolist()
    is_wider = max(wide - one.size[0], tall - one.size[1]) > 2.0 * AS_CUT
    return (wide, tall) if is_wider else None


def _clipped_sides(triangles: np.ndarray, high: float) -> np.ndarray:
    """Return the ends of the sides of triangles between two heights, 0 and another [m].

    Args:
        triangles: corners of the triangles, the height as the third number [m], (k, 3, 3).
    Returns:
        Ends (2, 3 k, 3) [m], which are not numbers of sides outside.
    """
    start, end = (triangles[:, order].reshape(-1, 3) for order in ([0, 1, 2], [1, 2, 0]))
    rise = (end - start)[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.sort([-start[:, 2] / rise, (high - start[:, 2]) / rise], axis=0)
    shares[:, rise == 0.0] = [[0.0], [1.0]]
    ends = start + np.clip(shares, 0.0, 1.0)[..., None] * (end - start)
    inside = (ends[..., 2] > -AT_EDGE) & (ends[..., 2] < high + AT_EDGE)
    return np.where(inside[..., None], ends, np.nan)
