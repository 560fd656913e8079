"""Patterns of a shaken layer, seen from above: stripes at half the frequency of the shaking.

C. Bizon, M. D. Shattuck, J. B. Swift, W. D. McCormick & H. L. Swinney, Phys. Rev. Lett. 80 (1998)
57, with their law of restitution, without friction and with theirs. Their wavelengths follow λ/H =
1 + 1.1 f*^(-1.32), H being the depth of the layer.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from pathlib import Path

import numpy as np

from benchmarks.cases.row import Row, mean_and_half_width
from sim_core import Friction, simulate
from tests.helpers.scenes.layer import DEPTH, DIAMETER, PER_AREA, bizon_restitution, shaken_layer

GAMMA, F_STAR, CYCLES = 3.0, 0.44, 60
# D, length and width of the periodic floor: one to be looked at, and one that is measured, in which
# stripes lie across and may be as long as 161/6, 161/7, 161/8, 161/9 ...
SQUARE, STRIP = (100.0, 100.0), (161.0, 10.0)
RUBBING = (0.5, 0.35)  # mu and beta0
# One start is known to half of the step to the strip's next wavelength, and says nothing of others.
STARTS = {None: 5, RUBBING: 1}
CELL = 1.0  # D, about, of the grid on which heights are averaged
LAST = 12  # cycles that are looked at
STRIKE = 0.25  # of a period, at which the pattern is high
BAND = 0.5  # of the wave number, to either side
ANTIPHASE = 0.2  # a pattern that changes places wholly has -1, one that stays +1, chance 0
FIT = 0.05  # of the experiment's wavelengths about their fit, read from its figure


@lru_cache
def heights(
    floor: tuple[float, float], friction: tuple[float, float] | None = None, seed: int | None = None
) -> np.ndarray:
    """Mean height of the balls over each cell, in D, at the same phase of the last cycles.

    (LAST, kx, ky); the mean of all where no ball is.
    """
    count = round(PER_AREA * floor[0] * floor[1])
    law = bizon_restitution(0.7)
    scene = shaken_layer(count, GAMMA, F_STAR, CYCLES, law=law, width=floor[1] * DIAMETER)
    if seed is not None:
        start = scene.balls.velocities
        velocities = np.random.default_rng(seed).normal(0.0, start.std(), start.shape)
        scene = replace(scene, balls=replace(scene.balls, velocities=velocities))
    if friction is not None:
        rubbing = Friction((friction,) * 3, friction)
        scene = replace(scene, physics=scene.physics._replace(friction=rubbing))
    period = scene.duration / CYCLES
    times = period * (np.arange(CYCLES - LAST, CYCLES) + STRIKE)
    maps = []
    for place in simulate(scene, times).frames.positions / DIAMETER:
        x, y, z = place.T
        edges = [np.linspace(0.0, side, round(side / CELL) + 1) for side in floor]
        number = np.histogram2d(x, y, edges)[0]
        total = np.histogram2d(x, y, edges, weights=z)[0]
        maps.append(np.where(number > 0.0, total / np.maximum(number, 1.0), z.mean()))
    return np.array(maps)


def pattern(height: np.ndarray, floor: tuple[float, float]) -> tuple[float, np.ndarray]:
    """λ [D] of the strongest wave, and the pattern of waves about as long, of the same shape.

    λ is that of the mean wave number of their power. The box is periodic, and so are its waves.
    """
    waves = np.fft.fft2(height - height.mean())
    numbers = (np.fft.fftfreq(n, side / n) for n, side in zip(height.shape, floor, strict=True))
    k = np.hypot(*np.meshgrid(*numbers, indexing="ij"))
    power = np.abs(waves) ** 2
    near = np.abs(k - k.ravel()[np.argmax(power)]) < BAND * k.ravel()[np.argmax(power)]
    length = float(power[near].sum() / (power[near] @ k[near]))
    return length, np.fft.ifft2(np.where(near, waves, 0.0)).real


def figures(
    floor: tuple[float, float], friction: tuple[float, float] | None, seed: int
) -> tuple[float, float]:
    """Correlation of the pattern with that of the next cycle, and λ [D], means of a start."""
    maps = heights(floor, friction, seed)
    lengths, patterns = zip(*(pattern(one, floor) for one in maps), strict=True)
    after = [(one * two).sum() / np.sqrt((one**2).sum() * (two**2).sum())
             for one, two in pairwise(patterns)]  # fmt: skip
    return float(np.mean(after)), float(np.mean(lengths))


def rows() -> Iterator[Row]:
    expected = DEPTH / DIAMETER * (1.0 + 1.1 * F_STAR**-1.32)
    for friction, starts in STARTS.items():
        after, lengths = np.array([figures(STRIP, friction, seed) for seed in range(starts)]).T
        name = f"friction {friction[0]}, beta0 {friction[1]}" if friction else "no friction"
        name += f", starts: {starts}"
        length = float(lengths[0]), 0.5 * float(lengths[0]) ** 2 / STRIP[0]
        if starts > 1:
            yield Row("shaken layer", name, "correlation with the next cycle",
                      -1.0, ANTIPHASE, *mean_and_half_width(after))  # fmt: skip
            length = mean_and_half_width(lengths)
        yield Row("shaken layer", name, "wavelength, diameters", expected,
                  FIT * expected, *length)  # fmt: skip


def picture(path: Path) -> None:
    """A square layer from above in two cycles that follow each other."""
    import matplotlib.pyplot as plt

    maps = heights(SQUARE)
    figure, both = plt.subplots(1, 2, figsize=(9, 4.4), layout="constrained")
    for axes, one, cycle in zip(both, maps[-2:], (CYCLES - 1, CYCLES), strict=True):
        shown = axes.imshow(one.T, origin="lower", extent=(0, SQUARE[0]) * 2, cmap="gray")
        axes.set(title=f"cycle {cycle}", xlabel="diameters")
    figure.colorbar(shown, ax=both, label="mean height, diameters")
    figure.savefig(path, dpi=110)
    plt.close(figure)
