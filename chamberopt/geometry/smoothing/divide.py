"""Finer triangles on the smooth surface: edges along which it bends are split, their middles moved.

Each edge decides alone whether it is split, so triangles on both sides always meet at whole edges
and a closed surface stays closed. The middle of an edge lies on the arc through its ends that has
their normals. The tangents of a crease are the cross products of the normals of both sides, and its
normals are across them, in the plane in which it bends. A piece of a plane therefore stays in its
plane, its border included.

Notation
    p, n   ends of an edge [m] and the surface's unit normals there
    t      unit tangents of a crease at its ends
    e      unit vector from end to end
    s      rise of the middle over the chord [m]

    s = dp.dn / (4 + 2 |n0 + n1|)        along n0 + n1: exact on a circle
    n = n0 + n1 - 1.5 f (e . (n0 + n1))  in the middle, before it is made a unit vector: that of a
                                         cubic with these ends and normals
    f ~ (W² + |det W|) e, with f . e = 1

W is the shape operator of the triangle, which its three normals tell. Among all f with f . e = 1
this one turns the normal where the surface bends: across the lines of a cylinder, along e on a
sphere and in the straight directions of a saddle.
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
TURNED = 0.6  # cosine between a triangle and the normals at its corners: below, it is not made
STRAIGHT = 6.0  # a side that bends by so many times less than the limit makes no triangle lean
SLACK = 1.02  # what bends by the limit is not split, whichever way it is rounded
WEAK = 0.1  # sine between the sides of a crease below which it has no tangent of its own
FARTHER = 3.0  # a surface so many times farther than a side may move is not approached
LEVEL = 1e-3  # rise over length of what is as good as straight
LESS = 1.0 / 3.0  # rise of the middle of half an edge over that of the edge, with a margin over 1/4
TIE = 1e-6  # relative difference of diagonals that counts as none

# The triangles that become of one, by which of its sides are split: corners 0 to 2, middles of
# sides 3 to 5. The first side that is split comes first; of two split sides the last is whole.
_ONE = ((0, 3, 2), (3, 1, 2))
_TWO = ((3, 1, 4), (0, 3, 4), (0, 4, 2))
_TWO_OTHER = ((3, 1, 4), (0, 3, 2), (3, 4, 2))
_THREE = ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5))


@dataclass(frozen=True)
class Surface:
    """A mesh with what is known of the smooth surface behind it.

    Attributes:
        vertices: [m], shape (n, 3).
        triangles: shape (k, 3).
        parent: triangle of the file from which each comes, shape (k,).
        normals: of the smooth surface at the corners, unit vectors, shape (k, 3, 3).
        crease: marks the sides at creases, shape (k, 3).
        rise: the farthest that the middle of a side may move [m], shape (k,).
    """

    vertices: np.ndarray
    triangles: np.ndarray
    parent: np.ndarray
    normals: np.ndarray
    crease: np.ndarray
    rise: np.ndarray


def divide(surface: Surface, limit: np.ndarray, narrow: np.ndarray) -> Surface:
    """Split edges until none bends by more than the lower limit of the parents at both sides.

    Args:
        limit: of each triangle of the file [rad], shape (m,); infinite where none is divided.
        narrow: distance across the bend [m] below which an edge of such a triangle is not split,
            shape (m,).
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
    """One round of splitting; edges stay whole where a new triangle would be turned over."""
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
        finer, row, side = _divided(
            surface, vertices, new.reshape(-1, 3), of_side.reshape(-1, 3, 3)
        )
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
    """Marks (k, 3) the longest side of each triangle that leans by more than the limit.

    A long and narrow triangle leans away from the surface's normals by the rise along its longest
    side over its height, though no side bends by much; two of them make a fold.
    """
    corners = surface.vertices[surface.triangles]
    cosine = np.einsum("ki,ki->k", unit_normals(corners), unit_vectors(surface.normals.sum(axis=1)))
    length = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    leans = cosine < np.cos(np.minimum(limit[surface.parent], np.pi))
    return np.asarray(leans[:, None] & (length >= length.max(axis=1, keepdims=True)))


def _middles(surface: Surface, sides: np.ndarray) -> tuple[np.ndarray, ...]:
    """Middles of edges with two sides (e, 2) each.

    Returns:
        Places [m], shape (e, 3); normals on both sides, shape (2, e, 3); the bend along each edge
        [rad], shape (e,), and its width across the bend [m], shape (e,); marks edges whose middle
        may move as far as their surface is away, or nearly, shape (e,).
    """
    triangle, k = np.divmod(sides.T, 3)
    own, following = (
        surface.normals[triangle, at] for at in (k, (k + 1) % 3)
    )  # (2, e, 3), at the sides' starts and ends; the second side runs the other way
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
    """The vectors f of edges on both sides, (2, e, 3); of creases each side has its own W.

    Args:
        normal: in the middle of the edges, of any length, shape (2, e, 3).
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
        """Along e and along m, (2, e) each."""
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
    return e + share[..., None] * m


def _lean(normal: np.ndarray, e: np.ndarray) -> np.ndarray:
    """Angles [rad] by which normals (e, 3) lean along unit vectors."""
    return np.asarray(np.abs(np.arcsin(np.clip(np.einsum("ei,ei->e", normal, e), -1.0, 1.0))))


def _curve_normals(n0: np.ndarray, n1: np.ndarray, e: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Normals of creases at their starts and ends, in the plane in which each curve bends.

    Args:
        n0, n1: normals of the surfaces on both sides at the starts and ends, shape (2, e, 3).
        e: unit vectors from start to end, shape (e, 3).
    """
    t0, t1 = (_tangent(of_end[0], of_end[1], e) for of_end in (n0, n1))
    first, last = np.cross(t0, e), np.cross(e, t1)  # of one direction where the curve is an arc
    more = np.linalg.norm(first, axis=1) > np.linalg.norm(last, axis=1)
    axis = unit_vectors(np.where(more[:, None], first, last))
    return np.cross(t0, axis), np.cross(t1, axis)


def _tangent(one: np.ndarray, two: np.ndarray, e: np.ndarray) -> np.ndarray:
    """Unit tangents of creases from the normals of both sides; e where these hardly differ."""
    cross = np.cross(one, two)
    cross *= np.sign(np.einsum("ei,ei->e", cross, e))[:, None]
    weak = np.linalg.norm(cross, axis=1) < WEAK
    return np.where(weak[:, None], e, unit_vectors(cross))


def _divided(
    surface: Surface, vertices: np.ndarray, new: np.ndarray, normal: np.ndarray
) -> tuple[Surface, np.ndarray, np.ndarray]:
    """Divide triangles at the middles of their sides.

    Args:
        vertices: those of the surface and the new ones [m].
        new: vertex in the middle of each side, -1 where it is not split, shape (k, 3).
        normal: in the middle of each side, shape (k, 3, 3).

    Returns:
        The finer surface; the triangle (c,) of the surface from which each comes; and the side of
        that triangle on which each new side lies, -1 inside it, shape (c, 3).
    """
    split = new >= 0
    count = split.sum(axis=1)
    # Turned so that of one split side it is the first, and of two the first two.
    first = np.where(count == 2, ((~split).argmax(axis=1) + 1) % 3, split.argmax(axis=1))
    first[count % 3 == 0] = 0
    turned = (first[:, None] + np.arange(3)) % 3
    corner = np.concatenate(
        [np.take_along_axis(one, turned, axis=1) for one in (surface.triangles, new)], axis=1
    )
    a, c, ab, bc = (vertices[corner[:, k]] for k in (0, 2, 3, 4))
    one, other = (np.linalg.norm(d, axis=1) for d in (a - bc, ab - c))
    # Diagonals of one length are told apart by the order of the corners in the file, which is the
    # same in copies of one figure: the mesh keeps the symmetry of the part.
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
    order = np.argsort(row, kind="stable")  # children lie where their parents did
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
    """The side (6, 6) of a triangle on which two of its corners and middles lie; else -1."""
    table = np.full((6, 6), -1)
    for k in range(3):
        on_side = [k, 3 + k, (k + 1) % 3]
        for one, two in ((0, 1), (1, 2), (0, 2)):
            table[on_side[one], on_side[two]] = table[on_side[two], on_side[one]] = k
    return table


_ON_SIDE = _sides_of_codes()
