"""Measure triangle meshes: edges, connected pieces, areas, normals, inside or outside.

A surface is given by vertices (n, 3) [m] and triangles (m, 3), rows of the vertices. Side k of
triangle t runs from its corner k to the next corner. The sides of all triangles count as 3 t + k.
"""

import numpy as np

LEVEL = 1e-3  # rad: a surface that rises by less is level up to rounding
# Step of a sequence that fills a square evenly from its first point on, from powers of the plastic
# number. Source: M. Roberts, "The unreasonable effectiveness of quasirandom sequences" (2018).
EVEN_STEP = np.array([0.7548776662466927, 0.5698402909980532])
MAX_SAMPLES = 8  # points of a shell that are tested for lying in another shell


def unique_rows(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the index of the first row of each set of equal rows, and each row's set number.

    np.unique(axis=0) with index and inverse gives the same result, in six times the time.
    """
    order = np.lexsort(rows.T[::-1])
    ordered = rows[order]
    is_new = np.ones(len(rows), dtype=bool)
    is_new[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    which = np.empty(len(rows), dtype=np.int64)
    which[order] = np.cumsum(is_new) - 1
    return order[is_new], which


def count_up(times: np.ndarray) -> np.ndarray:
    """Return the numbers from 0 to n - 1 for each n of `times` (k,), joined to one array."""
    return np.asarray(np.arange(times.sum()) - np.repeat(np.cumsum(times) - times, times))


def connected_pieces(a: np.ndarray, b: np.ndarray, count: int) -> tuple[int, np.ndarray]:
    """Return the number of connected pieces of a graph, and the piece of each node, (count,).

    Args:
        a, b: nodes at both ends of each link, (k,).
        count: number of nodes.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(len(a)), (a, b)), shape=(count, count))
    number, piece = connected_components(graph, directed=False)
    return int(number), piece


def sides_of(triangles: np.ndarray) -> np.ndarray:
    """Return the start and end vertex of each side, shape (3 m, 2)."""
    return triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)


def edge_keys(triangles: np.ndarray) -> np.ndarray:
    """Return a number for the edge of each side, shape (3 m,), the same in both directions."""
    count = int(triangles.max()) + 1
    a, b = sides_of(triangles).T.astype(np.int64)
    return np.asarray(np.minimum(a, b) * count + np.maximum(a, b))


def side_pairs(triangles: np.ndarray) -> np.ndarray:
    """Return the numbers of the two sides at each edge of a closed surface, shape (e, 2)."""
    return np.argsort(edge_keys(triangles), kind="stable").reshape(-1, 2)


def border_edges(triangles: np.ndarray) -> np.ndarray:
    """Return start and end vertex (k, 2) of the sides at the border of a piece of surface.

    No other triangle of the piece shares such a side.
    """
    sides = sides_of(triangles).astype(np.int64)
    count = int(sides.max()) + 1
    return sides[~np.isin(sides[:, 0] * count + sides[:, 1], sides[:, 1] * count + sides[:, 0])]


def swept(
    vertices: np.ndarray, triangles: np.ndarray, way: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the closed surface that a piece of surface sweeps as its vertices move by `way` [m].

    Args:
        vertices: vertices of the piece [m], (n, 3).
        triangles: its triangles, whose normals point away from the way.
        way: the same for all vertices (3,), or for each its own (n, 3).
    """
    count, (a, b) = len(vertices), border_edges(triangles).T
    walls = np.concatenate([np.c_[b, a, a + count], np.c_[b, a + count, b + count]])
    all_triangles = np.concatenate([triangles, triangles[:, ::-1] + count, walls])
    return np.concatenate([vertices, vertices + way]), all_triangles.astype(np.int32)


def sharp_edges(vertices: np.ndarray, triangles: np.ndarray, degrees: float = 30.0) -> np.ndarray:
    """Return both end vertices (k, 2) of the edges at which a closed surface turns sharply."""
    return np.asarray(sides_of(triangles)[sharp_sides(vertices, triangles, degrees)[:, 0]])


def sharp_sides(vertices: np.ndarray, triangles: np.ndarray, degrees: float = 30.0) -> np.ndarray:
    """Return the numbers of the two sides (k, 2) at edges where a closed surface turns sharply.

    Sharply means by more than an angle in `degrees`.
    """
    normals, pairs = unit_vectors(area_vectors(vertices, triangles)), side_pairs(triangles)
    one, two = normals[pairs.T // 3]
    is_sharp = np.einsum("ij,ij->i", one, two) < np.cos(np.radians(degrees))
    return np.asarray(pairs[is_sharp])


def find_shells(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the number of the connected closed piece of each triangle (m,), and the volume that
    each piece encloses [m³], negative if its normals point inward.
    """
    a, b = triangles[:, [0, 1]].T.ravel(), triangles[:, [1, 2]].T.ravel()
    _, piece = connected_pieces(a, b, len(vertices))
    shells = np.unique(piece[triangles[:, 0]], return_inverse=True)[1].reshape(-1)
    return shells, np.bincount(shells, tetrahedron_volumes(vertices, triangles))


def in_small_pieces(
    vertices: np.ndarray, triangles: np.ndarray, marked: np.ndarray, least: float
) -> np.ndarray:
    """Return marks of marked triangles (m,) in pieces whose area is below `least` [m²].

    The triangles of a piece are connected by their corners.
    """
    own, small = triangles[marked], np.zeros(len(triangles), dtype=bool)
    _, piece = connected_pieces(own[:, [0, 1]].ravel(), own[:, [1, 2]].ravel(), len(vertices))
    of_piece = np.bincount(piece[own[:, 0]], areas(vertices, own), len(vertices))
    small[marked] = of_piece[piece[own[:, 0]]] < least
    return small


def tetrahedron_volumes(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return the signed volumes (m,) [m³] between triangles and the mean of all vertices.

    Their sum is the volume that a closed surface encloses.
    """
    a, b, c = (vertices[triangles[:, k]] - vertices.mean(axis=0) for k in range(3))
    return np.asarray(np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0)


def centre_of_mass(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return the centre of mass (3,) [m] of the solid that a closed surface encloses."""
    middle, volume = vertices.mean(axis=0), tetrahedron_volumes(vertices, triangles)
    offsets = (vertices[triangles] - middle).sum(axis=1) / 4.0
    return np.asarray(middle + volume @ offsets / volume.sum())


def winding_number(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return the winding number (p,) of a closed surface (m, 3, 3) around each point (p, 3).

    It is 1 inside and 0 outside: the sum of the triangles' solid angles over 4 pi.

    Source: A. Van Oosterom and J. Strackee, IEEE Trans. Biomed. Eng. 30 (1983) 125.
    """
    a, b, c = (corners[None, :, k] - points[:, None] for k in range(3))
    length_a, length_b, length_c = (np.linalg.norm(side, axis=2) for side in (a, b, c))
    triple = np.einsum("pij,pij->pi", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("pij,pij->pi", u, v) for u, v in ((a, b), (b, c), (c, a)))
    bottom = length_a * length_b * length_c + ab * length_c + bc * length_a + ca * length_b
    return np.asarray(np.arctan2(triple, bottom).sum(axis=1) / (2.0 * np.pi))


def shell_winding(
    vertices: np.ndarray, triangles: np.ndarray, shells: np.ndarray, outer: int, inner: int
) -> float:
    """Return the winding number of shell `outer` around shell `inner`, two closed surfaces.

    The number is 1 if the inner shell lies inside the outer shell, and 0 if it lies beside it.

    Args:
        shells: shell of each triangle, (m,), as `find_shells` returns it.
    """
    points = vertices[triangles[shells == inner]].mean(axis=1)
    points = points[:: max(1, len(points) // MAX_SAMPLES)]
    return float(np.median(winding_number(points, vertices[triangles[shells == outer]])))


def find_unwalled_border(
    vertices: np.ndarray, triangles: np.ndarray, face: np.ndarray
) -> np.ndarray | None:
    """Return a point (3,) [m] at the border of a floor where no wall rises beside it.

    Returns None if walls rise all round. Normals point out of the room.

    Args:
        face: marks the flat triangles of the floor, (m,).
    """
    sides, pairs = sides_of(triangles), side_pairs(triangles)
    one, two = pairs[face[pairs[:, 0] // 3] != face[pairs[:, 1] // 3]].T
    of_face, beside = np.where(face[one // 3], one, two), np.where(face[one // 3], two, one)
    normal = unit_vectors(area_vectors(vertices, triangles)[of_face // 3])
    a, b = vertices[sides[beside, 0]], vertices[sides[beside, 1]]
    apex = vertices[triangles[beside // 3, (beside % 3 + 2) % 3]]
    along = unit_vectors(b - a)
    across = apex - a - np.einsum("ij,ij->i", apex - a, along)[:, None] * along
    rise = -np.einsum("ij,ij->i", across, normal)
    low = np.flatnonzero(rise < LEVEL * np.linalg.norm(across, axis=1))
    return 0.5 * (a[low[0]] + b[low[0]]) if len(low) else None


def heights(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return the smallest height of each triangle, shape (m,) [m]; 0 if it has no area."""
    corners = vertices[triangles]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    twice = 2.0 * areas(vertices, triangles)
    return np.asarray(np.divide(twice, longest, out=np.zeros_like(twice), where=longest > 0.0))


def areas(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return the area of each triangle, shape (m,) [m²]."""
    return np.asarray(np.linalg.norm(area_vectors(vertices, triangles), axis=1))


def area_vectors(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return the unit normal times the area of each triangle, shape (m, 3) [m²]."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return 0.5 * np.cross(b - a, c - a)


def interpolate(values: np.ndarray, corners: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return values (p, c) at points (p, 3), interpolated linearly from corners of triangles.

    Each point has its own triangle, with corners (p, 3, 3) and values (p, 3, c) at the corners. A
    point beside the plane of its triangle counts as the nearest point in the plane. A triangle
    without area has the mean of its values.
    """
    a, b, c = corners.swapaxes(0, 1)
    normal = np.cross(b - a, c - a)
    square = np.einsum("ij,ij->i", normal, normal)
    weights = np.full((len(corners), 3), 1.0 / 3.0)
    some = square > 0.0
    for k, (one, two) in enumerate(((b, c), (c, a), (a, b))):
        piece = np.einsum("ij,ij->i", np.cross(two - one, places - one), normal)
        weights[some, k] = piece[some] / square[some]
    return np.asarray(np.einsum("pk,pkc->pc", weights, values))


def on_triangles(corners: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Map points u, v (..., n) of the unit square to points (..., n, c) on triangles (n, 3, c).

    One half of the square is folded onto the other, so that an even spread stays even.
    """
    fold = u + v > 1.0
    u, v = np.where(fold, 1.0 - u, u)[..., None], np.where(fold, 1.0 - v, v)[..., None]
    a, b, c = corners.swapaxes(0, 1)
    return np.asarray(a + u * (b - a) + v * (c - a))


def unit_normals(corners: np.ndarray) -> np.ndarray:
    """Return the unit normals (..., 3) of triangles with corners (..., 3, 3).

    The normal is zero for a triangle without area.
    """
    first = corners[..., 0, :]
    return unit_vectors(np.cross(corners[..., 1, :] - first, corners[..., 2, :] - first))


def facet_normals(corners: np.ndarray) -> np.ndarray:
    """Return the unit normals of triangles (m, 3, 3) at each of their corners, (m, 3, 3)."""
    return np.repeat(unit_normals(corners)[:, None], 3, axis=1)


def unit_vectors(vectors: np.ndarray) -> np.ndarray:
    """Return vectors (..., 3) scaled to length 1. A zero vector stays zero."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0.0))


def angles_between(one: np.ndarray, two: np.ndarray) -> np.ndarray:
    """Return the angles [rad] between unit vectors (..., 3), shape (...)."""
    half = 0.5 * np.linalg.norm(one - two, axis=-1)
    return np.asarray(2.0 * np.arcsin(np.clip(half, 0.0, 1.0)))


def rotation_matrix(degrees: tuple[float, float, float]) -> np.ndarray:
    """Return the matrix (3, 3) of rotations about the fixed axes x, then y, then z.

    It is exact for quarter turns.
    """
    matrix = np.eye(3)
    for axis, angle in enumerate(degrees):
        quarters, rest = divmod(angle, 90.0)
        s, c = np.sin(np.radians(rest)), np.cos(np.radians(rest))
        for _ in range(int(quarters) % 4):
            s, c = c, -s
        i, j = (axis + 1) % 3, (axis + 2) % 3
        turn = np.eye(3)
        turn[i, i], turn[i, j], turn[j, i], turn[j, j] = c, -s, s, c
        matrix = turn @ matrix
    return matrix
