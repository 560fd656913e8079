"""Exact planes and cylinders agree with a mesh, and a cylinder wall is never missed."""

from collections.abc import Callable
from decimal import Decimal, getcontext

import numpy as np
import pytest

from sim_core import (
    AnalyticCavity,
    BallCollisions,
    Balls,
    Drag,
    Friction,
    Gravity,
    PartRotation,
    Physics,
    RandomPhase,
    Restitution,
    Scene,
    SceneError,
    Vibration,
    can_rest,
    cylinder_cavity,
    pack_balls,
    prism_cavity,
    simulate,
)
from sim_core.detect.ball_cylinder import cylinder_delay
from sim_core.geometry.analytic import CylinderAxis
from sim_core.geometry.obstacles import NUMBERS
from sim_core.numerics.vec3 import Flight, Vec3
from sim_core.scene.invariants import energy
from tests.helpers.scenes import cavities

DIAMETER = 3e-3
TAGS = (cavities.FLOOR, cavities.CEILING, cavities.SIDES)
SQUARE = np.array([[0.0, 0.0], [0.03, 0.0], [0.03, 0.04], [0.0, 0.04]])
BOX = prism_cavity(SQUARE, 0.0, 0.02, TAGS)
CYLINDER = cylinder_cavity(0.05, 0.0, 0.02, TAGS)
NOTHING = Vec3(0.0, 0.0, 0.0)
STEEL = Restitution(((0.91, 0.5),) * 3, (0.91, 1.5))
SHAKEN = Physics(
    Gravity(), STEEL, Vibration(cavities.FLOOR, 25e-6, 20e3, 0.4), ball_collisions=BallCollisions()
)


def shot(
    room: AnalyticCavity, count: int, seed: int, diameter: float | np.ndarray = DIAMETER
) -> Balls:
    rng = np.random.default_rng(seed)
    positions = pack_balls(room, count, diameter, rng, clear=5e-5)
    return Balls(positions, rng.normal(size=(count, 3)), diameter)


def hexagonal_mesh() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Outline (6, 2), and the vertices and triangles of the prism over it."""
    angle = np.arange(6) * np.pi / 3.0 + 0.2
    outline = 0.025 * np.column_stack([np.cos(angle), np.sin(angle)])
    vertices = np.concatenate([np.column_stack([outline, np.full(6, z)]) for z in (0.0, 0.02)])
    fan = [(0, k, k + 1) for k in range(1, 5)]
    triangles = [(a, c, b) for a, b, c in fan] + [(a + 6, b + 6, c + 6) for a, b, c in fan]
    for k in range(6):
        n = (k + 1) % 6
        triangles += [(k, n, n + 6), (k, n + 6, k + 6)]
    return outline, vertices, np.array(triangles)


@pytest.mark.parametrize("shape", ["box", "hexagon"])
def test_a_prism_is_its_mesh_event_by_event(shape: str) -> None:
    """The same planes to within rounding, which a gas amplifies: equal for the first hundred
    events.
    """
    room, mesh = BOX, cavities.box((0.03, 0.04, 0.02))
    if shape == "hexagon":
        outline, vertices, triangles = hexagonal_mesh()
        room, mesh = prism_cavity(outline, 0.0, 0.02, TAGS), cavities.tagged(vertices, triangles)
    balls = shot(room, 12, 3)
    one, two = (simulate(Scene(cavity, balls, SHAKEN, 0.12)).impacts for cavity in (room, mesh))
    assert len(two) > 200
    first = slice(200 if shape == "box" else 80)
    np.testing.assert_array_equal(one.ball[first], two.ball[first])
    np.testing.assert_array_equal(room.tags[one.triangle[first]], mesh.tags[two.triangle[first]])
    np.testing.assert_allclose(one.time[first], two.time[first], rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(one.position[first], two.position[first], rtol=0.0, atol=1e-8)
    assert abs(room.volume / mesh.volume - 1.0) < 1e-14


@pytest.mark.long
def test_elastic_shot_of_two_sizes_keeps_its_energy_in_a_cylinder() -> None:
    balls = shot(CYLINDER, 30, 5, np.repeat([3e-3, 2e-3], 15))
    physics = Physics(Gravity(), ball_collisions=BallCollisions())
    end = simulate(Scene(CYLINDER, balls, physics, 0.5))
    assert end.collisions.total > 1500
    assert abs(energy(end.balls, Gravity()) / energy(balls, Gravity()) - 1.0) < 1e-12
    gaps = CYLINDER.gaps(end.balls.positions) - 0.5 * balls.diameters[:, None]
    assert gaps.min() > -1e-15
    touched = CYLINDER.gaps(end.impacts.position)[np.arange(len(end.impacts)), end.impacts.triangle]
    np.testing.assert_allclose(
        touched, 0.5 * balls.diameters[end.impacts.ball], rtol=0.0, atol=1e-15
    )


def test_all_effects_together_in_a_cylinder() -> None:
    physics = SHAKEN._replace(
        random_phase=RandomPhase(7), drag=Drag(), friction=Friction(((0.3, 0.2),) * 3, (0.1, 0.2))
    )
    scene = Scene(CYLINDER, shot(CYLINDER, 30, 6), physics, 0.5)
    one, two = simulate(scene), simulate(scene)
    np.testing.assert_array_equal(one.balls.positions, two.balls.positions)
    assert CYLINDER.contains(one.balls.positions, 25e-6).all()
    assert set(one.impacts.triangle.tolist()) == {0, 1, 2}
    assert np.abs(one.balls.spins).max() > 1.0
    sideways = one.impacts.velocity[one.impacts.triangle == 2]
    outward = one.impacts.position[one.impacts.triangle == 2, :2]
    closing = np.einsum("ij,ij->i", sideways[:, :2], outward) / np.linalg.norm(outward, axis=1)
    np.testing.assert_allclose(
        closing, one.impacts.normal_speed[one.impacts.triangle == 2], rtol=1e-9
    )


def flights(family: str, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Places and velocities (count, 2) within the reach of 1, a family of them hard in one way."""
    rng = np.random.default_rng(len(family))
    angle, way = rng.uniform(0.0, 2.0 * np.pi, (2, count))
    distance, speed = np.sqrt(rng.uniform(size=count)), rng.uniform(0.1, 8.0, count)
    if family in ("touching", "grazing"):
        distance = 1.0 + rng.integers(-4, 5, count) * 2.0**-53
    if family == "grazing":
        way = (
            angle
            + 0.5 * np.pi
            + rng.choice([-1.0, 1.0], count) * 10.0 ** rng.uniform(-17.0, -3.0, count)
        )
    if family == "slow":
        speed = 10.0 ** rng.uniform(-12.0, -6.0, count)
    return (
        np.column_stack([distance * np.cos(angle), distance * np.sin(angle)]),
        np.column_stack([speed * np.cos(way), speed * np.sin(way)]),
    )


@pytest.mark.parametrize("family", ["random", "touching", "grazing", "slow"])
def test_the_round_side_is_never_missed(family: str) -> None:
    """In 60 digits: at the time given the ball is on the side, not on its way in, and it never was
    beyond before.

    Beyond the side a path goes out for ever, so that who is on it to within rounding, and not on
    the way in, has not passed it. Overlaps by rounding count as touching.
    """
    getcontext().prec = 60
    numbers = np.zeros((1, NUMBERS))
    numbers[0, 3] = 1.0
    for place, velocity in zip(*flights(family, 3000), strict=True):
        ball = Flight(Vec3(*place.tolist(), 0.3), Vec3(*velocity.tolist(), 1.0), NOTHING)
        delay = cylinder_delay(CylinderAxis(0.0, 0.0), numbers, 0, ball)
        assert 0.0 <= delay < np.inf
        x, y = (
            Decimal(p) + Decimal(v) * Decimal(delay)
            for p, v in zip(place.tolist(), velocity.tolist(), strict=True)
        )
        u, v = (Decimal(k) for k in velocity.tolist())
        assert abs((x * x + y * y).sqrt() - 1) < Decimal("1e-15"), (place, velocity)
        assert x * u + y * v > Decimal("-4e-16") * (u * u + v * v).sqrt(), (place, velocity)


def test_a_start_in_overlap_of_rounding_going_in_is_no_contact() -> None:
    numbers = np.zeros((1, NUMBERS))
    numbers[0, 3] = 1.0
    ball = Flight(Vec3(1.0 + 2.0**-52, 0.0, 0.0), Vec3(-2.0, 0.0, 0.0), NOTHING)
    assert cylinder_delay(CylinderAxis(0.0, 0.0), numbers, 0, ball) == pytest.approx(1.0, abs=1e-15)
    still = Flight(Vec3(0.5, 0.0, 0.0), Vec3(0.0, 0.0, 3.0), NOTHING)
    assert cylinder_delay(CylinderAxis(0.0, 0.0), numbers, 0, still) == np.inf


@pytest.mark.parametrize(
    ("room", "changes", "said"),
    [
        (
            BOX,
            {"part_rotation": PartRotation(0, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 10.0)},
            "part_rotation is not supported",
        ),
        (
            CYLINDER,
            {"gravity": Gravity(1.0, 0.0, -9.8)},
            "not supported with an analytical cylinder unless along z",
        ),
        (BOX, {"vibration": SHAKEN.vibration._replace(axis=(0.0, 1.0, 0.0))}, "vibration.axis"),
        (
            BOX,
            {"vibration": SHAKEN.vibration._replace(tag=cavities.SIDES)},
            "that of side 2, side 3, side 4, side 5",
        ),
    ],
)
def test_what_is_not_supported_says_so(room: AnalyticCavity, changes: dict, said: str) -> None:
    balls = Balls(room.middle[None], np.zeros((1, 3)), DIAMETER)
    with pytest.raises(SceneError, match=said):
        Scene(room, balls, SHAKEN._replace(**changes), 1.0)


@pytest.mark.parametrize(
    ("room", "place", "diameter", "said"),
    [
        (
            CYLINDER,
            (0.03, 0.0, 0.01),
            3e-3,
            "ball 0 at .* is outside the cavity, beyond the cylinder wall",
        ),
        (CYLINDER, (0.0, 0.024, 0.01), 3e-3, "overlaps the cylinder wall by 0.0005 m"),
        (BOX, (0.001, 0.02, 0.01), 3e-3, "overlaps side 5 by 0.0005 m"),
        (
            BOX,
            (0.015, 0.02, 0.0015),
            3e-3,
            r"overlaps the floor \(displaced by its phase at the start\)",
        ),
        (BOX, (0.015, 0.02, 0.0100049), 0.01999, "does not fit between the floor and the ceiling"),
    ],
)
def test_a_ball_without_room_is_named(
    room: AnalyticCavity, place: tuple, diameter: float, said: str
) -> None:
    with pytest.raises(SceneError, match=said):
        Scene(room, Balls(np.array([place]), np.zeros((1, 3)), diameter), SHAKEN, 1.0)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: prism_cavity(SQUARE[::-1], 0.0, 0.02, TAGS), "does not turn left"),
        (
            lambda: prism_cavity(np.array([[0, 0], [1, 0], [2, 0], [1, 1]]), 0.0, 0.02, TAGS),
            "corner 1",
        ),
        (lambda: prism_cavity(SQUARE[[0, 2]], 0.0, 0.02, TAGS), "shape"),
        (lambda: prism_cavity(SQUARE, 0.02, 0.0, TAGS), "top must be above bottom"),
        (lambda: prism_cavity(SQUARE, 0.0, 0.02, (0, 1, 2, 3)), "tags"),
        (lambda: cylinder_cavity(0.0, 0.0, 0.02, TAGS), "diameter"),
        (lambda: cylinder_cavity(0.05, 0.0, 0.02, TAGS, (np.nan, 0.0)), "centre"),
        (lambda: cylinder_cavity(0.05, 0.0, 0.02, (0, 1, 300)), "tags"),
    ],
)
def test_numbers_that_make_no_cavity_are_refused(
    make: Callable[[], AnalyticCavity], said: str
) -> None:
    with pytest.raises(SceneError, match=said):
        make()


def test_a_star_is_no_prism() -> None:
    angle = np.arange(5) * 4.0 * np.pi / 5.0
    with pytest.raises(SceneError, match="winds round more than once"):
        prism_cavity(np.column_stack([np.cos(angle), np.sin(angle)]), 0.0, 1.0, TAGS)


def test_balls_can_rest_on_a_still_floor_alone() -> None:
    assert can_rest(CYLINDER, Gravity())
    assert not can_rest(CYLINDER, Gravity(), cavities.FLOOR)
    assert not can_rest(CYLINDER, None)


def test_too_much_shot_is_refused() -> None:
    with pytest.raises(SceneError, match=r"balls of 3 mm find a free place in 39\.3 cm³"):
        pack_balls(CYLINDER, 2000, DIAMETER, np.random.default_rng(1))
