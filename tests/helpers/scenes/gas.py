"""An elastic gas of hard spheres in a cube, and what statistical physics says of it.

The balls' mass is one: kT is in m²/s². Energy is kept, so that kT = <v²>/3 holds without error; and
because the energy of hard spheres is all kinetic, places are as independent of velocities as at
constant temperature.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.optimize import brentq

from sim_core import Balls, Physics, Scene, SimulationResult, TriangleMesh, simulate
from tests.helpers.scenes.cavities import WEIGHTLESS, box

DIAMETER = 1e-3  # m
SPEED = 1.0  # m/s, of every ball at the start
BLOCKS = 20
EFFORT = 80_000  # collisions a block, each counted for both balls
SMALL, LARGE = 6, 10  # balls along an edge at the start
SURE = (
    4.5  # standard errors that a test allows: a normal variable is farther off once in 1.5e5 times
)


@dataclass(frozen=True)
class Gas:
    """``inner`` [m]: side of the cube the centres can reach, one diameter less than the room's; its
    volume is V.
    """

    room: TriangleMesh
    balls: Balls
    inner: float

    @property
    def packing(self) -> float:
        """Volume of the balls over V."""
        return len(self.balls) * np.pi / 6.0 * (DIAMETER / self.inner) ** 3

    @property
    def kt(self) -> float:
        """Temperature [m²/s²]."""
        return float((self.balls.velocities**2).sum() / (3 * len(self.balls)))


def lattice_gas(per_side: int, packing: float, seed: int) -> Gas:
    """per_side³ balls on a cubic lattice, all equally fast, in random directions."""
    inner = DIAMETER * per_side * (np.pi / 6.0 / packing) ** (1.0 / 3.0)
    line = 0.5 * DIAMETER + inner * np.linspace(1e-6, 1.0 - 1e-6, per_side)
    velocities = np.random.default_rng(seed).normal(size=(per_side**3, 3))
    velocities *= SPEED / np.linalg.norm(velocities, axis=1)[:, None]
    places = np.stack(np.meshgrid(line, line, line), axis=-1).reshape(-1, 3)
    return Gas(box((inner + DIAMETER,) * 3), Balls(places, velocities, DIAMETER), inner)


def played(
    gas: Gas, pieces: int, collisions: float, record: tuple[int, ...] | None = None
) -> Iterator[tuple[SimulationResult, float]]:
    """The gas in so many pieces, each of about so many ``collisions`` a ball, and their duration
    [s]; after a hundred that melt the lattice.
    """
    duration = collisions / enskog_rate(carnahan_starling(gas.packing), gas.kt)
    balls = simulate(
        Scene(gas.room, gas.balls, Physics(WEIGHTLESS), 100.0 * duration / collisions, record=())
    ).balls
    for _ in range(pieces):
        result = simulate(Scene(gas.room, balls, Physics(WEIGHTLESS), duration, record=record))
        balls = result.balls
        yield result, duration


def jackknife(
    estimate: Callable[[np.ndarray], float], rows: np.ndarray, blocks: int = 20
) -> tuple[float, float]:
    """estimate(mean row) and its standard error, from leaving out one block of rows (n, ...) after
    the other.

    Efron, The Jackknife, the Bootstrap and Other Resampling Plans (1982), chapter 3.
    """
    means = np.array([block.mean(axis=0) for block in np.array_split(rows, blocks)])
    without = [estimate((means.sum(axis=0) - mean) / (blocks - 1)) for mean in means]
    return estimate(means.mean(axis=0)), float(np.sqrt((blocks - 1) * np.var(without)))


def carnahan_starling(packing: float) -> float:
    """pV/NkT of hard spheres. Carnahan & Starling, J. Chem. Phys. 51 (1969) 635; good to 0.3 %."""
    return (1.0 + packing + packing**2 - packing**3) / (1.0 - packing) ** 3


def theory_error(packing: float) -> float:
    """How far theory may be off, of Z - 1.

    Carnahan & Starling's error (the fourth virial coefficient is 18.36, not 18: 0.3 % at φ = 0.3,
    and less than in proportion below), N balls that have N - 1 partners, and 1 % of the surface
    tension, whose whole effect, carried on to no edges, is 0.2 (Z - 1).
    """
    return 0.011 * packing + 0.001 + 0.002


def in_a_box(gas: Gas) -> float:
    """pV/NkT on the walls of the cube, up to terms of (DIAMETER / inner)².

    A gas at a hard wall has the surface tension γ = ∂Φ/∂n2 of scaled particle theory (Reiss,
    Frisch, Helfand & Lebowitz, J. Chem. Phys. 32 (1960) 119; in this form Roth, J. Phys.: Condens.
    Matter 22 (2010) 063102), here reckoned on the surface the centres reach: γ - p d/2, with the
    pressure of the same theory. The balls crowd at the wall, N = ρ V - A dγ/dμ, so that the middle
    is thinner than N/V; and a larger cube has more surface, so that the force on the walls is p V -
    4 γ V / inner.
    """
    ratio = DIAMETER / gas.inner

    def tension(packing: float) -> float:
        """γ d²/kT"""
        free = 1.0 - packing
        own_pressure = (1.0 + packing + packing**2) / free**3
        return 3.0 * packing / np.pi * (1.0 / free + 1.5 * packing / free**2 - own_pressure)

    def average(packing: float) -> float:
        """N over V, as a packing, where the middle has ``packing``; dμ = dp/ρ."""
        low, high = 0.9999 * packing, 1.0001 * packing
        pressure = high * carnahan_starling(high) - low * carnahan_starling(low)
        return packing - np.pi * ratio * packing * (tension(high) - tension(low)) / pressure

    middle = brentq(lambda packing: average(packing) - gas.packing, 0.5 * gas.packing, gas.packing)
    return (
        middle * carnahan_starling(middle) - 2.0 / 3.0 * np.pi * ratio * tension(middle)
    ) / gas.packing


def enskog_rate(compressibility: float, kt: float, diameter: float = DIAMETER) -> float:
    """Collisions of a ball a second, 4 n d² sqrt(π kT) χ, where pV/NkT = 1 + 4 φ χ is
    ``compressibility``.

    Chapman & Cowling, The Mathematical Theory of Non-uniform Gases, 3rd ed. (1970), sections 5.21
    and 16.2. By the virial theorem the two go together at any density, with walls or without: both
    count the contacts.
    """
    return 6.0 * np.sqrt(kt / np.pi) * (compressibility - 1.0) / diameter


@lru_cache
def measured(per_side: int, packing: float, effort: int) -> tuple[Gas, np.ndarray]:
    """The gas, and a row a block: pV/NkT from the impulses on the walls, collisions of a ball a
    second.
    """
    gas = lattice_gas(per_side, packing, seed=1)
    rows = []
    for result, duration in played(gas, BLOCKS, effort / per_side**3):
        impulse = 2.0 * result.impacts.normal_speed.sum()
        pressure = impulse / (6.0 * gas.inner**2 * duration)
        rate = 2.0 * result.collisions.balls / (len(gas.balls) * duration)
        rows.append((pressure * gas.inner**3 / (len(gas.balls) * gas.kt), rate))
    return gas, np.array(rows)


def without_edges(ratios: list[tuple[float, float]], sizes: list[float]) -> tuple[float, float]:
    """Two ratios to theory (value, error) on cubes of two sizes [m], carried on to where (1 /
    size)² is none.
    """
    weight = sizes[1] ** 2 / (sizes[1] ** 2 - sizes[0] ** 2)
    (small, small_error), (large, large_error) = ratios
    return weight * large - (weight - 1.0) * small, float(
        np.hypot(weight * large_error, (weight - 1.0) * small_error)
    )


def gas_over_theory(packing: float, effort: int = EFFORT) -> dict[str, tuple[float, float, float]]:
    """Simulated over theoretical values, their standard errors, and how far theory may be off.

    Walls add a term of DIAMETER / inner, which in_a_box has, and edges one of its square, which
    two sizes give.
    """
    ratios: dict[str, list[tuple[float, float]]] = {"pressure": [], "collision rate": []}
    sizes = []
    for per_side in (SMALL, LARGE):
        gas, rows = measured(per_side, packing, effort)
        compressibility = in_a_box(gas)
        theory = (compressibility, enskog_rate(compressibility, gas.kt))
        for name, column, value in zip(ratios, rows.T, theory, strict=True):
            mean, error = jackknife(np.mean, column)
            ratios[name].append((mean / value, error / value))
        sizes.append(gas.inner)
    error, dense = theory_error(packing), 1.0 - 1.0 / carnahan_starling(packing)
    allowed = {"pressure": error * dense, "collision rate": error}
    return {name: (*without_edges(ratios[name], sizes), allowed[name]) for name in ratios}
