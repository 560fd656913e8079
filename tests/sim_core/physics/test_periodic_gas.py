"""An elastic gas between floor and ceiling, periodic along x and y, against the theory of hard
spheres.

V is the volume the centres can reach: sides² (height - diameter). There are two walls and no edges,
so that no error of (diameter / side)² is left, and one size is enough.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from sim_core import Balls, Physics, Scene, periodic_box, simulate
from tests.helpers.scenes.cavities import WEIGHTLESS
from tests.helpers.scenes.gas import (
    DIAMETER,
    SPEED,
    SURE,
    carnahan_starling,
    enskog_rate,
    jackknife,
    theory_error,
)

BLOCKS = 20


def tension(packing: float) -> float:
    """γ d²/kT of scaled particle theory on the surface that centres reach, as in gas.py."""
    free = 1.0 - packing
    own_pressure = (1.0 + packing + packing**2) / free**3
    return float(3.0 * packing / np.pi * (1.0 / free + 1.5 * packing / free**2 - own_pressure))


def middle_of(packing: float, ratio: float) -> float:
    """The packing half-way between the walls: N = ρ V - 2 A dγ/dμ, dμ = dp/ρ; ratio: d/height."""

    def average(middle: float) -> float:
        low, high = 0.9999 * middle, 1.0001 * middle
        pressure = high * carnahan_starling(high) - low * carnahan_starling(low)
        lost = np.pi / 3.0 * ratio * middle * (tension(high) - tension(low)) / pressure
        return float(middle - lost)

    return float(brentq(lambda middle: average(middle) - packing, 0.5 * packing, 1.5 * packing))


@pytest.mark.parametrize(
    "per_side", [8, pytest.param(11, marks=pytest.mark.long)]
)  # fewer and more balls than blocks begin with
@pytest.mark.parametrize("packing", [0.02, 0.1, 0.2, 0.3])
def test_pressure_and_collision_rate(packing: float, per_side: int) -> None:
    """The walls bear the pressure p of the middle. Along them the gas bears less, by the tension:
    p V on average of the three directions is N kT + (d/3) Σ impulses of collisions per time, so
    that 3 p V - 4 γ A = N kT (3 + ν d sqrt(π/kT)/2), with closing speeds that average sqrt(π kT).
    """
    count = per_side**3
    inner = DIAMETER * per_side * (np.pi / 6.0 / packing) ** (1.0 / 3.0)
    room = periodic_box((0.0, 0.0, 0.0), (inner, inner, inner + DIAMETER), (0, 1))
    line = inner * np.linspace(1e-6, 1.0 - 1e-6, per_side)
    around = inner * (np.arange(per_side) + 0.5) / per_side
    places = np.stack(np.meshgrid(around, around, line + 0.5 * DIAMETER), axis=-1).reshape(-1, 3)
    velocities = np.random.default_rng(1).normal(size=(count, 3))
    velocities -= velocities.mean(axis=0) * [1.0, 1.0, 0.0]  # what is kept is no temperature
    velocities *= SPEED / np.sqrt(np.square(velocities).sum() / count)
    kt = SPEED**2 / 3.0
    balls = Balls(places, velocities, DIAMETER)
    duration = 80_000 / count / enskog_rate(carnahan_starling(packing), kt)
    # collisions are logged, as in test_periodic_box: each set of effects is compiled
    gas = Scene(room, balls, Physics(WEIGHTLESS), duration, record_collisions=True)
    balls = simulate(replace(gas, duration=100.0 * duration * count / 8e4)).balls
    rows = []
    for _ in range(BLOCKS):
        result = simulate(replace(gas, balls=balls))
        balls = result.balls
        impulse = 2.0 * result.impacts.normal_speed.sum()
        pressure = impulse / (2.0 * inner**2 * duration) * inner**3 / (count * kt)
        rows.append((pressure, 2.0 * result.collisions.balls / (count * duration)))
    middle = middle_of(packing, DIAMETER / inner)
    compressibility = middle * carnahan_starling(middle) / packing
    walls = 4.0 * tension(middle) * inner**2 / DIAMETER**2 / count  # 4 γ A / N kT
    rate = 2.0 / DIAMETER * np.sqrt(kt / np.pi) * (3.0 * (compressibility - 1.0) - walls)
    for name, column, theory, allowed in (
        ("pressure", 0, compressibility, theory_error(packing) * (1.0 - 1.0 / compressibility)),
        ("collision rate", 1, rate, theory_error(packing)),
    ):
        mean, error = jackknife(lambda row, column=column: row[column], np.array(rows))  # type: ignore[misc]
        print(f"{packing} {count} {name} over theory {mean / theory:.4f} +- {error / theory:.4f}")
        assert abs(mean / theory - 1.0) < allowed + SURE * error / theory, name
