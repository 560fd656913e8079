"""A part that turns: contacts against independent references, and conserved quantities."""

import os
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from sim_core import (
    Balls,
    Gravity,
    PartRotation,
    Physics,
    Restitution,
    Scene,
    SceneError,
    SimulationResult,
    TriangleMesh,
    Vibration,
    pack_balls,
    simulate,
)
from sim_core.scene.invariants import clearance
from tests.helpers.jit_on_and_off import with_and_without_jit
from tests.helpers.scenes.cavities import SMOOTH, WEIGHTLESS, box_around, uniform_restitution
from tests.helpers.scenes.turning_parts import BODIES, PART, Rotor, bar

EARLY = 1e-12  # m
SAMPLES = 1500
STARTS = int(os.environ.get("TURNING_STARTS", "48"))  # of each body and motion
MOTIONS = {
    "still": {"rpm": 0.0},
    "slow": {"rpm": 3.0},
    "100 rpm": {"rpm": 100.0},
    "backwards": {"rpm": -700.0},
    "fast": {"rpm": 9000.0},
    "to and fro": {"amplitude": 0.4, "frequency": 3.0},
    "shaken": {"amplitude": 0.05, "frequency": 400.0},
    "over and over": {"amplitude": 9.0, "frequency": 8.0},
}


def checked_flight(rotor, position, velocity, gravity, time, limit):  # type: ignore[no-untyped-def]
    """The first contact, after holding it against the gap on a dense row of times; (delay, -1) if
    there is none.
    """
    delay, row = rotor.search(position, velocity, gravity, time, limit)
    assert 0.0 <= delay <= limit
    rows = np.concatenate([np.linspace(0.0, delay, SAMPLES), [delay - 1e-6 * delay, delay - 1e-9]])
    gap = rotor.gap(position, velocity, gravity, time, np.maximum(rows, 0.0))
    worst = gap.argmin()
    assert gap[worst] > -EARLY, (
        f"missed at {rows[worst]:.9g} s: overlap {-gap[worst]:.3g} m, answer {delay, row}"
    )
    if row >= 0:
        there = rotor.gap(position, velocity, gravity, time, np.array([delay]))[0]
        assert abs(there) <= EARLY, f"gap {there:.3g} m at the contact"
    return delay, row


def random_motion(rng: np.random.Generator, motion: dict[str, float]) -> PartRotation:
    axis = rng.normal(size=3) if rng.random() < 0.5 else np.array([0.0, 0.0, 1.0])
    point = rng.uniform(-3e-3, 3e-3, 3)
    return PartRotation(PART, tuple(point), tuple(axis), phase=rng.uniform(0.0, 6.0), **motion)


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("body", BODIES)
def test_random_flights_meet_the_part_when_its_surface_is_there(body: str, motion: str) -> None:
    """From all sides, slow, fast and at rest, with gravity and without; then off again from where
    it touched.
    """
    rng = np.random.default_rng(len(body) * 100 + len(motion))
    hits = 0
    for _ in range(STARTS // 12):
        turn = random_motion(rng, MOTIONS[motion])
        rotor = Rotor(BODIES[body], turn, diameter=float(rng.choice([0.5e-3, 1.5e-3, 3e-3])))
        for _ in range(12):
            gravity = Gravity() if rng.random() < 0.5 else None
            velocity = rng.normal(size=3) * rng.choice([0.0, 0.3, 1.0, 3.0, 10.0])
            position = rng.uniform(-0.025, 0.025, 3)
            time = rng.uniform(0.0, 0.02)
            if not rotor.clear(position, time):
                continue
            if rng.random() < 0.7:  # aimed at the part
                velocity = (
                    np.linalg.norm(velocity)
                    * (BODIES[body].sample(1, seed=rng)[0] - position)
                    / 0.02
                )
            for _ in range(4):
                delay, row = checked_flight(rotor, position, velocity, gravity, time, 0.01)
                fall = np.zeros(3) if gravity is None else np.array(gravity)
                position = position + delay * velocity + 0.5 * delay**2 * fall
                velocity = velocity + delay * fall
                time += delay
                if row < 0:
                    continue
                hits += 1
                velocity = bounced(rotor, position, velocity, time, rng.choice([1.0, 0.5, 0.02]))
    assert hits > 0.06 * STARTS


def bounced(
    rotor: Rotor, position: np.ndarray, velocity: np.ndarray, time: float, e: float
) -> np.ndarray:
    """Velocity after the ball has hit the part, its normal taken from how the gap changes with the
    place.
    """
    step = 1e-7
    moved = position + step * np.concatenate([np.eye(3), -np.eye(3)])
    gap = np.array([rotor.gap(p, velocity, None, time, np.zeros(1))[0] for p in moved])
    normal = gap[:3] - gap[3:]
    normal /= np.linalg.norm(normal)
    early, late = (flight_point(rotor, position, time, s) for s in (-1e-7, 1e-7))
    relative = velocity - (late - early) / 2e-7
    rate = normal @ relative
    return np.asarray(velocity - (1.0 + e) * min(rate, 0.0) * normal)


def flight_point(rotor: Rotor, position: np.ndarray, time: float, later: float) -> np.ndarray:
    """Where the point of the part that is at a place now will be a little later [m]."""
    frame = rotor.seen(position[None], np.array([time]))
    axis = np.array(rotor.turn.axis) / np.linalg.norm(rotor.turn.axis)
    forth = Rotation.from_rotvec(rotor.angle(np.array([time + later]))[:, None] * axis)
    return np.asarray(forth.apply(frame - rotor.turn.axis_point) + rotor.turn.axis_point)[0]


@pytest.mark.parametrize("rpm", [3.0, 3000.0])
@pytest.mark.parametrize("miss", [1e-6, 1e-9, 1e-11])
def test_a_grazing_corner_hits_a_resting_ball_or_not_by_which_side_it_is_on(
    rpm: float, miss: float
) -> None:
    tip = np.hypot(10e-3, 2e-3)
    rotor = Rotor(BODIES["bar"], PartRotation(PART, rpm=rpm))
    for angle in np.linspace(0.3, 1.2, 7):
        for side in (-1.0, 1.0):
            position = (tip + rotor.radius + side * miss) * np.array(
                [np.cos(angle), np.sin(angle), 0.0]
            )
            delay, row = checked_flight(rotor, position, np.zeros(3), None, 0.0, 30.0 / rpm)
            assert (row >= 0) == (side < 0.0)
            if row >= 0:  # a little before the corner would be straight under it
                assert delay == pytest.approx(
                    (angle - np.arctan2(2e-3, 10e-3)) / (2 * np.pi * rpm / 60), rel=0.1
                )


BAR_HALF, REACH = 2e-3, 3.5e-3  # m: half the bar's width, and that plus a ball's radius


def effects(turn: PartRotation | None, gravity: Gravity = WEIGHTLESS, e: float = 1.0) -> Physics:
    """One set of effects for most tests, as each set is compiled; test_friction has it too."""
    law = Restitution(((e, 1e3),) * 3, (1.0, 1e3), elastic_below=0.0)
    return Physics(gravity, law, part_rotation=turn, friction=SMOOTH)


def one_ball(
    position: tuple[float, ...], velocity: tuple[float, ...], physics: Physics, duration: float
) -> SimulationResult:
    room = box_around(BODIES["bar"], 0.05)
    shot = Balls(np.array([position]), np.array([velocity]), 3e-3)
    return simulate(Scene(room, shot, physics, duration))


def reference_time(gap: Callable[[np.longdouble], np.longdouble], before: float) -> np.longdouble:
    """The first zero of a gap that is positive at 0, by a dense search and bisection in extended
    precision.
    """
    step = np.longdouble(before) / 2000
    k = next(k for k in range(1, 2001) if gap(k * step) <= 0)
    low, high = (k - 1) * step, k * step
    for _ in range(80):
        middle = (low + high) / 2
        low, high = (low, middle) if gap(middle) <= 0 else (middle, high)
    return high


@pytest.mark.parametrize("rpm", [1.0, 30.0, 100.0, -1000.0, 6000.0])
def test_a_falling_ball_meets_the_turning_bar_when_the_closed_form_says(rpm: float) -> None:
    omega, g = 2 * np.pi * rpm / 60, 9.81
    x, y, v = np.copysign(6e-3, rpm), 9e-3, -0.3
    physics = effects(PartRotation(PART, rpm=rpm), Gravity(0.0, -g, 0.0))

    def gap(
        t: np.longdouble,
    ) -> np.longdouble:  # n(t) x(t) - reach with n = (-sin, cos) of the angle
        height = y + t * (v - t * g / 2)
        return abs(height * np.cos(omega * t) - x * np.sin(omega * t)) - REACH

    when = reference_time(gap, 0.03)
    log = one_ball((x, y, 0.0), (0.0, v, 0.0), physics, 0.04).impacts
    step = np.longdouble(1e-6)
    rate = float((gap(when + step) - gap(when - step)) / (2 * step))
    assert abs(float(log.time[0] - when) * rate) <= EARLY
    assert log.normal_speed[0] == pytest.approx(-rate, rel=1e-6)


@pytest.mark.parametrize("frequency", [0.5, 7.0, 200.0])
def test_a_bar_swinging_to_and_fro_meets_a_resting_ball_when_the_closed_form_says(
    frequency: float,
) -> None:
    swing, x, y = 0.5, 6e-3, 4.5e-3
    physics = effects(PartRotation(PART, amplitude=swing, frequency=frequency))
    log = one_ball((x, y, 0.0), (0.0, 0.0, 0.0), physics, 0.3 / frequency).impacts
    angle = np.arctan2(y, x) - np.arcsin(REACH / np.hypot(x, y))
    when = np.arcsin(angle / swing) / (2 * np.pi * frequency)
    speed = (
        2
        * np.pi
        * frequency
        * swing
        * np.cos(np.arcsin(angle / swing))
        * np.sqrt(x * x + y * y - REACH**2)
    )
    assert log.time[0] * speed == pytest.approx(when * speed, abs=EARLY)
    assert log.normal_speed[0] == pytest.approx(speed, rel=1e-12)


@pytest.mark.parametrize("e", [1.0, 0.6])
def test_a_resting_ball_is_thrown_by_the_bar_as_by_a_heavy_moving_face(e: float) -> None:
    """u' = U + e (U - u) along the normal: 2 U for the elastic one at rest; the tangential part is
    kept.
    """
    omega, x, y = 2 * np.pi * 2.0, 6e-3, 4.5e-3
    physics = effects(PartRotation(PART, rpm=120.0), e=e)
    angle = np.arctan2(y, x) - np.arcsin(REACH / np.hypot(x, y))
    speed = omega * np.sqrt(x * x + y * y - REACH**2)
    result = one_ball((x, y, 0.0), (0.0, 0.0, 0.0), physics, angle / omega + 1e-4)
    expected = (1.0 + e) * speed * np.array([-np.sin(angle), np.cos(angle), 0.0])
    np.testing.assert_allclose(result.balls.velocities[0], expected, atol=1e-12)
    # the touched face runs under the ball at omega times its height over the axis
    np.testing.assert_allclose(
        result.impacts.velocity[0], [omega * BAR_HALF, -speed, 0.0], atol=1e-12
    )


def test_a_part_that_turns_at_0_rpm_is_the_still_part() -> None:
    rng = np.random.default_rng(3)
    room = box_around(BODIES["star"], 0.02)
    for _ in range(10):
        balls = Balls(pack_balls(room, 5, 2e-3, rng), rng.normal(0.0, 1.5, (5, 3)), 2e-3)
        still, turning = (
            simulate(Scene(room, balls, effects(turn, Gravity()), 0.012))
            for turn in (None, PartRotation(PART, (1e-3, 2e-3, 0.0), rpm=0.0))
        )
        assert turning.collisions.total == still.collisions.total > 1
        np.testing.assert_array_equal(turning.impacts.triangle, still.impacts.triangle)
        np.testing.assert_allclose(turning.impacts.time, still.impacts.time, atol=1e-12)
        np.testing.assert_allclose(turning.impacts.velocity, still.impacts.velocity, atol=1e-9)


@pytest.mark.parametrize("rpm", [60.0, 2000.0])
def test_hits_on_a_steady_rotor_keep_the_jacobi_integral(rpm: float) -> None:
    """Seen from the rotor, v²/2 - omega² rho²/2 is kept by flights and elastic hits (Goldstein,
    section 3.12); in the room's terms that is the energy less omega times the angular momentum,
    which collisions among balls keep too.
    """
    omega, rng = 2 * np.pi * rpm / 60, np.random.default_rng(8)
    room = box_around(BODIES["star"], 0.3)
    own = room.tags == PART
    angle, radius = 2 * np.pi * np.arange(24) / 24, 0.0165
    positions = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(24)])
    velocities = -0.6 * positions / radius + rng.normal(0.0, 0.1, (24, 3))
    result = simulate(
        Scene(room, Balls(positions, velocities, 3e-3), effects(PartRotation(PART, rpm=rpm)), 0.06)
    )
    assert len(result.impacts) > 15
    assert own[result.impacts.triangle].all()

    def jacobi(balls: Balls) -> float:
        momentum = np.cross(balls.positions, balls.velocities)[:, 2].sum()
        return float(0.5 * (balls.velocities**2).sum() - omega * momentum)

    before, after = jacobi(Balls(positions, velocities, 3e-3)), jacobi(result.balls)
    energy = 0.5 * (velocities**2).sum(), 0.5 * (result.balls.velocities**2).sum()
    assert abs(energy[1] - energy[0]) > 1e-3 * energy[0]  # which alone is not kept
    assert after == pytest.approx(before, abs=1e-11 * max(energy))


def crowd(turn: PartRotation, duration: float, count: int = 40, seed: int = 4) -> Scene:
    """Balls about a star in a cube whose floor shakes them."""
    room = box_around(BODIES["star"], 0.025)
    tags = room.tags.copy()
    tags[(room.corners[:, :, 2] == room.corners[:, :, 2].min()).all(axis=1)] = 1
    room = TriangleMesh(room.vertices, room.triangles, tags)
    physics = Physics(
        Gravity(), uniform_restitution(0.9, 1.0), Vibration(1, 40e-6, 20e3, 0.3), part_rotation=turn
    )
    rng = np.random.default_rng(seed)
    positions = pack_balls(room, count, 3e-3, rng, clear=50e-6, part_rotation=turn)
    return Scene(
        room,
        Balls(positions, rng.normal(0.0, 2.0, (count, 3)), 3e-3),
        physics,
        duration,
        record=(PART,),
    )


@pytest.mark.long
@pytest.mark.parametrize(
    "turn",
    [
        PartRotation(PART, rpm=37.0, phase=1.0),
        PartRotation(PART, rpm=-3000.0),
        PartRotation(PART, amplitude=0.7, frequency=3.3, phase=0.5),
    ],
    ids=["slow", "fast", "to and fro"],
)
def test_impacts_lie_on_the_part_in_its_own_frame_and_balls_stay_outside_it(
    turn: PartRotation,
) -> None:
    """Over thousands of windows: the angle must not step from one to the next, nor drift."""
    scene = crowd(turn, 20.0)
    result = simulate(scene)
    log = result.impacts
    assert result.collisions.total > 100_000
    assert len(log) > 5_000
    some = np.random.default_rng(1).choice(len(log), 1000, replace=False)
    off = [
        clearance(scene.mesh.corners[[log.triangle[k]]], log.position[[k]], 0.01)[0]
        - scene.balls.radius
        for k in some
    ]
    assert np.abs(off).max() <= 1e-9
    rotor = Rotor(BODIES["star"], turn)
    gap = clearance(
        rotor.own, rotor.seen(result.balls.positions, np.full(len(result.balls), 20.0)), 0.05
    )
    assert gap.min() > scene.balls.radius - 1e-9


@pytest.mark.long
def test_the_same_scene_gives_the_same_bits_with_the_jit_on_and_off() -> None:
    code = (
        "from tests.sim_core.loop.test_determinism import fingerprint;"
        "from tests.sim_core.geometry.test_turning_part import crowd, PartRotation, PART; from "
        "sim_core import simulate;"
        "r = simulate(crowd(PartRotation(PART, rpm=400.0), 0.06, 8)); print(r.collisions.total, "
        "fingerprint(r))"
    )
    answers = with_and_without_jit(code)
    assert int(answers[0].split()[0]) > 20
    assert answers[0] == answers[1]


def shaft_through_ceiling(sections: int, across: float, tilt: float = 0.0) -> TriangleMesh:
    """A cube with a prism hanging into it through the ceiling, about the z axis before it is moved
    ``across`` [m].
    """
    shaft = trimesh.creation.cylinder(radius=0.008, height=0.04, sections=sections)
    shaft.apply_transform(trimesh.transformations.rotation_matrix(tilt, [1, 0, 0]))
    shaft.apply_translation([across, 0.0, 0.02])
    room = trimesh.boolean.difference(
        [trimesh.creation.box((0.05, 0.05, 0.04)), shaft], engine="manifold"
    )
    inside = np.linalg.norm(room.triangles_center[:, :2] - [across, 0.0], axis=1) < 0.0085
    ceiling = (np.abs(room.triangles[:, :, 2] - 0.02) < 1e-9).all(axis=1)
    floor = (np.abs(room.triangles[:, :, 2] + 0.02) < 1e-9).all(axis=1)
    return TriangleMesh(room.vertices, room.faces, np.where(inside & ~ceiling & ~floor, 0, 2))


def test_a_round_shaft_turns_where_it_goes_through_the_ceiling_and_balls_stay_in() -> None:
    room = shaft_through_ceiling(24, 0.0)
    rng = np.random.default_rng(2)
    turn = PartRotation(0, rpm=50.0)
    balls = Balls(pack_balls(room, 60, 3e-3, rng), rng.normal(0.0, 2.0, (60, 3)), 3e-3)
    result = simulate(Scene(room, balls, effects(turn), 10.0))
    assert result.collisions.total > 100_000


def disc_on_a_shaft() -> TriangleMesh:
    """A cube with a disc in it that hangs on a shaft, which covers the rims of the disc's holes.

    The disc has tag 0, the shaft 1, the room 2.
    """
    disc = trimesh.creation.cylinder(radius=0.012, height=0.004, sections=48)
    holes = [trimesh.creation.cylinder(radius=0.0025, height=0.01, sections=32) for _ in range(4)]
    for hole, (x, y) in zip(holes, ((1, 0), (0, 1), (-1, 0), (0, -1)), strict=True):
        hole.apply_translation([0.00606 * x, 0.00606 * y, 0.0])
    disc = trimesh.boolean.difference([disc, *holes], engine="manifold")
    shaft = trimesh.creation.cylinder(radius=0.004, height=0.03, sections=12)
    shaft.apply_translation([0.0, 0.0, 0.002 + 0.015 - 1e-6])
    cube = trimesh.creation.box((0.04, 0.04, 0.03))
    room = trimesh.boolean.difference([cube, disc, shaft], engine="manifold")
    middles = room.triangles_center
    in_room = (np.abs(room.triangles) > 0.0149).any(axis=2).all(axis=1)
    on_shaft = ~in_room & (middles[:, 2] > 0.002 - 2e-6)
    on_shaft &= np.linalg.norm(middles[:, :2], axis=1) < 0.004 + 1e-6
    return TriangleMesh(room.vertices, room.faces, np.select([in_room, on_shaft], [2, 1], 0))


def test_balls_stay_in_where_the_holder_that_turns_with_a_part_covers_some_of_a_hole() -> None:
    """Beneath the shaft's edge a ball comes out of the hole, where there is no joint to recede."""
    room, rng = disc_on_a_shaft(), np.random.default_rng(5)
    balls = Balls(pack_balls(room, 150, 1e-3, rng), rng.normal(0.0, 1.0, (150, 3)), 1e-3)
    result = simulate(Scene(room, balls, effects(PartRotation(0, rpm=60.0, with_part=(1,))), 3.0))
    assert set(room.tags[result.impacts.triangle]) == {0, 1, 2}


def test_what_turns_with_a_part_turns_as_the_part_does() -> None:
    rng = np.random.default_rng(9)
    whole = box_around(BODIES["star"], 0.02)
    own, halves = np.flatnonzero(whole.tags == PART), whole.tags.copy()
    other = next(tag for tag in range(3) if tag not in halves)
    halves[own[::2]] = other
    divided = TriangleMesh(whole.vertices, whole.triangles, halves)
    balls = Balls(pack_balls(whole, 8, 2e-3, rng), rng.normal(0.0, 1.5, (8, 3)), 2e-3)
    turn = PartRotation(PART, rpm=500.0)
    one, two = (
        simulate(Scene(room, balls, effects(moving, Gravity()), 0.05))
        for room, moving in ((whole, turn), (divided, turn._replace(with_part=(other,))))
    )
    assert len(one.impacts) > 20
    np.testing.assert_array_equal(one.impacts.triangle, two.impacts.triangle)
    np.testing.assert_array_equal(one.impacts.time, two.impacts.time)
    np.testing.assert_array_equal(one.balls.positions, two.balls.positions)


class Refused(NamedTuple):
    room: Callable[[], TriangleMesh]
    turn: PartRotation
    words: str


@pytest.mark.parametrize(
    "case",
    [
        Refused(
            lambda: shaft_through_ceiling(24, 0.004),
            PartRotation(0, rpm=1.0),
            "not round about its axis",
        ),
        Refused(
            lambda: shaft_through_ceiling(24, 0.0),
            PartRotation(0, axis=(0.1, 0.0, 1.0), rpm=1.0),
            "not round about",
        ),
        Refused(
            lambda: shaft_through_ceiling(4, 0.0),
            PartRotation(0, rpm=1.0),
            "not round about its axis",
        ),
        Refused(
            lambda: box_around(BODIES["bar"], 0.0102),
            PartRotation(PART, (0.005, 0.0, 0.0), rpm=1.0),
            "cannot turn",
        ),
        Refused(
            lambda: box_around(bar(0.0198, 0.0198), 0.0102),
            PartRotation(PART, rpm=1.0),
            "cannot turn",
        ),
        Refused(
            lambda: box_around(BODIES["bar"], 0.02),
            PartRotation(9, rpm=1.0),
            "part_rotation.tag: 9, but",
        ),
        Refused(
            lambda: box_around(BODIES["bar"], 0.02),
            PartRotation(PART),
            "either rpm, or amplitude and frequency",
        ),
        Refused(
            lambda: box_around(BODIES["bar"], 0.02),
            PartRotation(PART, rpm=1.0, amplitude=1.0),
            "either rpm, or",
        ),
        Refused(
            lambda: box_around(BODIES["bar"], 0.02),
            PartRotation(PART, amplitude=1.0),
            "either rpm, or amplitude",
        ),
        Refused(
            lambda: box_around(BODIES["bar"], 0.02),
            PartRotation(PART, rpm=float("nan")),
            "part_rotation.rpm is nan",
        ),
        Refused(
            lambda: box_around(BODIES["bar"], 0.02),
            PartRotation(PART, axis=(0.0, 0.0, 0.0), rpm=1.0),
            "a direction",
        ),
        Refused(
            lambda: box_around(BODIES["bar"], 0.02),
            PartRotation(PART, amplitude=-1.0, frequency=1.0),
            "part_rotation.amplitude is -1",
        ),
        Refused(
            lambda: box_around(BODIES["bar"], 0.02),
            PartRotation(PART, amplitude=1.0, frequency=0.0),
            "part_rotation.frequency is 0",
        ),
        Refused(
            lambda: box_around(BODIES["bar"], 0.02),
            PartRotation(PART, rpm=1.0, phase=float("inf")),
            "part_rotation.phase is inf",
        ),
    ],
    ids=lambda case: case.words,
)
def test_a_part_that_cannot_turn_is_refused_in_words(case: Refused) -> None:
    room = case.room()
    corner = room.vertices.min(axis=0) + 2e-4
    with pytest.raises(SceneError, match=case.words):
        Scene(
            room, Balls(corner[None], np.zeros((1, 3)), 2e-4), Physics(part_rotation=case.turn), 0.1
        )


def test_a_small_swing_is_allowed_where_a_whole_turn_is_not() -> None:
    room = box_around(bar(0.0198, 0.0198), 0.0102)
    corner = room.vertices.min(axis=0)[None] + [[2e-4, 2e-4, 2e-4]]
    shot = Balls(corner, np.zeros((1, 3)), 2e-4)
    Scene(room, shot, Physics(part_rotation=PartRotation(PART, amplitude=0.01, frequency=1.0)), 0.1)
    with pytest.raises(SceneError, match="cannot turn"):
        Scene(
            room, shot, Physics(part_rotation=PartRotation(PART, amplitude=0.2, frequency=1.0)), 0.1
        )


def test_one_surface_cannot_vibrate_and_turn() -> None:
    scene = crowd(PartRotation(PART, rpm=1.0), 0.1, 2)
    with pytest.raises(SceneError, match="both"):
        Scene(
            scene.mesh,
            scene.balls,
            scene.physics._replace(part_rotation=PartRotation(1, rpm=1.0)),
            0.1,
        )


def test_a_ball_may_not_start_in_the_part_where_its_phase_has_it() -> None:
    room = box_around(BODIES["bar"], 0.02)
    shot = Balls(np.array([[0.0, 0.008, 0.0]]), np.zeros((1, 3)), 3e-3)
    Scene(room, shot, Physics(part_rotation=PartRotation(PART, rpm=1.0)), 0.1)
    for phase, words in ((np.pi / 2, "outside the mesh"), (1.2, "overlaps a surface")):
        with pytest.raises(SceneError, match=words):
            Scene(room, shot, Physics(part_rotation=PartRotation(PART, rpm=1.0, phase=phase)), 0.1)
