"""How much faster is shot without friction, and does it matter which friction and which faces?

    python benchmarks/friction.py [--csv FILE]

Steel balls of 3 mm in an exact cylinder of 35 mm radius and 40 mm height, over a sonotrode of 25 µm
at 20 kHz, e = 0.91 at all speeds: without friction, with several of Walton's mu and beta0, and with
faces of several rms slopes. Figures are means over 3 s in steady state with 95 % intervals from 8
seeds. An upright impact moves less than a thousandth as fast along the lid as towards it.
"""

import argparse
import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from benchmarks.cases.peening_cylinder import chamber, constant
from benchmarks.table import print_table, write_csv
from chamberopt.common.estimate import Estimate, estimate
from sim_core import Roughness, simulate

PIECE = 0.05  # s: the mean square speed is that at the ends of such pieces; whole periods
WARMUP, PIECES, SEEDS = 10, 60, 8
COUNTS = (200, 30, 15)
FRICTIONS = (  # mu and beta0
    None, (0.05, 0.0), (0.1, 0.0), (0.2, -0.5), (0.2, 0.0), (0.2, 0.4), (0.3, 0.2), (0.5, 0.0),
)  # fmt: skip
SLOPES = (1.0, 3.0, 5.0)  # degrees, with each of the following frictions
ROUGH = (None, (0.2, 0.0))
UPRIGHT = 1e-3


class Figures(NamedTuple):
    """Of one seed, in steady state."""

    rms_speed: float  # of the balls [m/s]
    impacts: float  # on the lid [1/s]
    normal_speed: float  # mean, of those [m/s]
    upright: float  # share of those [%]


def figures(count: int, friction: tuple[float, float] | None, degrees: float, seed: int) -> Figures:
    """Simulate so many balls between faces of a slope piece by piece."""
    scene = chamber(count, constant(0.91), PIECE, seed, friction)
    slope = math.tan(math.radians(degrees))
    squares, speeds, upright = [], [], []
    for piece in range(WARMUP + PIECES):
        if degrees:  # each piece with draws of its own
            rough = Roughness((slope,) * 3, seed * (WARMUP + PIECES) + piece)
            scene = replace(scene, physics=scene.physics._replace(roughness=rough))
        result = simulate(scene)
        balls = result.balls
        scene = replace(scene, balls=balls)
        if piece >= WARMUP:
            squares.append(float((balls.velocities**2).sum(axis=1).mean()))
            velocity = result.impacts.velocity
            speeds.append(result.impacts.normal_speed)
            along = np.hypot(velocity[:, 0], velocity[:, 1])
            upright.append(along < UPRIGHT * np.abs(velocity[:, 2]))
    together = np.concatenate(speeds)
    rate = len(together) / (PIECES * PIECE)
    share = 100.0 * float(np.concatenate(upright).mean())
    return Figures(math.sqrt(np.mean(squares)), rate, float(together.mean()), share)


def _text(one: Estimate) -> str:
    if one.half_width == 0.0:
        return f"{one.value:g}"
    digits = max(0, 1 - math.floor(math.log10(one.half_width)))
    return f"{one.value:.{digits}f} ± {one.half_width:.{digits}f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--csv", help="name of a file in benchmarks/results")
    arguments = parser.parse_args()
    rows: list[dict[str, Any]] = []
    for count in COUNTS:
        rough = [(friction, degrees) for friction in ROUGH for degrees in SLOPES]
        for friction, degrees in [*((one, 0.0) for one in FRICTIONS), *rough]:
            found = [figures(count, friction, degrees, seed) for seed in range(SEEDS)]
            columns = zip(Figures._fields, zip(*found, strict=True), strict=True)
            mu, beta0 = friction or ("none", "")
            means = {name: _text(estimate(values)) for name, values in columns}
            rows.append({"balls": count, "mu": mu, "beta0": beta0, "slope_deg": degrees, **means})
    print_table(rows)
    if arguments.csv:
        write_csv(arguments.csv, rows)


if __name__ == "__main__":
    main()
