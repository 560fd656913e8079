"""Which edges can be touched, and on which triangle an impact on an edge is recorded."""

import numpy as np
import trimesh

from sim_core import Balls, Physics, Scene, simulate
from sim_core.geometry.obstacle_set import build_obstacle_set
from sim_core.geometry.obstacles import CAPSULE, FACE
from tests.helpers.scenes.cavities import CEILING, WEIGHTLESS, box, box_around, cylinder


def test_only_edges_convex_towards_the_shot_are_obstacles() -> None:
    for room in (box((0.1, 0.1, 0.1)), cylinder(0.03, 0.04)):
        assert (build_obstacle_set(room, (1.5e-3,)).tree.kinds == FACE).all()
    room = box_around(trimesh.creation.box((0.02, 0.02, 0.02)), 0.05)
    kinds = build_obstacle_set(room, (1.5e-3,)).tree.kinds
    assert (kinds == CAPSULE).sum() == 12  # a cube's edges, not the diagonals of its faces


def test_hits_on_an_edge_are_shared_by_its_two_faces() -> None:
    """Balls fall on a roof's ridge from random places near it: either slope gets its share, by
    symmetry half.
    """
    ridge = trimesh.creation.box((0.06, 0.02, 0.02))
    ridge.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 4, [1, 0, 0]))
    room = box_around(ridge, 0.05)
    top = 0.02 / np.sqrt(2)
    rng = np.random.default_rng(1)
    slopes = []
    for offset in rng.uniform(
        -0.9e-3, 0.9e-3, 60
    ):  # within the radius x sin 45° that meets the ridge, not a slope
        ball = Balls(np.array([[0.003, offset, top + 0.01]]), np.array([[0.0, 0.0, -5.0]]), 3e-3)
        log = simulate(
            Scene(room, ball, Physics(WEIGHTLESS), duration=0.0025, record=(CEILING,))
        ).impacts
        assert len(log) == 1
        normal = np.cross(
            *(room.corners[log.triangle[0], k] - room.corners[log.triangle[0], 0] for k in (1, 2))
        )
        slopes.append(np.sign(-normal[1]) == np.sign(offset))
    assert all(slopes), "a ball left of the ridge dents the left slope"
