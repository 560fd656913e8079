"""Patterns of a shaken layer, seen from above: stripes at half the frequency of the shaking.

C. Bizon, M. D. Shattuck, J. B. Swift, W. D. McCormick & H. L. Swinney, Phys. Rev. Lett. 80 (1998)
57, with their law of restitution and without friction. Their wavelengths follow λ/H = 1 + 1.1
f*^(-1.32), H being the depth of the layer.
"""

from collections.abc import Iterator
from functools import lru_cache
from itertools import pairwise
from pathlib import Path

import numpy as np

from benchmarks.cases.row import Row, mean_and_half_width
from sim_core import simulate
from tests.helpers.scenes.layer import DEPTH, DIAMETER, bizon_restitution, shaken_layer

GAMMA, F_STAR = 3.0, 0.44
BALLS, CYCLES = 60_000, 60
CELL = 1.0  # D, of the grid on which heights are averaged
LAST = 12  # cycles that are looked at
STRIKE = 0.25  # of a period, at which the pattern is high
BAND = 0.5  # of the wave number, to either side
ANTIPHASE = 0.2  # a pattern that changes places wholly has -1, one that stays +1, chance 0
FIT = 0.05  # of the experiment's wavelengths about their fit, read from its figure


@lru_cache
def heights() -> np.ndarray:
    """Mean height of the balls over each cell, in D, at the same phase of the last cycles.

    (LAST, k, k)
    """
    scene = shaken_layer(BALLS, GAMMA, F_STAR, CYCLES, law=bizon_restitution(0.7), sides=False)
    period = scene.duration / CYCLES
    times = period * (np.arange(CYCLES - LAST, CYCLES) + STRIKE)
    places = simulate(scene, times).frames.positions / DIAMETER
    side = float(np.ptp(scene.mesh.bounds[:, 0])) / DIAMETER
    edges = np.linspace(0.0, side, round(side / CELL) + 1)
    maps = []
    for place in places:
        x, y, z = place.T
        number = np.histogram2d(x, y, (edges, edges))[0]
        maps.append(np.histogram2d(x, y, (edges, edges), weights=z)[0] / np.maximum(number, 1.0))
    return np.array(maps)


def pattern(height: np.ndarray) -> tuple[float, np.ndarray]:
    """λ [D] of the strongest wave, and the pattern of waves about as long, of the same shape.

    λ is that of the mean wave number of their power. The box is periodic, and so are its waves.
    """
    waves = np.fft.fft2(height - height.mean())
    number = np.fft.fftfreq(len(height), CELL)
    k = np.hypot(*np.meshgrid(number, number, indexing="ij"))
    power = np.abs(waves) ** 2
    near = np.abs(k - k.ravel()[np.argmax(power)]) < BAND * k.ravel()[np.argmax(power)]
    length = float(power[near].sum() / (power[near] @ k[near]))
    return length, np.fft.ifft2(np.where(near, waves, 0.0)).real


def rows() -> Iterator[Row]:
    lengths, patterns = zip(*map(pattern, heights()), strict=True)
    after = [float((one * two).sum() / np.sqrt((one**2).sum() * (two**2).sum()))
             for one, two in pairwise(patterns)]  # fmt: skip
    conditions = f"Γ = {GAMMA}, f* = {F_STAR}, {BALLS:,} balls, {CYCLES} cycles"
    yield Row("shaken layer", conditions, "correlation with the next cycle", -1.0,
              ANTIPHASE, *mean_and_half_width(np.array(after)))  # fmt: skip
    expected = DEPTH / DIAMETER * (1.0 + 1.1 * F_STAR**-1.32)
    yield Row("shaken layer", conditions, "wavelength, diameters", expected, FIT * expected,
              *mean_and_half_width(np.array(lengths)))  # fmt: skip


def picture(path: Path) -> None:
    """The layer from above in two cycles that follow each other."""
    import matplotlib.pyplot as plt

    maps = heights()
    figure, both = plt.subplots(1, 2, figsize=(9, 4.4), layout="constrained")
    for axes, one, cycle in zip(both, maps[-2:], (CYCLES - 1, CYCLES), strict=True):
        side = len(one) * CELL
        shown = axes.imshow(one.T, origin="lower", extent=(0, side, 0, side), cmap="gray")
        axes.set(title=f"cycle {cycle}", xlabel="diameters")
    figure.colorbar(shown, ax=both, label="mean height, diameters")
    figure.savefig(path, dpi=110)
    plt.close(figure)
