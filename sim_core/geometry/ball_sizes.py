"""Balls of several sizes or densities: what differs from ball to ball; absent where all balls are alike.

Each size has obstacles of its own (the mesh moved out by its own radius), all in one tree with a root for each size.
"""

from typing import NamedTuple

import numpy as np

from sim_core.balls import Balls
from sim_core.geometry.obstacles import seam
from sim_core.numerics.jit import inlined
from sim_core.numerics.vec3 import Vec3


class Sizes(NamedTuple):
    """``size`` (n,) int32: which of the k sizes each ball has; ``root`` (k,) int64: the node of the tree where that
    size's obstacles begin; ``radius``, ``seam`` (k,) [m]; ``mass`` (n,) [kg].
    """

    size: np.ndarray
    root: np.ndarray
    radius: np.ndarray
    seam: np.ndarray
    mass: np.ndarray


def new_sizes(balls: Balls, roots: np.ndarray) -> Sizes | None:
    """None for balls that are all alike; ``roots`` (k,): as Ground has them, in the order of ``balls.sizes``."""
    if balls.alike:
        return None
    size = np.searchsorted(balls.sizes, balls.diameters).astype(np.int32)
    radius = 0.5 * balls.sizes
    return Sizes(size, roots, radius, np.array([seam(float(r)) for r in radius]), balls.masses)


@inlined
def own_root(sizes: Sizes | None, ball: int) -> int:
    """The node of the tree where the ball's obstacles begin."""
    if sizes is None:
        return 0
    return sizes.root[sizes.size[ball]]


@inlined
def own_radius(sizes: Sizes | None, radius: float, ball: int) -> float:
    """A ball's radius [m]; ``radius`` is that of all, if they are alike."""
    if sizes is None:
        return radius
    return sizes.radius[sizes.size[ball]]


@inlined
def own_seam(sizes: Sizes | None, overlap: float, ball: int) -> float:
    """How far the ball's faces overlap [m]; ``overlap`` for all, if they are alike."""
    if sizes is None:
        return overlap
    return sizes.seam[sizes.size[ball]]


@inlined
def by_mass(sizes: Sizes | None, ball: int, other: int, change: Vec3) -> Vec3:
    """What a pair of equal balls would each be changed by [m/s], for this ball of an unequal pair.

    The reduced mass is m1 m2 / (m1 + m2), half a mass if they are equal; momentum is kept.
    """
    if sizes is None:
        return change
    share = 2.0 * sizes.mass[other] / (sizes.mass[ball] + sizes.mass[other])
    return Vec3(share * change.x, share * change.y, share * change.z)
