"""Balls that lie still at the end of a simulation, and a test if balls can rest in a chamber."""

from dataclasses import dataclass

import numpy as np

from sim_core.effects.contact_mode import ASLEEP, JAMMED, MAX_SUPPORTS, ON_BALL, ContactState
from sim_core.effects.gravity import Gravity
from sim_core.geometry.analytic import AnalyticCavity
from sim_core.geometry.mesh import TriangleMesh, normals_towards_shot
from sim_core.geometry.obstacle_set import ObstacleSet
from sim_core.geometry.obstacles import CAPSULE
from sim_core.geometry.triangle_lookup import find_triangle
from sim_core.numerics.vec3 import Vec3

UPWARD = 1e-6  # share of the weight: a wall that bears less is upright up to rounding
NONE = -1


@dataclass(frozen=True)
class Resting:
    """The k balls that lie still at the end of a simulation.

    ball: numbers of the balls, (k,).
    position: positions of the ball centres [m], (k, 3).
    since: times at which the balls came to lie still [s since the end of the warm-up], (k,). A time
        during the warm-up is negative.
    triangles: triangles under each ball, (k, 4), -1 for unused entries.
    balls: balls under each ball, (k, 4), -1 for unused entries.
    jammed: True for a ball that is held by the balls around it and not only by its supports, (k,)
        bool.
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
    """Find the balls that lie still now, and the triangles and balls under them.

    Args:
        contact: state of contact mode. Without it no ball lies still.
        obstacles: still obstacles of the scene.
        positions: positions of all ball centres [m], (n, 3).
        middle: middle of the mesh [m], (3,).
        origin: end of the warm-up [s since the start].
    """
    still = np.zeros(0, np.int64)
    if contact is not None:
        still = np.flatnonzero(contact.mode >= ASLEEP)
    triangles = np.full((len(still), MAX_SUPPORTS), NONE)
    balls = triangles.copy()
    if contact is None:
        no_time, no_ball = np.zeros(0), np.zeros(0, np.bool_)
        return Resting(still, positions[still], no_time, triangles, balls, no_ball)
    for i, ball in enumerate(still):
        for support in range(contact.supports.number[ball]):
            obstacle = int(contact.supports.obstacles[ball, support])
            if obstacle <= ON_BALL:
                balls[i, support] = ON_BALL - obstacle
            else:
                seed = int(obstacles.tree.triangles[obstacle, 0])
                at = Vec3(*(float(x) for x in positions[ball] - middle))
                lone = obstacles.tree.kinds[obstacle] == CAPSULE
                triangles[i, support] = seed if lone else find_triangle(obstacles.lookup, seed, at)
    since = contact.still_since[still] - origin
    jammed = contact.mode[still] == JAMMED
    return Resting(still, positions[still], since, triangles, balls, jammed)


def can_rest(mesh: TriangleMesh | AnalyticCavity, gravity: Gravity | None, *moving: int) -> bool:
    """Return True if gravity can press a ball onto a triangle of the chamber that stands still.

    ``moving``: tags of the surfaces that vibrate or turn.
    """
    if gravity is None:
        return False
    weight = np.array(gravity, dtype=np.float64)
    normals, doubled = normals_towards_shot(mesh.corners)
    still = (doubled > 0.0) & ~np.isin(mesh.tags, moving)
    return bool((normals[still] @ weight < -UPWARD * np.linalg.norm(weight)).any())
