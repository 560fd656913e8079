"""Balls of several sizes and densities in one room: what collisions keep, and how they share out
energy.
"""

import math
from concurrent.futures import ThreadPoolExecutor
from itertools import product

import numpy as np
import pytest
import trimesh

from sim_core import (
    Balls,
    Drag,
    Gravity,
    Physics,
    RandomPhase,
    Restitution,
    Scene,
    SceneError,
    TriangleMesh,
    Vibration,
    pack_balls,
    simulate,
)
from sim_core.effects.ball_sizes import (
    least_share_by_mass,
    new_ball_sizes,
    reach_of_pair,
    share_by_mass,
)
from sim_core.numerics.vec3 import Vec3
from sim_core.scene.invariants import clearance, contained, energy, momentum, narrowest_gap
from tests.helpers.scenes.cavities import (
    FLOOR,
    WEIGHTLESS,
    box,
    box_around,
    cylinder,
    uniform_restitution,
)
from tests.helpers.scenes.gas import SURE
from tests.sim_core.loop.test_determinism import fingerprint

SIZES = np.array([1e-3, 2e-3, 3e-3])  # m


def mixture(
    room: TriangleMesh, counts: tuple[int, int, int], seed: int, clear: float = 0.0
) -> Balls:
    """So many of each of the SIZES, in random order; the smallest are as dense as tungsten
    carbide.
    """
    rng = np.random.default_rng(seed)
    which = rng.permutation(np.repeat(np.arange(3), counts))
    diameter, density = SIZES[which], np.array([15_000.0, 7_800.0, 3_850.0])[which]
    places = pack_balls(room, len(which), diameter, rng, clear=clear)
    return Balls(places, rng.normal(0.0, 3.0, (len(which), 3)), diameter, density)


def logged(room: TriangleMesh, balls: Balls, gravity: Gravity, duration: float) -> Scene:
    """Elastic balls, with a log of collisions: the same machine code as in test_collision_log."""
    return Scene(room, balls, Physics(gravity), duration, record_collisions=True)


def test_two_unequal_balls_collide_as_momentum_and_energy_say() -> None:
    """Head on: v1' = ((m1 - m2) v1 + 2 m2 v2) / (m1 + m2) when elastic; they meet when r1 + r2
    apart.
    """
    room = box((0.1, 0.02, 0.02))
    start = np.array([[0.02, 0.01, 0.01], [0.08, 0.01, 0.01]])
    balls = Balls(
        start,
        np.array([[1.0, 0, 0], [-2.0, 0, 0]]),
        np.array([3e-3, 1e-3]),
        np.array([7800.0, 15e3]),
    )
    after = simulate(logged(room, balls, WEIGHTLESS, 0.025)).balls
    m, n = balls.masses
    expected = [
        ((m - n) * 1.0 + 2.0 * n * -2.0) / (m + n),
        ((n - m) * -2.0 + 2.0 * m * 1.0) / (m + n),
    ]
    np.testing.assert_allclose(after.velocities[:, 0], expected, rtol=1e-14)
    met = (0.06 - 2e-3) / 3.0
    places = start[:, 0] + balls.velocities[:, 0] * met + np.array(expected) * (0.025 - met)
    np.testing.assert_allclose(after.positions[:, 0], places, rtol=1e-12)


@pytest.mark.long
def test_a_pair_keeps_its_momentum_whatever_it_loses() -> None:
    room, rng = box((0.1, 0.1, 0.1)), np.random.default_rng(3)
    physics = Physics(restitution=Restitution(((1.0, 1.0),) * 3, (0.6, 0.5)))
    for _ in range(20):
        direction = rng.normal(size=3)
        direction *= 0.01 / np.linalg.norm(direction)
        places = np.array([[0.05] * 3, np.full(3, 0.05) + direction])
        fast = np.array([direction * 100.0 + rng.normal(0.0, 0.02, 3), np.zeros(3)])
        balls = Balls(places, fast, rng.choice(SIZES, 2, replace=False), rng.uniform(2e3, 2e4, 2))
        result = simulate(Scene(room, balls, physics, 0.012))
        assert result.collisions.balls == 1
        assert result.collisions.walls == 0
        np.testing.assert_allclose(momentum(result.balls), momentum(balls), rtol=1e-13, atol=1e-20)
        assert energy(result.balls) < energy(balls)


@pytest.mark.long
def test_an_elastic_mixture_keeps_its_energy_its_room_and_its_distances() -> None:
    room = cylinder(0.02, 0.02, sections=37)
    start = mixture(room, (60, 30, 15), 2)
    result = simulate(Scene(room, start, Physics(Gravity()), 3.0, record=()))
    assert result.collisions.total > 100_000
    assert abs(energy(result.balls, Gravity()) / energy(start, Gravity()) - 1.0) < 1e-11
    assert contained(room, result.balls.positions).all()
    assert narrowest_gap(result.balls)[0] > -1e-12


def test_energy_is_shared_out_evenly_between_the_sizes() -> None:
    """Equipartition: <m v²> / 3 is one temperature, whatever a ball weighs."""
    room = box((0.03, 0.03, 0.03))
    balls = mixture(room, (30, 30, 30), 4)
    assert balls.masses.max() / balls.masses.min() > 5.0
    balls = simulate(logged(room, balls, WEIGHTLESS, 2.0)).balls
    which = [balls.diameters == size for size in SIZES]
    samples = []
    for _ in range(300):
        balls = simulate(logged(room, balls, WEIGHTLESS, 0.03)).balls
        each = balls.masses * (balls.velocities**2).sum(axis=1)
        samples.append([each[own].mean() for own in which])
    rows = np.array(samples) / np.mean(samples)
    means = rows.mean(axis=0)
    errors = np.array([block.mean(axis=0) for block in np.array_split(rows, 20)]).std(
        axis=0
    ) / math.sqrt(19.0)
    print("m v² by size over the mean", means, "+-", errors)
    assert (np.abs(means - 1.0) < SURE * errors).all()
    assert errors.max() < 0.02


@pytest.mark.parametrize("name", ["slanted walls", "a cube's edges"])
def test_every_size_touches_at_its_own_radius(name: str) -> None:
    """At every impact the surface is a radius away from the centre, to rounding."""
    cube = trimesh.creation.box(
        (0.01,) * 3, transform=trimesh.transformations.rotation_matrix(0.5, (1, 2, 3))
    )
    room = cylinder(0.02, 0.02, sections=12) if name == "slanted walls" else box_around(cube, 0.015)
    start = mixture(room, (20, 20, 20), 5)
    log = simulate(logged(room, start, Gravity(), 0.3)).impacts
    radius = 0.5 * start.diameters[log.ball]
    for size in SIZES:
        own = np.flatnonzero(radius == 0.5 * size)[:400]
        assert len(own) > 300
        near = clearance(room.corners, log.position[own], size)
        np.testing.assert_allclose(near, 0.5 * size, rtol=0.0, atol=1e-12)


def test_each_ball_of_a_mixture_flies_as_it_does_alone() -> None:
    """Where they do not collide with one another, to the last bit: its obstacles are those of its
    own size.
    """
    room = cylinder(0.012, 0.02, sections=12)
    physics = Physics(Gravity(), uniform_restitution(0.9, 0.7), Vibration(FLOOR, 25e-6, 20e3, 0.3))
    by_itself, physics = physics, physics._replace(ball_collisions=None)
    balls = mixture(room, (4, 4, 4), 10, clear=50e-6)
    together = simulate(Scene(room, balls, physics, 0.2))
    for ball in range(len(balls)):
        diameter, density = float(balls.diameters[ball]), float(balls.densities[ball])
        one = Balls(balls.positions[[ball]], balls.velocities[[ball]], diameter, density)
        alone = simulate(Scene(room, one, by_itself, 0.2))
        own = together.impacts.ball == ball
        np.testing.assert_array_equal(together.impacts.position[own], alone.impacts.position)
        np.testing.assert_array_equal(together.impacts.triangle[own], alone.impacts.triangle)
        assert (together.balls.velocities[ball] == alone.balls.velocities[0]).all()


@pytest.mark.long
def test_a_mixture_in_a_chamber_that_shakes_stays_inside_and_apart() -> None:
    room = cylinder(0.015, 0.02, sections=37)
    law = uniform_restitution(0.9, 0.7)
    physics = Physics(
        Gravity(), law, Vibration(FLOOR, 25e-6, 20e3), random_phase=RandomPhase(), drag=Drag()
    )
    start = mixture(room, (30, 20, 10), 6, clear=50e-6)
    result = simulate(Scene(room, start, physics, 1.0))
    assert result.collisions.sonotrode > 1000
    assert contained(room, result.balls.positions).all()
    assert narrowest_gap(result.balls)[0] > -1e-12
    floor = room.tags[result.impacts.triangle] == FLOOR
    height = result.impacts.position[floor, 2] - 0.5 * start.diameters[result.impacts.ball[floor]]
    assert np.abs(height).max() <= 25e-6 * (1.0 + 1e-9)


@pytest.mark.long
def test_many_balls_in_blocks_meet_as_few_do() -> None:
    """Above 1,024 balls the filter looks in blocks: energy and distances say whether it misses a
    meeting.
    """
    room = box((0.08, 0.08, 0.04))
    start = mixture(room, (800, 300, 100), 7)
    result = simulate(Scene(room, start, Physics(Gravity()), 0.1, record=()))
    assert result.collisions.balls > 10_000
    assert abs(energy(result.balls, Gravity()) / energy(start, Gravity()) - 1.0) < 1e-11
    assert narrowest_gap(result.balls)[0] > -1e-12


def test_same_scene_same_bits_and_equal_numbers_are_one() -> None:
    room = cylinder(0.015, 0.02, sections=12)
    scene = logged(room, mixture(room, (10, 10, 10), 8), Gravity(), 0.3)
    with ThreadPoolExecutor(4) as pool:
        assert len({fingerprint(result) for result in pool.map(simulate, [scene] * 4)}) == 1
    one = Balls(np.full((1, 3), 0.01), np.zeros((1, 3)), 1e-3)
    same = Balls(one.positions, one.velocities, np.array([1e-3]), np.array([7800.0]))
    assert same.alike
    assert (same.diameter, same.density) == (one.diameter, one.density)


def test_packing_leaves_room_for_every_size() -> None:
    room = box((0.02, 0.02, 0.02))
    balls = mixture(room, (60, 20, 10), 9)
    assert narrowest_gap(balls)[0] >= 0.0
    gap = clearance(room.corners, balls.positions, balls.radius) - 0.5 * balls.diameters
    assert gap.min() >= 0.0


def test_a_mixed_ball_that_overlaps_is_named() -> None:
    room, still = box((0.03, 0.03, 0.03)), np.zeros((3, 3))
    diameter = np.array([2e-3, 2e-3, 6e-3])
    near = np.array(
        [[0.01, 0.01, 0.01], [0.01, 0.01, 0.0125], [0.01, 0.01, 0.016]]
    )  # 0 and 1 are nearer, and clear
    with pytest.raises(SceneError, match=r"balls 1 and 2 overlap by 0\.0005 m"):
        Scene(room, Balls(near, still, diameter), Physics(), 1.0)
    with pytest.raises(SceneError, match=r"ball 2 .* overlaps a surface by 0\.001 m"):
        Scene(
            room,
            Balls([[0.01] * 3, [0.02] * 3, [0.002, 0.02, 0.02]], still, diameter),
            Physics(),
            1.0,
        )


def test_a_collision_is_shared_out_by_mass() -> None:
    """Momentum is kept, and of equal masses each takes its own change."""
    change = Vec3(1.0, -2.0, 0.5)
    balls = Balls(np.arange(9.0).reshape(3, 3), np.zeros((3, 3)), SIZES, np.array([7.8e3] * 3))
    sizes = new_ball_sizes(balls, np.arange(3), np.arange(3), np.zeros(3))
    assert sizes is not None
    for one, two in product(range(3), repeat=2):
        of_one, of_two = (share_by_mass(sizes, *pair, change) for pair in ((one, two), (two, one)))
        for k in range(3):
            assert sizes.mass[one] * of_one[k] == pytest.approx(sizes.mass[two] * of_two[k])
            assert of_one[k] + of_two[k] == pytest.approx(2.0 * change[k])
        assert least_share_by_mass(sizes, one, two) == pytest.approx(min(of_one.x, of_two.x))
        apart = 0.5 * (SIZES[one] + SIZES[two])
        assert reach_of_pair(sizes, 1.0, one, two) == pytest.approx(apart)
        assert reach_of_pair(sizes, 0.0, one, two) == 0.0
