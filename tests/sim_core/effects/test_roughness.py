"""Balls that hit rough faces: the drawn normals, their energy, and gases between rough walls."""

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import kstest, norm

from sim_core import (
    Balls,
    Friction,
    Gravity,
    ImpactLog,
    Physics,
    Restitution,
    Roughness,
    Scene,
    SceneError,
    SimulationResult,
    Vibration,
    pack_balls,
    simulate,
)
from tests.helpers.scenes.cavities import CEILING, FLOOR, SIDES, box
from tests.sim_core.loop.test_determinism import fingerprint

UNLIKELY = 1e-4
COUNT, DIAMETER, SPEED = 4000, 1e-3, 5.0
ROOM = box((1.0, 1.0, 0.02))
ELASTIC = Restitution(((1.0, 1.0, 0.0),) * 3, (1.0, 1.0, 0.0))

LAW = (0.9, 1.0, 0.25)
ALL = Physics(
    gravity=Gravity(),
    restitution=Restitution((LAW,) * 3, LAW),
    vibration=Vibration(FLOOR, 25e-6, 20e3),
    friction=Friction(((0.2, 0.2),) * 3, (0.2, 0.2)),
)


def thrown(angle: float, slope: float, e: float = 1.0) -> SimulationResult:
    """Balls that are thrown at a rough floor once, at an angle to its normal, along -x.

    The balls begin 0.1 mm above the floor, do not meet, and hit nothing else.
    """
    rng = np.random.default_rng(3)
    places = np.column_stack(
        [rng.uniform(0.2, 0.8, (COUNT, 2)), np.full(COUNT, 0.5 * DIAMETER + 1e-4)]
    )
    velocity = SPEED * np.array([-math.sin(angle), 0.0, -math.cos(angle)])
    balls = Balls(places, np.tile(velocity, (COUNT, 1)), DIAMETER)
    law = (e, 1.0, 0.0)
    physics = Physics(
        roughness=Roughness((slope,) * 3, 11),
        restitution=Restitution((law,) * 3, law),
        ball_collisions=None,
    )
    return simulate(Scene(ROOM, balls, physics, 1.2e-4 / (SPEED * math.cos(angle))))


def drawn_slopes(result: SimulationResult, before: np.ndarray) -> np.ndarray:
    """Slopes along x and y of the facets that turned elastic balls round, shape (n, 2)."""
    change = result.balls.velocities - before
    assert (np.linalg.norm(change, axis=1) > 0.0).all()
    return np.asarray(change[:, :2] / change[:, 2:])


def test_slopes_seen_from_above_are_normal() -> None:
    result = thrown(0.0, 0.08)
    slopes = drawn_slopes(result, np.array([0.0, 0.0, -SPEED]))
    for k in range(2):
        assert kstest(slopes[:, k] / 0.08, "norm").pvalue > UNLIKELY
    assert abs(np.corrcoef(slopes.T)[0, 1]) < 4.0 / math.sqrt(COUNT)


@pytest.mark.parametrize(("degrees", "slope"), [(45.0, 0.1), (70.0, 0.05), (80.0, 0.02)])
def test_facets_that_face_a_ball_are_hit_more_often(degrees: float, slope: float) -> None:
    """The density of u = s / sigma is that of Sommerfeld and Huber, exp(-u²/2) max(0, 1 + a u)."""
    angle = math.radians(degrees)
    result = thrown(angle, slope)
    before = SPEED * np.array([-math.sin(angle), 0.0, -math.cos(angle)])
    a = slope * math.tan(angle)
    whole = quad(lambda u: norm.pdf(u) * max(0.0, 1.0 + a * u), -8.0, 8.0)[0]

    def share_below(u: np.ndarray) -> np.ndarray:
        # the closed form of the integral; nothing is visible below -1 / a
        low = -1.0 / a
        inner = np.maximum(u, low)
        return np.asarray(
            (norm.cdf(inner) - norm.cdf(low) - a * (norm.pdf(inner) - norm.pdf(low))) / whole
        )

    slopes = drawn_slopes(result, before) / slope
    assert result.collisions.total == COUNT
    assert kstest(slopes[:, 0], share_below).pvalue > UNLIKELY
    assert kstest(slopes[:, 1], "norm").pvalue > UNLIKELY


@pytest.mark.parametrize("degrees", [0.0, 60.0, 85.0, 89.9])
@pytest.mark.parametrize("slope", [0.05, 0.3, 0.5])
def test_no_ball_is_thrown_into_the_wall_and_none_gains_energy(
    degrees: float, slope: float
) -> None:
    for e in (1.0, 0.5):
        result = thrown(math.radians(degrees), slope, e)
        velocity = result.balls.velocities
        assert (velocity[:, 2] > 0.0).all()
        energy = (velocity**2).sum(axis=1) / SPEED**2
        assert (energy <= 1.0 + 1e-12).all()
        if e == 1.0:
            np.testing.assert_allclose(energy, 1.0, rtol=1e-12)


def gas(slope: float, seconds: float) -> SimulationResult:
    """Balls of one speed in a rough cube that lose nothing."""
    rng, cube = np.random.default_rng(5), box((0.05, 0.05, 0.05))
    places = pack_balls(cube, 300, np.full(300, 3e-3), rng)
    velocity = rng.normal(size=(300, 3))
    velocity *= SPEED / np.linalg.norm(velocity, axis=1)[:, None]
    roughness = Roughness((slope,) * 3, 2)
    physics = Physics(restitution=ELASTIC, roughness=roughness, ball_collisions=None)
    return simulate(Scene(cube, Balls(places, velocity, 3e-3), physics, seconds, 0.2))


@pytest.mark.parametrize(("slope", "error"), [(0.05, 0.01), (0.1, 0.01), (0.3, 0.02)])
def test_a_gas_between_rough_walls_stays_isotropic(slope: float, error: float) -> None:
    """The flux of an isotropic gas has uniform cos². Its mean is 1/2, and that of cos is 2/3."""
    log = gas(slope, 2.0).impacts
    cube = box((0.05, 0.05, 0.05))
    normal = np.cross(
        cube.corners[:, 1] - cube.corners[:, 0], cube.corners[:, 2] - cube.corners[:, 0]
    )
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    cosine = np.einsum("ij,ij->i", log.velocity, normal[log.triangle]) / SPEED
    assert abs(cosine.mean() / (2.0 / 3.0) - 1.0) < error
    assert abs((cosine**2).mean() / 0.5 - 1.0) < error


def hopping_share(slope: float) -> float:
    """Share of the hits on a flat lid at which a ball moves straight up, of a few balls with
    friction between lid and sonotrode.
    """
    room = box((0.04, 0.04, 0.015))
    balls = 15
    rng = np.random.default_rng(1)
    places = pack_balls(room, balls, np.full(balls, 3e-3), rng, clear=40e-6)
    physics = ALL._replace(roughness=Roughness((slope,) * 3, 7))
    start = Balls(places, rng.normal(0.0, 2.0, (balls, 3)), 3e-3)
    log = simulate(Scene(room, start, physics, 5.0, 5.0, record=(CEILING,))).impacts
    sideways = np.linalg.norm(log.velocity[:, :2], axis=1) / np.abs(log.velocity[:, 2])
    return float((sideways < 1e-3).mean())


def test_rough_faces_keep_balls_from_hopping_on_one_spot() -> None:
    """Friction of smooth faces takes all motion along them for good."""
    assert hopping_share(0.0) > 0.9
    assert hopping_share(math.tan(math.radians(3.0))) < 0.01


def test_a_slope_of_zero_changes_no_bit() -> None:
    def hits(slope: float | None) -> ImpactLog:
        rng, cube = np.random.default_rng(5), box((0.05, 0.05, 0.05))
        places = pack_balls(cube, 50, np.full(50, 3e-3), rng)
        roughness = None if slope is None else Roughness((slope,) * 3)
        balls = Balls(places, rng.normal(0.0, 2.0, (50, 3)), 3e-3)
        return simulate(Scene(cube, balls, ALL._replace(roughness=roughness), 0.1)).impacts

    np.testing.assert_array_equal(hits(0.0).position, hits(None).position)


def test_the_same_seed_gives_the_same_bits_on_any_thread() -> None:
    alone = fingerprint(gas(0.1, 0.1))
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda _: fingerprint(gas(0.1, 0.1)), range(4)))
    assert all(one == alone for one in together)


@pytest.mark.parametrize(
    ("roughness", "told"),
    [
        (Roughness((0.1, 0.1)), "roughness.surfaces"),
        (Roughness((0.1, -0.1, 0.1)), r"roughness.surfaces\[1\]"),
        (Roughness((0.1, 0.1, 0.6)), r"roughness.surfaces\[2\]"),
        (Roughness((0.1, math.nan, 0.1)), r"roughness.surfaces\[1\]"),
        (Roughness((0.1, "smooth", 0.1)), r"roughness.surfaces\[1\]"),  # type: ignore[arg-type]
        (Roughness((0.1,) * 3, -1), "roughness.seed"),
        (Roughness((0.1,) * 3, 2**32), "roughness.seed"),
        ((0.1,) * 3, "physics.roughness"),
    ],
)
def test_bad_roughness_is_refused_by_name(roughness: object, told: str) -> None:
    balls = Balls(np.array([[0.5, 0.5, 0.01]]), np.zeros((1, 3)), DIAMETER)
    with pytest.raises(SceneError, match=told):
        Scene(ROOM, balls, Physics(roughness=roughness), 1.0)  # type: ignore[arg-type]


def test_surfaces_are_rough_one_by_one() -> None:
    """Balls between a smooth floor and a rough ceiling keep their sideways speed at the floor."""
    places = np.column_stack([np.linspace(0.2, 0.8, 100), np.full(100, 0.5), np.full(100, 0.01)])
    balls = Balls(places, np.tile([1.0, 0.0, -SPEED], (100, 1)), DIAMETER)
    slopes = [0.0, 0.0, 0.0]
    slopes[CEILING], slopes[SIDES] = 0.1, 0.1
    roughness = Roughness(tuple(slopes))
    physics = Physics(restitution=ELASTIC, roughness=roughness, ball_collisions=None)
    result = simulate(Scene(ROOM, balls, physics, 0.003))
    np.testing.assert_array_equal(result.balls.velocities[:, 0], 1.0)
    result = simulate(Scene(ROOM, balls, physics, 0.007))
    assert (result.balls.velocities[:, 0] != 1.0).all()
