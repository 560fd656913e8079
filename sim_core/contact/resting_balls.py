"""Where balls can lie still, and which do: what a designer wants to know of pockets, slots and dead corners."""

from dataclasses import dataclass

import numpy as np

from sim_core.effects.contact_mode import (
    ASLEEP,
    JAMMED,
    LIES_SINCE,
    MAX_SUPPORTS,
    MODE,
    ON_BALL,
    SUPPORTS,
    ContactState,
)
from sim_core.effects.gravity import Gravity
from sim_core.geometry.analytic import AnalyticCavity
from sim_core.geometry.mesh import TriangleMesh, normals_towards_shot
from sim_core.geometry.obstacle_set import ObstacleSet
from sim_core.geometry.obstacles import CAPSULE
from sim_core.geometry.triangle_lookup import find_triangle
from sim_core.numerics.vec3 import Vec3

UPWARD = 1e-6  # of the weight: a wall that bears less is upright but for rounding
NONE = -1


@dataclass(frozen=True)
class Resting:
    """The k balls that lie still at the end, by number.

    ``ball`` (k,): which; ``position`` (k, 3) [m]; ``since`` (k,) [s]: when each came to lie still, on the clock of the
    impacts, so negative when it was during the warm-up; ``triangles`` (k, 4) and ``balls`` (k, 4): what each stands
    on, -1 where there is no more; ``jammed`` (k,) bool: held by balls around it, not by what it stands on alone.
    """

    ball: np.ndarray
    position: np.ndarray
    since: np.ndarray
    triangles: np.ndarray
    balls: np.ndarray
    jammed: np.ndarray

    def __len__(self) -> int:
        return len(self.ball)


def resting(
    contact: ContactState | None,
    obstacles: ObstacleSet,
    positions: np.ndarray,
    middle: np.ndarray,
    origin: float,
) -> Resting:
    """Who lies still now; ``positions`` (n, 3) [m], ``middle`` (3,) of the mesh, ``origin`` [s] of their clock."""
    if contact is None:
        return Resting(*(np.zeros(shape, kind) for shape, kind in _EMPTY))
    still = np.flatnonzero(contact.marks[:, MODE] >= ASLEEP)
    triangles = np.full((len(still), MAX_SUPPORTS), NONE)
    balls = triangles.copy()
    for i, ball in enumerate(still):
        for support in range(contact.marks[ball, SUPPORTS]):
            row = int(contact.rows[ball, support])
            if row <= ON_BALL:
                balls[i, support] = ON_BALL - row
            else:
                seed = int(obstacles.tree.triangles[row, 0])
                at = Vec3(*(float(x) for x in positions[ball] - middle))
                lone = obstacles.tree.kinds[row] == CAPSULE
                triangles[i, support] = seed if lone else find_triangle(obstacles.lookup, seed, at)
    return Resting(
        still,
        positions[still],
        contact.memory[still, LIES_SINCE] - origin,
        triangles,
        balls,
        contact.marks[still, MODE] == JAMMED,
    )


_EMPTY = (
    ((0,), np.int64),
    ((0, 3), np.float64),
    ((0,), np.float64),
    ((0, MAX_SUPPORTS), np.int64),
    ((0, MAX_SUPPORTS), np.int64),
    ((0,), np.bool_),
)


def can_rest(mesh: TriangleMesh | AnalyticCavity, gravity: Gravity | None, *moving: int) -> bool:
    """True when a ball can lie still in the chamber: gravity presses it onto some triangle that keeps still.

    ``moving``: the tags of the surfaces that vibrate or turn.
    """
    if gravity is None:
        return False
    acceleration = np.array(gravity, dtype=np.float64)
    normals, doubled = normals_towards_shot(mesh.corners)
    still = (doubled > 0.0) & ~np.isin(mesh.tags, moving)
    return bool((normals[still] @ acceleration < -UPWARD * np.linalg.norm(acceleration)).any())
