"""The tree's first contact of a flying ball with a body of faces, edges and corners, against a dense extended-
precision reference.
"""

import numpy as np
import pytest
import trimesh

from sim_core import Gravity
from sim_core.detect.ball_mesh import first_contact, new_scratch
from sim_core.flight import Point
from sim_core.surfaces.ground import build_ground
from sim_core.vec3 import Vec3
from tests.cavities import CEILING, box_around
from tests.sim_core.first_contact_reference import first_contact_reference, gap_at

HALF = 0.05  # m, half side of the room
RADIUS = 1.5e-3
EARLY = 1e-12  # m: how far from touching a reported contact may be


def random_body(rng: np.random.Generator, family: str) -> trimesh.Trimesh:
    """A tetrahedron: plump, a sliver (one corner a few µm above the others' plane), or a needle."""
    corners = rng.normal(size=(4, 3))
    corners *= 0.01 / np.linalg.norm(corners, axis=1)[:, None]
    if family == "sliver":
        corners[3] = corners[:3].mean(axis=0) + 1e-6 * rng.normal(size=3)
    if family == "needle":
        corners[1:] = corners[1] + 2e-6 * rng.normal(size=(3, 3))
    return trimesh.Trimesh(corners, trimesh.convex.convex_hull(corners).faces, process=False).convex_hull


def shots_at(body: trimesh.Trimesh, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Balls that start clear of the body and fly at its surroundings, some aimed to graze it."""
    start = rng.normal(size=(count, 3))
    start *= rng.uniform(0.015, 0.03, size=(count, 1)) / np.linalg.norm(start, axis=1)[:, None]
    aim = body.sample(count, seed=int(rng.integers(1 << 31))) + rng.normal(size=(count, 3)) * RADIUS
    velocity = aim - start
    velocity *= rng.uniform(0.3, 20.0, size=(count, 1)) / np.linalg.norm(velocity, axis=1)[:, None]
    return start, velocity


def compare_with_reference(family: str, bodies: int, shots: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    gravity = Gravity()
    fall = np.array(gravity)
    scratch = new_scratch()
    hits = 0
    for _ in range(bodies):
        body = random_body(rng, family)
        mesh = box_around(body, HALF)
        ground = build_ground(mesh, RADIUS)
        centre = mesh.middle
        start, velocity = shots_at(body, shots, rng)
        length = 0.04 / np.linalg.norm(velocity, axis=1)
        expected, lowest = first_contact_reference(start, velocity, fall, body.triangles, RADIUS, length)
        found = np.full(shots, np.inf)
        for i in range(shots):
            ball = Point(Vec3(*(start[i] - centre).tolist()), Vec3(*velocity[i].tolist()))
            delay, obstacle = first_contact(
                ground.tree, scratch, ball, gravity, None, ground.seam, 0.0, float(length[i])
            )
            if obstacle >= 0 and mesh.tags[ground.tree.triangles[obstacle, 0]] == CEILING:
                found[i] = delay
        hit = np.flatnonzero(np.isfinite(found))
        hits += len(hit)
        everywhere = np.broadcast_to(body.triangles, (len(hit), *body.triangles.shape))
        gaps = gap_at(found[hit], start[hit], velocity[hit], np.broadcast_to(fall, (len(hit), 3)), everywhere, RADIUS)
        assert np.abs(gaps).max(initial=0.0) <= EARLY, "a contact was reported where the ball does not touch"
        # the reference saw the ball inside before the reported contact: one was missed
        missed = np.flatnonzero(np.isfinite(expected) & (found > expected + 1e-15))
        for i in missed:
            # unless it is a graze shallower than the tolerance
            assert lowest[i] > -EARLY or found[i] - expected[i] < 1e-12, (
                f"{family}: contact at {found[i]!r} s, but the reference touches at {expected[i]!r} s, "
                f"{-lowest[i]:.3g} m deep"
            )
        assert lowest[~np.isfinite(found)].min() > -EARLY, f"{family}: a contact was missed altogether"
    assert hits > 0.2 * bodies * shots, "the shots do not test much: too few hit"


@pytest.mark.parametrize("family", ["plump", "sliver", "needle"])
def test_first_contact_is_never_missed_and_never_early(family: str) -> None:
    compare_with_reference(family, bodies=6, shots=150, seed=7)


@pytest.mark.long
@pytest.mark.parametrize("family", ["plump", "sliver", "needle"])
def test_first_contact_on_a_hundred_thousand_cases(family: str) -> None:
    compare_with_reference(family, bodies=70, shots=500, seed=11)
