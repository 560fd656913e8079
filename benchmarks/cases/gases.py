"""Gases of hard spheres: their equation of state, how they cool, how a shaken floor heats them."""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.cases.row import ERRORS_EACH_SIDE, Row, mean_and_half_width
from sim_core import Balls, Gravity, Physics, Restitution, Scene, Vibration, periodic_box, simulate
from sim_core.effects.gravity import STANDARD
from tests.helpers.scenes.cavities import CEILING, FLOOR
from tests.helpers.scenes.gas import (
    carnahan_starling,
    enskog_rate,
    gas_over_theory,
    in_a_box,
    lattice_gas,
    played,
)

ELASTIC = (1.0, 1.0, 0.0)  # at all speeds

PACKINGS = (0.02, 0.1, 0.2, 0.3)

PER_SIDE = 16  # 4,096 balls that cool
COOLED = 20  # starts
# Of the slope: 0.05 % for Carnahan & Starling, 0.05 % for the edges of the cube, 0.1 % until
# velocities are no longer Maxwell's. That balls which meet have met before is not in Enskog's
# theory and not known in closed form: 0.1 % is our guess.
ENSKOG = 0.003

SHAKEN = 200
SIDE = 0.06  # m, of the floor: balls of 3 mm, N d² / area = 0.5
SHOT = 3e-3  # m
SPEED, FREQUENCY = 1.0, 20e3  # m/s, the floor's peak: its mean square is half of it squared
SHAKEN_SEEDS = 8
SETTLING, SHAKEN_FOR, SAMPLES = 4, 8, 80  # relaxation times before and while it is sampled


def equation_of_state() -> Iterator[Row]:
    for packing in PACKINGS:
        for name, (ratio, error, allowed) in gas_over_theory(packing).items():
            yield Row("elastic gas", f"φ = {packing}", f"{name} over Carnahan–Starling's", 1.0,
                      allowed, ratio, ERRORS_EACH_SIDE * error)  # fmt: skip


def state_picture(path: Path) -> None:
    """pV/NkT against the packing."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7, 4.5), layout="constrained")
    line = np.linspace(0.0, 0.32, 100)
    axes.plot(line, carnahan_starling(line), color="0.4", label="Carnahan & Starling")
    axes.plot(line, 1.0 + 4.0 * line, "--", color="0.7", label="second virial coefficient alone")
    for packing in PACKINGS:
        ratio, error, _ = gas_over_theory(packing)["pressure"]
        middle = ratio * carnahan_starling(packing)
        axes.errorbar(packing, middle, ERRORS_EACH_SIDE * error * middle, fmt="o", color="tab:red",
                      label="simulated" if packing == PACKINGS[0] else None)  # fmt: skip
    axes.set(xlabel="packing φ", ylabel="pV / NkT", title="Elastic balls")
    axes.legend(frameon=False)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def cooling(e: float, packing: float, seed: int, times: np.ndarray) -> np.ndarray:
    """√(E₀/E) of a cooling gas at ``times`` (in its time constant τ), (t,).

    Each ball loses (1 - e²) kT/2 at each of its collisions in the mean, so that τ = 6 / ((1 - e²)
    ν), with ν a ball's collisions a second at first: P. K. Haff, J. Fluid Mech. 134 (1983) 401.
    """
    gas = lattice_gas(PER_SIDE, packing, seed)
    ((melted, _),) = played(gas, 1, 20.0, record=())
    balls, energies = melted.balls, [float((melted.balls.velocities**2).sum())]
    constant = 6.0 / ((1.0 - e * e) * enskog_rate(in_a_box(gas), gas.kt))
    physics = Physics(restitution=Restitution((ELASTIC,) * 3, (e, 1.0, 0.0), 0.0))
    for step in np.diff(times, prepend=0.0):
        balls = simulate(Scene(gas.room, balls, physics, constant * step, record=())).balls
        energies.append(float((balls.velocities**2).sum()))
    return np.sqrt(energies[0] / np.array(energies[1:]))


def excess(e: float) -> float:
    """a2 of a gas that cools: by how much <v⁴> exceeds Maxwell's, over its value.

    T. P. C. van Noije & M. H. Ernst, Granular Matter 1 (1998) 57, in three dimensions.
    """
    return 16.0 * (1.0 - e) * (1.0 - 2.0 * e * e) / (81.0 - 17.0 * e + 30.0 * e * e * (1.0 - e))


def haff() -> Iterator[Row]:
    """A gas of excess a2 cools 1 + 3 a2/16 times as fast as Maxwell's: van Noije & Ernst."""
    times = np.linspace(0.0, 1.0, 11)[1:]
    for packing in (0.02, 0.05):
        for e in (0.8, 0.9, 0.95, 0.98):
            grown = np.array([cooling(e, packing, seed, times) - 1.0 for seed in range(COOLED)])
            slopes = grown @ times / (times @ times)
            yield Row("cooling gas", f"e = {e}, φ = {packing}", "slope of √(E₀/E) against t/τ",
                      1.0 + 3.0 / 16.0 * excess(e), ENSKOG,
                      *mean_and_half_width(slopes))  # fmt: skip


def haff_picture(path: Path) -> None:
    """√(E₀/E) against time."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7, 4.5), layout="constrained")
    times = np.linspace(0.0, 3.0, 31)[1:]
    for e, mark in ((0.8, "o"), (0.9, "s"), (0.98, "^")):
        axes.plot(times, cooling(e, 0.05, 0, times), mark, ms=4, label=f"simulated, e = {e}")
    axes.plot([0, 3], [1, 4], color="0.4", label="Haff's law")
    axes.set(xlabel="t / τ", ylabel="√(E₀ / E)", title="4,096 balls that cool, φ = 0.05")
    axes.legend(frameon=False)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def shaken_temperature(e: float) -> tuple[float, float, float]:
    """kT/m of a gas over a shaken floor, over theory's: <U²>/(kT/m), the ratio, its half-width.

    Theory, to first order in <U²>/(kT/m), without sides: kT/m = (2√2/π)
    <U²> / (N d² (1 - e²) / area), V. Kumaran, J. Fluid Mech. 364 (1998) 163.
    """
    depth = SHAKEN * SHOT**2 / SIDE**2
    theory = 2.0 * math.sqrt(2.0) / math.pi * 0.5 * SPEED**2 / (depth * (1.0 - e * e))
    scale = theory / STANDARD
    floor = Vibration(FLOOR, SPEED / (math.tau * FREQUENCY), FREQUENCY)
    physics = Physics(Gravity(), Restitution((ELASTIC,) * 3, (e, 1.0, 0.0), 0.0), floor)
    room = periodic_box((0.0, 0.0, 0.0), (SIDE, SIDE, 30.0 * scale), (FLOOR, CEILING))
    # A ball has 5/2 kT, loses depth (1 - e²) sqrt(π kT) kT/scale a second and gains the same: what
    # it loses goes as sqrt(kT), what the floor gives as 1/sqrt(kT), so that a difference is
    # forgotten at their ratio. Pieces end where the floor's period does.
    forgotten = 2.5 * scale / (depth * (1.0 - e * e) * math.sqrt(math.pi * theory))
    settling, piece = (
        round(relaxations * forgotten * FREQUENCY) / FREQUENCY
        for relaxations in (SETTLING, SHAKEN_FOR / SAMPLES)
    )
    means = []
    for seed in range(SHAKEN_SEEDS):
        rng = np.random.default_rng(seed)
        places = rng.uniform(0.0, SIDE, (SHAKEN, 3))
        places[:, 2] = np.sort(rng.exponential(scale, SHAKEN)) + SHOT * np.arange(1, SHAKEN + 1)
        balls = Balls(places, rng.normal(0.0, math.sqrt(theory), (SHAKEN, 3)), SHOT)
        balls = simulate(Scene(room, balls, physics, settling, record=())).balls
        squares = []
        for _ in range(SAMPLES):
            balls = simulate(Scene(room, balls, physics, piece, record=())).balls
            squares.append((balls.velocities**2).sum() / (3 * SHAKEN) / theory)
        means.append(np.mean(squares))
    return 0.5 * SPEED**2 / theory, *mean_and_half_width(np.array(means))


def shaken_gas() -> Iterator[Row]:
    for e in (0.99, 0.98, 0.95):
        yield Row("gas over a shaken floor", f"e = {e}", "kT/m over Kumaran's", 1.0,
                  *shaken_temperature(e))  # fmt: skip
