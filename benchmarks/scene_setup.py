"""What it costs to set up a scene, and to place the balls, before anything is simulated.

    python benchmarks/scene_setup.py [--csv FILE]

Medians of five, CPU seconds. "first": a mesh that was not seen before; "again": another replica on
the same mesh. Set-up is a simulation of a microsecond, with all checks before and after it.
"""

import argparse
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.scenes import DIAMETER, PHYSICS, cylinder
from benchmarks.table import print_table, write_csv
from sim_core import Balls, Scene, pack_balls, simulate

ROUNDS = 5
BALLS = 200


def cpu_seconds(call: Callable[[], Any]) -> float:
    began = time.process_time()
    call()
    return time.process_time() - began


def setup_rows() -> Iterator[dict[str, Any]]:
    """Set-up of 200 balls in cylinders of more and more triangles."""
    rng = np.random.default_rng(1)
    for triangles in (1_000, 10_000, 100_000, 1_000_000):
        first, again = [], []
        for _ in range(ROUNDS):
            mesh = cylinder(35e-3, 40e-3, triangles)
            place = pack_balls(mesh, BALLS, DIAMETER, rng, clear=50e-6)
            balls = Balls(place, rng.normal(0.0, 2.0, place.shape), DIAMETER, 7800.0)

            def run(mesh: Any = mesh, balls: Balls = balls) -> None:
                simulate(Scene(mesh, balls, PHYSICS, duration=1e-6, record=(0,)))

            mesh = replace(mesh)  # nothing is known of it
            first.append(cpu_seconds(lambda run=run, mesh=mesh: run(mesh)))  # type: ignore[misc]
            again.append(cpu_seconds(lambda run=run, mesh=mesh: run(mesh)))  # type: ignore[misc]
        yield {
            "triangles": len(mesh.triangles),
            "first_s": float(np.median(first[1:])),  # the very first may compile
            "again_s": float(np.median(again)),
        }


def packing_rows() -> Iterator[dict[str, Any]]:
    """Random places for balls that fill a seventh of a cylinder of 10,000 triangles."""
    for count in (200, 2_000, 9_600, 100_000):
        size = (count / 200.0) ** (1.0 / 3.0)
        mesh = cylinder(20e-3 * size, 25e-3 * size, 10_000)
        seconds = [
            cpu_seconds(lambda: pack_balls(mesh, count, DIAMETER, np.random.default_rng(2)))  # noqa: B023
            for _ in range(ROUNDS)
        ]
        yield {"balls": count, "seconds": float(np.median(seconds))}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--csv", help="name of a file in benchmarks/results")
    arguments = parser.parse_args()
    rows = list(setup_rows())
    print_table(rows)
    print_table(list(packing_rows()))
    if arguments.csv:
        write_csv(arguments.csv, rows)


if __name__ == "__main__":
    main()
