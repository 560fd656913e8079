"""Flats: connected triangles of one surface that lie in one plane.

A fine mesh on a flat wall is the designer's wish to see coverage, not a shape: for the ball it is one face. A flat is
found by growing from its largest triangle over edges whose far corner lies in that triangle's plane but for rounding.
"""

from typing import NamedTuple

import numpy as np

from sim_core.geometry.mesh import towards_shot
from sim_core.numerics.jit import jit

# A corner this near the plane [m] is in it: below the 1e-12 m within which contacts are promised to be exact, above
# the rounding of coordinates in a chamber (1e-17 m). Far from the origin the coordinates' own rounding is more.
IN_PLANE = 1e-13
MOST_IN_PLANE = 5e-13
ROUNDINGS = 4.0
LEAST = 3  # triangles: two are not worth a search for their outline

LONE = -1


class Flats(NamedTuple):
    """``flat`` (m,) int32: which flat a triangle belongs to, LONE if none. Of each flat: ``seed`` (k,) int32, the
    triangle whose plane it has; ``frames`` (k, 3, 3) float64, a corner [m] and two unit vectors in the plane, the
    first along the longest edge of the rim, their cross product towards the shot; ``rims``, the directed edges
    (3 triangle + corner) that border it.
    """

    flat: np.ndarray
    seed: np.ndarray
    frames: np.ndarray
    rims: list[np.ndarray]


def edge_partners(triangles: np.ndarray) -> np.ndarray:
    """For each directed edge (3 triangle + corner) of a closed mesh the one that runs back along it, shape (3 m,)."""
    count = int(triangles.max()) + 1
    a = triangles.reshape(-1).astype(np.int64)
    b = np.roll(triangles, -1, axis=1).reshape(-1).astype(np.int64)
    forward, backward = a * count + b, b * count + a
    order = np.argsort(forward)
    return np.asarray(order[np.searchsorted(forward, backward, sorter=order)])


def in_plane(vertices: np.ndarray) -> float:
    """How far from a plane [m] a corner may lie to be in it, for coordinates as the user gave them (n, 3) [m]."""
    rounding = ROUNDINGS * float(np.finfo(np.float64).eps * np.abs(vertices).max())
    return min(max(IN_PLANE, rounding), MOST_IN_PLANE)


def find_flats(
    corners: np.ndarray, partners: np.ndarray, surface: np.ndarray, tolerance: float
) -> Flats:
    """Flats of LEAST triangles and more.

    ``corners`` (m, 3, 3) [m]; ``partners`` as edge_partners gives them; ``surface`` (m,): only triangles of one number
    join; ``tolerance`` [m], see in_plane.
    """
    normals, doubled = towards_shot(corners)
    flat = np.full(len(corners), LONE, dtype=np.int32)
    largest_first = np.argsort(-doubled, kind="stable")
    seeds = np.zeros(len(corners), dtype=np.int32)
    queue = np.zeros(len(corners), dtype=np.int32)
    tried = np.zeros(len(corners), dtype=np.bool_)
    count = _grow(
        corners,
        normals,
        doubled,
        partners,
        surface,
        tolerance,
        largest_first,
        flat,
        seeds,
        queue,
        tried,
    )
    seed = seeds[:count].copy()
    rims = _rims(flat, partners, count)
    frames = np.zeros((count, 3, 3))
    for k, rim in enumerate(rims):
        start = corners[rim // 3, rim % 3]
        along = corners[rim // 3, (rim % 3 + 1) % 3] - start
        length = np.linalg.norm(along, axis=1)
        frames[k, 0] = corners[seed[k], 0]
        first = along[length.argmax()] / length.max()
        frames[k, 1] = first
        frames[k, 2] = np.cross(normals[seed[k]], first)
    return Flats(flat, seed, frames, rims)


def _rims(flat: np.ndarray, partners: np.ndarray, count: int) -> list[np.ndarray]:
    """The directed edges between each flat and the rest."""
    edges = np.arange(len(partners))
    here, there = flat[edges // 3], flat[partners // 3]
    rim = edges[(here != there) & (here != LONE)]
    rim = rim[np.argsort(flat[rim // 3], kind="stable")]
    return np.split(rim, np.searchsorted(flat[rim // 3], np.arange(1, count))) if count else []


@jit
def _grow(
    corners: np.ndarray,
    normals: np.ndarray,
    doubled: np.ndarray,
    partners: np.ndarray,
    surface: np.ndarray,
    tolerance: float,
    largest_first: np.ndarray,
    flat: np.ndarray,
    seeds: np.ndarray,
    queue: np.ndarray,
    tried: np.ndarray,
) -> int:
    count = 0
    for k in range(len(largest_first)):
        seed = largest_first[k]
        if tried[seed] or doubled[seed] == 0.0:
            continue
        tried[seed] = True
        flat[seed] = count
        queue[0] = seed
        size, done = 1, 0
        while done < size:
            triangle = queue[done]
            done += 1
            for side in range(3):
                other = partners[3 * triangle + side] // 3
                if tried[other] or surface[other] != surface[seed] or doubled[other] == 0.0:
                    continue
                if _lies_in(corners, normals, other, seed, tolerance):
                    tried[other] = True
                    flat[other] = count
                    queue[size] = other
                    size += 1
        if size < LEAST:
            for i in range(size):
                flat[queue[i]] = LONE
        else:
            seeds[count] = seed
            count += 1
    return count


@jit
def _lies_in(
    corners: np.ndarray, normals: np.ndarray, triangle: int, seed: int, tolerance: float
) -> bool:
    """True when the triangle lies in the seed's plane and faces the same way."""
    facing = 0.0
    for axis in range(3):
        facing += normals[triangle, axis] * normals[seed, axis]
    if facing <= 0.0:
        return False
    for corner in range(3):
        height = 0.0
        for axis in range(3):
            height += normals[seed, axis] * (
                corners[triangle, corner, axis] - corners[seed, 0, axis]
            )
        if abs(height) > tolerance:
            return False
    return True
