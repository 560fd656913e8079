r"""Find the normals of the smooth surface behind the facets of a mesh.

Notation
t      angle between the facets at an edge [rad], convex positive        Edges.turn, (e,)
l, h   length of an edge, and the lower height of its triangles [m]
phi    angle from a facet's normal to the surface's, in the middle of each side of the facet
       [rad], positive where the surface falls away from it              phi, (m, 3)
A      area of a facet [m²]
m      unit vector in a facet's plane, out of it across a side           across, (m, 3, 3)
S      shape operator of a facet: sum over its sides of l phi / A m mᵀ   [1/m]

The surface has piecewise constant curvature and turns at edges as the facets do. phi minimises the
sum over the smooth edges of

    l (FIT |t - phi_1 - phi_2| + ‖(l dS_ee, sqrt(l² + h²) dS_em, h dS_mm)‖) + l CREASE |phi|,

where dS is the difference of the shape operators in the frame of the edge and the direction across
it. The last term holds for sides at creases. Sums of absolute values let curvature jump at few
edges. Planes, cylinders and spheres therefore come out exactly, and a round has the plane's own
normal where it meets a plane.

Source: E. Grinspun, Y. Gingold, J. Reisman, D. Zorin, "Computing discrete shape operators on
general meshes", Computer Graphics Forum 25 (2006) 547.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.geometry.triangles import (
    area_vectors,
    connected_pieces,
    count_up,
    sides_of,
    unit_vectors,
)

if TYPE_CHECKING:
    from scipy.sparse import csr_array

    from chamberopt.geometry.smoothing.rounds import Edges

FIT, CREASE, DOUBTED = 2.5, 0.5, 0.005
# Reweighted least squares: largest number of steps, [rad] below which a residual counts by its
# square, and [rad] of the last step.
STEPS, FEW_STEPS, FLOOR, LAST = 25, 10, 0.01, 1e-3
FLAT = np.radians(0.5)  # phi below which a facet is a piece of a plane
PLANE = 1e-4  # rad: facets that turn by less are in one plane, up to the rounding of a file
MANY_SIDES = 64  # sides of a plane that is one facet
OPPOSITE = 0.45  # cosine between sides across which a facet bends about one axis
ONE_LINE = 0.02  # share of squares: sides that bend by less at a corner are one line, 16 degrees
# Angle defects by which a vertex is the apex of a cone: at once, or if the defect is OF_AROUND
# times larger than the defects around it.
APEX, SMALL_APEX, OF_AROUND = 0.5, np.radians(3.0), 4.0


class Facets(NamedTuple):
    """Normals, areas and sides of the triangles of a surface.

    Attributes:
        normal: outward unit normals, shape (m, 3).
        area: areas [m²], shape (m,).
        across: unit vectors in the plane, out of the triangle across each side, shape (m, 3, 3).
        length: length of each side [m], shape (m, 3).
    """

    normal: np.ndarray
    area: np.ndarray
    across: np.ndarray
    length: np.ndarray

    @property
    def height(self) -> np.ndarray:
        """Height [m] of each triangle over each of its sides, shape (m, 3)."""
        return np.asarray(2.0 * self.area[:, None] / np.maximum(self.length, 1e-30))


def measure_facets(vertices: np.ndarray, triangles: np.ndarray) -> Facets:
    """Return normals, areas and sides of triangles (m, 3) over vertices (n, 3) [m]."""
    vector = area_vectors(vertices, triangles)
    normal = unit_vectors(vector)
    start, end = sides_of(triangles).T
    along = (vertices[end] - vertices[start]).reshape(-1, 3, 3)
    length = np.linalg.norm(along, axis=2)
    across = np.cross(along / np.maximum(length, 1e-30)[..., None], normal[:, None])
    area = np.maximum(np.linalg.norm(vector, axis=1), 1e-30)
    return Facets(normal, area, across, length)


class Pieces(NamedTuple):
    """Facets of a surface: small planes, such as quadrangles, or single triangles.

    Attributes:
        number: number of the piece to which each triangle belongs, shape (m,).
        inner: marks the sides between triangles of one piece, shape (3 m,).
    """

    number: np.ndarray
    inner: np.ndarray

    @property
    def has_several(self) -> np.ndarray:
        """Marks of the triangles that share their piece with others, shape (m,)."""
        return np.asarray(np.bincount(self.number)[self.number] > 1)

    def around(self, triangle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the outer sides of the pieces to which some triangles (r,) belong.

        The first array (k,) has, for each side, the index in `triangle` of its triangle. The second
        array (k,) has the numbers of the sides.
        """
        outer = np.flatnonzero(~self.inner)
        outer = outer[np.argsort(self.number[outer // 3], kind="stable")]
        ends = np.searchsorted(self.number[outer // 3], np.arange(int(self.number.max()) + 2))
        first = ends[self.number[triangle]]
        count = ends[self.number[triangle] + 1] - first
        row = np.repeat(np.arange(len(triangle)), count)
        return row, outer[first[row] + count_up(count)]


def find_pieces(edges: Edges, count: int) -> Pieces:
    """Return the facets of `count` triangles.

    A plane of at most MANY_SIDES outer sides is one facet. In larger planes each triangle is a
    facet.
    """
    number = plane_facets(edges, count)
    one, two = number[edges.triangles].T
    inner = np.zeros(3 * count, dtype=bool)
    inner[edges.sides[one == two]] = True
    is_simple = (np.bincount(np.repeat(number, 3), ~inner) <= MANY_SIDES)[number]
    number = np.where(is_simple, number, number.max() + 1 + np.arange(count))
    return Pieces(number, inner & np.repeat(is_simple, 3))


def fit_phi(
    facets: Facets,
    pieces: Pieces,
    edges: Edges,
    is_crease: np.ndarray,
    fitted: np.ndarray,
    apexes: np.ndarray,
    doubted: np.ndarray | None = None,
    told: np.ndarray | None = None,
) -> np.ndarray:
    """Return the angles phi (m, 3) [rad] that fit the angles between facets best.

    phi is the angle from a triangle's normal to the normal of the smooth surface, in the middle of
    each side. It is 0 for triangles that are not fitted.

    Args:
        is_crease: marks the creases, shape (e,).
        fitted: marks the triangles that have unknown phi, shape (m,).
        apexes: marks edges that end at the apex of a cone, shape (e,).
        doubted: marks the creases that may be no creases, shape (e,), where phi is pulled to 0 only
            weakly. If it is given, fewer steps are made: phi then serves only to find creases.
        told: marks the creases at which the angle between the facets is fitted too, shape (e,).
    """
    phi = np.zeros(3 * len(fitted))
    if not fitted.any():
        return phi.reshape(-1, 3)
    unknown = np.full(3 * len(fitted), -1)
    is_unknown = np.repeat(fitted, 3) & ~_straight_to_creases(facets, pieces, edges, is_crease)
    unknown[is_unknown] = np.arange(is_unknown.sum())
    smooth = np.flatnonzero(~is_crease & fitted[edges.triangles].any(axis=1))
    on_crease = edges.sides[is_crease].ravel()
    on_crease = on_crease[unknown[on_crease] >= 0]
    pull, of_turns = np.full(len(unknown), CREASE), smooth
    if doubted is not None and told is not None:
        pull[edges.sides[doubted]] = DOUBTED
        of_turns = np.flatnonzero((~is_crease | told) & fitted[edges.triangles].any(axis=1))
    length = edges.length[smooth]
    sums = _rows(unknown, edges.sides[of_turns], np.ones((len(of_turns), 2)))
    bends = _bend_differences(facets, edges, smooth, unknown, apexes)
    creases = _rows(unknown, on_crease[:, None], np.ones((len(on_crease), 1)))
    x = _solve(
        [sums, *bends, creases],
        [edges.turn[of_turns], *[np.zeros(len(smooth))] * 3, np.zeros(len(on_crease))],
        [FIT * edges.length[of_turns], length, (pull * facets.length.ravel())[on_crease]],
        STEPS if doubted is None else FEW_STEPS,
    )
    phi[unknown >= 0] = x
    return phi.reshape(-1, 3)


def _straight_to_creases(
    facets: Facets, pieces: Pieces, edges: Edges, is_crease: np.ndarray
) -> np.ndarray:
    """Return marks (3 m,) of sides at creases towards which their facets do not bend.

    Such sides are at the ends of a cylinder or cone, whose facets bend along these sides only.
    """
    turns = np.zeros(3 * len(facets.area), dtype=bool)
    turns[edges.sides[~is_crease & (np.abs(edges.turn) > PLANE)]] = True
    crease = edges.sides[is_crease].ravel()
    crease = crease[pieces.has_several[crease // 3]]
    row, side = pieces.around(crease // 3)
    across = facets.across.reshape(-1, 3)
    cosine = np.abs(np.einsum("ri,ri->r", across[crease[row]], across[side]))
    tells = np.bincount(row, turns[side] & (cosine > OPPOSITE), len(crease)) > 0
    straight = np.zeros(len(turns), dtype=bool)
    straight[crease[~tells]] = True
    return straight


def _rows(unknown: np.ndarray, sides: np.ndarray, factor: np.ndarray) -> csr_array:
    """Return a sparse matrix that multiplies the unknown angles phi of sides.

    Each row of `sides` (r, c) gives a row of the matrix, with the factors (r, c) of its sides.

    Args:
        unknown: column of the phi of each side, -1 if that phi is fixed at 0, (3 m,).
    """
    from scipy.sparse import csr_array

    row = np.repeat(np.arange(len(sides)), sides.shape[1])
    column, values = unknown[sides.ravel()], factor.ravel()
    kept = column >= 0
    return csr_array(
        (values[kept], (row[kept], column[kept])), shape=(len(sides), int(unknown.max()) + 1)
    )


def _bend_differences(
    facets: Facets, edges: Edges, smooth: np.ndarray, unknown: np.ndarray, apexes: np.ndarray
) -> list[csr_array]:
    """Return the matrices that give the jumps of curvature across smooth edges.

    They multiply the unknown angles phi, and give l dS_ee, sqrt(l² + h²) dS_em and h dS_mm. The
    module docstring explains these symbols.

    At the apex of a cone the sum of both S_ee replaces the difference, because a cone is straight
    along its edges, and dS_em counts as zero.
    """
    sides, length = edges.sides[smooth], edges.length[smooth]
    height = facets.height.ravel()[sides].min(axis=1)
    keeps = ~apexes[smooth]
    scales = (length, np.hypot(length, height) * keeps, height)
    parts: list[list[np.ndarray]] = [[], [], []]
    for which, sign in ((0, 1.0), (1, -1.0)):
        triangle, k = np.divmod(sides[:, which], 3)
        m = facets.across[triangle]  # vectors of the three sides, (s, 3, 3)
        own = m[np.arange(len(k)), k]
        along = np.cross(facets.normal[triangle], own)  # the side's own direction
        of_m = np.einsum("sij,sj->si", m, own)
        of_e = np.einsum("sij,sj->si", m, along)
        weight = sign * facets.length[triangle] / facets.area[triangle][:, None]
        of_sum = np.abs(weight)
        weights = (np.where(keeps[:, None], weight, of_sum), weight, weight)
        # Both along and across are reversed on the second side, so that products keep their sign.
        products = (of_e * of_e, of_e * of_m, of_m * of_m)
        for part, factor, product in zip(parts, weights, products, strict=True):
            part.append(factor * product)
    of_sides = np.concatenate([3 * (sides[:, [w]] // 3) + np.arange(3) for w in (0, 1)], axis=1)
    return [
        _rows(unknown, of_sides, scale[:, None] * np.concatenate(part, axis=1))
        for part, scale in zip(parts, scales, strict=True)
    ]


def _solve(
    matrices: list[csr_array], right: list[np.ndarray], weights: list[np.ndarray], steps: int
) -> np.ndarray:
    """Return the unknown angles phi [rad] that minimise a sum of weighted absolute values.

    The sum, which the module docstring gives, has terms for turns, for jumps of curvature (three
    rows each) and for creases.

    The method is least squares whose weights are divided by the residuals of the previous step.
    """
    from scipy.sparse import csc_array, diags_array, vstack
    from scipy.sparse.linalg import splu

    matrix, target = vstack(matrices).tocsr(), np.concatenate(right)
    turns, bends = len(weights[0]), len(weights[1])
    size = np.full(turns + bends + len(weights[2]), 1.0)
    x = np.zeros(matrix.shape[1])
    transposed = matrix.T.tocsr()
    for _ in range(steps):
        scale = np.concatenate(weights) / size
        rows = np.concatenate([scale[:turns], *[scale[turns : turns + bends]] * 3,
                               scale[turns + bends :]])  # fmt: skip
        weighted = diags_array(rows) @ matrix
        normal = csc_array(transposed @ weighted)
        normal.setdiag(normal.diagonal() * (1.0 + 1e-12) + 1e-30)
        solver = splu(normal, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
                      options={"SymmetricMode": True})  # fmt: skip
        before, x = x, solver.solve(transposed @ (rows * target))
        if np.abs(x - before).max() < LAST:
            break
        residual = np.abs(matrix @ x - target)
        of_bends = np.sqrt((residual[turns : turns + 3 * bends].reshape(3, -1) ** 2).sum(axis=0))
        size = np.maximum(
            np.concatenate([residual[:turns], of_bends, residual[turns + 3 * bends :]]), FLOOR
        )
    return np.asarray(x)


def phi_of_normals(facets: Facets, normals: np.ndarray) -> np.ndarray:
    """Return the angles phi (m, 3) [rad] from facets to the smooth surface with known normals.

    Each is the angle in the middle of a side.

    Args:
        normals: unit normals of the smooth surface at the corners, (m, 3, 3).
    """
    middle = normals + np.roll(normals, -1, axis=1)
    sine = np.einsum("mki,mki->mk", middle, facets.across)
    return np.asarray(np.arctan2(sine, np.einsum("mki,mi->mk", middle, facets.normal)))


def shape_operators(facets: Facets, phi: np.ndarray) -> np.ndarray:
    """Return the curvature tensor (shape operator) of each facet, shape (m, 3, 3) [1/m].

    Args:
        phi: angles from the facet to the smooth surface at its sides [rad], (m, 3).
    """
    weight = facets.length * phi / facets.area[:, None]
    return np.asarray(np.einsum("mk,mki,mkj->mij", weight, facets.across, facets.across))


def hollow_curvature(facets: Facets, phi: np.ndarray) -> np.ndarray:
    """Return the largest hollow (concave) curvature of each facet [1/m], shape (m,).

    It is 0 for a facet that is not hollow in any direction.
    """
    return np.asarray(np.maximum(-np.linalg.eigvalsh(shape_operators(facets, phi))[:, 0], 0.0))


def corner_normals(
    facets: Facets,
    pieces: Pieces,
    vertices: np.ndarray,
    triangles: np.ndarray,
    edges: Edges,
    is_crease: np.ndarray,
    phi: np.ndarray,
    apex: np.ndarray,
) -> np.ndarray:
    """Return unit normals of the smooth surface at the corners of triangles, shape (m, 3, 3).

    Args:
        phi: angles from the facets to the smooth surface at their sides [rad], shape (m, 3).
        apex: marks vertices, shape (n,), at which each facet keeps its own normal.
    """
    lean = np.tan(phi)[..., None] * facets.across  # at the middles of the sides
    # Linear over the facet: the value at a corner is the sum of its two sides less the opposite
    # side.
    own = facets.normal[:, None] + lean + np.roll(lean, 1, axis=1) - np.roll(lean, 2, axis=1)
    own = unit_vectors(own.reshape(-1, 3))
    own = _at_corners_of_pieces(own, facets, pieces, triangles, edges, is_crease, phi)
    fan = fans(triangles, edges, ~is_crease)
    count = int(fan.max()) + 1
    opening = _opening(facets).ravel()

    def sums_of(weight: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Return the weighted sums (count, 3) of vectors over the corners of each fan."""
        return np.column_stack([np.bincount(fan, weight * one, count) for one in values.T])

    mean = unit_vectors(sums_of(opening, own))
    of_planes = np.where(np.repeat((np.abs(phi) < FLAT).all(axis=1), 3), opening, 0.0)
    planes = sums_of(of_planes, np.repeat(facets.normal, 3, axis=0))
    # Planes with one normal have a total length equal to the sum of their weights.
    total = np.bincount(fan, of_planes, count)
    is_one = (total > 0.0) & (np.linalg.norm(planes, axis=1) > np.cos(FLAT) * total)
    mean[is_one] = unit_vectors(planes)[is_one]
    mean = _even_along_lines(mean, vertices, triangles, edges, fan, ~is_crease)
    result = mean[fan]
    at_apex = apex[triangles].ravel()
    result[at_apex] = own[at_apex]
    return np.asarray(result.reshape(-1, 3, 3))


def _at_corners_of_pieces(
    own: np.ndarray,
    facets: Facets,
    pieces: Pieces,
    triangles: np.ndarray,
    edges: Edges,
    is_crease: np.ndarray,
    phi: np.ndarray,
) -> np.ndarray:
    """Return unit normals at the corners (3 m, 3), corrected in facets of several triangles.

    In a facet of several triangles, the normal is inclined by phi across each of the facet's two
    sides that end at the corner. A side at a crease with a phi of 0 is not used, because the normal
    of a cone changes only across its straight lines. Other corners keep their normals.

    Args:
        own: normals at the corners before the correction, (3 m, 3).
        phi: angles from the facets to the smooth surface at their sides [rad], (m, 3).
    """
    corners = np.flatnonzero(np.repeat(pieces.has_several, 3))
    told = ~pieces.inner & np.repeat(pieces.has_several, 3)
    on_crease = edges.sides[is_crease].ravel()
    told[on_crease[np.abs(phi.ravel()[on_crease]) < FLAT]] = False
    side = np.flatnonzero(told)
    following = 3 * (side // 3) + (side % 3 + 1) % 3
    # One corner of a piece for all of its triangles that meet there.
    vertex = triangles.astype(np.int64).ravel()[corners]
    place = pieces.number[corners // 3] * (int(triangles.max()) + 1) + vertex
    corner = np.full(len(own), -1)
    corner[corners] = np.unique(place, return_inverse=True)[1].reshape(-1)
    at, m = np.r_[corner[side], corner[following]], facets.across.reshape(-1, 3)[np.r_[side, side]]
    lean, count = np.tan(phi.ravel())[np.r_[side, side]], int(corner.max(initial=-1)) + 1
    square = np.empty((count, 3, 3))
    right = np.column_stack([np.bincount(at, lean * m[:, i], count) for i in range(3)])
    for i in range(3):
        for j in range(3):
            square[:, i, j] = np.bincount(at, m[:, i] * m[:, j], count)
    leaning = np.einsum("cij,cj->ci", np.linalg.pinv(square, rcond=ONE_LINE, hermitian=True), right)
    result = own.copy()
    result[corners] = unit_vectors(facets.normal[corners // 3] + leaning[corner[corners]])
    return result


def _even_along_lines(
    normals: np.ndarray,
    vertices: np.ndarray,
    triangles: np.ndarray,
    edges: Edges,
    fan: np.ndarray,
    is_smooth: np.ndarray,
) -> np.ndarray:
    """Return the normals (f, 3) of fans (triangles round a vertex, up to creases), made equal along
    each line where two plane facets meet.

    Two plane facets of several triangles each belong to a developable surface, whose normal does
    not change along such a line. New vertices then lie in planes too, so that a ball meets few
    faces.
    """
    one, two = edges.triangles.T
    facet = plane_facets(edges, len(triangles))
    pair = np.sort(np.column_stack([facet[one], facet[two]]), axis=1)
    meets = np.flatnonzero(is_smooth & (pair[:, 0] != pair[:, 1]))
    _, line, edges_of = np.unique(pair[meets], axis=0, return_inverse=True, return_counts=True)
    meets = meets[edges_of[line.reshape(-1)] > 1]
    side = edges.sides[meets, 0]
    following = 3 * (side // 3) + (side % 3 + 1) % 3
    count, line = connected_pieces(fan[side], fan[following], len(normals))
    start, end = vertices[triangles.ravel()[side]], vertices[triangles.ravel()[following]]
    along = unit_vectors(end - start)
    of_edge = line[fan[side]]
    first = np.zeros(count, dtype=np.int64)
    first[of_edge[::-1]] = np.arange(len(of_edge))[::-1]
    turned = np.abs(np.einsum("ei,ei->e", along, along[first[of_edge]])) < np.cos(PLANE)
    straight = np.bincount(of_edge, minlength=count) > 0
    straight[of_edge[turned]] = False
    sums = np.column_stack([np.bincount(line, column, count) for column in normals.T])
    lines = np.flatnonzero(straight)
    direction = along[first[lines]]
    mean = np.zeros((count, 3))
    across = sums[lines] - np.einsum("li,li->l", sums[lines], direction)[:, None] * direction
    mean[lines] = unit_vectors(across)
    return np.where(straight[line][:, None], mean[line], normals)


def plane_facets(edges: Edges, count: int) -> np.ndarray:
    """Return the number of the plane facet of each of `count` triangles, shape (m,).

    A plane facet consists of connected triangles in one plane.
    """
    one, two = edges.triangles[np.abs(edges.turn) < PLANE].T
    return connected_pieces(one, two, count)[1]


def fans(triangles: np.ndarray, edges: Edges, joins: np.ndarray) -> np.ndarray:
    """Return the number of the fan of each corner, shape (3 m,).

    A fan consists of corners at one vertex whose triangles meet at edges marked by `joins` (e,).
    """
    one, two = edges.sides[joins].T
    # Side k begins at corner k. The side across the edge runs in the other direction.
    next_of_one, next_of_two = (3 * (s // 3) + (s % 3 + 1) % 3 for s in (one, two))
    return connected_pieces(np.r_[one, next_of_one], np.r_[next_of_two, two], 3 * len(triangles))[1]


def find_apexes(
    facets: Facets, triangles: np.ndarray, edges: Edges, is_crease: np.ndarray
) -> np.ndarray:
    """Return marks (n,) of vertices at which the surface comes to a point, as a cone does.

    Vertices at creases are not marked.
    """
    count = int(triangles.max()) + 1
    defect = 2.0 * np.pi - np.bincount(triangles.ravel(), _opening(facets).ravel(), count)
    start, end = sides_of(triangles)[edges.sides[:, 0]].T
    crease_ends = np.bincount(np.r_[start[is_crease], end[is_crease]], minlength=count)
    size = np.where(crease_ends > 0, 0.0, np.abs(defect))
    neighbours = np.maximum(np.bincount(np.r_[start, end], minlength=count), 1)
    around = np.bincount(np.r_[start, end], np.r_[size[end], size[start]], count) / neighbours
    return np.asarray((size > APEX) | (size > np.maximum(SMALL_APEX, OF_AROUND * around)))


def _opening(facets: Facets) -> np.ndarray:
    """Return the angle of each triangle at each of its corners [rad], shape (m, 3)."""
    into = -facets.across  # vectors of the sides k and k - 1, which meet at corner k
    cosine = -np.einsum("mki,mki->mk", into, np.roll(into, 1, axis=1))
    return np.asarray(np.arccos(np.clip(cosine, -1.0, 1.0)))
