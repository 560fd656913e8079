"""A shaking floor that each ball meets at a random phase: the draws, and their effect."""

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from scipy.stats import kstest

from sim_core import (
    Balls,
    Gravity,
    ImpactLog,
    Physics,
    RandomPhase,
    Rest,
    Restitution,
    Scene,
    SceneError,
    Vibration,
    simulate,
)
from sim_core.effects.random_phase import draw_phase
from tests.helpers.scenes.cavities import CEILING, FLOOR, WEIGHTLESS, box
from tests.helpers.scenes.gas import jackknife
from tests.sim_core.loop.test_determinism import fingerprint
from tests.sim_core.physics.test_shaken_ball import DIAMETER, LAWS, SHAKING, G, balls_side_by_side

UNLIKELY = 1e-4
RADIUS = 0.5 * DIAMETER
ONE_BALL = box((0.01, 0.01, 0.02))


def flights(count: int) -> tuple[ImpactLog, np.ndarray]:
    """Impacts of one ball that flies straight up and down, losing nothing, and which are on the
    floor.
    """
    ball = Balls(np.array([[0.005, 0.005, 0.01]]), np.array([[0.0, 0.0, -20.0]]), DIAMETER)
    elastic = Restitution(((1.0, 1.0, 0.0),) * 3, (1.0, 1.0, 0.0))
    shaking = Vibration(FLOOR, 25e-6, 20e3)
    physics = Physics(WEIGHTLESS, elastic, shaking, random_phase=RandomPhase(1))
    log = simulate(Scene(ONE_BALL, ball, physics, count * 1e-3)).impacts
    return log, ONE_BALL.tags[log.triangle] == FLOOR


def test_draws_are_uniform_and_independent() -> None:
    draws = (
        np.array([[draw_phase(7, ball, k) for k in range(1000)] for ball in range(50)]) / math.tau
    )
    assert kstest(draws.ravel(), "uniform").pvalue > UNLIKELY
    for one, two in (
        (draws[1:], draws[:-1]),
        (draws[:, 1:], draws[:, :-1]),
    ):  # of two balls, of two draws
        assert abs(np.corrcoef(one.ravel(), two.ravel())[0, 1]) < 4.0 / math.sqrt(one.size)


def test_the_wall_is_where_its_path_has_it_and_as_fast() -> None:
    """Height s and speed u of the face at contact are on the path: s² + (u / ω)² = A². The ball's
    own speed before is that at the ceiling, where it was last.
    """
    log, floor = flights(500)
    hits = np.flatnonzero(floor[1:] & ~floor[:-1]) + 1
    assert len(hits) > 500
    omega, amplitude = math.tau * 20e3, 25e-6
    height = log.position[hits, 2] - RADIUS
    speed = log.normal_speed[hits] - log.normal_speed[hits - 1]
    np.testing.assert_allclose(np.hypot(height, speed / omega), amplitude, rtol=1e-6)


def test_phases_at_the_envelope_are_uniform() -> None:
    log, floor = flights(500)
    hits = np.flatnonzero(floor[1:] & ~floor[:-1]) + 1
    omega, amplitude = math.tau * 20e3, 25e-6
    height, own = log.position[hits, 2] - RADIUS, log.normal_speed[hits - 1]
    phase = np.arctan2(height, (log.normal_speed[hits] - own) / omega)
    at_envelope = phase - omega * (amplitude - height) / own
    assert kstest((at_envelope / math.tau) % 1.0, "uniform").pvalue > UNLIKELY


@pytest.mark.long
@pytest.mark.parametrize(("law", "share"), [("the paper's", 0.015), ("two materials", 0.015)])
def test_rates_and_speeds_are_those_of_the_sinusoid(law: str, share: float) -> None:
    """Fast balls of a lossy floor and ceiling arrive at any phase anyway."""
    room, balls = balls_side_by_side(24, np.random.default_rng(7))
    restitution, _ = LAWS[law]
    rows = {}
    for name, random_phase in (("sinusoid", None), ("drawn", RandomPhase(3))):
        physics = Physics(Gravity(), restitution, SHAKING, random_phase=random_phase)
        log = simulate(Scene(room, balls, physics, 4.0, warmup=0.2)).impacts
        high = room.tags[log.triangle] == CEILING
        counts, low = (
            np.bincount(log.ball[which], minlength=len(balls)) for which in (high, ~high)
        )
        rows[name] = np.stack(
            [counts, low, np.bincount(log.ball[high], log.normal_speed[high], len(balls))], axis=1
        )
    for what, estimate in (
        ("ceiling rate", lambda row: row[0]),
        ("floor rate", lambda row: row[1]),
        ("speed at the ceiling", lambda row: row[2] / row[0]),
    ):
        (one, one_error), (two, two_error) = (jackknife(estimate, rows[name]) for name in rows)
        error = math.hypot(one_error / one, two_error / two)
        print(f"{law}: {what} drawn over sinusoid {two / one:.4f} +- {error:.4f}")
        assert abs(two / one - 1.0) < share
        assert error < 0.5 * share


def test_a_ball_locked_to_the_floor_is_freed() -> None:
    """A ball that loses energy can jump once a period, always at the phase where the face's speed
    makes up for what is lost (Luck & Mehta, Phys. Rev. E 48 (1993) 3988); with drawn phases it has
    no period to keep.
    """
    frequency, amplitude, e = 50.0, 1.2 * G / (math.tau * 50.0) ** 2, 0.5
    jump = 0.5 * G / frequency
    phase = math.acos(jump * (1.0 - e) / (1.0 + e) / (math.tau * frequency * amplitude))
    start = [[0.005, 0.005, RADIUS + amplitude * math.sin(phase) + 1e-9]]
    ball = Balls(np.array(start), np.array([[0.0, 0.0, jump]]), DIAMETER)
    spread = []
    for random_phase in (None, RandomPhase(2)):
        physics = Physics(
            Gravity(),
            Restitution(((e, 1e3),) * 3, (1.0, 1.0), elastic_below=1e-3),
            Vibration(FLOOR, amplitude, frequency, phase),
            random_phase=random_phase,
        )
        speed = simulate(Scene(ONE_BALL, ball, physics, 20.0, warmup=20.0)).impacts.normal_speed
        spread.append(float(speed.std() / speed.mean()))
    assert spread[0] < 1e-6
    assert spread[1] > 0.1


def test_the_same_seed_gives_the_same_bits_on_threads_and_another_does_not() -> None:
    room, balls = balls_side_by_side(5, np.random.default_rng(1))

    def scene(seed: int) -> Scene:
        return Scene(
            room,
            balls,
            Physics(Gravity(), LAWS["the paper's"][0], SHAKING, random_phase=RandomPhase(seed)),
            1,
        )

    with ThreadPoolExecutor(4) as pool:
        same = {fingerprint(result) for result in pool.map(simulate, [scene(1)] * 4)}
    assert len(same) == 1
    assert fingerprint(simulate(scene(2))) not in same


@pytest.mark.long
def test_balls_at_rest_beside_the_floor_do_not_mind() -> None:
    """A ball within the swing that never leaves it keeps its phase."""
    ball = Balls(np.array([[0.005, 0.005, RADIUS + 5e-5]]), np.zeros((1, 3)), DIAMETER)
    physics = Physics(
        Gravity(),
        Restitution(((0.5, 1.0),) * 3, (1.0, 1.0)),
        Vibration(FLOOR, 25e-6, 20e3),
        rest=Rest(),
        random_phase=RandomPhase(),
    )
    result = simulate(Scene(ONE_BALL, ball, physics, 0.5))
    assert result.collisions.sonotrode > 10


@pytest.mark.parametrize("seed", [-1, 2**32, 0.5, "new"])
def test_a_seed_that_is_none_is_named(seed: object) -> None:
    ball = Balls(np.array([[0.005, 0.005, 0.01]]), np.zeros((1, 3)), DIAMETER)
    with pytest.raises(SceneError, match=r"random_phase\.seed is "):
        Scene(ONE_BALL, ball, Physics(vibration=SHAKING, random_phase=RandomPhase(seed)), 1.0)  # type: ignore[arg-type]


def test_drawn_phases_without_a_vibration_are_refused() -> None:
    ball = Balls(np.array([[0.005, 0.005, 0.01]]), np.zeros((1, 3)), DIAMETER)
    with pytest.raises(SceneError, match=r"without physics\.vibration"):
        Scene(ONE_BALL, ball, Physics(random_phase=RandomPhase()), 1.0)
