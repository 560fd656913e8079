"""The cylinder of published ultrasonic peening experiments: steel balls of 3 mm over a sonotrode.

Radius 35 mm, height 40 mm, 25 µm at 20 kHz: M. Micoulaut, D. Retraint, P. Viot & M. François,
ICSP-9 (2005) 119; with S. Mechkov, Granular Matter 9 (2007) 25.
"""

import json
import math
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from benchmarks.cases.row import Row, mean_and_half_width
from sim_core import (
    AnalyticCavity,
    Balls,
    Friction,
    Gravity,
    ImpactLog,
    Physics,
    Restitution,
    Scene,
    Vibration,
    cylinder_cavity,
    pack_balls,
    simulate,
)

CEILING, FLOOR, SIDE = 0, 1, 2
RADIUS, HEIGHT, DIAMETER = 0.035, 0.04, 3e-3  # m
AMPLITUDE, FREQUENCY = 25e-6, 20e3  # m, Hz
WARM_UP = 1.0  # s
# s, warm-up and record of soft spheres, of which a second takes minutes; few balls forget slowly
SOFT_S = {200: 0.5, 30: 2.0}
SEEDS = 8
RINGS = 8
# Balls crowd at a hard wall: 1.5 φ d over the ring's width more in the outer ring at φ = 0.018, to
# lowest order of the surface tension of scaled particle theory (tests/helpers/scenes/gas.py).
CROWDING = 1.02, 0.01
CONTACTS = (8e-6, 4e-6, 2e-6)  # s: Hertz's theory gives steel balls 7.5 µs at 5 m/s


def chamber(
    count: int,
    restitution: Restitution,
    seconds: float,
    seed: int,
    friction: tuple[float, float] | None = None,
    amplitude: float = AMPLITUDE,
) -> Scene:
    """So many balls in the cylinder, with one friction (mu, beta0); the ceiling's log is kept."""
    cavity, rng = _cavity(), np.random.default_rng(seed)
    places = pack_balls(cavity, count, DIAMETER, rng, amplitude)
    balls = Balls(places, rng.normal(0.0, 1.0, places.shape), DIAMETER)
    shaking = Vibration(FLOOR, amplitude, FREQUENCY, rng.uniform(0.0, 2.0 * np.pi))
    law = None if friction is None else Friction((friction,) * 3, friction)
    physics = Physics(Gravity(), restitution, shaking, friction=law)
    return Scene(cavity, balls, physics, seconds, record=(CEILING,))


def impacts(
    count: int, restitution: Restitution, seed: int, amplitude: float = AMPLITUDE
) -> ImpactLog:
    """Impacts on the ceiling in two seconds after the warm-up, without friction."""
    scene = chamber(count, restitution, 2.0, seed, amplitude=amplitude)
    return simulate(replace(scene, warmup=WARM_UP)).impacts


def constant(e: float, wall: float | None = None) -> Restitution:
    """The same at all speeds; another one of the side."""
    law, side = (e, 1.0, 0.0), (e if wall is None else wall, 1.0, 0.0)
    return Restitution((law, law, side), law)


def by_speed() -> Restitution:
    """The paper's law of the designs that come with the program."""
    law = (0.91, 1.0)
    return Restitution((law,) * 3, law)


@lru_cache
def ring_shares(wall: float, seeds: int) -> np.ndarray:
    """Impacts per area of the ceiling in rings of equal width, over their mean, (seeds, RINGS)."""
    edges = np.linspace(0.0, 1.0, RINGS + 1)
    found = []
    for seed in range(seeds):
        places = impacts(200, constant(0.91, wall), seed).position
        way = np.hypot(places[:, 0], places[:, 1]) / (RADIUS - 0.5 * DIAMETER)
        found.append(np.histogram(way, edges)[0] / len(way) / np.diff(edges**2))
    return np.array(found)


def side_walls() -> Iterator[Row]:
    """Inelastic sides make impacts gather at the rim; at elastic ones balls crowd a little."""
    for wall in (1.0, 0.9, 0.7, 0.5):
        shares = ring_shares(wall, SEEDS)
        ratio, half_width = mean_and_half_width(shares[:, -1] / shares[:, :2].mean(axis=1))
        reference, allowed = CROWDING if wall == 1.0 else (math.nan, 0.0)
        yield Row("side walls", f"restitution {wall}", "impacts per area, rim / centre",
                  reference, allowed, ratio, half_width)  # fmt: skip


def side_walls_picture(path: Path) -> None:
    """Impacts per area against the distance from the axis."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7, 4.5), layout="constrained")
    middle = (np.arange(RINGS) + 0.5) / RINGS * (RADIUS - 0.5 * DIAMETER) * 1e3
    for wall in (1.0, 0.9, 0.7, 0.5):
        shares = ring_shares(wall, SEEDS)
        error = 2.0 * shares.std(axis=0, ddof=1) / np.sqrt(len(shares))
        axes.errorbar(middle, shares.mean(axis=0), error, capsize=2, label=f"sides with e = {wall}")
    axes.set(xlabel="distance from the axis, mm", ylabel="impacts per area / mean", ylim=(0, None),
             title="200 balls of 3 mm: where they hit the ceiling")  # fmt: skip
    axes.legend(frameon=False)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def exponent(restitution: Restitution, count: int) -> tuple[float, float]:
    """p in (mean normal speed on the ceiling) ~ amplitude^p, from 25 to 50 µm."""
    samples = []
    for seed in range(SEEDS):
        low, high = (
            impacts(count, restitution, seed, amplitude).normal_speed.mean()
            for amplitude in (AMPLITUDE, 2.0 * AMPLITUDE)
        )
        samples.append(np.log2(high / low))
    return mean_and_half_width(np.array(samples))


def practice() -> Iterator[Row]:
    """What the trade reports of intensity: nearly in proportion to amplitude, hardly to charge."""
    for name, law in (("e falls with speed", by_speed()), ("e constant", constant(0.91))):
        for count in (50, 200):
            yield Row("practice", f"{name}, {count} balls", "speed's exponent of the amplitude",
                      math.nan, 0.0, *exponent(law, count))  # fmt: skip
    few, many = (
        np.array([impacts(count, by_speed(), seed).normal_speed.mean()
                  for seed in range(SEEDS)])
        for count in (100, 200)
    )  # fmt: skip
    yield Row("practice", "e falls with speed", "speed with 200 balls / with 100", math.nan, 0.0,
              *mean_and_half_width(many / few))  # fmt: skip


def soft_speed(count: int, mu: float, contact: float) -> tuple[float, float]:
    """√<v²> [m/s] of the balls in LAMMPS with contacts of ``contact`` [s], and its half-width."""
    places = pack_balls(_cavity(), count, DIAMETER, np.random.default_rng(1), AMPLITUDE)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scene.npz"
        np.savez(
            file, positions=places, density=7800.0, diameter=DIAMETER, contact_s=contact, e=0.91,
            mu=mu, radius=RADIUS, height=HEIGHT, amplitude=AMPLITUDE, frequency=FREQUENCY,
            warmup_s=SOFT_S[count], duration_s=SOFT_S[count], blocks=10,
        )  # fmt: skip
        program = Path(__file__).with_name("soft_spheres.py")
        done = subprocess.run([sys.executable, str(program), str(file)], check=True, text=True,
                              stdout=subprocess.PIPE)  # fmt: skip
    return _root(*mean_and_half_width(np.array(json.loads(done.stdout))))


def hard_speed(count: int, mu: float) -> tuple[float, float]:
    """√<v²> [m/s] of the balls here, and its 95 % half-width."""
    friction, squares = (mu, 0.0) if mu else None, []
    for seed in range(SEEDS):
        scene = replace(chamber(count, constant(0.91), 1.0, seed, friction), warmup=WARM_UP)
        frames = simulate(scene, np.linspace(0.0, 1.0, 41)[1:]).frames
        squares.append((frames.velocities**2).sum(axis=-1).mean())
    return _root(*mean_and_half_width(np.array(squares)))


def peers() -> Iterator[Row]:
    """Hard spheres against soft ones as contacts get shorter, and their limit."""
    for count in SOFT_S:
        for mu in (0.2, 0.0):
            found, half_width = hard_speed(count, mu)
            soft = [soft_speed(count, mu, contact) for contact in CONTACTS]
            values, errors = np.array(soft).T
            conditions = f"{count} balls, friction {mu}"
            for contact, value, error in zip(CONTACTS, values, errors, strict=True):
                yield Row("soft spheres", f"{conditions}, contacts of {contact * 1e6:g} µs",
                          "√<v²> in LAMMPS, m/s", math.nan, 0.0, value, error)  # fmt: skip
            fit, spread = np.polyfit(CONTACTS, values, 1, w=2.0 / errors, cov="unscaled")
            error = 2.0 * np.sqrt(spread[1, 1])
            yield Row("soft spheres", f"{conditions}, contacts of no time",
                      "√<v²>, m/s", fit[1], error, found, half_width)  # fmt: skip


def _root(mean: float, half_width: float) -> tuple[float, float]:
    return float(np.sqrt(mean)), float(0.5 * half_width / np.sqrt(mean))


def _cavity() -> AnalyticCavity:
    return cylinder_cavity(2.0 * RADIUS, 0.0, HEIGHT, (FLOOR, CEILING, SIDE))
