"""Patterns of a shaken layer, seen from above: stripes at half the frequency of the shaking.

C. Bizon, M. D. Shattuck, J. B. Swift, W. D. McCormick & H. L. Swinney, Phys. Rev. Lett. 80 (1998)
57, with their law of restitution and without friction. Their wavelengths follow λ/H = 1 + 1.1
f*^(-1.32), H being the depth of the layer.
"""

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np

from benchmarks.cases.row import Row, mean_and_half_width
from sim_core import simulate
from tests.helpers.scenes.layer import DEPTH, DIAMETER, bizon_restitution, shaken_layer

GAMMA, F_STAR = 3.0, 0.44
CELL = 1.0  # D, of the grid on which heights are averaged
LAST = 12  # cycles that are looked at
STRIKE = 0.25  # of a period, at which the pattern is high


def heights(count: int, cycles: int) -> np.ndarray:
    """Mean height of the balls over each cell, in D, at the same phase of the last cycles.

    (LAST, k, k)
    """
    scene = shaken_layer(count, GAMMA, F_STAR, cycles, law=bizon_restitution(0.7))
    period = scene.duration / cycles
    times = period * (np.arange(cycles - LAST, cycles) + STRIKE)
    places = simulate(scene, times).frames.positions / DIAMETER
    side = float(np.ptp(scene.mesh.vertices[:, 0])) / DIAMETER
    edges = np.linspace(0.0, side, round(side / CELL) + 1)
    maps = []
    for place in places:
        x, y, z = place.T
        number = np.histogram2d(x, y, (edges, edges))[0]
        maps.append(np.histogram2d(x, y, (edges, edges), weights=z)[0] / np.maximum(number, 1.0))
    return np.array(maps)


def wavelength(height: np.ndarray) -> float:
    """λ [D] of the strongest wave: the mean wave number of the power about its peak."""
    wave = height - height.mean()
    window = np.outer(np.hanning(len(wave)), np.hanning(len(wave)))
    size = 4 * len(wave)
    power = np.abs(np.fft.fftshift(np.fft.fft2(wave * window, (size, size)))) ** 2
    number = np.fft.fftshift(np.fft.fftfreq(size, CELL))
    k = np.hypot(*np.meshgrid(number, number, indexing="ij"))
    bins = np.arange(0.5, 40.5) / size * 2.0
    radial = np.histogram(k, bins, weights=power)[0]
    peak = int(np.argmax(radial[1:])) + 1
    near = slice(max(1, peak - 3), peak + 4)
    middle = 0.5 * (bins[1:] + bins[:-1])
    return float(radial[near].sum() / (radial[near] @ middle[near]))


def rows(count: int, cycles: int) -> Iterator[Row]:
    maps = heights(count, cycles)
    waves = maps - maps.mean(axis=(1, 2), keepdims=True)
    after = [float((one * two).sum() / np.sqrt((one**2).sum() * (two**2).sum()))
             for one, two in pairwise(waves)]  # fmt: skip
    conditions = f"Γ = {GAMMA}, f* = {F_STAR}, {count:,} balls, {cycles} cycles"
    yield Row("shaken layer", conditions, "correlation with the next cycle", -1.0, 0.2,
              *mean_and_half_width(np.array(after)))  # fmt: skip
    expected = DEPTH / DIAMETER * (1.0 + 1.1 * F_STAR**-1.32)
    found = np.array([wavelength(one) for one in maps])
    yield Row("shaken layer", conditions, "wavelength, diameters", expected, 0.1 * expected,
              *mean_and_half_width(found))  # fmt: skip


def picture(path: Path, count: int, cycles: int) -> None:
    """The layer from above in two cycles that follow each other."""
    import matplotlib.pyplot as plt

    maps = heights(count, cycles)
    figure, both = plt.subplots(1, 2, figsize=(9, 4.4), layout="constrained")
    for axes, one, name in zip(both, maps[-2:], (cycles - 1, cycles), strict=True):
        side = len(one) * CELL
        shown = axes.imshow(one.T, origin="lower", extent=(0, side, 0, side), cmap="gray")
        axes.set(title=f"cycle {name}", xlabel="diameters")
    figure.colorbar(shown, ax=both, label="mean height, diameters")
    figure.savefig(path, dpi=110)
    plt.close(figure)
