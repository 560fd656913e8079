"""Each exact contact search alone, against checks in extended precision.

A contact is never reported early, never missed, and never from behind, wherever the ball starts and
however it
comes: the aims and shapes are named in cases.py. In the long run a million random and a million
hard cases for each primitive.
"""

import math

import numpy as np
import pytest

from sim_core import TriangleMesh
from sim_core.effects.gravity import STANDARD
from sim_core.geometry.flat_faces import surface_triangles
from sim_core.geometry.obstacles import (
    CAPSULE,
    FACE,
    NUMBERS,
    ObstacleTable,
    build_obstacle_table,
    face_overlap_of,
)
from sim_core.numerics.roots import WaveGap, first_wave_approach
from tests.helpers.contacts import calls
from tests.helpers.contacts import cases as contact_cases
from tests.helpers.contacts.cases import (
    AIMS,
    FAR,
    HARD_AIMS,
    SHAPES,
    falls_for,
    flights_to,
    spread,
    units,
)
from tests.helpers.contacts.reference import (
    ContactErrors,
    check_capsules,
    check_faces,
    check_meetings,
    check_waves,
)

TOLERANCE = 1e-12  # m
LIMIT = 0.02  # s, length of a flight
CHUNK = 10_000  # cases checked together: arrays that fit the cache
QUICK, LONG = 10_000, 1_000_000

SIZES = [pytest.param(QUICK, id="quick"), pytest.param(LONG, id="long", marks=pytest.mark.long)]


def require(errors: ContactErrors, found: np.ndarray, family: str, hits: float = 0.0) -> None:
    """Nothing early, nothing late, nothing receding; and at least a share of ``hits``, or the test
    tests little.
    """
    for said in ContactErrors._fields:
        column = getattr(errors, said)
        bad = np.flatnonzero(~(column <= TOLERANCE))
        assert not len(bad), (
            f"{family}: {len(bad)} of {len(found)} contacts {said}, by up to {column.max():.3g}; "
            "the first is case "
            f"{bad[0]}, reported at {found[bad[0]]!r} s"
        )
    assert np.isfinite(found).mean() >= hits, f"{family}: too few hits to test much"


def families(count: int, hard: bool, aims: tuple[str, ...] = AIMS) -> list[tuple[str, str, int]]:
    """(shape, aim, cases): plump bodies hit at random, or every other pair, ``count`` cases in
    all.
    """
    pairs = [
        (s, a)
        for s in SHAPES
        for a in (aims if hard else aims[:1])
        if hard == ((s, a) != ("plump", "random"))
    ]
    share = math.ceil(count / len(pairs))
    return [(*pair, min(CHUNK, share)) for pair in pairs for _ in range(math.ceil(share / CHUNK))]


def obstacles_around(mesh: TriangleMesh, radius: float) -> ObstacleTable:
    """All obstacles of a mesh that stands still."""
    return build_obstacle_table(surface_triangles(mesh), radius)


def obstacles_of(rng: np.random.Generator, shape: str, count: int):  # type: ignore[no-untyped-def]
    """The obstacles of tetrahedra, and the mesh relative to its centre, as the simulation sees
    it.
    """
    radius, half = SHAPES[shape]
    corners = contact_cases.tetrahedra(rng, shape, count)
    offset = FAR if shape == "far" else np.zeros(3)
    mesh = contact_cases.room_with(corners, contact_cases.TETRAHEDRON, half, offset)
    obstacles = obstacles_around(mesh, radius)
    return obstacles, mesh.corners - mesh.middle, radius


@pytest.mark.parametrize("count", SIZES)
@pytest.mark.parametrize("hard", [False, True], ids=["random", "hard"])
def test_faces(count: int, hard: bool) -> None:
    rng = np.random.default_rng(1)
    for shape, aim, cases in families(count, hard):
        obstacles, corners, radius = obstacles_of(rng, shape, cases // 8 + 1)
        part = np.flatnonzero((obstacles.kinds == FACE) & (obstacles.triangles[:, 0] >= 12))
        rows = rng.choice(part, cases)
        triangle = corners[obstacles.triangles[rows, 0]]
        normal = obstacles.numbers[rows, 0:3]
        where = rng.dirichlet(np.ones(3), cases)
        border = (
            rng.integers(3, size=cases) == 0
        )  # aimed at an edge or a corner, and a little past it or short of it
        where[border, rng.integers(3, size=cases)[border]] = 0.0
        where /= where.sum(axis=1)[:, None]
        past = units(rng, cases) * (spread(rng, 1e-12, 1e-6, cases) * border)[:, None]
        touch = np.einsum("nk,nkd->nd", where, triangle) + radius * normal + past
        flights = flights_to(rng, aim, touch, normal, falls_for(rng, cases), radius)
        found = calls.faces(obstacles.numbers, rows, flights, radius, face_overlap_of(radius))
        found[found > LIMIT] = np.inf
        errors, outside = check_faces(
            triangle, flights, radius, face_overlap_of(radius), LIMIT, found
        )
        require(
            errors, found, f"faces, {shape}, {aim}", hits=0.3 if aim in ("random", "fast") else 0.0
        )
        assert outside.max() <= 3.2 * face_overlap_of(radius), (
            f"{shape}, {aim}: a contact {outside.max():.3g} m beside the face"
        )


@pytest.mark.parametrize("count", SIZES)
@pytest.mark.parametrize("hard", [False, True], ids=["random", "hard"])
@pytest.mark.parametrize("end", [False, True], ids=["side", "end"])
def test_capsules(count: int, hard: bool, end: bool) -> None:
    """About an edge: its side, and its round ends, which are the corners."""
    rng = np.random.default_rng(2)
    for shape, aim, cases in families(count, hard, AIMS[:-1]):
        obstacles, _, radius = obstacles_of(rng, shape, cases // 8 + 1)
        rows = rng.choice(np.flatnonzero(obstacles.kinds == CAPSULE), cases)
        start, along, length = (obstacles.numbers[rows, k] for k in (slice(0, 3), slice(3, 6), 6))
        normal = units(rng, cases)
        lean = np.einsum("nd,nd->n", normal, along)[:, None]
        share = rng.uniform(size=cases)
        if end:
            normal -= np.where(lean > 0.0, 2.0 * lean, 0.0) * along  # off the start
            share[:] = 0.0
        else:
            normal -= lean * along
            normal /= np.linalg.norm(normal, axis=1)[:, None]
        touch = start + (share * length)[:, None] * along + radius * normal
        flights = flights_to(rng, aim, touch, normal, falls_for(rng, cases), radius)
        # a capsule has no other side: a flight that starts deep in it starts inside the body
        at = flights[:, :3] - start
        at -= np.clip(np.einsum("nd,nd->n", at, along), 0.0, length)[:, None] * along
        keep = np.linalg.norm(at, axis=1) > 0.5 * radius
        rows, flights, start, along, length = (
            x[keep] for x in (rows, flights, start, along, length)
        )
        found = calls.capsules(obstacles.numbers, rows, flights, radius, LIMIT)
        ends = np.stack([start, start.astype(np.longdouble) + length[:, None] * along], axis=1)
        errors = check_capsules(ends, flights, radius, LIMIT, found)
        require(
            errors,
            found,
            f"capsules, {shape}, {aim}",
            hits=0.9 if aim in ("random", "fast") else 0.0,
        )


@pytest.mark.parametrize("count", SIZES)
@pytest.mark.parametrize("aim", AIMS[:-1])
def test_meetings_of_two_balls(count: int, aim: str) -> None:
    """In the free-fall frame no gravity is left. The gap of balls that start d apart is known to d²
    1e-16 / reach.
    """
    rng = np.random.default_rng(3)
    cases = count if aim == "random" else math.ceil(count / len(HARD_AIMS[:-1]))
    for _ in range(math.ceil(cases / CHUNK)):
        size = min(CHUNK, cases)
        reach = spread(rng, 2e-4, 1e-2, size)
        normal = units(rng, size)
        flights = flights_to(rng, aim, reach[:, None] * normal, normal, np.zeros((size, 3)), 0.0)
        apart, closing = np.ascontiguousarray(flights[:, :3]), np.ascontiguousarray(flights[:, 3:6])
        found = calls.meetings(apart, closing, reach)
        found[found > LIMIT] = np.inf
        require(check_meetings(apart, closing, reach, LIMIT, found), found, f"meetings, {aim}")


WAVE_AIMS = (
    "random",
    "fast",
    "chatter",
    "crest",
    "tangent",
    "receding slower",
    "at rest",
    "still",
    "behind",
)


def wave_cases(rng: np.random.Generator, aim: str, count: int):  # type: ignore[no-untyped-def]
    """Planes, waves, flights, times and limits for calls.vibrating_planes; radius 1.5 mm.

    random           0.1 to 10 m/s from up to 0.1 m above, any phase
    fast             20 m/s
    chatter          starts in touch, and leaves barely faster than the surface
    crest            meets a crest within 1e-6 to 1e-13 m, almost without speed
    tangent          the same at any phase, moving with the surface
    receding slower  starts in touch or overlapping by up to 1e-9 m, leaving slower than the
                     surface moves
    at rest          starts at rest above, below the crests too
    still            a wave of no amplitude, or one too slow to bend a parabola the other way
    behind           starts below the wave, and where gravity allows comes out in front of it and
                     back
    """
    radius = 1.5e-3
    axis = np.where(rng.integers(2, size=(count, 1)) == 0, [[0.0, 0.0, 1.0]], units(rng, count))
    normal = axis * rng.choice([-1.0, 1.0], (count, 1))
    tilted = rng.integers(3, size=count) == 0
    normal[tilted] += 0.3 * units(rng, int(tilted.sum()))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    swing, omega = spread(rng, 5e-6, 1e-4, count), 2 * np.pi * spread(rng, 1e4, 4e4, count)
    if aim == "still":
        swing *= rng.integers(2, size=count)
        omega = 2 * np.pi * rng.uniform(5.0, 40.0, count)
    phase, times = (
        rng.uniform(0.0, 2 * np.pi, count),
        rng.uniform(0.0, 0.02, count) * rng.integers(2, size=count),
    )
    fall = falls_for(rng, count)
    planes = np.zeros((count, NUMBERS))
    planes[:, 0:3], planes[:, 3] = normal, rng.normal(size=count) * 0.01 + radius

    lift = swing * np.einsum("nd,nd->n", normal, axis)
    delay = spread(rng, 1e-6, 1e-2, count)
    if aim == "crest":
        turn = (np.pi / 2 * np.sign(lift) - phase) / omega
        delay = (
            turn
            + 2 * np.pi / omega * rng.integers(1, 100, count)
            + rng.normal(size=count) * 1e-3 / omega
            - times
        )
        delay += 2 * np.pi / omega * np.ceil(-delay * omega / (2 * np.pi) + 1)
    elif aim in ("chatter", "receding slower", "at rest", "behind"):
        delay = np.zeros(count)
    angle = omega * (times + delay) + phase
    surface, moving = lift * np.sin(angle), lift * omega * np.cos(angle)
    gap, speed = np.zeros(count), -spread(rng, 0.1, 10.0, count)
    if aim == "fast":
        speed[:] = -20.0
    elif aim == "chatter":
        gap = rng.choice([0.0, 1e-15, -1e-15], count)
        speed = moving + spread(rng, 1e-6, 1.0, count)
    elif aim in ("crest", "tangent"):
        gap = spread(rng, 1e-13, 1e-6, count) * rng.integers(-1, 2, count)
        speed = moving + spread(rng, 1e-9, 1e-2, count) * rng.integers(-1, 2, count)
    elif aim == "receding slower":
        gap = -spread(rng, 1e-15, 1e-9, count) * rng.integers(2, size=count)
        speed = moving * rng.uniform(0.0, 1.0, count)
    elif aim == "at rest":
        gap = np.abs(lift) * rng.uniform(0.0, 3.0, count) - surface + np.abs(lift)
        speed[:] = 0.0
    elif aim == "behind":
        gap = -2.0 * np.abs(lift) - radius * rng.uniform(0.6, 3.0, count)
        pull = np.maximum(-np.einsum("nd,nd->n", normal, fall), 0.0)
        speed = np.sqrt(2.0 * pull * (2.0 * np.abs(lift) - gap + spread(rng, 1e-9, 1e-2, count)))
    height = planes[:, 3] + surface + gap
    sideways = np.cross(normal, units(rng, count))
    velocity = speed[:, None] * normal + sideways - delay[:, None] * fall
    start = height[:, None] * normal - delay[:, None] * (velocity + 0.5 * delay[:, None] * fall)
    limits = delay + (30 if aim != "behind" else 3000) * 2 * np.pi / omega
    waves = np.concatenate([np.stack([swing, omega, phase], axis=1), axis], axis=1)
    flights = np.concatenate([start, velocity, fall], axis=1)
    opening = (
        np.einsum("nd,nd->n", normal, start) - planes[:, 3] - lift * np.sin(omega * times + phase)
    )
    keep = (opening > -0.5 * radius) | (aim == "behind")
    return (*(x[keep] for x in (planes, waves, flights, times)), radius, limits[keep])


@pytest.mark.parametrize("count", SIZES)
@pytest.mark.parametrize("aim", WAVE_AIMS)
def test_vibrating_planes(count: int, aim: str) -> None:
    rng = np.random.default_rng(4)
    cases = count if aim == "random" else math.ceil(count / (len(WAVE_AIMS) - 1))
    for _ in range(math.ceil(cases / CHUNK)):
        planes, waves, flights, times, radius, limits = wave_cases(rng, aim, min(CHUNK, cases))
        found = calls.vibrating_planes(planes, waves, flights, times, radius, limits)
        errors = check_waves(planes, waves, flights, times, radius, limits, found)
        require(errors, found, f"waves, {aim}")


def test_a_ball_that_slides_over_an_edge_leaves_it() -> None:
    """It touches an edge along x, 1e-15 m deep, and moves across it just so fast that it takes off:
    v² / r > g.

    The plane at the nearest point falls behind the ball so slowly at first that the search once ran
    out of steps, and reported a contact 1e-10 m above the edge.
    """
    radius = 1.5e-3
    edge = np.zeros((1, NUMBERS))
    edge[0, 0], edge[0, 3], edge[0, 6] = -0.01, 1.0, 0.02
    for excess in (1.0, 1.0 + 1e-9, 1.0 + 1e-6, 1.0 + 1e-3, 1.1):
        speed = math.sqrt(excess * STANDARD * radius)
        flight = np.array([[0.0, 0.0, radius - 1e-15, 0.0, speed, 1e-16, 0.0, 0.0, -STANDARD]])
        found = calls.capsules(edge, np.zeros(1, dtype=np.int64), flight, radius, LIMIT)
        ends = np.array([[[-0.01, 0.0, 0.0], [0.01, 0.0, 0.0]]])
        require(check_capsules(ends, flight, radius, LIMIT, found), found, f"sliding, {excess}")
        assert np.isinf(found[0]) or excess == 1.0


def test_a_face_ends_at_its_needles_tip() -> None:
    """A ball comes down on the plane of a triangle with a corner of 1e-4 rad, in line with it but
    past the corner.

    The seams along its two long borders cross 0.1 mm past it, where once was a contact with
    nothing.
    """
    radius = 1.5e-3
    sharp = np.array(
        [[[0.0, 0.0, 0.0], [-0.01, -0.5e-6, 0.0], [-0.01, 0.5e-6, 0.0], [-0.01, 0.0, -0.01]]]
    )
    mesh = contact_cases.room_with(sharp, contact_cases.TETRAHEDRON, 0.05, np.zeros(3))
    obstacles = obstacles_around(mesh, radius)
    (row,) = np.flatnonzero(
        (obstacles.kinds == FACE)
        & (obstacles.numbers[:, 2] > 0.99)
        & (obstacles.triangles[:, 0] > 11)
    )
    past = np.array([-1e-3, 0.0, 1e-9, 1e-7, 1e-6, 1e-5, 5e-5])
    flights = np.zeros((len(past), 9))
    flights[:, 0], flights[:, 2], flights[:, 5] = past, radius + 1e-3, -1.0
    found = calls.faces(
        obstacles.numbers, np.full(len(past), row), flights, radius, face_overlap_of(radius)
    )
    assert np.isfinite(found).tolist() == [True, True, True, False, False, False, False]


def test_a_ball_in_touch_with_the_rising_sonotrode_is_met_at_once() -> None:
    """Contact 3e-19 s ahead in the concave half of the swing: rounding must not leave Newton 1e-12
    s behind it.
    """
    w = WaveGap(
        -2.1362465026236732e-06,
        1.8668212650412204,
        -4.561448583727416,
        1.4342755040985464e-05,
        240153.2747446059,
        2173.8326174762115,
    )
    assert first_wave_approach(w, 1e-3, 1e-3) <= 1e-18


def test_a_ball_from_behind_meets_the_sonotrode_after_it_has_come_out() -> None:
    """It flies over a wall from a place lower than the sonotrode's plane: 5 mm up, 1 mm above, and
    down again.
    """
    b = math.sqrt(2.0 * STANDARD * 6e-3)
    w = WaveGap(-5e-3, b, -0.5 * STANDARD, 4e-5, 2 * math.pi * 2e4, 0.0)
    down = (b + math.sqrt(b * b - 2.0 * STANDARD * 5e-3)) / STANDARD
    assert first_wave_approach(w, 1.0, 0.75e-3) == pytest.approx(down, abs=1e-3)
    assert first_wave_approach(w, 0.5 * down, 0.75e-3) == math.inf
