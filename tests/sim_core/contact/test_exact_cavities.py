"""Balls that roll and rest in exact cavities: on planes as in a mesh, and beside a cylinder wall.

Steel balls of 3 mm, with friction coefficients of 0 where balls are smooth.
"""

import math

import numpy as np
import pytest

from sim_core import (
    AnalyticCavity,
    Balls,
    Friction,
    Gravity,
    Physics,
    Rest,
    Restitution,
    Scene,
    SceneError,
    cylinder_cavity,
    pack_balls,
    periodic_box,
    prism_cavity,
    simulate,
)
from sim_core.detect.ball_cylinder import accelerated_cylinder_delay, cylinder_delay
from sim_core.effects.contact_mode import ASLEEP
from sim_core.effects.gravity import STANDARD as G
from sim_core.geometry.analytic import CylinderAxis
from sim_core.geometry.obstacles import CYLINDER_WALL, NUMBERS
from sim_core.loop.simulate import Simulation
from sim_core.numerics.vec3 import Flight, Vec3
from sim_core.scene.invariants import energy, narrowest_gap
from tests.helpers.jit_on_and_off import without_jit

R = 1.5e-3  # m
CAPTURE = 1e-3
TOUCH = 1e-12  # m
TAGS = (0, 1, 2)  # of floor, ceiling and sides
FLOOR = 0  # number of the surface
SQUARE = np.array([[0.0, 0.0], [0.3, 0.0], [0.3, 0.04], [0.0, 0.04]])
BOX = prism_cavity(SQUARE, 0.0, 0.03, TAGS)
WIDE = 0.02  # m, of the centres' circle in the cylinder
CUP = cylinder_cavity(2.0 * (WIDE + R), 0.0, 0.06, TAGS)


def physics(
    floor: float,
    wall: float,
    e: float = 0.6,
    resistance: float = 0.0,
    tilt: tuple[float, float] = (0.0, 0.0),
) -> Physics:
    """With friction of these mu on the floor and on the wall, and gravity of these slopes."""
    law, down = (e, 1e3), np.array([*tilt, -1.0])
    down *= G / np.linalg.norm(down)
    return Physics(
        Gravity(*down.tolist()),
        Restitution((law,) * 3, law),
        rest=Rest(CAPTURE, resistance),
        friction=Friction(((floor, 0.0), (0.0, 0.0), (wall, 0.0)), (floor, 0.0)),
    )


def shot(places: object, velocities: object = 0.0) -> Balls:
    places = np.atleast_2d(np.array(places, dtype=float))
    speeds = np.broadcast_to(np.array(velocities, dtype=float), places.shape)
    return Balls(places, speeds, 2.0 * R, spins=np.zeros_like(places))


@pytest.mark.long
@pytest.mark.parametrize("mu", [0.0, 0.05, 10.0])
def test_on_a_tilted_floor_a_ball_slides_slips_or_rolls(mu: float) -> None:
    """With g sin, with mu g cos against it, or with 5/7 of g sin."""
    slope, until = 0.25, 0.2
    start = [0.02, 0.02, R]
    end = simulate(Scene(BOX, shot(start), physics(mu, 0.0, tilt=(slope, 0.0)), until)).balls
    push, press = G * math.sin(math.atan(slope)), G * math.cos(math.atan(slope))
    gain = 5.0 / 7.0 * push if 2.0 / 7.0 * push < mu * press else push - mu * press
    np.testing.assert_allclose(end.velocities[0], [gain * until, 0.0, 0.0], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(
        end.positions[0] - start, [0.5 * gain * until**2, 0.0, 0.0], rtol=1e-9, atol=1e-12
    )


@pytest.mark.long
def test_in_a_tilted_box_balls_come_to_rest_in_the_corner_and_beside_it() -> None:
    """The first lies in the corner of three planes, the second on two planes and on the first."""
    effects = physics(0.2, 0.2, resistance=0.01, tilt=(-0.2, -0.1))
    result = simulate(Scene(BOX, shot([[0.004, 0.004, 0.01], [0.02, 0.004, 0.01]]), effects, 3.0))
    np.testing.assert_allclose(result.balls.positions, [[R, R, R], [3.0 * R, R, R]], atol=1e-9)
    assert result.resting.ball.tolist() == [0, 1]
    assert set(result.resting.triangles[0]) == {-1, FLOOR, 2, 5}  # the sides at y = 0 and at x = 0
    assert 0 in result.resting.balls[1]


def slide_along_the_wall(mu: float) -> None:
    """Friction of the cylinder wall slows a ball until it rolls.

    The wall presses with v²/R, so that 1/v grows by mu/R in each second, until the ball rolls on
    the wall with 5/7 of its speed. The floor is smooth.
    """
    speed, start = 0.5, shot([WIDE, 0.0, R], [0.0, 0.5, 0.0])
    rolls = 0.4 * WIDE / (mu * speed)
    effects = physics(0.0, mu)
    for until in (0.5 * rolls, 1.5 * rolls):
        end = simulate(Scene(CUP, start, effects, until)).balls
        expected = max(speed / (1.0 + mu * speed * until / WIDE), 5.0 / 7.0 * speed)
        assert np.linalg.norm(end.velocities[0]) == pytest.approx(expected, rel=1e-3)
        assert np.linalg.norm(end.positions[0, :2]) == pytest.approx(WIDE, abs=1e-8)
        assert end.positions[0, 2] == pytest.approx(R, abs=TOUCH)


def lean_on_two_balls_and_the_wall() -> None:
    """The ball lies still two radii from both others, and where the wall lets it be."""
    lower = np.array([WIDE - 1.2 * R, R, R])
    height = R + math.sqrt(4.0 * R**2 - (1.2 * R) ** 2 - R**2)
    places = [lower, lower * [1.0, -1.0, 1.0], [WIDE - 1e-6, 0.0, height + 1e-5]]
    for mu in (0.0, 0.3):
        result = simulate(Scene(CUP, shot(places), physics(mu, mu, resistance=0.01), 0.5))
        assert result.resting.ball.tolist() == [0, 1, 2]
        np.testing.assert_allclose(result.balls.positions[2], [WIDE, 0.0, height], atol=1e-8)
        assert result.collisions.total < 20_000


def test_beside_a_cylinder_wall_balls_slide_roll_and_rest() -> None:
    """Without the JIT: compiling for a cylinder with contact mode takes longer."""
    here = "tests.sim_core.contact.test_exact_cavities"
    without_jit(
        f"import {here} as t; t.slide_along_the_wall(0.4); t.lean_on_two_balls_and_the_wall()"
    )


@pytest.mark.long
def test_beside_a_cylinder_wall_balls_slide_roll_and_rest_with_the_jit() -> None:
    slide_along_the_wall(0.1)
    slide_along_the_wall(0.4)
    lean_on_two_balls_and_the_wall()


def watched(room: AnalyticCavity, balls: Balls, effects: Physics, pieces: int = 40) -> Simulation:
    """Two seconds, in which no ball overlaps anything and the energy does not grow."""
    run, before = Simulation(Scene(room, balls, effects, 2.0)), math.inf
    for stop in np.linspace(0.0, 2.0, pieces + 1)[1:]:
        run.play(float(stop), record=False)
        now = run.balls()
        assert (room.gaps(now.positions) - 0.5 * now.diameters[:, None]).min() > -TOUCH
        assert narrowest_gap(now)[0] > -TOUCH
        left = energy(now, effects.gravity) / float(now.masses.sum())
        assert left < before + 50.0 * CAPTURE**2
        before = left
    return run


@pytest.mark.long
@pytest.mark.parametrize(
    "room",
    [
        BOX,
        pytest.param(CUP, marks=pytest.mark.long),
        pytest.param(cylinder_cavity(0.009, 0.0, 0.06, TAGS), marks=pytest.mark.long),
    ],
    ids=["box", "cup", "tube"],
)
def test_shot_settles_without_overlap_or_energy(room: AnalyticCavity) -> None:
    """Most balls in the narrow cylinder lean on others and on the wall."""
    rng, count = np.random.default_rng(2), 25 if room is not BOX else 12
    places = pack_balls(room, count, 2.0 * R, rng)
    balls = shot(places, rng.normal(0.0, 0.3, places.shape))
    run = watched(room, balls, physics(0.3, 0.2, 0.6, 0.02))
    assert run.state.contact is not None
    assert (run.state.contact.mode >= ASLEEP).sum() > 0.9 * count
    rows, kinds = run.state.contact.supports.obstacles, run.state.obstacles.tree.kinds
    on_wall = (kinds[rows[rows >= 0]] == CYLINDER_WALL).any()
    assert on_wall == (room.radius is not None and room.radius < WIDE)
    assert run.state.counts[:3].sum() < 400_000


@pytest.mark.long
@pytest.mark.parametrize("seed", range(40))
def test_any_shot_settles_in_any_exact_cavity(seed: int) -> None:
    """Upright cylinders and prisms, these tilted too, and balls of one size or of two."""
    rng, high = np.random.default_rng(seed), 0.08
    wide, tilt = R * 10.0 ** rng.uniform(0.35, 1.0), (0.0, 0.0)
    room = cylinder_cavity(2.0 * wide, 0.0, high, TAGS)
    if seed % 2:
        turns = 2.0 * np.pi * (np.arange(3 + seed % 7) + rng.uniform()) / (3 + seed % 7)
        outline = 2.0 * wide * np.column_stack([np.cos(turns), np.sin(turns)])
        room, tilt = prism_cavity(outline, 0.0, high, TAGS), tuple(rng.normal(0.0, 0.3, 2))
    count = int(rng.integers(3, 25))
    shares = rng.choice([0.5, 1.0], count) if seed % 4 > 1 else np.ones(count)
    places = pack_balls(room, count, 2.0 * R * shares, rng)
    mu, wall, e = rng.choice([0.0, 0.3, 3.0]), rng.choice([0.0, 0.3]), rng.choice([0.0, 0.6, 0.9])
    speeds, still = rng.normal(0.0, 0.3, places.shape), np.zeros_like(places)
    balls = Balls(places, speeds, 2.0 * R * shares, spins=still)
    run = watched(room, balls, physics(mu, wall, e, rng.choice([0.0, 0.02]), tilt), 20)
    assert run.state.counts[:3].sum() < 3_000_000


def test_an_accelerated_ball_meets_the_wall_at_the_first_root_of_the_quartic() -> None:
    """Roots of |p + v s + a s²/2|² = 1 by the companion matrix."""
    rng, numbers = np.random.default_rng(4), np.zeros((1, NUMBERS))
    numbers[0, 3], axis, met = 1.0, CylinderAxis(0.0, 0.0), 0
    for _ in range(400):
        turn = rng.uniform(0.0, 2.0 * np.pi)
        p = rng.choice([1.0, rng.uniform(0.0, 1.0)]) * np.array([np.cos(turn), np.sin(turn)])
        v, a = rng.normal(size=2) * rng.choice([0.0, 1.0, 10.0]), rng.normal(size=2)
        p *= min(1.0, 1.0 / np.linalg.norm(p))  # rounding: not beyond the wall
        if p @ p > 0.999 and p @ v > -0.3 * np.linalg.norm(v) - 1e-9:
            continue  # on the wall: only balls that leave it clearly
        flight = Flight(Vec3(*p, 0.3), Vec3(*v, 1.0), Vec3(*a, -9.8))
        delay = accelerated_cylinder_delay(axis, numbers, 0, flight, 5.0)
        quartic = [0.25 * (a @ a), v @ a, v @ v + p @ a, 2.0 * (p @ v), p @ p - 1.0]
        roots = np.roots(quartic)
        real = np.sort(roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real > 1e-7)])
        first = next((s for s in real if np.polyval(np.polyder(quartic), s) > 0.0), math.inf)
        if first < 5.0:
            met += 1
            assert delay == pytest.approx(first, abs=1e-9)
            there = p + v * delay + 0.5 * a * delay**2
            assert abs(np.linalg.norm(there) - 1.0) < 2e-13
        else:
            assert delay > 5.0
    assert met > 150


def test_without_acceleration_across_the_axis_the_wall_is_met_as_in_flight() -> None:
    rng, numbers = np.random.default_rng(5), np.zeros((1, NUMBERS))
    numbers[0, 3], axis = 1.0, CylinderAxis(0.0, 0.0)
    for _ in range(100):
        p, v = rng.uniform(-0.7, 0.7, 2), rng.normal(size=2)
        flight = Flight(Vec3(*p, 0.3), Vec3(*v, 1.0), Vec3(0.0, 0.0, -9.8))
        exact = cylinder_delay(axis, numbers, 0, flight)
        assert accelerated_cylinder_delay(axis, numbers, 0, flight, 1e3) == exact


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_still_ball_at_the_wall_meets_it_where_it_is_pulled_to(side: float) -> None:
    """Pulled against the wall it is in contact now, pulled away it comes to the other side."""
    numbers, nothing = np.zeros((1, NUMBERS)), Vec3(0.0, 0.0, 0.0)
    numbers[0, 3] = 1.0
    flight = Flight(Vec3(1.0, 0.0, 0.0), nothing, Vec3(2.0 * side, 0.0, 0.0))
    delay = accelerated_cylinder_delay(CylinderAxis(0.0, 0.0), numbers, 0, flight, 10.0)
    assert delay == pytest.approx(0.0 if side > 0.0 else math.sqrt(2.0), abs=1e-12)
    assert accelerated_cylinder_delay(CylinderAxis(0.0, 0.0), numbers, 0, flight, 0.0) > 0.0


def test_rest_in_a_periodic_box_is_refused() -> None:
    room = periodic_box((0.0, 0.0, 0.0), (0.03, 0.03, 0.03), (0, 1))
    with pytest.raises(SceneError, match=r"physics\.rest is not supported in a periodic box"):
        Scene(room, shot([0.01, 0.01, 0.01]), physics(0.1, 0.1), 1.0)
