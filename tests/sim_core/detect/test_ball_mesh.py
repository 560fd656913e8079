"""The first contact of a flying ball with a whole mesh, checked in extended precision.

Two references are used: dense sampling with bisection (tests/helpers/contacts/first_contact.py) on
random bodies, and the checks of tests/helpers/contacts/reference.py, fast enough for millions of
cases, on every shape and aim of tests/helpers/contacts/cases.py.
"""

import numpy as np
import pytest
import trimesh

from sim_core import Balls, Gravity, Physics, Restitution, Scene, TriangleMesh, simulate
from sim_core.geometry.obstacle_set import build_obstacle_set
from sim_core.geometry.obstacles import MAX_CORNER_OVERLAPS, face_overlap_of
from sim_core.scene.invariants import clearance, contained
from sim_core.scene.scene import TOUCH
from tests.helpers.contacts import calls
from tests.helpers.contacts.cases import (
    AIMS,
    BODIES,
    FAR,
    body_of,
    flights_to,
    room_with,
    touches,
    units,
)
from tests.helpers.contacts.first_contact import first_contact_reference, gap_at
from tests.helpers.contacts.reference import check_triangles
from tests.helpers.scenes.cavities import CEILING, box_around
from tests.sim_core.detect.test_contacts import SIZES, TOLERANCE, require

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
    return trimesh.Trimesh(
        corners, trimesh.convex.convex_hull(corners).faces, process=False
    ).convex_hull


def shots_at(
    body: trimesh.Trimesh, count: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
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
    hits = 0
    for _ in range(bodies):
        body = random_body(rng, family)
        mesh = box_around(body, HALF)
        surfaces = build_obstacle_set(mesh, (RADIUS,))
        centre = mesh.middle
        start, velocity = shots_at(body, shots, rng)
        length = 0.04 / np.linalg.norm(velocity, axis=1)
        expected, lowest = first_contact_reference(
            start, velocity, fall, body.triangles, RADIUS, length
        )
        flights = np.concatenate([start - centre, velocity], axis=1)
        found, triangles = calls.contacts(surfaces, flights, gravity, None, 0.0, length)
        found[mesh.tags[triangles] != CEILING] = np.inf  # the room's walls
        hit = np.flatnonzero(np.isfinite(found))
        hits += len(hit)
        everywhere = np.broadcast_to(body.triangles, (len(hit), *body.triangles.shape))
        gaps = gap_at(
            found[hit],
            start[hit],
            velocity[hit],
            np.broadcast_to(fall, (len(hit), 3)),
            everywhere,
            RADIUS,
        )
        assert np.abs(gaps).max(initial=0.0) <= EARLY, (
            "a contact was reported where the ball does not touch"
        )
        # the reference saw the ball inside before the reported contact: one was missed
        missed = np.flatnonzero(np.isfinite(expected) & (found > expected + 1e-15))
        for i in missed:
            # unless it is a graze shallower than the tolerance
            assert lowest[i] > -EARLY or found[i] - expected[i] < 1e-12, (
                f"{family}: contact at {found[i]!r} s, but the reference touches at "
                f"{expected[i]!r} s, "
                f"{-lowest[i]:.3g} m deep"
            )
        assert lowest[~np.isfinite(found)].min() > -EARLY, (
            f"{family}: a contact was missed altogether"
        )
    assert hits > 0.2 * bodies * shots, "the shots do not test much: too few hit"


@pytest.mark.parametrize("family", ["plump", "sliver", "needle"])
def test_first_contact_is_never_missed_and_never_early(family: str) -> None:
    compare_with_reference(family, bodies=6, shots=150, seed=7)


@pytest.mark.long
@pytest.mark.parametrize("family", ["plump", "sliver", "needle"])
def test_first_contact_on_a_hundred_thousand_cases(family: str) -> None:
    compare_with_reference(family, bodies=70, shots=500, seed=11)


GROUP = 500  # flights to one body; fewer to the cone's many triangles
PULLS = (
    Gravity(),
    Gravity(0.0, 0.0, 0.0),
    Gravity(),
    Gravity(500.0, -600.0, 550.0),
)  # 1, 0 and 100 g


@pytest.mark.parametrize("count", SIZES)
@pytest.mark.parametrize("shape", BODIES)
def test_first_contact_from_any_start(shape: str, count: int) -> None:
    """Half of the flights are random, half hard; in the long run all shapes see more than ``count``
    of each.
    """
    rng = np.random.default_rng(13)
    radius, half = BODIES[shape]
    offset = FAR if shape == "far" else np.zeros(3)
    hits = np.zeros(0, dtype=bool)
    size = GROUP if shape != "cone" else GROUP // 10
    for group in range(max(2 * (len(AIMS) - 2), 3 * count // len(BODIES) // GROUP)):
        aim = "random" if group % 2 == 0 else AIMS[1:-1][group // 2 % (len(AIMS) - 2)]
        pull = PULLS[group // 2 % len(PULLS)] if aim != "random" else PULLS[group // 2 % 2]
        corners, triangles = body_of(rng, shape)
        mesh = room_with(corners[None], triangles, half, offset)
        surfaces = build_obstacle_set(mesh, (radius,))
        touch, normal = touches(rng, corners, triangles, radius, size)
        flights = flights_to(
            rng, aim, touch, normal, np.broadcast_to(np.array(pull), (size, 3)), radius
        )
        seen = (
            mesh.corners - mesh.middle
        )  # all digits of a far mesh's rounded corners, as the simulation has them
        free = clearance(seen, flights[:, :3], radius) >= radius - TOUCH
        flights = flights[free & contained(mesh, flights[:, :3] + offset)]
        tilt = (
            1.1 * MAX_CORNER_OVERLAPS * face_overlap_of(radius) / radius
        )  # faces reach an overlap over their borders, three past their corners
        lengths = rng.uniform(0.002, 0.02, len(flights))
        found, _ = calls.contacts(surfaces, flights, pull, None, 0.0, lengths)
        everywhere = np.broadcast_to(seen, (len(flights), *seen.shape))
        errors = check_triangles(everywhere, flights, radius, lengths, found, TOLERANCE, tilt)
        require(errors, found, f"{shape}, {aim}")
        hits = np.concatenate([hits, np.isfinite(found)])
    assert hits.mean() > 0.3, "the flights do not test much: too few hit"


def test_a_scene_a_kilometre_away_plays_the_same_bits() -> None:
    """On a grid of 2^-30 m the move is exact: no digit goes to the far origin."""
    grid = 2.0**30
    rng = np.random.default_rng(5)
    corners, triangles = body_of(rng, "spiky")
    near = room_with(corners[None], triangles, 0.03, np.zeros(3))
    rounded = np.round(near.vertices * grid) / grid
    positions = np.round(0.024 * units(rng, 40) * grid) / grid
    positions = positions[clearance(rounded[near.triangles], positions, 0.001) >= 0.001]
    velocities = 3.0 * units(rng, len(positions))
    physics = Physics(Gravity(), Restitution(((0.9, 1.0),) * 3, (1.0, 1.0)))
    shift = np.round(FAR * grid) / grid
    logs = []
    for move in (np.zeros(3), shift):
        mesh = TriangleMesh(rounded + move, near.triangles, near.tags)
        logs.append(
            simulate(Scene(mesh, Balls(positions + move, velocities, 1e-3), physics, 0.1)).impacts
        )
    assert len(logs[0]) > 100
    for column in ("time", "triangle", "normal_speed"):
        np.testing.assert_array_equal(getattr(logs[0], column), getattr(logs[1], column))
