"""How much faster is shot without friction, and does it matter which friction it is?

    python benchmarks/friction.py [--csv FILE]

Steel balls of 3 mm in an exact cylinder of 35 mm radius and 40 mm height, over a sonotrode of 25 µm
at 20 kHz, e = 0.91 at all speeds: once without friction, and with several of Walton's mu and beta0.
Figures are means over 3 s in steady state with 95 % intervals from 8 seeds.
"""

import argparse
import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from benchmarks.cases.peening_cylinder import chamber, constant
from benchmarks.table import print_table, write_csv
from chamberopt.common.estimate import Estimate, estimate
from sim_core import simulate

PIECE = 0.05  # s: the mean square speed is that at the ends of such pieces; whole periods
WARMUP, PIECES, SEEDS = 10, 60, 8
COUNTS = (200, 30)
FRICTIONS = (  # mu and beta0
    None, (0.05, 0.0), (0.1, 0.0), (0.2, -0.5), (0.2, 0.0), (0.2, 0.4), (0.3, 0.2), (0.5, 0.0),
)  # fmt: skip


class Figures(NamedTuple):
    """Of one seed, in steady state."""

    rms_speed: float  # of the balls [m/s]
    impacts: float  # on the lid [1/s]
    normal_speed: float  # mean, of those [m/s]


def figures(count: int, friction: tuple[float, float] | None, seed: int) -> Figures:
    """Simulate so many balls piece by piece."""
    scene = chamber(count, constant(0.91), PIECE, seed, friction)
    squares, speeds = [], []
    for piece in range(WARMUP + PIECES):
        result = simulate(scene)
        balls = result.balls
        scene = replace(scene, balls=balls)
        if piece >= WARMUP:
            squares.append(float((balls.velocities**2).sum(axis=1).mean()))
            speeds.append(result.impacts.normal_speed)
    together = np.concatenate(speeds)
    rate = len(together) / (PIECES * PIECE)
    return Figures(math.sqrt(np.mean(squares)), rate, float(together.mean()))


def _text(one: Estimate) -> str:
    digits = max(0, 1 - math.floor(math.log10(one.half_width)))
    return f"{one.value:.{digits}f} ± {one.half_width:.{digits}f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--csv", help="name of a file in benchmarks/results")
    arguments = parser.parse_args()
    rows: list[dict[str, Any]] = []
    for count in COUNTS:
        for friction in FRICTIONS:
            found = [figures(count, friction, seed) for seed in range(SEEDS)]
            columns = zip(Figures._fields, zip(*found, strict=True), strict=True)
            mu, beta0 = friction or ("none", "")
            means = {name: _text(estimate(values)) for name, values in columns}
            rows.append({"balls": count, "mu": mu, "beta0": beta0, **means})
    print_table(rows)
    if arguments.csv:
        write_csv(arguments.csv, rows)


if __name__ == "__main__":
    main()
