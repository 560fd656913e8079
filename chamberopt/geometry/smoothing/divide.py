"""Divide triangles whose smooth surface bends: split their edges, and move the middles onto it.

An edge is split for both of its triangles or for neither. The triangles on both sides therefore
always meet at whole edges, and a closed surface stays closed. The middle of an edge moves to the
arc through both ends that has the surface's normals there. A crease is an edge of the part, where
two smooth surfaces meet. Its tangents are the cross products of the normals of these surfaces. Its
own normals are perpendicular to its tangents, in the plane in which the crease bends. A piece of a
plane stays in its plane, its border included.

Notation
p, n   ends of an edge [m] and the surface's unit normals there; dp, dn: from start to end
t      unit tangents of a crease at its ends
e      unit vector from end to end
s      rise of the middle over the chord [m]

s = dp.dn / (4 + 2 |n0 + n1|)        along n0 + n1: exact on a circle
n = n0 + n1 - 1.5 f (e . (n0 + n1))  normal in the middle, before it is made a unit vector: the
                                     normal of a cubic with these ends and normals
f ~ (W² + |det W|) e, with f . e = 1

W is the shape operator of the triangle, given by its three normals. Many vectors f have f . e = 1.
This f turns the normal where the surface bends: across the lines of a cylinder, along e on a sphere
and in the straight directions of a saddle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from chamberopt.geometry.triangles import (
    angles_between,
    area_vectors,
    edge_keys,
    unit_normals,
    unit_vectors,
)

LEVELS = 6  # rounds of splitting; 90 degrees an edge at 6 degrees take four
# cosine between a triangle and the normals at its corners: a triangle below is not made
TURNED = 0.6
STRAIGHT = 6.0  # factor below the limit: a side that bends by less makes no triangle lean
SLACK = 1.02  # an edge that bends by the limit is not split, in either direction of rounding
WEAK = 0.1  # sine between the sides of a crease below which the crease has no tangent
FARTHER = 3.0  # a surface farther than this many times the allowed move is not approached
LEVEL = 1e-3  # rise over length of an edge that is as good as straight
# rise of the middle of half an edge over the rise of the edge, with a margin over 1/4
LESS = 1.0 / 3.0
TIE = 1e-6  # relative difference of diagonals that counts as none

# The triangles that one triangle becomes, by its split sides: corners 0 to 2, middles of sides 3 to
# 5. The first split side comes first. Of two split sides the last side is whole.
_ONE = ((0, 3, 2), (3, 1, 2))
_TWO = ((3, 1, 4), (0, 3, 4), (0, 4, 2))
_TWO_OTHER = ((3, 1, 4), (0, 3, 2), (3, 4, 2))
_THREE = ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5))


@dataclass(frozen=True)
class Surface:
    """Triangle mesh with the normals and creases of the smooth surface behind it.

    Attributes:
        vertices: vertex positions [m], shape (n, 3).
        triangles: vertex indices, shape (k, 3).
        parent: triangle of the file from which each triangle comes, shape (k,).
        normals: unit normals of the smooth surface at the corners, shape (k, 3, 3).
        crease: marks the sides at creases, shape (k, 3).
        rise: largest allowed move of the middle of a side [m], shape (k,).
    """

    vertices: np.ndarray
    triangles: np.ndarray
    parent: np.ndarray
    normals: np.ndarray
    crease: np.ndarray
    rise: np.ndarray


def divide(surface: Surface, limit: np.ndarray, narrow: np.ndarray) -> Surface:
    """Return the surface with its edges split until it bends by at most a limit along each edge.

    The limit of an edge is the lower limit of the file's triangles on both sides.

    Args:
        limit: largest angle by which the surface may bend along an edge [rad], for each triangle of
            the file, shape (m,); infinite where no edge is split.
        narrow: extent of an edge in the direction of the bend [m] below which it is not split, for
            each triangle of the file, shape (m,).
    """
    whole = np.zeros((len(surface.triangles), 3), dtype=bool)  # sides that must not be split
    for _ in range(LEVELS):
        finer, whole = _split_once(surface, limit, narrow, whole)
        if len(finer.triangles) == len(surface.triangles):
            break
        surface = finer
    return surface


def _split_once(
    surface: Surface, limit: np.ndarray, narrow: np.ndarray, whole: np.ndarray
) -> tuple[Surface, np.ndarray]:
    """Split once all edges that bend too much, except where a new triangle would turn over.

    Args:
        limit, narrow: as in `divide`.
        whole: marks the sides that must not be split, shape (k, 3).

    Returns:
        The finer surface, and marks of its sides that must not be split.
    """
    sides = np.argsort(edge_keys(surface.triangles), kind="stable").reshape(-1, 2)
    place, normal, bend, width, is_near = _middles(surface, sides)
    most, least = (
        np.repeat(of_parent[surface.parent], 3)[sides].min(axis=1) for of_parent in (limit, narrow)
    )
    wanted = (bend > SLACK * most) & (width > least)
    wanted |= (bend > most / STRAIGHT) & _folds(surface, limit).ravel()[sides].any(axis=1)
    wanted &= is_near & ~whole.ravel()[sides].any(axis=1)
    while True:
        new = np.full(3 * len(surface.triangles), -1)
        new[sides[wanted]] = len(surface.vertices) + np.arange(wanted.sum())[:, None]
        of_side = np.zeros((len(new), 3))
        of_side[sides.T] = normal
        vertices = np.concatenate([surface.vertices, place[wanted]])
        finer, row, side = divided(surface, vertices, new.reshape(-1, 3), of_side.reshape(-1, 3, 3))
        facing = unit_vectors(area_vectors(finer.vertices, finer.triangles))
        turned = np.einsum("ki,kji->kj", facing, finer.normals).min(axis=1) < TURNED
        is_split = np.asarray((new.reshape(-1, 3) >= 0).any(axis=1))
        bad = np.zeros(len(new) // 3, dtype=bool)
        bad[row[turned & is_split[row]]] = True
        if not bad.any():
            return finer, np.where(side >= 0, whole[row[:, None], side], False)
        whole = whole | (bad[:, None] & (new.reshape(-1, 3) >= 0))
        wanted &= ~whole.ravel()[sides].any(axis=1)


def _folds(surface: Surface, limit: np.ndarray) -> np.ndarray:
    """Return marks (k, 3) of the longest side of each triangle that leans by more than its limit.

    To lean is to be inclined to the surface's normals. A long and narrow triangle leans by the rise
    of the surface over its longest side, divided by its height, although the surface bends little
    along each side. Two such triangles make a fold.
    """
    corners = surface.vertices[surface.triangles]
    cosine = np.einsum("ki,ki->k", unit_normals(corners), unit_vectors(surface.normals.sum(axis=1)))
    length = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    leans = cosine < np.cos(np.minimum(limit[surface.parent], np.pi))
    return np.asarray(leans[:, None] & (length >= length.max(axis=1, keepdims=True)))


def _middles(surface: Surface, sides: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return the points to which the middles of edges would move, and the bends of the edges.

    Args:
        sides: numbers of the two sides at each edge, shape (e, 2).

    Returns:
        Points [m], shape (e, 3); normals there of the surfaces on both sides, shape (2, e, 3); the
        angle by which the surface bends along each edge [rad], shape (e,); the extent of the edge
        in the direction of the bend [m], shape (e,); marks of the edges whose middle would need
        little more than the allowed move, shape (e,).
    """
    triangle, k = np.divmod(sides.T, 3)
    own, following = (
        surface.normals[triangle, at] for at in (k, (k + 1) % 3)
    )  # (2, e, 3), at the sides' starts and ends; the second side runs in the other direction
    n0, n1 = np.stack([own[0], following[1]]), np.stack([following[0], own[1]])
    is_crease = surface.crease[triangle[0], k[0]]
    start, end = (
        surface.vertices[surface.triangles[triangle[0], at]] for at in (k[0], (k[0] + 1) % 3)
    )
    chord = end - start
    length = np.linalg.norm(chord, axis=1)
    e = chord / np.maximum(length, 1e-30)[:, None]

    a, b = unit_vectors(n0.sum(axis=0)), unit_vectors(n1.sum(axis=0))
    a, b = (
        np.where(is_crease[:, None], of_curve, of_surface)
        for of_curve, of_surface in zip(_curve_normals(n0, n1, e), (a, b), strict=True)
    )
    both, change = a + b, b - a
    size = np.linalg.norm(both, axis=1)
    rise = np.einsum("ei,ei->e", chord, change) / (4.0 + 2.0 * size)
    far = surface.rise[triangle].max(axis=0)
    is_near = np.abs(rise) <= FARTHER * far + LEVEL * length
    rise = np.clip(rise, -far, far)
    place = 0.5 * (start + end) + rise[:, None] * unit_vectors(both)
    bend = np.maximum(angles_between(a, b), _lean(a, e) + _lean(b, e))
    width = np.abs(np.einsum("ei,ei->e", chord, unit_vectors(change)))

    normal = n0 + n1
    f = _tilts(surface, sides, normal, e, is_crease)
    normal = normal - 1.5 * np.einsum("sei,ei->se", normal, e)[..., None] * f
    return place, unit_vectors(normal), bend, width, is_near


def _tilts(
    surface: Surface, sides: np.ndarray, normal: np.ndarray, e: np.ndarray, is_crease: np.ndarray
) -> np.ndarray:
    """Return the vectors f, (2, e, 3), that tilt the normals in the middles of edges.

    The module docstring gives f. At creases each side has its own shape operator W.

    Args:
        normal: vector of any length along the normal in the middle of the edges, shape (2, e, 3).
        e: unit vectors along the edges, shape (e, 3).
    """
    triangle, k = np.divmod(sides.T, 3)
    at = (k + np.array([[0], [1]])) % 3  # the corners at e's start; the second side runs against e
    own, following, apex = (
        surface.normals[triangle, corner] for corner in (at, (2 * k + 1 - at) % 3, (k + 2) % 3)
    )
    corners = surface.vertices[surface.triangles]
    chord = corners[triangle, (2 * k + 1 - at) % 3] - corners[triangle, at]
    away = corners[triangle, (k + 2) % 3] - corners[triangle, at]
    length = np.maximum(np.linalg.norm(chord, axis=2), 1e-30)
    m = unit_vectors(np.cross(unit_vectors(normal), e))

    def components(vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the components of vectors along e and along m, (2, e) each."""
        return np.einsum("sei,ei->se", vectors, e), np.einsum("sei,sei->se", vectors, m)

    along, height = components(away)
    height = np.where(np.abs(height) > 1e-9 * length, height, np.inf)
    of_e = (following - own) / length[..., None]
    of_m = (apex - own - along[..., None] * of_e) / height[..., None]
    ee, em = components(of_e)
    mm = components(of_m)[1]
    size = ee * ee + em * em + np.abs(ee * mm - em * em)
    turned = em * (ee + mm)
    size, turned = (np.where(is_crease, one, one.sum(axis=0)) for one in (size, turned))
    share = np.divide(turned, size, out=np.zeros_like(size), where=size > 0.0)
    return np.asarray(e + share[..., None] * m)


def _lean(normal: np.ndarray, e: np.ndarray) -> np.ndarray:
    """Return the angles [rad], (e,), of normals (e, 3) to planes perpendicular to e (e, 3)."""
    return np.asarray(np.abs(np.arcsin(np.clip(np.einsum("ei,ei->e", normal, e), -1.0, 1.0))))


def _curve_normals(n0: np.ndarray, n1: np.ndarray, e: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the normals (e, 3) of crease edges at their starts, and at their ends.

    They lie in the plane in which each crease bends.

    Args:
        n0, n1: normals of the surfaces on both sides at the starts and ends, shape (2, e, 3).
        e: unit vectors from start to end, shape (e, 3).
    """
    t0, t1 = (_tangent(of_end[0], of_end[1], e) for of_end in (n0, n1))
    # both have one direction where the curve is an arc
    first, last = np.cross(t0, e), np.cross(e, t1)
    more = np.linalg.norm(first, axis=1) > np.linalg.norm(last, axis=1)
    axis = unit_vectors(np.where(more[:, None], first, last))
    return np.cross(t0, axis), np.cross(t1, axis)


def _tangent(one: np.ndarray, two: np.ndarray, e: np.ndarray) -> np.ndarray:
    """Return the unit tangents (e, 3) of creases, from the normals of both sides.

    Where these normals hardly differ, the tangent is the unit vector e along the edge.
    """
    cross = np.cross(one, two)
    cross *= np.sign(np.einsum("ei,ei->e", cross, e))[:, None]
    weak = np.linalg.norm(cross, axis=1) < WEAK
    return np.where(weak[:, None], e, unit_vectors(cross))


def divided(
    surface: Surface, vertices: np.ndarray, new: np.ndarray, normal: np.ndarray
) -> tuple[Surface, np.ndarray, np.ndarray]:
    """Return the surface with its triangles divided at the middles of their sides.

    Args:
        vertices: vertices of the surface and new vertices [m].
        new: vertex in the middle of each side, -1 for a whole side, shape (k, 3).
        normal: normal in the middle of each side, shape (k, 3, 3).

    Returns:
        The finer surface; the triangle of the surface from which each new triangle comes, shape
        (c,); and the side of that triangle on which each new side lies, -1 inside it, shape (c, 3).
    """
    split = new >= 0
    count = split.sum(axis=1)
    # The triangle is turned so that its only split side is the first, or its two split sides are
    # the first two.
    first = np.where(count == 2, ((~split).argmax(axis=1) + 1) % 3, split.argmax(axis=1))
    first[count % 3 == 0] = 0
    turned = (first[:, None] + np.arange(3)) % 3
    corner = np.concatenate(
        [np.take_along_axis(one, turned, axis=1) for one in (surface.triangles, new)], axis=1
    )
    a, c, ab, bc = (vertices[corner[:, k]] for k in (0, 2, 3, 4))
    one, other = (np.linalg.norm(d, axis=1) for d in (a - bc, ab - c))
    # The order of the corners in the file decides between diagonals of one length. Copies of one
    # figure have the same order, so that the mesh keeps the symmetry of the part.
    shorter = one < other * (1.0 - TIE)
    rows, codes = [np.flatnonzero(count == 0)], [np.tile([[0, 1, 2]], ((count == 0).sum(), 1))]
    for chosen, pieces in (
        (count == 1, _ONE),
        ((count == 2) & shorter, _TWO),
        ((count == 2) & ~shorter, _TWO_OTHER),
        (count == 3, _THREE),
    ):
        for piece in pieces:
            rows.append(np.flatnonzero(chosen))
            codes.append(np.tile([piece], (int(chosen.sum()), 1)))
    row, code = np.concatenate(rows), np.concatenate(codes)
    order = np.argsort(row, kind="stable")  # children take the place of their parents
    row, code = row[order], code[order]

    normals = np.concatenate(
        [np.take_along_axis(one, turned[..., None], axis=1) for one in (surface.normals, normal)],
        axis=1,
    )
    side = _ON_SIDE[code, np.roll(code, -1, axis=1)]
    side = np.where(side >= 0, (side + first[row][:, None]) % 3, -1)
    on_crease = (side >= 0) & surface.crease[row[:, None], side]
    is_whole = count[row] == 0
    finer = Surface(
        vertices=vertices,
        triangles=corner[row[:, None], code].astype(surface.triangles.dtype),
        parent=surface.parent[row],
        normals=normals[row[:, None], code],
        crease=on_crease,
        rise=np.where(is_whole, 1.0, LESS) * surface.rise[row],
    )
    return finer, row, side


def _sides_of_codes() -> np.ndarray:
    """Return a table (6, 6) of the side of a triangle on which any two of its points lie, or -1.

    The points 0 to 2 are the corners, and 3 to 5 the middles of the sides.
    """
    table = np.full((6, 6), -1)
    for k in range(3):
        on_side = [k, 3 + k, (k + 1) % 3]
        for one, two in ((0, 1), (1, 2), (0, 2)):
            table[on_side[one], on_side[two]] = table[on_side[two], on_side[one]] = k
    return table


_ON_SIDE = _sides_of_codes()
