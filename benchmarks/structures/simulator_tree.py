"""The product's own search, which tests eight boxes in one instruction.

It is measured as it is, and over the same obstacles that the other structures hold.
"""

from typing import NamedTuple

import numpy as np

from benchmarks.structures.compiled import searches
from benchmarks.structures.mesh_obstacles import Shell
from sim_core.detect.ball_mesh import Scratch, first_contact, new_scratch
from sim_core.geometry.bvh import Tree, build_tree
from sim_core.geometry.obstacle_set import build_obstacle_set
from sim_core.geometry.obstacles import ObstacleTable
from sim_core.geometry.triangle_lookup import TriangleLookup
from sim_core.numerics.vec3 import Flight


class EightWide(NamedTuple):
    tree: Tree
    scratch: Scratch
    seam: float


def build(shell: Shell) -> EightWide:
    """The product's tree over the shell's obstacles."""
    grow = shell.grow[:, None]
    low, high = shell.points.min(axis=1) - grow, shell.points.max(axis=1) + grow
    names = np.repeat(np.arange(len(shell.kinds), dtype=np.int32)[:, None], 2, axis=1)
    tree = build_tree(ObstacleTable(shell.numbers, shell.kinds, names, low, high), shell.radius)
    return EightWide(tree, new_scratch(), shell.seam)


def build_product(shell: Shell) -> tuple[EightWide, TriangleLookup]:
    """What the product makes of the mesh, with flat faces merged.

    The second item finds the triangle that was hit.
    """
    surfaces = build_obstacle_set(shell.mesh, (shell.radius,))
    return EightWide(surfaces.tree, new_scratch(), surfaces.face_overlap), surfaces.lookup


@searches(EightWide)
def nearest(eight, ball, fall, length):  # type: ignore[no-untyped-def]
    """Delay [s] and name of the first contact within ``length`` [s].

    The name is the row of the shell or the triangle of the product.
    """
    flight = Flight(ball.position, ball.velocity, fall)
    delay, row = first_contact(
        *(None, None, None, -1, eight.tree, eight.scratch, flight),
        *(None, None, None, eight.seam, 0.0, length),
    )
    return delay, int(eight.tree.triangles[row, 0]) if row >= 0 else -1
