"""Sizes, positions, speeds, accelerations, amplitudes and losses at the ends of their ranges."""

import math
from functools import partial

import numpy as np
import trimesh

from sim_core import (
    Balls,
    Gravity,
    Physics,
    Restitution,
    Scene,
    TriangleMesh,
    Vibration,
    pack_balls,
    simulate,
)
from sim_core.scene.invariants import energy
from tests.hard_cases.cases.drops import EXACT, RADIUS, G, one_ball
from tests.hard_cases.outcome import (
    DRIFT,
    LOSSLESS,
    ROUNDING,
    Case,
    Claim,
    Outcome,
    named,
    near,
    outcome_of,
    play,
    with_rest,
)
from tests.helpers.scenes.cavities import (
    FLOOR,
    WEIGHTLESS,
    box,
    box_around,
    cylinder,
    uniform_restitution,
)
from tests.helpers.scenes.fuzzed_chambers import Chamber

SIDE = 0.03  # m
DROP = 0.01  # m
ROOM = box((SIDE, SIDE, SIDE))


def _to_and_fro(
    side: float, radius: float, speed: float, duration: float, off: float = 0.0
) -> Outcome:
    """Between floor and ceiling of a cube with side [m]: hits at (first way + k (side - 2 r))/v,
    none is lost.

    ``off`` [m]: how far from the origin the cube is, along every axis.
    """
    room = box((side,) * 3, centre=(off,) * 3)
    low, high = (
        float(f(room.vertices[:, 2])) for f in (np.min, np.max)
    )  # where rounding has put them
    ball = Balls(np.full((1, 3), off), np.array([[0.0, 0.0, speed]]), 2.0 * radius)
    seen = play(Chamber(room, ball, Physics()), duration)
    way = high - low - 2.0 * radius
    first = high - radius - off
    times = (first + way * np.arange(0.0, (speed * duration - first) / way)) / speed
    # a flight is followed in windows of 20 ms, each of which rounds the place anew
    windows = duration / 0.02
    rounding = ROUNDING * (side + abs(off)) * (len(times) + windows) / speed
    return outcome_of(
        seen,
        f"{len(times)} hits at the times of a uniform motion",
        near("times [s]", seen.time, times, rounding + EXACT * duration),
        near("speed [m/s]", np.abs(seen.end.velocities[0]), [0.0, 0.0, speed], 0.0),
    )


def gas_of_small_balls() -> Outcome:
    """Balls a millionth of their room, all in a corner of it."""
    rng = np.random.default_rng(11)
    grid = np.stack(np.meshgrid(*[np.arange(4.0)] * 3), axis=-1).reshape(-1, 3)
    balls = Balls(1e-6 * (1.0 + 3.0 * grid), rng.normal(0.0, 1.0, (64, 3)), 1e-6)
    seen = play(Chamber(box((1.0, 1.0, 1.0)), balls, Physics()), 5.0, 5, record=())
    return outcome_of(
        seen,
        "fly out of their corner and keep their energy",
        Claim(seen.collisions > 500, "few hits"),
    )


def large_ball_on_a_small_body() -> Outcome:
    """A ball of a metre falls beside a tetrahedron of a micrometre: mirrored at the line to its
    tip.
    """
    tiny, radius = 1e-6, 0.5
    corners = np.array([[0.0, 0.0, 0.0], [1, 0, -1], [-0.5, 0.8, -1], [-0.5, -0.8, -1]]) * tiny
    body = trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]], process=False)
    room = box_around(body, 2.0)
    off, speed = 0.3 * radius, 1.0
    height = math.sqrt(radius**2 - off**2)
    ball = Balls(np.array([[off, 0.0, height + 0.1]]), np.array([[0.0, 0.0, -speed]]), 2.0 * radius)
    seen = play(Chamber(room, ball, Physics()), 0.2)
    normal = np.array([off, 0.0, height]) / radius
    after = np.array([0.0, 0.0, -speed]) + 2.0 * speed * normal[2] * normal
    return outcome_of(
        seen,
        "is mirrored at the line to the tip",
        near("time [s]", seen.time, [0.1], EXACT),
        near("velocity [m/s]", seen.end.velocities[0], after, EXACT),
    )


def triangles_of_two_sizes() -> Outcome:
    """A wall with a square micrometre set into it, in its plane: bounces on and beside it, as on
    any wall.
    """
    tiny, half = 1e-6, 0.5 * SIDE
    square = [(half - tiny, half - tiny), (half, half - tiny), (half, half), (half - tiny, half)]
    floor = [(0.0, 0.0), (SIDE, 0.0), (SIDE, SIDE), (0.0, SIDE), *square]
    vertices = np.array([(x, y, 0.0) for x, y in floor] + [(x, y, SIDE) for x, y in floor[:4]])
    frame = [
        t
        for k in range(4)
        for t in ((k, 4 + k, (k + 1) % 4), ((k + 1) % 4, 4 + k, 4 + (k + 1) % 4))
    ]
    sides = [
        t
        for k in range(4)
        for t in ((k, (k + 1) % 4, 8 + (k + 1) % 4), (k, 8 + (k + 1) % 4, 8 + k))
    ]
    triangles = [*frame, (4, 6, 5), (4, 7, 6), (8, 9, 10), (8, 10, 11), *sides]
    room = TriangleMesh(vertices, triangles, np.zeros(len(triangles), dtype=int))
    way = SIDE - 2.0 * RADIUS
    ball = one_ball((half, half, RADIUS + 0.5 * way), (1e-7, 0.0, -1.0))
    seen = play(Chamber(room, ball, Physics()), 0.5)
    times = np.arange(0.5 * way, 0.5, way)
    return outcome_of(
        seen,
        "a square micrometre in a wall is not felt",
        near("times [s]", seen.time, times, EXACT),
        near("velocity [m/s]", np.abs(seen.end.velocities[0]), [1e-7, 0.0, 1.0], 0.0),
    )


def no_gravity() -> Outcome:
    """g = 0 given as a number is no gravity: the same bits."""
    start = Balls(np.array([[0.011, 0.012, 0.013]]), np.array([[1.0, 2.0, 3.0]]), 2.0 * RADIUS)
    seen = play(Chamber(ROOM, start, Physics(Gravity(0.0, 0.0, 0.0))), 2.0)
    without = play(Chamber(ROOM, start, Physics()), 2.0)
    return outcome_of(
        seen,
        "flies straight",
        near("places [m]", seen.end.positions, without.end.positions, 0.0),
        near("times [s]", seen.time, without.time, 0.0),
    )


def hundredfold_gravity() -> Outcome:
    """Dropped under 100 g: bounces a tenth as long apart as under g."""
    fall = math.sqrt(2.0 * DROP / (100.0 * G))
    start = one_ball((0.011, 0.013, RADIUS + DROP), (0.0, 0.0, 0.0))
    seen = play(Chamber(ROOM, start, Physics(Gravity(z=-100.0 * G))), 0.5)
    times = fall * np.arange(1.0, 0.5 / fall, 2.0)
    return outcome_of(
        seen,
        "bounces for ever to the height it fell from",
        near("times [s]", seen.time, times, EXACT),
        near("speeds [m/s]", seen.normal_speed, np.full(len(times), 100.0 * G * fall), 1e-11),
    )


def sonotrode_without_swing() -> Outcome:
    """Amplitude 0: a floor like any other."""
    fall = math.sqrt(2.0 * DROP / G)
    start = one_ball((0.011, 0.013, RADIUS + DROP), (0.0, 0.0, 0.0))
    physics = Physics(Gravity(), LOSSLESS, Vibration(FLOOR, 0.0, 20e3))
    seen = play(Chamber(ROOM, start, physics), 0.5)
    return outcome_of(
        seen,
        "bounces as on a floor that stands still",
        near("times [s]", seen.time, fall * np.arange(1.0, 0.5 / fall, 2.0), EXACT),
    )


def sonotrode_swinging_a_millimetre() -> Outcome:
    """1 mm at 20 kHz: the face moves at up to 126 m/s. Each hit mirrors the velocity in the face's
    frame, at the place where the face is then; between hits nothing happens but the ceiling.
    """
    swing, omega, phase = 1e-3, math.tau * 20e3, 0.4
    start = one_ball((0.015, 0.015, 0.02), (0.0, 0.0, -3.0))
    physics = Physics(WEIGHTLESS, LOSSLESS, Vibration(FLOOR, swing, 20e3, phase))
    seen = play(Chamber(ROOM, start, physics), 0.01)
    place, speed, now = 0.02, -3.0, 0.0
    off, least = 0.0, math.inf
    for time, z, triangle, said in zip(
        seen.time, seen.position[:, 2], seen.triangle, seen.normal_speed, strict=True
    ):
        place, now = place + speed * (time - now), time
        off = max(off, abs(place - z))
        moving = seen.mesh.tags[triangle] == FLOOR
        surface = swing * omega * math.cos(omega * time + phase) if moving else 0.0
        face = swing * math.sin(omega * time + phase) + RADIUS if moving else SIDE - RADIUS
        off = max(off, abs(place - face))
        least = min(least, said)
        speed, place = 2.0 * surface - speed, float(z)
    return outcome_of(
        seen,
        f"is mirrored {len(seen.time)} times, where the face is and at its speed",
        near("places [m]", off, 0.0, 1e-12),
        near("velocity in the end [m/s]", seen.end.velocities[0, 2], speed, 1e-6),
        Claim(
            least > 0.0 and len(seen.time) > 10,
            f"{len(seen.time)} hits, the slowest at {least} m/s",
        ),
    )


def shot_on_a_sonotrode_swinging_a_millimetre() -> Outcome:
    """Thirty balls, e = 0.9, between walls: nothing leaves, nothing overlaps."""
    rng = np.random.default_rng(12)
    room = cylinder(0.02, 0.03)
    balls = Balls(
        pack_balls(room, 30, 2.0 * RADIUS, rng, clear=1e-3),
        rng.normal(0.0, 5.0, (30, 3)),
        2.0 * RADIUS,
    )
    law = (0.9, 1.0)
    physics = Physics(Gravity(), Restitution((law,) * 3, law), Vibration(FLOOR, 1e-3, 20e3))
    seen = play(Chamber(room, balls, physics), 0.05, 10)
    return outcome_of(
        seen, "stays in the chamber", Claim(seen.collisions > 2_000, f"only {seen.collisions} hits")
    )


def _plastic(e: float) -> Physics:
    return Physics(WEIGHTLESS, uniform_restitution(e, 1e3, 0.0))


def perfectly_plastic_walls() -> Outcome:
    """e = 0, no gravity: each wall takes the velocity across it and leaves the rest; after three
    walls all is gone.
    """
    start = one_ball((0.01, 0.01, 0.01), (0.3, 0.2, -0.1))
    seen = play(Chamber(ROOM, start, _plastic(0.0)), 1.0)
    way = SIDE - RADIUS - 0.01
    times = [way / 0.3, (0.01 - RADIUS) / 0.1, way / 0.2]
    corner = [SIDE - RADIUS, SIDE - RADIUS, RADIUS]
    return outcome_of(
        seen,
        "is in the corner after three hits, for good",
        near("times [s]", seen.time, sorted(times), EXACT),
        near("place [m]", seen.end.positions[0], corner, 1e-15),
        near("velocity [m/s]", seen.end.velocities[0], np.zeros(3), 0.0),
    )


def perfectly_plastic_pair() -> Outcome:
    """e = 0: after the hit both have their common velocity, for good."""
    balls = Balls(
        np.array([[0.01, 0.015, 0.015], [0.015, 0.015, 0.015]]),
        np.array([[0.2, 0, 0], [0, 0, 0.0]]),
        3e-3,
    )
    seen = play(Chamber(ROOM, balls, _plastic(0.0)), 0.05)
    return outcome_of(
        seen,
        "go on together",
        near("velocities [m/s]", seen.end.velocities, [[0.1, 0, 0], [0.1, 0, 0]], 1e-16),
        near("hits", seen.pairs, 1, 0),
    )


def almost_plastic_wall() -> Outcome:
    """e = 1e-9: comes away from the wall at a billionth of its speed."""
    start = one_ball((0.01, 0.015, 0.015), (1.0, 0.0, 0.0))
    seen = play(Chamber(ROOM, start, _plastic(1e-9)), 10.0)
    way = SIDE - RADIUS - 0.01
    return outcome_of(
        seen,
        "creeps away from the wall",
        near("hits", len(seen.time), 1, 0),
        near(
            "velocity [m/s]", seen.end.velocities[0, 0], -1e-9, 2e-16
        ),  # what is left of 1 m/s less 1 m/s
        near("place [m]", seen.end.positions[0, 0], SIDE - RADIUS - 1e-9 * (10.0 - way), 1e-14),
    )


def restitution_of_one() -> Outcome:
    """e = 1 given as a number is no loss."""
    rng = np.random.default_rng(13)
    balls = Balls(pack_balls(ROOM, 30, 3e-3, rng), rng.normal(0.0, 3.0, (30, 3)), 3e-3)
    physics = Physics(Gravity(), uniform_restitution(1.0, 1e3))
    seen = play(Chamber(ROOM, balls, physics), 1.0, 4, record=())
    drift = abs(energy(seen.end, Gravity()) / energy(balls, Gravity()) - 1.0)
    return outcome_of(seen, "keeps its energy", near("energy", drift, 0.0, DRIFT))


def plastic_ball_under_gravity(e: float) -> Outcome:
    """It drops, may bounce a few times, and lies: at r over the floor, at rest, without further
    events.
    """
    start = one_ball((0.011, 0.013, RADIUS + DROP), (0.0, 0.0, 0.0))
    physics = Physics(Gravity(), uniform_restitution(e, 1e3))
    seen = play(Chamber(ROOM, start, with_rest(physics)), 5.0, 5)
    bounces = 2 if e < 1e-6 else 2 + math.ceil(math.log(1e-3) / math.log(e))
    return outcome_of(
        seen,
        "lies still on the floor",
        near("place [m]", seen.end.positions[0], [0.011, 0.013, RADIUS], 1e-5),
        near("velocity [m/s]", seen.end.velocities[0], np.zeros(3), 1e-2),
        Claim(seen.events < 10 * bounces, f"{seen.events} events"),
    )


def hundred_million_collisions() -> Outcome:
    """An elastic gas under gravity between slanted walls, in one run without restart."""
    rng = np.random.default_rng(14)
    room = cylinder(0.02, 0.02, sections=37)
    balls = Balls(pack_balls(room, 60, 3e-3, rng), rng.normal(0.0, 3.0, (60, 3)), 3e-3)
    physics = Physics(Gravity())
    trial = simulate(Scene(room, balls, physics, 1.0, record=())).collisions.total
    seen = play(Chamber(room, balls, physics), 1.01e8 / trial, record=())
    # the promise is 1e-11 over 10^7 collisions; rounding, 1e-16 a collision, has a bias of 1/300:
    # 3.3e-11 was measured
    return outcome_of(
        seen,
        "keeps its energy and its balls",
        Claim(seen.collisions >= 1e8, f"only {seen.collisions} collisions"),
        drift=1e-10,
    )


CASES = [
    Case("1e6 : 1 room to ball", partial(_to_and_fro, 1.0, 0.5e-6, 1.0, 20.0)),
    Case("1e6 : 1 room to balls, a gas", gas_of_small_balls),
    Case("1e6 : 1 ball to body", large_ball_on_a_small_body),
    Case("1e6 : 1 among triangles", triangles_of_two_sizes),
    Case("1 km from the origin", partial(_to_and_fro, SIDE, RADIUS, 1.0, 2.0, 1e3)),
    Case("1e-9 m/s", partial(_to_and_fro, 2.0 * RADIUS + 1e-6, RADIUS, 1e-9, 5e3)),
    Case("1e2 m/s", partial(_to_and_fro, SIDE, RADIUS, 1e2, 2.0)),
    named(no_gravity),
    Case("100 g", hundredfold_gravity),
    named(sonotrode_without_swing),
    named(sonotrode_swinging_a_millimetre),
    named(shot_on_a_sonotrode_swinging_a_millimetre),
    named(perfectly_plastic_walls),
    named(perfectly_plastic_pair),
    named(almost_plastic_wall),
    named(restitution_of_one),
    *(
        Case(f"e = {e:g} under gravity", partial(plastic_ball_under_gravity, e), needs_rest=True)
        for e in (0.0, 1e-9, 0.5)
    ),
    named(hundred_million_collisions, long=True),
]
