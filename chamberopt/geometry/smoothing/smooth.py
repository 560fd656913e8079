"""Find the smooth surface of a part whose file has facets.

The facets of a round touch a ball elsewhere than the round does. In a hollow a ball lies across two
facets and leaves a bare strip between them. Rounds are therefore found and their triangles divided,
with new vertices on the surface through the file's vertices. Planes, sharp edges and noise stay as
they are. No vertex of the file moves.

The modules beside this file do the steps: `rounds` finds the edges that divide a round into facets,
`normals` the normals of the smooth surface at the corners of the facets, and `divide` makes finer
triangles. This file also finds further edges of rounds, between irregular triangles.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from chamberopt.geometry.smoothing.divide import Surface, divide
from chamberopt.geometry.smoothing.normals import (
    Facets,
    Pieces,
    corner_normals,
    find_apexes,
    find_pieces,
    fit_phi,
    hollow_curvature,
    measure_facets,
    phi_of_normals,
    plane_facets,
    shape_operators,
)
from chamberopt.geometry.smoothing.rounds import SMOOTH, Edges, find_creases, find_edges, is_hard
from chamberopt.geometry.triangles import connected_pieces, sides_of, unit_normals

# Edges of irregular triangles, across which a round goes on without evidence of its own.
#
# Facets that are nearly alike are evidence of a round. The edges of irregular triangles turn by any
# angle, also in the other direction. A fit to the edges with evidence gives the curvature beside
# the other edges. A round goes on across an edge that turns as this curvature suggests.
#
# Notation
#     S, A, l, phi   as in `normals`
#     e_1, e_2       the other two sides of a triangle, as vectors along its border [m]
#
#     phi = -l (e_1ᵀ S e_2) / (4 A)    the only phi of which S is the shape operator

WRONG = 0.5  # share of an edge's turn by which the turn may differ from the expected turn
LITTLE = np.radians(3.0)  # difference of the turn that is always allowed
SWEEPS = 20  # triangles in a row, each of which takes the curvature of the previous triangle


def valleys(edges: Edges, pieces: Pieces, is_crease: np.ndarray) -> np.ndarray:
    """Return marks (e,) of supposed creases that may lie inside a curved surface of irregular
    triangles.

    The triangles on both sides are facets by themselves, and have other edges that turn more and in
    the other direction. Rows of triangles that are shifted by half a triangle have such edges
    between them.
    """
    largest = np.zeros((2, len(pieces.number)))  # largest turns in each of the two directions
    for way, sign in enumerate((1.0, -1.0)):
        turns = ~is_crease & (sign * edges.turn > SMOOTH)
        for triangle in edges.triangles[turns].T:
            np.maximum.at(largest[way], triangle, np.abs(edges.turn[turns]))
    other_way = (edges.turn > 0.0).astype(int)[:, None]
    least = largest[other_way, edges.triangles].min(axis=1)
    is_single = ~pieces.has_several[edges.triangles].any(axis=1)
    return np.asarray(is_crease & is_single & (np.abs(edges.turn) < least))


def find_continued(
    sides: np.ndarray, edges: Edges, facets: Facets, is_crease: np.ndarray, phi: np.ndarray
) -> np.ndarray:
    """Return marks (e,) of supposed creases across which a round (a curved surface) goes on.

    Args:
        sides: sides of the triangles, as vectors [m], shape (m, 3, 3).
        is_crease: marks the edges without evidence that they belong to a round, shape (e,).
        phi: angles from a fit to the other edges [rad], shape (m, 3).
    """
    shape = shape_operators(facets, phi)
    turns = ~is_crease & (np.abs(edges.turn) > SMOOTH)
    known = np.zeros(len(shape), dtype=bool)
    known[edges.triangles[turns]] = True
    of_sides = -facets.length / (4.0 * facets.area[:, None])
    continued = np.zeros(len(is_crease), dtype=bool)
    rows = np.flatnonzero(is_crease & ~is_hard(edges))
    for _ in range(SWEEPS):
        triangle, k = np.divmod(edges.sides[rows], 3)
        knows = known[triangle]
        mean = np.einsum("ef,efij->eij", knows, shape[triangle])
        mean /= np.maximum(knows.sum(axis=1), 1)[:, None, None]
        one, two = (sides[triangle, (k + way) % 3] for way in (1, 2))
        of_both = of_sides[triangle, k] * np.einsum("efi,eij,efj->ef", one, mean, two)
        turn = edges.turn[rows]
        differs = np.abs(turn - of_both.sum(axis=1))
        goes_on = knows.any(axis=1) & (differs < np.maximum(WRONG * np.abs(turn), LITTLE))
        if not goes_on.any():
            break
        continued[rows[goes_on]] = True
        row, other = np.nonzero(goes_on[:, None] & ~knows)
        shape[triangle[row, other]] = mean[row]
        known[triangle[row, other]] = True
        rows = rows[~goes_on]
    return continued


# Factor on the rise of the circle given by an edge's larger turn and its facet. Of two facets of
# unequal width, the wide facet turns by up to twice as much as the edge between them.
RISE = 2.0
# times the area of the facets beside it: such a plane facet is not part of a round
FAR_LARGER = 3.0
BY_CHANCE = 8  # largest number of triangles of a round that lie in one plane by chance
LOOKS = 2  # searches for edges across which a round goes on, each with a new fit
LEFT_OVER = 0.5  # share of an edge's turn that no round explains, above which the edge is a crease
CREASE = np.radians(8.0)  # the least turn of such a crease
EXPLAINED = 0.25  # share below which an edge without evidence belongs to the rounds beside it
# Share of a round's turns without explanation, above which the round is noise; and this share of
# all turns.
NOISE, NOISE_IN_ALL = 0.3, 0.2
LINE = 12.0  # degrees: creases that turn by less and end freely are no line
TOLD = 3.0  # degrees: smaller turns say nothing about noise


class Surfaces(NamedTuple):
    """Normals, curvatures and creases of the smooth surface, for each triangle of the file.

    Attributes:
        normals: unit normals of the smooth surface at the corners, shape (m, 3, 3).
        hollow: largest hollow curvature on each triangle [1/m], 0 without it, shape (m,).
        turn: largest angle to a neighbour across a smooth edge, per triangle [rad], shape (m,).
        crease: marks the sides at creases, shape (m, 3).
        rise: largest move of the surface from each triangle [m], shape (m,).
        face: number of the round (curved surface) of each triangle, shape (m,).
        noisy: marks the triangles of rounds that are noise, as of a scan, shape (m,).
        blunt: number of the creases that turn by less than the facets of a round may.
    """

    normals: np.ndarray
    hollow: np.ndarray
    turn: np.ndarray
    crease: np.ndarray
    rise: np.ndarray
    face: np.ndarray
    noisy: np.ndarray
    blunt: int


def find_surfaces(
    vertices: np.ndarray, triangles: np.ndarray, wanted: np.ndarray, given: np.ndarray | None = None
) -> Surfaces:
    """Return the rounds (curved surfaces) and creases (sharp edges) of a part, and the normals of
    the surface behind its facets.

    Args:
        vertices: vertex positions [m], shape (n, 3).
        triangles: vertex indices of a closed surface, normals outward, shape (m, 3).
        wanted: marks the triangles that matter, shape (m,). Rounds without a wanted triangle are
            left flat.
        given: unit normals at the corners that the file states, shape (m, 3, 3).
    """
    edges, facets = find_edges(vertices, triangles), measure_facets(vertices, triangles)
    size = np.abs(edges.turn)
    lone = find_creases(edges, facets.area) if given is None else _stated_creases(edges, given)
    ends = sides_of(triangles)[edges.sides[:, 0]]
    pieces = find_pieces(edges, len(triangles))
    if given is None:
        for _ in range(LOOKS):
            continued = _continued(edges, facets, pieces, vertices, triangles, lone, wanted)
            if not continued.any():
                break
            lone = lone & ~continued
    face, fitted = _faces_to_fit(edges, facets, lone, wanted)
    apex = find_apexes(facets, triangles, edges, lone)
    if given is None:
        phi = fit_phi(facets, pieces, edges, lone, fitted, apex[ends].any(axis=1))
    else:
        phi = phi_of_normals(facets, given)
    left = edges.turn - phi.ravel()[edges.sides].sum(axis=1)
    of_round = fitted[edges.triangles].any(axis=1) & ~lone
    sharp = of_round & (size > CREASE) & (np.sign(edges.turn) * left > LEFT_OVER * size)
    explained = lone & ~is_hard(edges) & (np.abs(left) < EXPLAINED * size)
    is_crease = (lone & ~explained) | sharp
    on_crease = np.zeros(3 * len(triangles), dtype=bool)
    on_crease[edges.sides[is_crease]] = True
    if given is None:
        given = corner_normals(facets, pieces, vertices, triangles, edges, is_crease, phi, apex)
        noisy = _noise(edges, lone, left, face, fitted, ends)[face] > NOISE
    else:
        noisy = np.zeros(len(triangles), dtype=bool)
    turn, rise = _turns_and_rises(edges, facets, is_crease)
    return Surfaces(
        normals=given,
        hollow=hollow_curvature(facets, phi),
        turn=turn,
        crease=on_crease.reshape(-1, 3),
        rise=RISE * rise,
        face=face,
        noisy=noisy,
        blunt=int((is_crease & ~is_hard(edges) & (size > SMOOTH)).sum()),
    )


def divide_rounds(
    vertices: np.ndarray,
    triangles: np.ndarray,
    surfaces: Surfaces,
    limit: np.ndarray,
    narrow: np.ndarray,
) -> Surface:
    """Return the mesh with the triangles of rounds divided, new vertices on the smooth surface.

    Args:
        limit: angle between facets [rad] above which each triangle's edges are split, shape (m,);
            infinite where the triangle stays as it is.
        narrow: width of facets [m] below which each triangle is not divided, shape (m,).
    """
    surface = Surface(
        vertices=vertices,
        triangles=triangles,
        parent=np.arange(len(triangles)),
        normals=surfaces.normals,
        crease=surfaces.crease,
        rise=surfaces.rise,
    )
    return divide(surface, limit, narrow)


def moves(vertices: np.ndarray, triangles: np.ndarray, finer: Surface) -> np.ndarray:
    """Return how far the divided surface lies from each triangle of the file [m], shape (m,)."""
    normal = unit_normals(vertices[triangles])[finer.parent]
    start = vertices[triangles[finer.parent, 0]][:, None]
    height = np.abs(np.einsum("kci,ki->kc", finer.vertices[finer.triangles] - start, normal))
    moved = np.zeros(len(triangles))
    np.maximum.at(moved, finer.parent, height.max(axis=1))
    return moved


def _stated_creases(edges: Edges, normals: np.ndarray) -> np.ndarray:
    """Return marks (e,) of edges at which the normals that the file states differ on both sides."""
    triangle, k = np.divmod(edges.sides.T, 3)
    start, end = normals[triangle, k], normals[triangle, (k + 1) % 3]
    cosine = [np.einsum("ei,ei->e", start[0], end[1]), np.einsum("ei,ei->e", end[0], start[1])]
    return np.asarray(np.minimum(*cosine) < np.cos(SMOOTH))


def _continued(
    edges: Edges,
    facets: Facets,
    pieces: Pieces,
    vertices: np.ndarray,
    triangles: np.ndarray,
    lone: np.ndarray,
    wanted: np.ndarray,
) -> np.ndarray:
    """Return marks (e,) of edges that look like creases, but across which a round goes on.

    Args:
        lone: marks the edges without evidence that they belong to a round, shape (e,).
        wanted: marks the triangles that are to be divided, shape (m,).
    """
    _, fitted = _faces_to_fit(edges, facets, lone, wanted)
    doubted = lone & ~is_hard(edges) & fitted[edges.triangles].any(axis=1)
    if not doubted.any():
        return np.asarray(doubted)
    apexes = find_apexes(facets, triangles, edges, lone)[sides_of(triangles)[edges.sides[:, 0]]]
    told = doubted & valleys(edges, pieces, lone)
    phi = fit_phi(facets, pieces, edges, lone, fitted, apexes.any(axis=1), doubted, told)
    sides = vertices[np.roll(triangles, -1, axis=1)] - vertices[triangles]
    return find_continued(sides, edges, facets, lone, phi)


def _faces_to_fit(
    edges: Edges, facets: Facets, is_crease: np.ndarray, wanted: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the round (curved surface) of each triangle, and marks of triangles whose normals are
    to be found.

    Args:
        wanted: marks the triangles that are to be divided, shape (m,).

    Returns:
        The number of the round to which each triangle belongs, shape (m,), and a separate number
        for a triangle without a round; marks of the triangles in or beside a round with a wanted
        triangle, and of their neighbours across smooth edges, shape (m,). Plane faces beside rounds
        are left out.
    """
    joins = ~is_crease & (np.abs(edges.turn) > SMOOTH)
    one, two = edges.triangles[joins].T
    face = connected_pieces(one, two, len(wanted))[1]
    in_round = np.zeros(len(wanted), dtype=bool)
    in_round[edges.triangles[joins]] = True
    chosen = in_round & np.isin(face, face[in_round & _with_neighbours(wanted, edges.triangles)])
    fitted = _with_neighbours(chosen, edges.triangles[~is_crease])
    return face, fitted & ~_planes(edges, facets, is_crease)


def _planes(edges: Edges, facets: Facets, is_crease: np.ndarray) -> np.ndarray:
    """Return marks (m,) of triangles of plane facets far larger than all facets beside them.

    The facets of a round are nearly alike, so that such a plane is not part of the round beside it.
    A few irregular triangles of a round may lie in one plane by chance. Beside single triangles,
    the area of a plane is therefore divided by its number of triangles, up to BY_CHANCE.
    """
    facet = plane_facets(edges, len(facets.area))
    count, area = np.bincount(facet), np.bincount(facet, facets.area)
    turns = ~is_crease & (np.abs(edges.turn) > SMOOTH)
    largest = np.zeros(len(area))
    for one, two in (facet[edges.triangles[turns]].T, facet[edges.triangles[turns, ::-1]].T):
        by_chance = np.where(count[two] == 1, np.minimum(count[one], BY_CHANCE), 1)
        np.maximum.at(largest, one, by_chance * area[two])
    return np.asarray(((count > 1) & (area > FAR_LARGER * largest) & (largest > 0.0))[facet])


def _with_neighbours(marked: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Return marks (m,) of the marked triangles and their neighbours.

    Args:
        pairs: triangles that are neighbours, (e, 2).
    """
    both = pairs[marked[pairs].any(axis=1)]
    result = marked.copy()
    result[both] = True
    return result


def _noise(
    edges: Edges,
    lone: np.ndarray,
    left: np.ndarray,
    face: np.ndarray,
    fitted: np.ndarray,
    ends: np.ndarray,
) -> np.ndarray:
    """Return the share of the turning of each round (curved surface) that is noise, (f,).

    This is the share of its edges' turns that neither the fit of a smooth surface nor lines of
    creases explain.

    Args:
        lone: marks the edges without evidence of a round, shape (e,).
        left: turn of each edge that the fit does not explain [rad], shape (e,).
        face: number of the round of each triangle, shape (m,).
        fitted: marks the triangles for which there is a fit, shape (m,).
        ends: vertices of each edge, shape (e, 2).
    """
    degrees = np.degrees(np.abs(edges.turn))
    hard = is_hard(edges)
    meeting = np.bincount(ends[lone].ravel(), minlength=int(ends.max()) + 1)[ends]
    free = (meeting == 1).any(axis=1) | (degrees < LINE)
    no_line = lone & ~hard & (meeting != 2).any(axis=1) & free
    told = ~hard & (degrees > TOLD) & fitted[edges.triangles].any(axis=1)
    whole, rest = (np.where(told, edges.length * np.abs(one), 0.0) for one in (edges.turn, left))
    unexplained = np.where(lone, np.where(no_line, whole, 0.0), rest)
    count = int(face.max()) + 1
    one, two = face[edges.triangles].T
    some, every = (
        np.bincount(one, weight, count) + np.bincount(two, weight, count)
        for weight in (unexplained, whole)
    )
    if some.sum() > NOISE_IN_ALL * every.sum():
        return np.ones(count)  # smooth pieces among noise are no rounds either
    return np.asarray(np.divide(some, every, out=np.zeros(count), where=every > 0.0))


def _turns_and_rises(
    edges: Edges, facets: Facets, is_crease: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest angle to a neighbour across a smooth side of each triangle [rad], and the
    rise of the surface over it [m], (m,) each.

    The rise is the height of a circle's arc over its chord, which is the triangle's facet.
    """
    turn = np.zeros(3 * len(facets.area))
    turn[edges.sides[~is_crease]] = np.abs(edges.turn[~is_crease])[:, None]
    of_sides = turn.reshape(-1, 3)
    rise = (of_sides * facets.height).max(axis=1) / 8.0
    facet = plane_facets(edges, len(rise))
    of_facet = np.zeros(len(rise))
    np.maximum.at(of_facet, facet, rise)
    return of_sides.max(axis=1), of_facet[facet]
