"""How many dents does peening strength take? Even surfaces with known strength and saturation time.

    python benchmarks/strength_resolution.py [--seeds N]

Dents fall at random into windows in eight batches. Their strengths follow from normal speeds v by
the restitution of a strip, e = 0.91 (v / v0)^(-1/4), as sqrt(1 - e²) v. A row gives the step of
the mean from half of the dents to all over the mean, which decides whether the program shows the
figures, and for mean strength, its percentiles, saturation time and evenness the mean of the figure
over the true one and the share of the 95 % intervals that held. Intervals are shown here whether
the program would show them or not. Rows go to benchmarks/results/strength_resolution.csv; it takes
two minutes.
"""

import argparse
import math
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.table import print_table, write_csv
from chamberopt.coverage import strength_intervals
from chamberopt.coverage.field.surface_points import Reach
from chamberopt.coverage.strength import LEVELS, levels, saturated_strength
from chamberopt.coverage.strength_intervals import MAX_STEP, StrengthHistograms, estimates_of

WINDOWS, BATCHES, V0 = 300, 8, 1.25
AREA = 0.01  # of a dent of strength 1, over the window's
DENTS = 10, 15, 25, 60, 150, 400, 1000, 4000
SPEEDS = {
    "nearly one speed": lambda rng, n: rng.normal(4.0, 1.0, n),
    "Rayleigh, mean 3.8 m/s": lambda rng, n: rng.rayleigh(3.0, n),
    "half a normal law above v0": lambda rng, n: V0 + np.abs(rng.normal(0.0, 1.5, n)),
    "exponential above v0": lambda rng, n: V0 + rng.exponential(0.35, n),
}


def strengths(kind: str, rng: np.random.Generator, count: int) -> np.ndarray:
    speed = np.maximum(SPEEDS[kind](rng, count), 1.01 * V0)
    e = 0.91 * (speed / V0) ** -0.25
    return np.sqrt(1.0 - e * e) * speed


def rows(seeds: int) -> Iterator[dict[str, Any]]:
    for kind in SPEEDS:
        many = strengths(kind, np.random.default_rng(0), 2_000_000)
        highest, whole = float(many.max()), np.zeros((1, LEVELS))
        np.add.at(whole[0], levels(many, highest), AREA * many / len(many))
        strength, time = (float(one[0]) for one in saturated_strength(whole, highest))
        for dents in DENTS:
            found = [known(kind, dents, highest, seed) for seed in range(1, seeds + 1)]
            truth = dict.fromkeys(
                ("strength_um", "strength_p05_um", "strength_p95_um"), 1e6 * strength
            )
            truth |= {"saturation_time_s": time / dents * BATCHES, "intensity_uniformity": 1.0}
            step = np.array([one["strength_um"].bias / one["strength_um"].value for one in found])
            row = {"speeds": kind, "dents": dents, "step": float(np.median(step)),
                   "shown": float(np.mean(step <= MAX_STEP))}  # fmt: skip
            for name, true in truth.items():
                ratio = np.mean([one[name].value for one in found]) / true
                held = np.mean([abs(one[name].value - true) <= one[name].half_width
                                for one in found])  # fmt: skip
                row |= {name: float(ratio), f"{name}_held": float(held)}
            yield row


def known(kind: str, dents: int, highest: float, seed: int) -> dict[str, Any]:
    """Figures from so many dents a window, all batches together."""
    rng = np.random.default_rng(seed)
    counts = rng.poisson(dents / BATCHES, BATCHES * WINDOWS)
    s = strengths(kind, rng, int(counts.sum()))
    parts = np.zeros((BATCHES * WINDOWS, LEVELS))
    np.add.at(parts, (np.repeat(np.arange(len(counts)), counts), levels(s, highest)), AREA * s)
    histograms = parts.reshape(BATCHES, WINDOWS, LEVELS)
    return estimates_of(StrengthHistograms(histograms, np.ones(BATCHES), highest), Reach(1.0))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=40)
    asked = parser.parse_args()
    strength_intervals.MAX_STEP = math.inf  # to see what is not shown
    found = list(rows(asked.seeds))
    print_table(found)
    print(f"written to {write_csv('strength_resolution.csv', found)}")


if __name__ == "__main__":
    main()
