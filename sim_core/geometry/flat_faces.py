"""Flat faces: connected triangles of one surface in one plane are one face for the ball.

On a flat wall a fine mesh shows coverage in detail but adds no shape. A flat face grows from its
largest triangle. It takes in a triangle next to it if the far corner of this triangle lies in the
largest triangle's plane up to rounding. Its outline is then cut, square by square, into convex
quadrangles. Faces overlap, so that the quadrangles need not share corners as the triangles of a
mesh do. They are therefore large inside and small along a curved border, and their number follows
the outline, not the mesh.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import shapely

from sim_core.geometry.mesh import TriangleMesh, normals_towards_shot
from sim_core.numerics.jit import jit

# A corner this near the plane [m] lies in it. The value is below the promised accuracy of contacts,
# 1e-12 m, and above the rounding of coordinates in a chamber, 1e-17 m. Far from the origin the
# rounding of the coordinates is larger.
IN_PLANE = 1e-13
MAX_IN_PLANE = 5e-13
ROUNDINGS = 4.0
MIN_TRIANGLES = 3  # smallest flat face: two triangles are not worth a search for their outline
LONE = -1  # flat face number of a triangle that belongs to none

LONG_OUTLINE = 300  # segments from which on covering takes milliseconds
MAX_PIECE_CORNERS = 6  # a piece with more corners is cut; 4 to 8 gave the same query times
MAX_HALVINGS = 16  # the last square has 1e-5 of the flat face's size
# An outline corner nearer than this [m] to the line of its neighbours is left out. The value is a
# hundredth of the overlap between faces.
STRAIGHT = 1e-10


class FlatFaces(NamedTuple):
    """The k flat faces of a mesh of m triangles.

    A flat face is made of connected triangles of one surface that lie in one plane.
    """

    of_triangle: np.ndarray  # flat face of each triangle, LONE if none, shape (m,) int32
    seed: np.ndarray  # triangle that gives each flat face its plane, shape (k,) int32
    # A corner [m] and two unit vectors in the plane, shape (k, 3, 3). The first vector runs along
    # the longest edge of the outline. The cross product of the two points towards the shot.
    frames: np.ndarray
    outlines: list[np.ndarray]  # directed edges (3 triangle + corner) that border each flat face


class _Triangles(NamedTuple):
    """Data of each triangle that the search for flat faces reads."""

    corners: np.ndarray  # corner positions [m], shape (m, 3, 3)
    normals: np.ndarray  # unit normals, shape (m, 3), zero where a triangle has no area
    doubled: np.ndarray  # doubled areas [m²], shape (m,)
    partners: np.ndarray  # opposite of each directed edge, shape (3 m,)
    # number of the surface; only triangles of the same surface join, shape (m,)
    surface: np.ndarray


def in_plane_tolerance(vertices: np.ndarray) -> float:
    """Return how far [m] a corner may be from a plane and count as in it.

    It follows from the rounding of the mesh's vertices (n, 3) [m].
    """
    rounding = ROUNDINGS * float(np.finfo(np.float64).eps * np.abs(vertices).max())
    return min(max(IN_PLANE, rounding), MAX_IN_PLANE)


def find_flat_faces(
    corners: np.ndarray, partners: np.ndarray, surface: np.ndarray, tolerance: float
) -> FlatFaces:
    """Find the flat faces of a mesh: MIN_TRIANGLES or more connected triangles in one plane.

    Args:
        corners: corner positions [m], shape (m, 3, 3).
        partners: opposite directed edges from edge_partners, shape (3 m,).
        surface: number of the surface. Only triangles of the same surface join. Shape (m,).
        tolerance: tolerance from in_plane_tolerance [m].
    """
    count = len(corners)
    normals, doubled = normals_towards_shot(corners)
    largest_first = np.argsort(-doubled, kind="stable")
    of_triangle = np.full(count, LONE, dtype=np.int32)
    seeds = np.zeros(count, dtype=np.int32)
    queue = np.zeros(count, dtype=np.int32)
    mesh = _Triangles(corners, normals, doubled, partners, surface)
    tried = np.zeros(count, dtype=np.bool_)
    found = _grow(mesh, tolerance, largest_first, of_triangle, seeds, queue, tried)
    seed = seeds[:found].copy()
    outlines = _outlines(of_triangle, partners, found)
    frames = np.zeros((found, 3, 3))
    if found:
        border = np.concatenate(outlines)
        edge = corners[border // 3, (border % 3 + 1) % 3] - corners[border // 3, border % 3]
        length = np.linalg.norm(edge, axis=1)
        sizes = np.array([len(one) for one in outlines])
        face, first = np.repeat(np.arange(found), sizes), np.cumsum(sizes) - sizes
        is_longest = np.flatnonzero(length == np.maximum.reduceat(length, first)[face])
        longest = is_longest[np.unique(face[is_longest], return_index=True)[1]]
        frames[:, 0] = corners[seed, 0]
        frames[:, 1] = edge[longest] / length[longest, None]
        frames[:, 2] = np.cross(normals[seed], frames[:, 1])
    return FlatFaces(of_triangle, seed, frames, outlines)


def _outlines(of_triangle: np.ndarray, partners: np.ndarray, count: int) -> list[np.ndarray]:
    """Return the directed edges that border each of ``count`` flat faces.

    A directed edge has the number 3 triangle + corner.
    """
    edges = np.arange(len(partners))
    here, there = of_triangle[edges // 3], of_triangle[partners // 3]
    border = edges[(here != there) & (here != LONE)]
    border = border[np.argsort(of_triangle[border // 3], kind="stable")]
    cuts = np.searchsorted(of_triangle[border // 3], np.arange(1, count))
    return np.split(border, cuts) if count else []


@jit
def _grow(
    mesh: _Triangles,
    tolerance: float,
    largest_first: np.ndarray,
    of_triangle: np.ndarray,
    seeds: np.ndarray,
    queue: np.ndarray,
    tried: np.ndarray,
) -> int:
    """Let flat faces grow from the largest triangles: fill ``of_triangle`` and ``seeds``.

    ``queue`` and ``tried`` are working arrays.

    Returns: the number of flat faces.
    """
    count = 0
    for k in range(len(largest_first)):
        seed = largest_first[k]
        if tried[seed] or mesh.doubled[seed] == 0.0:
            continue
        tried[seed] = True
        of_triangle[seed] = count
        queue[0] = seed
        size, done = 1, 0
        while done < size:
            triangle = queue[done]
            done += 1
            for side in range(3):
                other = mesh.partners[3 * triangle + side] // 3
                if (
                    not tried[other]
                    and mesh.surface[other] == mesh.surface[seed]
                    and mesh.doubled[other] != 0.0
                    and _lies_in_plane(mesh, other, seed, tolerance)
                ):
                    tried[other] = True
                    of_triangle[other] = count
                    queue[size] = other
                    size += 1
        if size < MIN_TRIANGLES:
            for i in range(size):
                of_triangle[queue[i]] = LONE
        else:
            seeds[count] = seed
            count += 1
    return count


@jit
def _lies_in_plane(mesh: _Triangles, triangle: int, seed: int, tolerance: float) -> bool:
    """Return True if the triangle lies in the plane of triangle ``seed`` and faces the same way."""
    corners, normals = mesh.corners, mesh.normals
    facing = 0.0
    for axis in range(3):
        facing += normals[triangle, axis] * normals[seed, axis]
    if facing <= 0.0:
        return False
    for corner in range(3):
        height = 0.0
        for axis in range(3):
            offset = corners[triangle, corner, axis] - corners[seed, 0, axis]
            height += normals[seed, axis] * offset
        if abs(height) > tolerance:
            return False
    return True


class Quadrangles(NamedTuple):
    """Convex quadrangles that cover the insides of k outlines.

    Attributes:
        corners: positions [m], counter-clockwise, shape (q, 4, 2). A triangle has its last corner
            twice.
        outline: the outline that each belongs to, ascending, shape (q,).
        covered: true for each outline that is covered, shape (k,).
    """

    corners: np.ndarray
    outline: np.ndarray
    covered: np.ndarray


def cover_with_quadrangles(
    segments: np.ndarray, outline: np.ndarray, areas: np.ndarray
) -> Quadrangles:
    """Cover the inside of each outline with few convex quadrangles.

    The quadrangles of long outlines are remembered: a part raised or lowered in its chamber, as in
    a search, keeps those of its horizontal faces.

    Args:
        segments: segments of all borders [m], shape (n, 2, 2). Loops of a border inside other loops
            of it are holes.
        outline: the outline that each segment belongs to, ascending from 0 to k - 1, shape (n,).
        areas: area of the inside of each outline [m²], (k,). An outline that crosses itself has a
            different area, and is not covered.
    """
    is_long = np.bincount(outline, minlength=len(areas)) >= LONG_OUTLINE
    if not is_long.any():
        return _cover(segments, outline, areas)
    short = np.flatnonzero(~is_long)
    rows = ~is_long[outline]
    found = _cover(segments[rows], np.searchsorted(short, outline[rows]), areas[short])
    corners, owner, covered = [found.corners], [short[found.outline]], np.zeros(len(areas), bool)
    covered[short] = found.covered
    for k in np.flatnonzero(is_long):
        one = _cover_long(segments[outline == k].tobytes(), float(areas[k]))
        corners.append(one.corners)
        owner.append(np.full(len(one.corners), k))
        covered[k] = one.covered[0]
    in_order = np.argsort(np.concatenate(owner), kind="stable")
    return Quadrangles(np.concatenate(corners)[in_order], np.concatenate(owner)[in_order], covered)


@lru_cache(8)
def _cover_long(segments: bytes, area: float) -> Quadrangles:
    """Cover the inside of one outline, given by the bytes of its segments."""
    ends = np.frombuffer(segments).reshape(-1, 2, 2)
    return _cover(ends, np.zeros(len(ends), dtype=np.int64), np.array([area]))


def _cover(segments: np.ndarray, outline: np.ndarray, areas: np.ndarray) -> Quadrangles:
    """Cover outlines as `cover_with_quadrangles` does."""
    lines = shapely.multilinestrings(shapely.linestrings(segments), indices=outline)
    regions = shapely.simplify(shapely.build_area(lines), STRAIGHT)
    is_sound = ~shapely.is_empty(regions) & shapely.is_valid(regions)
    corners, owner = _quadrangles(*_cut(regions[is_sound], np.flatnonzero(is_sound)))
    one = _doubled_area(corners[:, 0], corners[:, 1], corners[:, 2])
    two = _doubled_area(corners[:, 0], corners[:, 2], corners[:, 3])
    size = 0.5 * one + 0.5 * two
    covered = np.abs(np.bincount(owner, size, len(areas)) - areas) <= 1e-9 * areas
    longest = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1)
    # The overlap of neighbouring pieces covers a piece that is thinner than that.
    kept = np.flatnonzero(is_sound[owner] & covered[owner] & (size > STRAIGHT * longest))
    kept = kept[np.argsort(owner[kept], kind="stable")]
    return Quadrangles(corners[kept], owner[kept], is_sound & covered)


def _doubled_area(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Return twice the signed area [m²] of triangles with corners a, b and c, (n, 2) [m] each."""
    one, two = b - a, c - a
    return np.asarray(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0])


def _cut(regions: np.ndarray, owner: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cut regions into quarters, and each quarter again, until each piece has few corners.

    Args:
        regions: polygons with holes, (k,).
        owner: a number of each region, (k,).
    Returns:
        The pieces, which are polygons, and the number of the region of each.
    """
    simple, owners = [], []
    for depth in range(MAX_HALVINGS + 1):
        parts, whole = shapely.get_parts(regions, return_index=True)
        # a quarter may miss the piece, or touch it in a point or a line
        solid = (shapely.get_dimensions(parts) == 2) & ~shapely.is_empty(parts)
        parts, owner = parts[solid], owner[whole[solid]]
        few = shapely.get_num_coordinates(parts) - 1 <= MAX_PIECE_CORNERS
        few |= depth == MAX_HALVINGS
        simple.append(parts[few])
        owners.append(owner[few])
        parts, owner = parts[~few], owner[~few]
        if not len(parts):
            break
        x0, y0, x1, y1 = shapely.bounds(parts).T
        # a strip is only cut across
        wide, high = x1 - x0 >= 0.5 * (y1 - y0), y1 - y0 >= 0.5 * (x1 - x0)
        x, y = np.where(wide, 0.5 * (x0 + x1), x1), np.where(high, 0.5 * (y0 + y1), y1)
        quarters = [
            (np.ones(len(parts), dtype=bool), shapely.box(x0, y0, x, y)),
            (high, shapely.box(x0, y, x, y1)),
            (wide, shapely.box(x, y0, x1, y)),
            (wide & high, shapely.box(x, y, x1, y1)),
        ]
        regions = np.concatenate([shapely.intersection(parts[k], box[k]) for k, box in quarters])
        owner = np.concatenate([owner[k] for k, _ in quarters])
    return np.concatenate(simple), np.concatenate(owners)


def _quadrangles(polygons: np.ndarray, owner: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return convex quadrangles (q, 4, 2) [m] that make up polygons (n,), with no corner added.

    A cut that misses a corner by rounding leaves a side of 1e-17 m. Such a side has no direction
    and would shut balls out of the piece, so that its corner is left out.

    Args:
        owner: a number of each polygon, (n,).
    Returns:
        The quadrangles, and for each the number of its polygon, (q,).
    """
    polygons = shapely.orient_polygons(shapely.simplify(polygons, STRAIGHT))
    ring, whole = shapely.get_coordinates(polygons, return_index=True)
    count = np.bincount(whole, minlength=len(polygons)) - 1  # corners, if there is no hole
    first = np.cumsum(count + 1) - count - 1
    before, here = np.arange(len(ring)) - 1, np.flatnonzero(np.diff(whole, append=-1) == 0)
    there = count > 0
    before[first[there]] = (first + count - 1)[there]
    turn = np.zeros(len(ring))
    turn[here] = _doubled_area(ring[before[here]], ring[here], ring[here + 1])
    convex = np.bincount(whole, turn < 0.0, len(polygons)) == 0
    convex &= shapely.get_num_interior_rings(polygons) == 0
    # a convex polygon becomes a fan of quadrangles
    fans = np.where(convex, np.maximum(count - 1, 0) // 2, 0)
    fan = np.repeat(np.arange(len(polygons)), fans)
    k = 1 + 2 * (np.arange(len(fan)) - np.repeat(np.cumsum(fans) - fans, fans))
    last = count[fan] - 1
    at = np.stack([np.zeros_like(k), k, k + 1, np.minimum(k + 2, last)], axis=1)
    corners = [ring[first[fan][:, None] + at]]
    # all others become triangles; a piece that is only a line has none
    others = np.flatnonzero(~convex)
    triangles, of = shapely.get_parts(
        shapely.constrained_delaunay_triangles(polygons[others]), return_index=True
    )
    tips = shapely.get_coordinates(shapely.orient_polygons(triangles)).reshape(-1, 4, 2)
    corners.append(tips[:, [0, 1, 2, 2]])
    return np.concatenate(corners), owner[np.concatenate([fan, others[of]])]


class SurfaceTriangles(NamedTuple):
    """The m triangles of a mesh with all data that obstacles are made from."""

    mesh: TriangleMesh  # the mesh
    corners: np.ndarray  # corner positions relative to the mesh's middle [m], shape (m, 3, 3)
    # unit normals towards the shot, shape (m, 3), zero where a triangle has no area
    normals: np.ndarray
    doubled: np.ndarray  # doubled areas [m²], shape (m,)
    vibrating: np.ndarray  # True for each vibrating triangle, shape (m,) bool
    amplitude: np.ndarray  # zero-to-peak [m], 0 for triangles that stand still, shape (m,)
    flat_faces: FlatFaces  # the flat faces of the mesh


def surface_triangles(
    mesh: TriangleMesh, vibrating_tags: tuple[int, ...] = (), amplitudes: tuple[float, ...] = ()
) -> SurfaceTriangles:
    """Return the triangles of a mesh with all data that obstacles are made from.

    Triangles with the tag vibrating_tags[i] vibrate with the amplitude amplitudes[i] [m].
    """
    corners = mesh.corners - mesh.middle
    amplitude = np.zeros(len(corners))
    for tag, largest in zip(vibrating_tags, amplitudes, strict=True):
        amplitude[mesh.tags == tag] = largest
    partners, tolerance = mesh.partners, in_plane_tolerance(mesh.vertices)
    return SurfaceTriangles(
        mesh,
        corners,
        *normals_towards_shot(corners),
        np.isin(mesh.tags, vibrating_tags),
        amplitude,
        find_flat_faces(corners, partners, mesh.tags, tolerance),
    )
