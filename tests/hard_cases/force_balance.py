"""Can contacts carry the balls? Forces at contacts, found by a linear programme; nothing of the
code under test.
"""

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import coo_array

from sim_core import Balls, TriangleMesh
from sim_core.scene.invariants import clearance

SIDES = 8  # of the pyramid that stands for the cone of friction
STEP = 1e-7  # m: over which a distance is differentiated


def force_lacking(
    mesh: TriangleMesh, balls: Balls, still: np.ndarray, slack: float, friction: float
) -> np.ndarray:
    """The least force, as a share of the weight, that each of the ``still`` balls lacks, shape
    (k,); gravity along -z.

    Contacts are what is within ``slack`` [m] of touching; they only push, and within ``friction``
    [-] of their normal.
    """
    seat = {int(ball): k for k, ball in enumerate(still)}
    pushes: list[
        tuple[int, np.ndarray, int]
    ] = []  # who is pushed, which way, and who by (-1: what carries itself)
    for ball, k in seat.items():
        pushes += [
            (k, way, -1) for n in _surfaces(mesh, balls, ball, slack) for way in _cone(n, friction)
        ]
        apart = balls.positions[ball] - balls.positions
        distance = np.linalg.norm(apart, axis=1)
        for other in map(
            int, np.flatnonzero((distance > 0.0) & (distance < balls.diameter + slack))
        ):
            if other > ball or other not in seat:
                by = seat.get(other, -1)
                pushes += [(k, way, by) for way in _cone(apart[other] / distance[other], friction)]
    rows = [3 * k + axis for who, _, by in pushes for k in (who, by) if k >= 0 for axis in range(3)]
    columns = [c for c, (_, _, by) in enumerate(pushes) for _ in range(3 if by < 0 else 6)]
    values = [x for _, way, by in pushes for x in (way if by < 0 else np.concatenate([way, -way]))]
    size = 3 * len(still)
    rows += [row for row in range(size) for _ in range(2)]
    columns += list(range(len(pushes), len(pushes) + 2 * size))
    values += [1.0, -1.0] * size
    balance = coo_array((values, (rows, columns)), shape=(size, len(pushes) + 2 * size)).tocsr()
    cost = np.concatenate([np.zeros(len(pushes)), np.ones(2 * size)])
    found = linprog(
        cost,
        A_eq=balance,
        b_eq=np.tile([0.0, 0.0, 1.0], len(still)),
        bounds=(0, None),
        method="highs",
    )
    return np.asarray(found.x[len(pushes) :].reshape(len(still), 6).sum(axis=1))


def _cone(normal: np.ndarray, friction: float) -> list[np.ndarray]:
    side = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    side /= np.linalg.norm(side)
    turns = 2.0 * np.pi * np.arange(SIDES) / SIDES
    return [
        normal + friction * (np.cos(t) * side + np.sin(t) * np.cross(normal, side)) for t in turns
    ]


def _surfaces(mesh: TriangleMesh, balls: Balls, ball: int, slack: float) -> list[np.ndarray]:
    """Unit normals of the triangles it touches: which way its distance from each grows."""
    here, reach = balls.positions[ball], balls.radius + slack
    beside = (mesh.corners.min(axis=1) - reach <= here) & (here <= mesh.corners.max(axis=1) + reach)
    normals = []
    for t in np.flatnonzero(beside.all(axis=1)):
        around = here + STEP * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
        distance = clearance(mesh.corners[[t]], around, 2.0 * reach)
        if distance[0] <= reach:
            slope = distance[1:4] - distance[4:]
            normals.append(slope / np.linalg.norm(slope))
    return normals
