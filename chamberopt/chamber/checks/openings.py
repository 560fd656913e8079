"""Find where the part goes out of its chamber: openings of the wall, in which it is clamped."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.chamber.checks.place_names import CEILING, surface_names
from chamberopt.design.shape_surface import TAG_PART
from chamberopt.geometry.triangles import (
    area_vectors,
    connected_pieces,
    edge_keys,
    sides_of,
    unit_vectors,
)

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber


THIN = 5e-5  # m: sides of openings below it are none
SAME_SIDE = 0.7  # cosine between walls that an edge and one inside it lie in


class Opening(NamedTuple):
    """An opening of the wall, filled by the part that goes out through it."""

    wall: str  # "the ceiling" or "the wall"
    size: tuple[float, float]  # of the box round it in the wall, level side first [m]
    place: tuple[float, float, float]  # middle of that box, in the chamber's frame [m]
    beyond: float  # how far the part stands out, square to the wall [m]
    way: tuple[float, float, float]  # unit vector square to the wall, outwards


def find_openings(chamber: Chamber) -> list[Opening]:
    """Return the openings of a chamber's wall through which the part goes out, the largest first.

    An edge inside another, as of a hollow part, is no opening of its own.
    """
    vertices, triangles = chamber.vertices, chamber.triangles
    names, on_part = surface_names(chamber), chamber.tags == TAG_PART
    fixed = np.zeros(len(triangles), dtype=bool)
    for name in chamber.fixtures:
        fixed |= chamber.on_fixture(name)
    edges, outward = edge_keys(triangles), unit_vectors(area_vectors(vertices, triangles))
    meets = np.isin(edges, edges[np.repeat(on_part, 3)])
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
