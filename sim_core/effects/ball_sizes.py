"""Sizes and masses of balls that are not all alike. They are None where all balls are alike.

Each size has its own obstacles, the mesh moved out by its own radius. All obstacles are in one tree
with a root for each size.
"""

from typing import NamedTuple

import numpy as np

from sim_core.balls import Balls
from sim_core.numerics.jit import inlined
from sim_core.numerics.vec3 import Vec3, scaled


class BallSizes(NamedTuple):
    """Sizes and masses of n balls of k sizes."""

    size: np.ndarray  # size number of each ball, shape (n,) int32
    root: np.ndarray  # node of the tree where each size's obstacles begin, shape (k,) int64
    part_root: np.ndarray  # the same node of the turning part's tree, shape (k,) int64
    radius: np.ndarray  # radius of each size [m], shape (k,)
    face_overlap: np.ndarray  # overlap of neighbouring faces for each size [m], shape (k,)
    mass: np.ndarray  # mass of each ball [kg], shape (n,)


def new_ball_sizes(
    balls: Balls, roots: np.ndarray, part_roots: np.ndarray, face_overlaps: np.ndarray
) -> BallSizes | None:
    """Return the sizes and masses of the balls; None if all balls are alike.

    Args:
        balls: the balls.
        roots: nodes of the search tree where the obstacles for each size begin, (k,).
        part_roots: the same nodes of the turning part's tree, (k,). They are not used without a
            turning part.
        face_overlaps: overlap of neighbouring faces for each size [m], (k,).
    """
    if balls.alike:
        return None
    size = np.searchsorted(balls.sizes, balls.diameters).astype(np.int32)
    return BallSizes(size, roots, part_roots, 0.5 * balls.sizes, face_overlaps, balls.masses)


@inlined
def root_of_ball(sizes: BallSizes | None, ball: int) -> int:
    """Return the node of the search tree where the obstacles for this ball begin."""
    if sizes is None:
        return 0
    return int(sizes.root[sizes.size[ball]])


@inlined
def part_root_of_ball(sizes: BallSizes | None, ball: int) -> int:
    """Return the node of the turning part's tree where the obstacles for this ball begin."""
    if sizes is None:
        return 0
    return int(sizes.part_root[sizes.size[ball]])


@inlined
def radius_of_ball(sizes: BallSizes | None, radius: float, ball: int) -> float:
    """Return the radius of a ball [m], which is ``radius`` if all balls are alike."""
    if sizes is None:
        return radius
    return float(sizes.radius[sizes.size[ball]])


@inlined
def reach_of_pair(sizes: BallSizes | None, reach: float, ball: int, other: int) -> float:
    """Return the distance of two centres at which the balls touch [m].

    It is ``reach`` if all balls are alike, and 0, as ``reach`` is, if balls never touch.
    """
    if sizes is None:
        return reach
    if reach == 0.0:
        return 0.0
    return float(sizes.radius[sizes.size[ball]] + sizes.radius[sizes.size[other]])


@inlined
def face_overlap_of_ball(sizes: BallSizes | None, face_overlap: float, ball: int) -> float:
    """Return by how much neighbouring faces overlap for a ball [m].

    It is ``face_overlap`` if all balls are alike.
    """
    if sizes is None:
        return face_overlap
    return float(sizes.face_overlap[sizes.size[ball]])


@inlined
def share_by_mass(sizes: BallSizes | None, ball: int, other: int, change: Vec3) -> Vec3:
    """Return the velocity change [m/s] of ``ball`` when it collides with ``other``.

    ``change``: velocity change [m/s] of ``ball`` if both balls had the same mass.

    The reduced mass is m1 m2 / (m1 + m2), half a mass for equal balls. Momentum is kept.
    """
    if sizes is None:
        return change
    return scaled(2.0 * sizes.mass[other] / (sizes.mass[ball] + sizes.mass[other]), change)


@inlined
def least_share_by_mass(sizes: BallSizes | None, ball: int, other: int) -> float:
    """Return the smaller of the factors by which ``share_by_mass`` changes the two balls' speeds.

    It is 1 for balls of equal mass.
    """
    if sizes is None:
        return 1.0
    one, two = sizes.mass[ball], sizes.mass[other]
    return float(2.0 * min(one, two) / (one + two))
