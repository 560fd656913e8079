"""How many real collisions a CPU second the simulator plays, scene by scene.

    python benchmarks/events.py [--quick] [--json] [--scenes NAME ...]

Each scene is measured in its steady state, after 0.3 s, in CPU time of the process. The scenes take
turns of one window each, round after round, so that a machine that slows down slows them all.
Figures are medians over the rounds, and ratios are medians of each round's own ratio. Two
yardsticks are measured in the same run on the same meshes and flights: embree's batch of rays
(straight and without thickness, less than our query does), and the paper's own method (every
triangle a plane, faces only). Rows go to benchmarks/results/events.csv with the name of the
machine, except with --quick.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks import embree, paper_method
from benchmarks.scenes import MESHES, PHYSICS, ROOT, mesh, scene
from benchmarks.table import print_table, write_csv
from sim_core import compile_simulator
from sim_core.detect.ball_mesh import first_contact
from sim_core.effects.gravity import gravity_acceleration
from sim_core.loop.simulate import Simulation
from sim_core.motion import state_under
from sim_core.numerics.jit import jit
from sim_core.numerics.vec3 import Flight

STEADY = 0.3  # s
FLIGHT = 0.01  # s: the length of arc that the wall queries search
TARGET = 0.4  # CPU s a window
ROUNDS = 9
# Each thread plays so many seconds, a third of a CPU second. With shorter work the
# measurement would show the cost of handing it out.
SPAN = 8.0


def steady(name: str, seed: int = 1) -> Simulation:
    """The scene, played to its steady state."""
    run = Simulation(scene(name, seed=seed))
    advance(run, STEADY)
    return run


def advance(run: Simulation, seconds: float) -> tuple[int, float]:
    """Collisions and CPU seconds of so many simulated seconds, nothing recorded."""
    before, start = int(run.state.counts[:3].sum()), time.process_time()
    run.advance_to(run.time + seconds)
    return int(run.state.counts[:3].sum()) - before, time.process_time() - start


def rate(run: Simulation, windows: int) -> list[float]:
    """Collisions a CPU second in each window."""
    _, spent = advance(run, 0.01)
    piece = 0.01 * TARGET / max(spent, 1e-6)
    return [
        collisions / spent for collisions, spent in (advance(run, piece) for _ in range(windows))
    ]


@jit
def _queries(tree, scratch, motion, gravity, wave, overlap, time, length, repeats):  # type: ignore[no-untyped-def]
    total, acceleration = 0.0, gravity_acceleration(gravity)
    for _ in range(repeats):
        for ball in range(len(motion)):
            here = state_under(motion, ball, time, acceleration)
            flight = Flight(here.position, here.velocity, acceleration)
            delay, obstacle = first_contact(
                None, None, None, -1, tree, scratch, flight, wave, None, None, overlap, time, length
            )
            if obstacle >= 0:
                total += delay
    return total


def query_ns(run: Simulation, repeats: int = 50) -> float:
    """Our wall query [ns]: first contact of every ball along its next FLIGHT, walls held still."""
    arguments = (
        run.state.obstacles.tree,
        run.state.scratch,
        run.state.motion,
        run.state.gravity,
        run.state.wave,
        run.state.obstacles.face_overlap,
        run.state.clock.now[0],
        FLIGHT,
    )
    _queries(*arguments, 1)
    start = time.process_time()
    _queries(*arguments, repeats)
    return (time.process_time() - start) / (repeats * len(run.state.motion)) * 1e9


def flights(run: Simulation) -> tuple[np.ndarray, np.ndarray]:
    """Positions [m] and velocities [m/s] of the balls now, (n, 3) each."""
    pull = gravity_acceleration(run.state.gravity)
    points = [
        state_under(run.state.motion, i, run.state.clock.now[0], pull)
        for i in range(len(run.state.motion))
    ]
    return np.array([p.position for p in points]) + run.centre, np.array(
        [p.velocity for p in points]
    )


def ray_ns(rays: Any, run: Simulation, repeats: int = 50) -> float:
    """One of embree's rays [ns], from the same places in the same directions as our wall query."""
    position, velocity = (np.tile(array, (repeats, 1)).astype(np.float32) for array in flights(run))
    start = time.process_time()
    embree.ask(rays, position, velocity)
    return (time.process_time() - start) / len(position) * 1e9


def two_threads(name: str) -> float:
    """How much more two threads do than one, on independent replicas, by the clock on the wall."""
    runs = [steady(name, seed) for seed in (1, 2)]
    ratios = []
    for _ in range(7):
        start = time.perf_counter()
        for run in runs:
            advance(run, SPAN)
        alone = time.perf_counter() - start
        with ThreadPoolExecutor(2) as pool:
            start = time.perf_counter()
            list(pool.map(lambda run: advance(run, SPAN), runs))
            ratios.append(alone / (time.perf_counter() - start))
    return statistics.median(ratios)


class Contestant:
    """A scene in its steady state, and what was measured of it, a round an entry."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.run = steady(name)
        self.embree = embree.build(mesh(name).corners)
        self.triangles = len(mesh(name).triangles)
        _, spent = advance(self.run, 0.01)
        self.piece = 0.01 * TARGET / max(spent, 1e-6)
        self.rates: list[float] = []
        self.queries: list[float] = []
        self.rays: list[float] = []

    def play(self) -> None:
        """One round."""
        collisions, spent = advance(self.run, self.piece)
        self.rates.append(collisions / spent)
        repeats = max(1, 10_000 // len(self.run.state.motion))
        self.queries.append(query_ns(self.run, repeats))
        if self.embree is not None:
            self.rays.append(ray_ns(self.embree, self.run, repeats))

    def row(self) -> dict[str, Any]:
        """One row of the table."""
        run = self.run
        balls = len(run.state.motion)
        shares = run.state.counts / run.state.counts[:3].sum()
        walls = [*run.state.obstacles.tree[:-1], *run.state.obstacles.lookup]
        records = (run.state.queue, run.state.queue.meetings, run.state.neighbours)
        columns = [
            run.state.motion,
            *(a for record in records for a in record if isinstance(a, np.ndarray)),
        ]
        return {
            "scene": self.name,
            "balls": balls,
            "triangles": self.triangles,
            "collisions_per_cpu_s": round(statistics.median(self.rates)),
            "best": round(max(self.rates)),
            "worst": round(min(self.rates)),
            "searches_per_collision": round(float(shares[3]), 2),
            "wall_query_ns": round(statistics.median(self.queries)),
            "embree_ns": round(statistics.median(self.rays)) if self.rays else None,
            "bytes_per_triangle": round(sum(a.nbytes for a in walls) / self.triangles),
            "bytes_per_ball": round(sum(a.nbytes for a in columns) / balls),
        }


def ratios(by_name: dict[str, Contestant]) -> dict[str, Any]:
    """The yardsticks, from what was measured."""
    answer: dict[str, Any] = {"scene": "ratios"}
    small, middle, large = (by_name.get(f"cylinder-200-{size}") for size in ("1k", "10k", "100k"))
    if small and large:
        growth = [one / other for one, other in zip(small.rates, large.rates, strict=True)]
        answer["growth_1k_100k"] = round(statistics.median(growth), 2)
    queries = [q / r for c in by_name.values() for q, r in zip(c.queries, c.rays, strict=False)]
    answer["embree"] = round(statistics.median(queries), 2) if queries else None
    if middle:
        paper = paper_method.query_ns(mesh(middle.name), *flights(middle.run))
        answer["paper_method_10k"] = round(paper / query_ns(middle.run))
        answer["threads_2"] = round(two_threads(middle.name), 2)
    return answer


def compile_seconds() -> dict[str, float]:
    """Seconds until the simulator is ready.

    The first figure is for a machine that has never run it, the other for every later time.
    """
    code = (
        "from benchmarks.scenes import PHYSICS as p; from sim_core import compile_simulator as c; "
        "print(c(p))"
    )
    with tempfile.TemporaryDirectory() as folder:
        setting = {**os.environ, "NUMBA_CACHE_DIR": folder}
        spent = [
            float(
                subprocess.run(
                    [sys.executable, "-c", code],
                    env=setting,
                    cwd=ROOT,
                    capture_output=True,
                    text=True,
                    check=True,
                ).stdout
            )
            for _ in range(2)
        ]
    return {"compile_first_s": round(spent[0], 1), "compile_later_s": round(spent[1], 2)}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--quick", action="store_true", help="three rounds of short windows, within a minute"
    )
    parser.add_argument("--json", action="store_true", help="rows as JSON on stdout")
    parser.add_argument("--scenes", nargs="*", choices=list(MESHES), help="only these")
    options = parser.parse_args()
    compile_simulator(PHYSICS)
    contestants = [Contestant(name) for name in options.scenes or MESHES]
    for _ in range(3 if options.quick else ROUNDS):
        for contestant in contestants:
            contestant.play()
    rows = [contestant.row() for contestant in contestants]
    last = ratios({contestant.name: contestant for contestant in contestants})
    if not options.quick:
        last |= compile_seconds()
    if options.json:
        print(json.dumps([*rows, last], indent=1))
    else:
        print_table(rows)
        print(" ".join(f"{name} {value}" for name, value in last.items()))
    if not options.quick:
        write_csv("events.csv", rows)


if __name__ == "__main__":
    main()
