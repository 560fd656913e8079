"""From where a chosen part of a surface is seen best, as the surface itself may hide it.

Points are spread over the surface. In each direction the surface is divided into columns that lead
to the eye: a point is hidden if its column has another one much nearer to the eye.

Notation:
    w: unit vector to the eye, shape (3,)
    x, n: place [m] and unit normal of a point, shape (k, 3)
    d: width of a column [m]
"""

from __future__ import annotations

import numpy as np

from chamberopt.geometry.triangles import EVEN_STEP, areas, on_triangles, unit_normals

POINTS = 10_000  # on the chosen triangles, and as many on the others
AROUND = 12  # directions in a row of one height
HEIGHTS = {20: 1.0, 40: 0.8, -20: 0.65, -40: 0.5, -60: 0.35}  # degrees; worth of what is seen
USUAL = np.array([0.53, -0.85])  # to the eye, seen from above
ALIKE = 0.9  # of the most that is seen: the usual way shows enough
COLUMN = 2.0  # distances of neighbouring points
NEARER = 3.0  # columns' widths: what is nearer to the eye by more hides a point
ASIDE = 0.5  # weight of the usual way, by which the eye goes aside to show the depth


def way_to_see(vertices: np.ndarray, triangles: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Return the unit vector to the eye that sees most of the chosen triangles, shape (3,).

    The eye is above unless far more is seen from below. Where all sides show about the same, it is
    at the usual side.

    Args:
        vertices, triangles: the surface [m], normals outwards, z upwards.
        chosen: marks the chosen triangles, (m,).
    """
    turn = np.arctan2(USUAL[1], USUAL[0]) + 2.0 * np.pi * np.arange(AROUND) / AROUND
    usual = _way(turn[:1], 20.0)[0]
    if not chosen.any():
        return np.asarray(usual)
    corners, area = vertices[triangles], areas(vertices, triangles)
    place, normal = (
        np.concatenate(both)
        for both in zip(
            *(_spread(corners[one], area[one]) for one in (chosen, ~chosen)), strict=True
        )
    )
    wanted = np.arange(len(place)) < POINTS
    width = COLUMN * float(np.sqrt(area.sum() / len(place)))

    def seen(ways: np.ndarray) -> np.ndarray:
        return np.array([_share(place, normal, wanted, way, width) for way in ways])

    best, most = usual, 0.0
    for height, worth in HEIGHTS.items():
        ways = _way(turn, height)
        shares = worth * seen(ways)
        k = 0 if shares[0] > ALIKE * shares.max() else int(shares.argmax())
        if shares[k] > most:
            best, most = ways[k], shares[k]
    aside = best[:2] / np.hypot(*best[:2]) + ASIDE * USUAL
    turned = _way(np.arctan2(aside[1:], aside[:1]), float(np.degrees(np.arcsin(best[2]))))
    shows = seen(np.vstack([best, turned]))
    return np.asarray(turned[0] if shows[1] > ALIKE * shows[0] else best)


def _way(turn: np.ndarray, height: float) -> np.ndarray:
    """Return the unit vectors (k, 3) to the eye at angles about z [rad] and a height [degrees]."""
    up = np.radians(height)
    flat = np.cos(up) * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    return np.column_stack([flat, np.full(len(turn), np.sin(up))])


def _spread(corners: np.ndarray, area: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return places and normals (POINTS, 3) spread evenly over triangles (m, 3, 3), if any.

    Args:
        area: of each triangle, (m,).
    """
    if not len(corners):
        return np.empty((0, 3)), np.empty((0, 3))
    upto = np.cumsum(area)
    at = upto[-1] * (np.arange(POINTS) + 0.5) / POINTS
    triangle = np.minimum(np.searchsorted(upto, at), len(corners) - 1)
    u, v = (np.arange(POINTS)[:, None] * EVEN_STEP % 1.0).T
    return on_triangles(corners[triangle], u, v), unit_normals(corners[triangle])


def _share(
    place: np.ndarray, normal: np.ndarray, wanted: np.ndarray, way: np.ndarray, width: float
) -> float:
    """Return which share of the wanted points is seen, each as oblique as it is seen.

    Args:
        wanted: marks points, (k,).
        way: w.
        width: d.
    """
    right = np.array([-way[1], way[0], 0.0]) / np.hypot(way[0], way[1])
    cell = np.floor(place @ np.stack([right, np.cross(way, right)], axis=1) / width).astype(int)
    cell -= cell.min(axis=0)
    column = cell[:, 0] * (cell[:, 1].max() + 1) + cell[:, 1]
    depth = place @ way
    nearest = np.full(column.max() + 1, -np.inf)
    np.maximum.at(nearest, column, depth)
    facing = normal @ way
    is_seen = wanted & (facing > 0.0) & (nearest[column] - depth < NEARER * width)
    return float(facing[is_seen].sum() / wanted.sum())
