"""The cylinder of published ultrasonic peening experiments: steel balls of 3 mm over a sonotrode.

Radius 35 mm, height 40 mm, 25 µm at 20 kHz: M. Micoulaut, D. Retraint, P. Viot & M. François,
ICSP-9 (2005) 119; with S. Mechkov, Granular Matter 9 (2007) 25.
"""

import math
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.stats import t

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
from sim_core.effects.gravity import STANDARD

CEILING, FLOOR, SIDE = 0, 1, 2
RADIUS, HEIGHT, DIAMETER = 0.035, 0.04, 3e-3  # m
AMPLITUDE, FREQUENCY = 25e-6, 20e3  # m, Hz
WARM_UP = 1.0  # s
E = 0.91  # steel on steel
SEEDS = 8
RINGS = 8
# Balls crowd at a hard wall: 1.5 φ d over the ring's width more in the outer ring at φ = 0.018, to
# lowest order of the surface tension of scaled particle theory (tests/helpers/scenes/gas.py).
CROWDING = 1.02, 0.01

# s: Hertz's theory gives steel balls 7.5 µs at 5 m/s. Few balls must run for longer.
CONTACTS = {200: (8e-6, 4e-6, 2e-6), 30: (12e-6, 8e-6, 4e-6)}
# A tangential spring of 2/7 and a damper of the same constant swing as long as the normal ones, 7/2
# times as damped: a contact that sticks springs back at so much of its sideways speed.
SPRING_BACK = E**3.5
# s, warm-up and record of soft spheres, of which a second takes minutes; few balls forget slowly.
SOFT_S = {200: (0.06, 0.12), 30: (0.25, 0.5)}
SOFT_STARTS = 6
SOFT_START = 3.0  # m/s, of each component: warm from the start


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
        places = impacts(200, constant(E, wall), seed).position
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
        mean, error = np.array([mean_and_half_width(ring) for ring in shares.T]).T
        axes.errorbar(middle, mean, error, capsize=2, label=f"sides with e = {wall}")
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
    for name, law in (("e falls with speed", by_speed()), ("e constant", constant(E))):
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


def soft_speed(count: int, mu: float, contact: float, seed: int) -> float:
    """√<v²> [m/s] of the balls in LAMMPS with contacts of ``contact`` [s]."""
    warmup, duration = SOFT_S[count]
    start = chamber(count, constant(E), warmup, seed).balls
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scene.npz"
        np.savez(
            file, positions=start.positions, velocities=SOFT_START * start.velocities,
            density=7800.0, diameter=DIAMETER, contact_s=contact, e=E, mu=mu, radius=RADIUS,
            height=HEIGHT, amplitude=AMPLITUDE, frequency=FREQUENCY, gravity=STANDARD,
            warmup_s=warmup, duration_s=duration,
        )  # fmt: skip
        program = Path(__file__).with_name("soft_spheres.py")
        done = subprocess.run([sys.executable, str(program), str(file)], check=True, text=True,
                              stdout=subprocess.PIPE)  # fmt: skip
    return math.sqrt(float(done.stdout))


def hard_speed(count: int, mu: float, seed: int) -> float:
    """√<v²> [m/s] of the balls here; frames lie at all phases of the sonotrode alike."""
    friction = (mu, SPRING_BACK) if mu else None
    scene = replace(chamber(count, constant(E), 1.0, seed, friction), warmup=WARM_UP)
    frames = simulate(scene, np.sort(np.random.default_rng(seed).uniform(0.0, 1.0, 80))).frames
    return math.sqrt((frames.velocities**2).sum(axis=-1).mean())


def without_contacts(contacts: tuple[float, ...], speeds: np.ndarray) -> tuple[float, float]:
    """What a line through the ``speeds`` (contacts, starts) is at contacts of no time.

    The half-width of its 95 % interval is wider by √χ² where the line misses the means by more
    than their scatter.
    """
    starts = speeds.shape[1]
    error = np.sqrt(speeds.var(axis=1, ddof=1).mean() / starts)
    means = speeds.mean(axis=1)
    weights = np.full(len(means), 1.0 / error)
    line, spread = np.polyfit(contacts, means, 1, w=weights, cov="unscaled")
    chi_square = (((means - np.polyval(line, contacts)) / error) ** 2).sum() / (len(means) - 2)
    sure = t.ppf(0.975, len(means) * (starts - 1)) * max(1.0, np.sqrt(chi_square))
    return float(line[1]), float(sure * np.sqrt(spread[1, 1]))


def peers() -> Iterator[Row]:
    """Hard spheres against soft ones as contacts get shorter, and their limit."""
    for count in SOFT_S:
        for mu in (0.2, 0.0):
            conditions, speeds = f"{count} balls, friction {mu}", []
            for contact in CONTACTS[count]:
                speeds.append([soft_speed(count, mu, contact, seed) for seed in range(SOFT_STARTS)])
                yield Row("soft spheres", f"{conditions}, contacts of {contact * 1e6:g} µs",
                          "√<v²> in LAMMPS, m/s", math.nan, 0.0,
                          *mean_and_half_width(np.array(speeds[-1])))  # fmt: skip
            hard = np.array([hard_speed(count, mu, seed) for seed in range(SEEDS)])
            yield Row("soft spheres", f"{conditions}, contacts of no time", "√<v²>, m/s",
                      *without_contacts(CONTACTS[count], np.array(speeds)),
                      *mean_and_half_width(hard))  # fmt: skip


def _cavity() -> AnalyticCavity:
    return cylinder_cavity(2.0 * RADIUS, 0.0, HEIGHT, (FLOOR, CEILING, SIDE))
