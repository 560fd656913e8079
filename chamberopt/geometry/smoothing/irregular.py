"""Edges of irregular triangles, across which a round goes on without evidence of its own.

Facets that are nearly alike are evidence of a round. The edges of irregular triangles turn by
anything, also the other way round. A fit to the edges with evidence tells the curvature beside the
others. A round goes on across an edge that turns as this curvature lets expect.

Notation
    S, A, l, phi   as in `normals`
    e_1, e_2       the other two sides of a triangle, as vectors along its border [m]

    phi = -l (e_1ᵀ S e_2) / (4 A)    the only phi of which S is the shape operator
"""

from __future__ import annotations

import numpy as np

from chamberopt.geometry.smoothing.normals import Facets, Pieces, shape_operators
from chamberopt.geometry.smoothing.rounds import SMOOTH, Edges, is_hard

WRONG = 0.5  # share of an edge's turn by which the turn may differ from what is expected
LITTLE = np.radians(3.0)  # turn by which it always may
SWEEPS = 20  # triangles in a row, each of which takes the curvature of the one before


def valleys(edges: Edges, pieces: Pieces, is_crease: np.ndarray) -> np.ndarray:
    """Marks (e,) the creases that irregular triangles of one round may have between them.

    Both are single triangles with other edges that turn the other way, and by more. Two rows of
    triangles, each half a triangle ahead of the other, have such an edge along each row.
    """
    largest = np.zeros((2, len(pieces.number)))  # turns the one way and the other
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
    """Marks (e,) the creases across which a round goes on.

    Args:
        sides: of the triangles, as vectors [m], shape (m, 3, 3).
        is_crease: marks the edges without evidence, shape (e,).
        phi: of a fit to the other edges [rad], shape (m, 3).
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
