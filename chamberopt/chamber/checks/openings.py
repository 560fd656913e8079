"""Find where the part goes out of its chamber: openings of the wall, in which it is clamped.

Where the wall crosses a hole of the part, a piece of the wall stands in the hole.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.chamber.checks.place_names import CEILING, surface_names
from chamberopt.design.shape_surface import TAG_PART, TAG_WALL
from chamberopt.geometry.triangles import (
    area_vectors,
    connected_pieces,
    edge_keys,
    side_pairs,
    sides_of,
    unit_vectors,
)

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber


THIN = 5e-5  # m: sides of openings below it are none
SAME_SIDE = 0.7  # cosine between walls that an edge and one inside it lie in
# Mean cosine between the way to the middle and the normals of the part round a piece of the wall,
# from which on it stands in a hole: round a part that divides the room it is 0.
HOLLOW = 0.2


class Opening(NamedTuple):
    """An opening of the wall, filled by the part that goes out through it."""

    wall: str  # "the ceiling" or "the wall"
    size: tuple[float, float]  # of the box round it in the wall, level side first [m]
    place: tuple[float, float, float]  # middle of that box, in the chamber's frame [m]
    beyond: float  # how far the part stands out, square to the wall [m]
    way: tuple[float, float, float]  # unit vector square to the wall, outwards


class WallInHole(NamedTuple):
    """A piece of the wall that stands by itself in a hole of the part, round which is the part."""

    opening: Opening  # its place and size, like those of an opening
    beside: np.ndarray  # numbers of the part's triangles that it meets


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
    joint, on_joint = _joints(one, two, on_part)
    joint, on_joint = joint[alone[joint // 3]], on_joint[alone[joint // 3]]
    names, vectors = surface_names(chamber), area_vectors(chamber.vertices, triangles)
    outward, ends = unit_vectors(vectors), chamber.vertices[sides_of(triangles)]
    found = []
    for number in np.unique(piece[joint // 3]):
        own = piece[joint // 3] == number
        sides = ends[joint[own]]
        along = np.linalg.norm(sides[:, 1] - sides[:, 0], axis=1)
        corners = sides.reshape(-1, 3)
        middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        to_middle = unit_vectors(middle - sides.mean(axis=1))
        # The part's faces round a hole look to its middle. Normals point out of the cavity.
        facing = -np.einsum("ij,ij->i", to_middle, outward[on_joint[own] // 3])
        if along @ facing <= HOLLOW * along.sum():
            continue
        walls = np.flatnonzero(piece == number)
        largest = walls[np.linalg.norm(vectors[walls], axis=1).argmax()]
        opening = _opening(chamber, names[largest], outward, joint, own)
        if min(opening.size) > THIN:
            found.append(WallInHole(opening, np.unique(chamber.source[on_joint[own] // 3])))
    return sorted(found, key=lambda hole: -np.prod(hole.opening.size))


def part_at_wall(chamber: Chamber) -> np.ndarray:
    """Mark the part's triangles that meet the wall, but not those that a holder or mask meets."""
    one, two = side_pairs(chamber.triangles).T
    joint, on_joint = _joints(one, two, chamber.tags == TAG_PART)
    is_wall = (chamber.tags == TAG_WALL) & ~_on_fixtures(chamber)
    marked = np.zeros(len(chamber.part.triangles), dtype=bool)
    marked[chamber.source[on_joint[is_wall[joint // 3]] // 3]] = True
    return marked


def _joints(one: np.ndarray, two: np.ndarray, on_part: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
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


def find_openings(chamber: Chamber) -> list[Opening]:
    """Return the openings of a chamber's wall through which the part goes out, the largest first.

    An edge inside another, as of a hollow part, is no opening of its own.
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
        joint = np.flatnonzero(meets & np.repeat((names == wall) & ~on_part & ~fixed, 3))
        ends = sides_of(triangles)[joint]
        used, numbers = np.unique(ends, return_inverse=True)
        one, two = numbers.reshape(-1, 2).T
        piece = connected_pieces(one, two, len(used))[1] if len(used) else used
        loops = []
        edges_only: dict[tuple[float, ...], np.ndarray] = {}  # by the direction of their wall
        for own in (piece[one] == k for k in set(piece)):
            loop = _opening(chamber, wall, outward, joint, own)
            if min(loop.size) > THIN:
                loops.append(loop)
            else:  # where a part as wide as the chamber ends it, of which other sides meet no wall
                key = tuple(np.round(_out(outward, joint, own), 3))
                edges_only[key] = edges_only.get(key, False) | own
        loops += [_opening(chamber, wall, outward, joint, own) for own in edges_only.values()]
        loops.sort(key=lambda opening: -np.prod(opening.size))
        for loop in loops:
            if not any(_is_inside(loop, other) for other in found if other.wall == wall):
                found.append(loop)
    return sorted(found, key=lambda opening: -np.prod(opening.size))


def _opening(
    chamber: Chamber, wall: str, outward: np.ndarray, joint: np.ndarray, own: np.ndarray
) -> Opening:
    """Return the opening round which some sides of the chamber's triangles lie.

    Args:
        outward: unit normal of each triangle, out of the cavity, (k, 3).
        joint: numbers of the sides where the part meets a wall, (j,).
        own: marks those of the opening, (j,).
    """
    points = chamber.vertices[sides_of(chamber.triangles)[joint[own]].reshape(-1)]
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    out = _out(outward, joint, own)
    if wall == CEILING:
        size = np.ptp(points[:, :2], axis=0)
    else:
        level = np.array([-out[1], out[0], 0.0]) / np.hypot(out[0], out[1])
        size = np.array([np.ptp(points @ level), np.ptp(points @ np.cross(out, level))])
    beyond = float(((chamber.part.vertices - middle) @ out).max())
    (x, y, z), (u, v, w) = middle.tolist(), out.tolist()
    return Opening(wall, (float(size[0]), float(size[1])), (x, y, z), beyond, (u, v, w))


def _out(outward: np.ndarray, joint: np.ndarray, own: np.ndarray) -> np.ndarray:
    """Return the mean unit normal (3,) of the wall beside sides of triangles, as of `_opening`."""
    out = outward[joint[own] // 3].sum(axis=0)
    return np.asarray(out / np.linalg.norm(out))


def _is_inside(one: Opening, other: Opening) -> bool:
    """Return whether an opening lies in the box round a larger one on the same side."""
    away = np.linalg.norm(np.subtract(one.place, other.place))
    is_near = 2.0 * away < max(other.size) and np.dot(one.way, other.way) > SAME_SIDE
    return bool(is_near and min(one.size) < min(other.size))
