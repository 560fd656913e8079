"""What periodic sides cost: an elastic gas in a cube with walls and in one without side walls.

    python benchmarks/periodic_box.py

Millions of collisions of balls with one another a CPU second, which both have in common; hits on
walls take time too, but are not counted. The better of two turns.
"""

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from sim_core import AnalyticCavity, Balls, Physics, Scene, periodic_box, prism_cavity
from sim_core.loop.simulate import Simulation
from sim_core.loop.state import BALLS

DIAMETER = 1e-3  # m
COUNTS = (216, 1000, 8000)
PACKINGS = (0.02, 0.2, 0.4)
TARGET = 0.5  # CPU s a turn


def rate(room: AnalyticCavity, balls: Balls) -> float:
    """Collisions of balls a CPU second once the lattice has melted."""
    run = Simulation(Scene(room, balls, Physics(), 1e3, record=()))
    step, best, turns = 1e-3, 0.0, -1  # the first turn long enough is not counted
    while turns < 2:
        before, start = int(run.state.counts[BALLS]), time.process_time()
        run.advance_to(run.time + step)
        spent = time.process_time() - start
        if spent < TARGET:
            step *= 2.0
            continue
        turns += 1
        if turns > 0:
            best = max(best, (int(run.state.counts[BALLS]) - before) / spent)
    return best


def main() -> None:
    print("balls | packing | walls | periodic along x and y")
    for count in COUNTS:
        for packing in PACKINGS:
            side = DIAMETER * (count * np.pi / 6.0 / packing) ** (1.0 / 3.0)
            per_side = round(count ** (1.0 / 3.0))
            line = side * (np.arange(per_side) + 0.5) / per_side
            places = np.stack(np.meshgrid(line, line, line), axis=-1).reshape(-1, 3)
            balls = Balls(places, np.random.default_rng(1).normal(size=places.shape), DIAMETER)
            outline = side * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
            rooms = (
                prism_cavity(outline, 0.0, side, (0, 1, 2)),
                periodic_box((0.0, 0.0, 0.0), (side, side, side), (0, 1)),
            )
            rates = " | ".join(f"{rate(room, balls) / 1e6:.2f}" for room in rooms)
            print(f"{count:,} | {packing} | {rates}", flush=True)


if __name__ == "__main__":
    main()
