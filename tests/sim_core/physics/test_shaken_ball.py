"""One ball between a shaking floor and a ceiling at rest, under four laws of restitution, against
marching.

The marching steps through a flight in a four-hundredth of a period and bisects where a gap closes:
slow, and free of everything the simulator's own search relies on.
"""

import math
from collections.abc import Callable, Iterator
from itertools import islice, takewhile

import numpy as np
import pytest

from sim_core import Balls, Gravity, Physics, Restitution, Scene, TriangleMesh, Vibration, simulate
from sim_core.effects.gravity import STANDARD as G
from tests.helpers.scenes.cavities import CEILING, ELASTIC, FLOOR, box
from tests.helpers.scenes.gas import SURE, jackknife

DIAMETER = 3e-3
TOP = 0.02  # m, height of the ceiling
SHAKING = Vibration(FLOOR, 25e-6, 20e3, phase=0.7)
OMEGA = math.tau * SHAKING.frequency

Law = Callable[[float], float]  # restitution at a normal speed [m/s]


def constant(e: float, elastic_below: float = 0.0) -> Law:
    return lambda speed: e if speed >= elastic_below else 1.0


def power(c0: float, v0: float, elastic_below: float = 0.0) -> Law:
    """The paper's eq. 2; under ``elastic_below`` nothing is lost."""

    def law(speed: float) -> float:
        if speed < elastic_below:
            return 1.0
        return c0 if speed < v0 else c0 * (speed / v0) ** -0.25

    return law


# Each law as the simulator takes it, and as the marching does, on (ceiling, floor).
LAWS: dict[str, tuple[Restitution, tuple[Law, Law]]] = {
    "elastic": (ELASTIC, (constant(1.0),) * 2),
    "constant": (
        Restitution(((0.6, 1e3),) * 3, (1.0, 1.0), elastic_below=0.05),
        (constant(0.6, 0.05),) * 2,
    ),
    "the paper's": (
        Restitution(((0.9, 0.7),) * 3, (1.0, 1.0), elastic_below=0.05),
        (power(0.9, 0.7, 0.05),) * 2,
    ),
    "two materials": (
        Restitution(((0.5, 2.0), (0.95, 0.3), (1.0, 1.0)), (1.0, 1.0), elastic_below=0.3),
        (power(0.5, 2.0, 0.3), power(0.95, 0.3, 0.3)),
    ),
}


def floor_height(t: np.ndarray | float) -> np.ndarray | float:
    return SHAKING.amplitude * np.sin(OMEGA * t + SHAKING.phase)


def first_contact(z: float, v: float, t: float) -> tuple[float, int]:
    """Delay [s] until a ball that leaves z [m] with v [m/s] at t [s] touches the ceiling or the
    floor, and which.
    """

    def gaps(s: np.ndarray | float) -> np.ndarray:
        height = z + v * s - 0.5 * G * s * s
        return np.array(
            [TOP - 0.5 * DIAMETER - height, height - 0.5 * DIAMETER - floor_height(t + s)]
        )

    step = 1.0 / SHAKING.frequency / 400.0
    # the first points lie close together: a ball that has just been hit is still at the surface it
    # leaves
    times = step * np.concatenate([[1e-3, 1e-2, 1e-1], np.arange(1.0, 4001.0)])
    while True:
        closed = (gaps(times) <= 0.0).any(axis=0)
        if closed.any():
            k = int(closed.argmax())
            which = int(gaps(times[k]).argmin())
            low, high = times[k - 1] if k else 0.0, times[k]
            while (middle := 0.5 * (low + high)) not in (low, high):
                low, high = (middle, high) if gaps(middle)[which] > 0.0 else (low, middle)
            return high, which
        times = times[-1] + step * np.arange(0.0, 4001.0)


def marched(z: float, v: float, laws: tuple[Law, Law]) -> Iterator[tuple[float, float, int]]:
    """(time, normal speed, CEILING or FLOOR) of one impact after the other."""
    t = 0.0
    while True:
        delay, which = first_contact(z, v, t)
        z, v, t = z + v * delay - 0.5 * G * delay * delay, v - G * delay, t + delay
        surface = (
            SHAKING.amplitude * OMEGA * math.cos(OMEGA * t + SHAKING.phase)
            if which == FLOOR
            else 0.0
        )
        speed = abs(v - surface)
        yield t, speed, which
        v = surface - laws[which](speed) * (v - surface)


def balls_side_by_side(per_side: int, rng: np.random.Generator) -> tuple[TriangleMesh, Balls]:
    """Balls that fly up and down only, too far apart to meet: as many experiments as balls."""
    line = 2e-3 + 4e-3 * np.arange(per_side)
    count = per_side**2
    positions = np.concatenate(
        [np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2), np.zeros((count, 1))], axis=1
    )
    positions[:, 2] = rng.uniform(0.003, TOP - 0.003, count)
    velocities = np.zeros((count, 3))
    velocities[:, 2] = rng.normal(0.0, 3.0, count)
    wide = 4e-3 * per_side
    return box((wide, wide, TOP)), Balls(positions, velocities, DIAMETER)


def compare_impact_by_impact(law: str, per_side: int) -> None:
    """The flight is chaotic: two marches 1e-12 m apart say how far the rounding of either, 1e-16,
    may be carried.
    """
    restitution, laws = LAWS[law]
    room, balls = balls_side_by_side(per_side, np.random.default_rng(6))
    log = simulate(Scene(room, balls, Physics(Gravity(), restitution, SHAKING), 0.05)).impacts
    compared = 0
    for ball, (z, v) in enumerate(zip(balls.positions[:, 2], balls.velocities[:, 2], strict=True)):
        march, beside = (
            np.array(list(islice(marched(z + shift, v, laws), 10))) for shift in (0.0, 1e-12)
        )
        spread = np.maximum.accumulate(np.abs(march - beside), axis=0)
        together = (spread[:, 1] < 1e-3) & (march[:, 0] < 0.05)  # speeds within 1 mm/s
        march, spread = march[together], spread[together]
        seen = np.flatnonzero(log.ball == ball)[: len(march)]
        np.testing.assert_array_equal(room.tags[log.triangle[seen]], march[:, 2])
        assert (np.abs(log.time[seen] - march[:, 0]) <= spread[:, 0] + 1e-16).all(), ball
        assert (np.abs(log.normal_speed[seen] - march[:, 1]) <= spread[:, 1] + 1e-14).all(), ball
        compared += len(march)
    print(f"{law}: {compared} impacts of {len(balls)} balls compared")
    assert compared > 2 * len(balls)


def compare_statistics(law: str, per_side: int, duration: float) -> None:
    """How often and how hard the ceiling is hit: other balls for the marching, drawn from the same
    distribution.
    """
    restitution, laws = LAWS[law]
    room, balls = balls_side_by_side(24, np.random.default_rng(7))
    result = simulate(Scene(room, balls, Physics(Gravity(), restitution, SHAKING), duration))
    log = result.impacts
    assert result.collisions.balls == 0
    high = room.tags[log.triangle] == CEILING
    simulated = np.stack(
        [
            np.bincount(log.ball[high], minlength=len(balls)),
            np.bincount(log.ball[high], log.normal_speed[high], minlength=len(balls)),
        ],
        axis=1,
    )
    _, others = balls_side_by_side(per_side, np.random.default_rng(8))
    rows = []
    for z, v in zip(others.positions[:, 2], others.velocities[:, 2], strict=True):
        march = takewhile(lambda hit: hit[0] < duration, marched(z, v, laws))
        speeds = [speed for _, speed, which in march if which == CEILING]
        rows.append((len(speeds), sum(speeds)))
    for name, estimate in (
        ("impacts a second", lambda row: row[0] / duration),
        ("speed", lambda row: row[1] / row[0]),
    ):
        one, one_error = jackknife(estimate, simulated)
        two, two_error = jackknife(estimate, np.array(rows, dtype=float))
        error = float(np.hypot(one_error, two_error))
        print(
            f"{law}: {name} {one:.4g} simulated, {two:.4g} marched, ratio {one / two:.4f} +- "
            f"{error / two:.4f}"
        )
        assert abs(one - two) < SURE * error, name


@pytest.mark.parametrize("law", LAWS)
def test_impact_by_impact_against_marching(law: str) -> None:
    compare_impact_by_impact(law, per_side=3)


@pytest.mark.parametrize("law", LAWS)
def test_impact_rate_and_speed_on_the_ceiling_against_marching(law: str) -> None:
    compare_statistics(law, per_side=10, duration=0.06)


@pytest.mark.long
@pytest.mark.parametrize("law", LAWS)
def test_impact_rate_and_speed_over_thousands_of_impacts(law: str) -> None:
    compare_impact_by_impact(law, per_side=10)
    compare_statistics(law, per_side=20, duration=0.3)
