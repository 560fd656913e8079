"""The tree holds every obstacle once, inside its boxes, and finds what testing all of them finds,
bit for bit.
"""

import numpy as np
import trimesh

from sim_core import Gravity
from sim_core.detect.ball_mesh import first_contact, new_scratch
from sim_core.detect.ball_triangle import capsule_delay, face_delay
from sim_core.geometry.bvh import EMPTY, Tree
from sim_core.geometry.obstacle_set import build_obstacle_set
from sim_core.geometry.obstacles import CAPSULE, face_overlap_of
from sim_core.numerics.roots import NEVER
from sim_core.numerics.vec3 import Flight, Vec3
from tests.helpers.scenes.cavities import box_around

RADIUS = 1.5e-3
FALL = Vec3(*Gravity())


def room_with_a_knobbly_body() -> Tree:
    rng = np.random.default_rng(3)
    body = trimesh.creation.icosphere(subdivisions=3, radius=0.012)
    body.vertices *= 1.0 + 0.05 * rng.normal(size=(len(body.vertices), 1))
    mesh = box_around(body, 0.03)
    tree = build_obstacle_set(mesh, (RADIUS,)).tree
    assert (tree.kinds == CAPSULE).sum() > 1000
    return tree


def test_every_obstacle_is_in_one_leaf_and_inside_all_boxes_above_it() -> None:
    tree = room_with_a_knobbly_body()
    seen: list[int] = []

    def descend(node: int, low: np.ndarray, high: np.ndarray) -> None:
        for child in range(8):
            code = int(tree.children[node, child])
            if code == EMPTY:
                continue
            box_low, box_high = tree.bounds[node, :3, child], tree.bounds[node, 3:, child]
            assert (box_low >= low).all()
            assert (box_high <= high).all()
            if code < 0:
                seen.append(-1 - code)
            else:
                descend(code, box_low, box_high)

    descend(0, np.full(3, -np.inf), np.full(3, np.inf))
    assert sorted(seen) == list(range(len(tree.kinds)))


def all_obstacles(tree: Tree, ball: Flight, length: float) -> tuple[float, int]:
    best, found = length, -1
    for row in range(len(tree.kinds)):
        if tree.kinds[row] == CAPSULE:
            delay = capsule_delay(tree.numbers, row, ball, RADIUS, best)
        else:
            delay = face_delay(tree.numbers, row, ball, RADIUS, face_overlap_of(RADIUS))
        if delay < best:
            best, found = delay, row
    return (best, found) if found >= 0 else (NEVER, -1)


def test_the_walk_finds_what_testing_every_obstacle_finds() -> None:
    tree, scratch, rng = room_with_a_knobbly_body(), new_scratch(), np.random.default_rng(4)
    hits = 0
    for _ in range(300):
        start = rng.normal(size=3)
        start *= rng.uniform(0.018, 0.026) / np.linalg.norm(start)
        velocity = rng.normal(size=3) * 10.0 ** rng.uniform(-1.0, 1.3)
        ball = Flight(Vec3(*start.tolist()), Vec3(*velocity.tolist()), FALL)
        length = float(rng.uniform(0.001, 0.02))
        overlap = face_overlap_of(RADIUS)
        found = first_contact(
            None, None, None, -1, tree, scratch, ball, *(None,) * 3, overlap, 0.0, length
        )
        assert found == all_obstacles(tree, ball, length)
        hits += found[1] >= 0
    assert hits > 100
