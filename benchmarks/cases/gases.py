"""Gases of hard spheres: their equation of state, how they cool, how a shaken floor heats them."""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.cases.row import SURE, Row, mean_and_half_width
from sim_core import Balls, Gravity, Physics, Restitution, Scene, Vibration, periodic_box, simulate
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
SEEDS = 5

PACKINGS = (0.02, 0.1, 0.2, 0.3)

PER_SIDE = 16  # 4,096 balls that cool
# Enskog's theory lets velocities of balls that meet be independent and Maxwell's: that they are not
# is 0.3 % at e = 0.8 for Maxwell (van Noije & Ernst, Granular Matter 1 (1998) 57), the rest is not
# known in closed form.
ENSKOG = 0.01

SHAKEN = 200
SIDE = 0.06  # m, of the floor: balls of 3 mm, N d² / area = 0.5
SHOT = 3e-3  # m
SPEED, FREQUENCY = 1.0, 20e3  # m/s, the floor's peak: its mean square is half of it squared
SAMPLES = 400
G = 9.80665


def equation_of_state() -> Iterator[Row]:
    for packing in PACKINGS:
        for name, (ratio, error, allowed) in gas_over_theory(packing).items():
            yield Row("elastic gas", f"φ = {packing}", f"{name} over Carnahan–Starling's", 1.0,
                      allowed, ratio, SURE * error)  # fmt: skip


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
        axes.errorbar(packing, middle, SURE * error * middle, fmt="o", color="tab:red",
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


def haff() -> Iterator[Row]:
    times = np.linspace(0.0, 1.0, 11)[1:]
    for packing in (0.02, 0.05):
        for e in (0.8, 0.9, 0.95, 0.98):
            grown = np.array([cooling(e, packing, seed, times) - 1.0 for seed in range(SEEDS)])
            slopes = grown @ times / (times @ times)
            yield Row("cooling gas", f"e = {e}, φ = {packing}", "slope of √(E₀/E) against t/τ", 1.0,
                      ENSKOG, *mean_and_half_width(slopes))  # fmt: skip


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
    rng, scale = np.random.default_rng(1), theory / G
    places = rng.uniform(0.0, SIDE, (SHAKEN, 3))
    places[:, 2] = 2.0 * SHOT * np.arange(1, SHAKEN + 1)
    balls = Balls(places, rng.normal(0.0, math.sqrt(theory), (SHAKEN, 3)), SHOT)
    floor = Vibration(FLOOR, SPEED / (math.tau * FREQUENCY), FREQUENCY)
    physics = Physics(Gravity(), Restitution((ELASTIC,) * 3, (e, 1.0, 0.0), 0.0), floor)
    room = periodic_box((0.0, 0.0, 0.0), (SIDE, SIDE, 30.0 * scale), (FLOOR, CEILING))
    # A ball's energy is forgotten after about so long; pieces end where the floor's period does.
    memory = 3.0 * scale / (4.0 * depth * (1.0 - e * e) * math.sqrt(math.pi * theory))
    piece = round(0.2 * memory * FREQUENCY) / FREQUENCY
    squares = []
    for _ in range(SAMPLES):
        balls = simulate(Scene(room, balls, physics, piece, record=())).balls
        squares.append((balls.velocities**2).sum() / (3 * SHAKEN) / theory)
    blocks = np.array(squares[SAMPLES // 10 :]).reshape(-1, SAMPLES // 20)
    return 0.5 * SPEED**2 / theory, *mean_and_half_width(blocks.mean(axis=1))


def shaken_gas() -> Iterator[Row]:
    for e in (0.99, 0.98, 0.95):
        yield Row("gas over a shaken floor", f"e = {e}", "kT/m over Kumaran's", 1.0,
                  *shaken_temperature(e))  # fmt: skip
