"""An elastic gas under gravity thins out upwards as the barometric formula says, and is equally hot
all the way up.

N balls of energy E in all, potential included, and of mass one: a ball is above z with probability
(1 - g z/E)^(5N/2 - 1), for 3N velocities and N - 1 heights share what it leaves; exp(-g z/kT) with
E = 5/2 N kT when N is large. Roman, White & Velasco, Eur. J. Phys. 16 (1995) 83.
"""

import numpy as np
import pytest
from scipy.stats import kstest

from sim_core import Balls, Gravity, Physics, Scene, simulate
from tests.helpers.scenes.cavities import box
from tests.helpers.scenes.gas import SURE, enskog_rate, jackknife

DIAMETER = 2e-3
G = 200.0  # m/s², so that the gas is 2 cm high
WIDE, TALL = 0.1, 0.35  # m
PER_SIDE = 4
COUNT = PER_SIDE**3
APART = 8.0  # collisions of a ball with others between samples
UNLIKELY = 1e-4


def heights_and_speeds(samples: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Heights above the floor z (samples, COUNT) [m], v² [m²/s²], and E [m²/s²]."""
    line = np.linspace(0.01, WIDE - 0.01, PER_SIDE)
    positions = np.stack(np.meshgrid(line, line, 0.5 * line), axis=-1).reshape(-1, 3)
    velocities = np.random.default_rng(4).normal(0.0, 2.0, (COUNT, 3))
    balls = Balls(positions, velocities, DIAMETER)
    total = 0.5 * (velocities**2).sum() + G * (positions[:, 2] - balls.radius).sum()
    kt = 0.4 * total / COUNT
    duration = APART / enskog_rate(1.0 + 2.0 * packing_at_the_floor(total), kt, DIAMETER)
    room = box((WIDE, WIDE, TALL))
    balls = simulate(Scene(room, balls, Physics(Gravity(z=-G)), 10.0 * duration, record=())).balls
    heights, squares = np.empty((samples, COUNT)), np.empty((samples, COUNT))
    for k in range(samples):
        balls = simulate(Scene(room, balls, Physics(Gravity(z=-G)), duration, record=())).balls
        heights[k], squares[k] = (
            balls.positions[:, 2] - balls.radius,
            (balls.velocities**2).sum(axis=1),
        )
    return heights, squares, float(total)


def packing_at_the_floor(total: float) -> float:
    """Of the gas of no volume [1]."""
    scale = 0.4 * total / COUNT / G
    return float(COUNT * np.pi / 6.0 * DIAMETER**3 / ((WIDE - DIAMETER) ** 2 * scale))


def compare_with_the_formula(samples: int) -> None:
    heights, squares, total = heights_and_speeds(samples)
    packing = packing_at_the_floor(total)
    assert packing < 2e-3
    # the balls' own volume thins the gas to exp(-u) (1 + 4 φ - 8 φ exp(-u)): that moves the
    # distribution by at most φ
    result = kstest(heights.ravel(), lambda z: 1.0 - (1.0 - G * z / total) ** (2.5 * COUNT - 1.0))
    far = np.sqrt(-0.5 * np.log(0.5 * UNLIKELY) / heights.size)
    print(f"KS {result.statistic:.5f}, allowed {far:.5f} + {packing:.5f}")
    assert result.statistic < far + packing
    # p = n kT (1 + 4 φ) carries the column: <z> = kT/g (1 + 2 φ), and E = N kT (3/2 + 1 + 2 φ); φ
    # at the floor
    ratio, error = jackknife(lambda row: float(row.mean()), heights / (total / (2.5 * COUNT * G)))
    print(f"mean height over kT/g {ratio:.4f} +- {error:.4f}, expected {1.0 + 1.2 * packing:.4f}")
    assert abs(ratio - 1.0 - 1.2 * packing) < SURE * error
    # a ball at z leaves E - g z for 5N/2 - 1 pairs of quadratic terms, itself among them
    temperature = squares * (2.5 * COUNT - 1.0) / 3.0 / (total - G * heights)
    upper = heights > total / (2.5 * COUNT * G)
    rows = np.stack([temperature * upper, upper, temperature * ~upper, ~upper], axis=-1).mean(
        axis=1
    )
    ratio, error = jackknife(lambda row: float(row[0] / row[1] / (row[2] / row[3])), rows)
    print(f"temperature above over below {ratio:.4f} +- {error:.4f}")
    assert abs(ratio - 1.0) < SURE * error


def test_the_gas_thins_out_upwards_as_the_barometric_formula_says() -> None:
    compare_with_the_formula(samples=400)


@pytest.mark.long
def test_the_barometric_formula_over_many_samples() -> None:
    compare_with_the_formula(samples=20_000)
