"""Balls rest on still surfaces while a part turns; the part wakes those that it reaches.

Nothing rests on the part itself. Steel balls of 3 mm lie on the floor of a cube, with the part just
above it. There is no friction but the resistance to rolling.
"""

import numpy as np
import pytest
import trimesh

from sim_core import (
    Balls,
    Gravity,
    PartRotation,
    Physics,
    Rest,
    Restitution,
    Scene,
    SceneError,
    SimulationError,
    TriangleMesh,
    can_rest,
    pack_balls,
    simulate,
)
from sim_core.contact.pushed_by_part import drop_pressed_balls
from sim_core.contact.supports import add_support
from sim_core.effects.contact_mode import ASLEEP, MAX_SUPPORTS, ON_BALL
from sim_core.effects.gravity import STANDARD as G
from sim_core.loop.simulate import Simulation
from sim_core.numerics.vec3 import Vec3
from sim_core.scene.invariants import clearance, closest_pair
from tests.helpers.jit_on_and_off import with_and_without_jit
from tests.helpers.scenes.cavities import SIDES, box_around
from tests.helpers.scenes.turning_parts import BODIES, PART, star

R, HALF, WIDE = 1.5e-3, 0.02, 2e-3  # m: of a ball, the cube, and half the paddle's width
ELASTIC_BELOW = 0.01  # m/s
TOUCH = 1e-12  # m


def physics(turn: PartRotation, e: float = 0.8) -> Physics:
    law = (e, 1e3)
    return Physics(
        Gravity(),
        Restitution((law,) * 3, law, ELASTIC_BELOW),
        rest=Rest(1e-3, 0.005),
        part_rotation=turn,
    )


def paddle(length: float = 0.03) -> TriangleMesh:
    """A bar [m] along x in a cube, half a millimetre over its floor."""
    bar = trimesh.creation.box((length, 2 * WIDE, 0.02))
    bar.apply_translation([0.0, 0.0, 0.0105 - HALF])
    return box_around(bar, HALF)


def on_floor(places: object) -> Balls:
    flat = np.atleast_2d(np.array(places, dtype=float))
    return Balls(
        np.column_stack([flat, np.full(len(flat), R - HALF)]), np.zeros((len(flat), 3)), 2 * R
    )


def gaps(run: Simulation) -> float:
    """The smallest between balls, still surfaces and the part where it is now [m]."""
    balls, corners = run.balls(), run._corners()
    assert corners is not None
    pairs = closest_pair(balls)[0] - balls.diameter
    return min(float(clearance(corners, balls.positions, 2 * R).min() - R), pairs)


def modes(run: Simulation) -> np.ndarray:
    assert run.state.contact is not None
    return run.state.contact.mode


def arrival(x: float, y: float) -> float:
    """Angle [rad] at which the paddle's face touches a ball at (x, y)."""
    return float(np.arctan2(y, x) - np.arcsin((WIDE + R) / np.hypot(x, y)))


@pytest.mark.parametrize("rpm", [0.1, 1.0, 10.0, 100.0])
def test_a_sleeping_ball_is_woken_when_the_paddle_arrives(rpm: float) -> None:
    x, y, omega = 0.002, 0.012, 2 * np.pi * rpm / 60
    when = arrival(x, y) / omega
    run = Simulation(
        Scene(paddle(), on_floor([x, y]), physics(PartRotation(PART, rpm=rpm)), 2 * when)
    )
    run.play(0.5 * when, record=False)
    before = run.state.counts.copy()
    run.play(when * (1.0 - 1e-9), record=False)
    assert modes(run)[0] == ASLEEP
    assert (run.state.counts == before).all()  # it costs nothing until then
    np.testing.assert_allclose(run.balls().positions[0], [x, y, R - HALF], atol=TOUCH)
    run.play(when * (1.0 + 1e-9), record=False)
    speed = omega * np.sqrt(x * x + y * y - (WIDE + R) ** 2)
    e = 1.0 if speed < ELASTIC_BELOW else 0.8
    out = max((1.0 + e) * speed, speed + 1e-4 * G)  # what lies on it would hop for 0.2 ms
    angle = arrival(x, y)
    expected = out * np.array([-np.sin(angle), np.cos(angle), 0.0])
    np.testing.assert_allclose(
        run.balls().velocities[0], expected, rtol=1e-6, atol=2e-10 * when
    )  # less the brake
    run.play(2 * when, record=False)
    assert gaps(run) > -TOUCH


def test_a_part_that_oscillates_wakes_a_ball_that_it_reaches_and_no_other() -> None:
    swing, frequency = 0.9, 0.2
    turn = PartRotation(PART, amplitude=swing, frequency=frequency)
    near, far = (0.009, 0.007), (0.002, 0.012)
    assert arrival(*near) < swing < arrival(*far)
    when = np.arcsin(arrival(*near) / swing) / (2 * np.pi * frequency)
    run = Simulation(Scene(paddle(0.024), on_floor([near, far]), physics(turn), 20.0))
    run.play(when * (1.0 - 1e-9), record=False)
    assert (modes(run) == ASLEEP).all()
    run.play(when * (1.0 + 1e-9), record=False)
    assert (modes(run) == ASLEEP).tolist() == [False, True]


def test_what_the_part_never_reaches_is_never_looked_at_again() -> None:
    run = Simulation(
        Scene(paddle(), on_floor([0.018, 0.018]), physics(PartRotation(PART, rpm=30.0)), 30.0)
    )
    run.play(0.1, record=False)
    before = run.state.counts.copy()
    run.play(30.0, record=False)
    assert (run.state.counts == before).all()


@pytest.mark.parametrize("rpm", [0.05, 1.0, 10.0])
def test_what_it_pushes_pushes_others_however_slowly(rpm: float) -> None:
    """A ball before the paddle has two behind it that it cannot pass.

    All are slower than what moves sleeping balls otherwise.
    """
    omega = 2 * np.pi * rpm / 60
    first, step = WIDE + R + 1e-4, 1.001 * R
    places = [
        [0.012, first],
        [0.012 - step, first + np.sqrt(3.0) * step],
        [0.012 + step, first + np.sqrt(3.0) * step],
    ]
    until = 0.1 / omega
    run = Simulation(Scene(paddle(), on_floor(places), physics(PartRotation(PART, rpm=rpm)), until))
    for stop in np.linspace(0.0, until, 21)[1:]:
        run.play(float(stop), record=False)
        assert gaps(run) > -TOUCH
    moved = np.linalg.norm(run.balls().positions[:, :2] - np.array(places), axis=1)
    assert moved[0] > 0.1 * 0.012 - 2e-4
    assert moved[1:].max() > 2e-4
    assert run.state.counts.sum() < 100_000


@pytest.mark.parametrize("rpm", [1.0, 10.0])
def test_a_pile_swept_by_a_slow_paddle_gets_no_more_speed_than_that_gives(rpm: float) -> None:
    """A ball gets at most twice the speed of the paddle.

    Exceptions: what is squeezed hops at up to the speed at which hits begin to lose energy, and is
    shot out of a wedge at a few times that. What the paddle does not touch comes to rest.
    """
    room, turn = paddle(), PartRotation(PART, rpm=rpm)
    rng = np.random.default_rng(1)
    places = pack_balls(room, 60, 2 * R, rng, part_rotation=turn)
    balls = Balls(places, rng.normal(0.0, 0.1, places.shape), 2 * R)
    run = Simulation(Scene(room, balls, physics(turn), 4.0))
    tip = np.hypot(0.015, WIDE) * 2 * np.pi * rpm / 60
    asleep = 0
    for stop in np.linspace(0.0, 4.0, 81)[1:]:
        run.play(float(stop), record=False)
        assert gaps(run) > -TOUCH
        if stop > 2.0:
            assert (
                np.linalg.norm(run.balls().velocities, axis=1).max()
                < 2.0 * tip + 5.0 * ELASTIC_BELOW
            )
            asleep += int((modes(run) >= ASLEEP).sum())
    assert asleep > 40 * 25
    assert run.state.counts.sum() < 100_000


def test_balls_rest_below_a_gear_that_turns_and_nothing_overlaps() -> None:
    """A horizontal axis: teeth come down into the pile, lift balls and let them fall."""
    gear = star(7, 0.012, 0.007, 0.008)
    gear.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    room, turn = box_around(gear, 0.0145), PartRotation(PART, axis=(0.0, 1.0, 0.0), rpm=10.0)
    rng = np.random.default_rng(5)
    places = pack_balls(room, 80, 2 * R, rng, part_rotation=turn)
    balls = Balls(places, rng.normal(0.0, 0.1, places.shape), 2 * R)
    run = Simulation(Scene(room, balls, physics(turn), 2.0))
    for stop in np.linspace(0.0, 2.0, 41)[1:]:
        run.play(float(stop), record=False)
        assert gaps(run) > -TOUCH
    assert (modes(run) >= ASLEEP).sum() > 40
    assert run.state.counts.sum() < 1_000_000


def test_on_the_turning_part_nothing_rests_and_hops_are_bounded() -> None:
    slab = trimesh.creation.box((0.026, 0.026, 0.01))
    room, turn = box_around(slab, HALF), PartRotation(PART, rpm=2.0)
    ball = Balls(np.array([[0.0, 0.0, 0.005 + R + 1e-3]]), np.zeros((1, 3)), 2 * R)
    run = Simulation(Scene(room, ball, physics(turn, 0.5), 3.0))
    run.play(2.0, record=False)
    before = run.state.counts.copy()
    run.play(3.0, record=False)
    assert modes(run)[0] < ASLEEP
    assert 0.5 * G / ELASTIC_BELOW < run.state.counts[0] - before[0] < 0.5 / 1e-4
    assert 0.0 <= run.balls().positions[0, 2] - 0.005 - R < 1e-5
    assert not can_rest(room, Gravity(), PART, SIDES)
    assert can_rest(room, Gravity(), PART)


def pocket_and_cam() -> TriangleMesh:
    """A pocket in a cube's wall that just takes a ball, and a cam that comes 0.2 mm too near it."""
    cube = trimesh.creation.box((0.04, 0.04, 0.04))
    hole = trimesh.creation.box((0.0035, 0.0031, 0.0031))
    hole.apply_translation([0.0225 - 0.00175, 0.0, 0.0])
    room = trimesh.boolean.union([cube, hole], engine="manifold")
    cam = trimesh.creation.cylinder(radius=0.008, height=0.01, sections=32)
    cam.apply_translation([-0.0117, 0.0, 0.0])
    vertices = np.concatenate([room.vertices, cam.vertices])
    triangles = np.concatenate([room.faces, cam.faces[:, ::-1] + len(room.vertices)])
    tags = np.concatenate([np.full(len(room.faces), SIDES), np.full(len(cam.faces), PART)])
    return TriangleMesh(vertices, triangles, tags)


def test_a_ball_that_the_part_crushes_stops_the_run_and_the_part_is_named() -> None:
    ball = Balls(np.array([[0.021 - 1e-6, 0.0, R - 0.00155 + 1e-6]]), np.zeros((1, 3)), 2 * R)
    scene = Scene(pocket_and_cam(), ball, physics(PartRotation(PART, rpm=5.0)), 7.0)
    with pytest.raises(
        SimulationError, match=r"ball 0 is caught between .*the turning part \(triangle \d+\)"
    ):
        simulate(scene)


def any_scene(seed: int) -> Scene:
    """Some part that turns somehow, low in a cube, among balls that come to rest."""
    rng = np.random.default_rng(seed)
    body = BODIES[sorted(BODIES)[seed % len(BODIES)]].copy()
    body.apply_translation([0.0, 0.0, rng.uniform(-0.008, 0.0)])
    motion = (
        {"rpm": 10.0 ** rng.uniform(-1.0, 2.5)}
        if seed % 3
        else {"amplitude": rng.uniform(0.1, 2.0), "frequency": 2.0}
    )
    turn = PartRotation(
        PART, axis=tuple(rng.normal(0.0, 0.3, 3) + np.eye(3)[rng.integers(3)]), **motion
    )
    room = box_around(body, rng.uniform(0.021, 0.026))
    places = pack_balls(room, int(rng.integers(5, 60)), 2 * R, rng, part_rotation=turn)
    balls = Balls(places, rng.normal(0.0, 0.3, places.shape), 2 * R)
    return Scene(room, balls, physics(turn, rng.choice([0.0, 0.5, 0.9])), 1.0)


def run_or_message(seed: int) -> str:
    """ "ran" if nothing overlaps at any of twenty times, else why the part catches a ball."""
    try:
        run = Simulation(any_scene(seed))
        for stop in np.linspace(0.0, 1.0, 21)[1:]:
            run.play(float(stop), record=False)
            assert gaps(run) > -TOUCH
    except SceneError as error:
        return str(error)
    except SimulationError as error:
        assert "is caught between" in str(error), error  # noqa: PT017
        assert "the turning part" in str(error), error  # noqa: PT017
        return str(error)
    return "ran"


def test_any_part_turns_among_any_balls_or_the_run_says_why_not() -> None:
    outcomes = [run_or_message(seed) for seed in range(20)]
    assert outcomes.count("ran") > 10


@pytest.mark.long
def test_many_parts_turn_among_many_balls_or_the_run_says_why_not() -> None:
    outcomes = [run_or_message(seed) for seed in range(20, 500)]
    assert outcomes.count("ran") > 240


def small_scene() -> Scene:
    places = [[0.012, 0.005], [0.012, 0.009], [-0.006, 0.006], [0.017, 0.017]]
    return Scene(paddle(), on_floor(places), physics(PartRotation(PART, rpm=40.0)), 0.3)


def test_the_same_bits_with_the_jit_on_and_off() -> None:
    code = (
        "from tests.sim_core.contact.test_pushed_by_part import small_scene;"
        "from sim_core import simulate;"
        "from tests.sim_core.loop.test_determinism import fingerprint;"
        "r = simulate(small_scene()); print(r.collisions.total, len(r.resting), fingerprint(r))"
    )
    answers = with_and_without_jit(code)
    assert int(answers[0].split()[0]) > 5
    assert int(answers[0].split()[1]) > 0
    assert answers[0] == answers[1]


@pytest.mark.parametrize("count", range(MAX_SUPPORTS + 1))
def test_a_push_drops_the_balls_in_its_way_and_no_support_of_another_ball(count: int) -> None:
    """Up to four supports, from above and below in turn; the second one is a wall."""
    turn = PartRotation(PART, rpm=1.0)
    run = Simulation(Scene(paddle(), on_floor([[0.01, 0.01], [-0.01, 0.01]]), physics(turn), 1.0))
    contact, middle, up = run.state.contact, Vec3(0.0, 0.0, 0.0), Vec3(0.0, 0.0, 1.0)
    assert contact is not None
    supports = contact.supports
    under = [ON_BALL - 5, 7, ON_BALL - 6, ON_BALL - 7]
    normals = [Vec3(0.0, 0.0, -1.0 if k % 2 else 1.0) for k in range(MAX_SUPPORTS)]
    for k in range(MAX_SUPPORTS):
        add_support(supports, 1, ON_BALL - 9, Vec3(0.0, 0.0, -1.0), middle, 1.0)
        if k < count:
            add_support(supports, 0, under[k], normals[k], middle, 1.0)
    for push, stay in ((up, [0, 1, 2]), (Vec3(0.0, 0.0, -1.0), [1])):
        drop_pressed_balls(contact, 0, push)
        left = supports.obstacles[0, : supports.number[0]].tolist()
        assert left == [under[k] for k in stay if k < count]
    assert supports.number[1] == MAX_SUPPORTS
    assert (supports.obstacles[1] == ON_BALL - 9).all()
