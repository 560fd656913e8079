"""How many collisions a CPU second a dense layer on a shaken floor makes, cycle by cycle.

    python benchmarks/dense_layer.py [--balls N] [--cycles N]

Balls of 1 mm, 5.4 diameters deep, at the Γ and f* of experiments (tests/helpers/scenes/layer.py);
restitution 0.7, elastic below 10 mm/s.
"""

import argparse
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from sim_core import compile_simulator
from sim_core.loop.simulate import Simulation
from tests.helpers.scenes.layer import shaken_layer

DRIVES = ((2.0, 0.27), (4.6, 0.27), (3.0, 0.44))  # Γ and f*


def played(balls: int, gamma: float, f_star: float, cycles: int) -> tuple[int, float]:
    """Collisions of so many cycles, and their CPU seconds."""
    scene = shaken_layer(balls, gamma, f_star, cycles)
    compile_simulator(scene.physics, balls)
    run = Simulation(scene)
    start = time.process_time()
    run.play(scene.duration, record=False)
    return int(run.state.counts[:3].sum()), time.process_time() - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--balls", type=int, default=9_600)
    parser.add_argument("--cycles", type=int, default=5)
    options = parser.parse_args()
    print("Γ | f* | collisions a cycle | M collisions / CPU s | CPU s for 200 cycles")
    for gamma, f_star in DRIVES:
        collisions, spent = played(options.balls, gamma, f_star, options.cycles)
        print(
            f"{gamma} | {f_star} | {collisions / options.cycles:.3g} | "
            f"{collisions / spent / 1e6:.2f} | {200 * spent / options.cycles:.0f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
