"""How cost grows: with triangles, with balls, with replicas, with workers; time and memory.

    python benchmarks/growth.py [--quick] [--kinds KIND ...] [--rounds N] [--draw]

Each point runs in a process of its own, so that its peak memory is its own; all points of a kind
take turns, round after round, and figures are medians. `cpu` columns are CPU seconds, `wall_s` is
by the clock. Rows go to benchmarks/results/growth_KIND.csv with the name of the machine, and the
picture to docs/images/growth.png; --quick leaves out what takes minutes and writes neither, and
--draw draws the rows that are there.

triangles  200 balls in a cylinder. The first set-up of a scene builds the search tree; the next is
           another replica on the same mesh. A set-up is a simulation of a microsecond, with all
           checks before and after it.
balls      as many to each area of the floor, in a cylinder of 40 mm and 10,000 triangles
replicas   one evaluation of designs/gear.toml, with replicas of 0.2 s, on one worker
workers    the same with 32 replicas
"""

import argparse
import json
import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.gas import HEIGHT, PER_BALL
from benchmarks.pictures import IMAGES, growth_picture
from benchmarks.scenes import DIAMETER, PHYSICS, ROOT, cylinder
from benchmarks.table import print_table, read_csv, write_csv
from sim_core import Balls, Scene, TriangleMesh, compile_simulator, pack_balls, simulate
from sim_core.loop.simulate import Simulation

ROUNDS = 3
STEADY = 0.1  # s, after which the balls fill the chamber
WINDOW = 1.0  # CPU s in which collisions are counted
QUICK = 10_000  # no larger scene


def triangles(count: int) -> dict[str, Any]:
    """200 balls in a cylinder of about so many triangles."""
    mesh = cylinder(0.035, HEIGHT, count)
    cost = {"triangles": len(mesh.triangles), **simulated(mesh, 200)}
    del cost["packing_cpu_s"]
    return cost


def balls(count: int) -> dict[str, Any]:
    """So many balls."""
    radius = np.sqrt(count * PER_BALL / (np.pi * HEIGHT))
    cost = {"balls": count, **simulated(cylinder(radius, HEIGHT, 10_000), count)}
    del cost["first_cpu_s"]
    return cost


def simulated(mesh: TriangleMesh, count: int) -> dict[str, Any]:
    """CPU seconds of packing and set-up, and million collisions a CPU second."""
    rng = np.random.default_rng(1)
    compile_simulator(PHYSICS, count)
    small = cylinder(0.035, HEIGHT, 100)
    simulate(scene(small, pack_balls(small, 10, DIAMETER, rng), rng, 1e-6))  # loads compiled code

    packing, places = cpu_seconds(lambda: pack_balls(mesh, count, DIAMETER, rng, clear=50e-6))
    setups = [cpu_seconds(lambda: simulate(scene(mesh, places, rng, 1e-6)))[0] for _ in range(2)]
    run = Simulation(scene(mesh, places, rng, 1.0))
    run.advance_to(STEADY)
    before, spent = int(run.state.counts[:3].sum()), 0.0
    while spent < WINDOW:
        spent += cpu_seconds(lambda: run.advance_to(run.time + 0.01))[0]
    rate = (int(run.state.counts[:3].sum()) - before) / spent
    return {
        "packing_cpu_s": packing,
        "first_cpu_s": setups[0],
        "again_cpu_s": setups[1],
        "M_collisions_per_cpu_s": 1e-6 * rate,
    }


def scene(mesh: TriangleMesh, places: np.ndarray, rng: np.random.Generator, time: float) -> Scene:
    shot = Balls(places, rng.normal(0.0, 2.0, places.shape), DIAMETER)
    return Scene(mesh, shot, PHYSICS, time)


def replicas(count: int) -> dict[str, Any]:
    """One evaluation of the gear."""
    cpu, (_, figures) = cpu_seconds(lambda: evaluation(count, 1))
    return {"replicas": count, "cpu_s": cpu, "figures_s": figures}


def workers(count: int) -> dict[str, Any]:
    """One evaluation of the gear on so many workers."""
    cpu, (wall, _) = cpu_seconds(lambda: evaluation(32, count))
    return {"workers": count, "wall_s": wall, "cpu_s": cpu}


def evaluation(count: int, workers: int) -> tuple[float, float]:
    """Seconds by the clock of the second of two evaluations, and those of its figures alone."""
    from chamberopt.chamber.build import build_chamber
    from chamberopt.common.executor import local_executor
    from chamberopt.design.load import load_design
    from chamberopt.simulation.evaluate import evaluate

    asked = {
        "process.accuracy.simulated_time_s": 0.2,
        "process.accuracy.warmup_time_s": 0.1,
        "process.accuracy.replicas": count,
    }
    design = load_design(ROOT / "designs" / "gear.toml").changed(asked)
    chamber = build_chamber(design)
    with local_executor(workers) as executor:
        begin = time.perf_counter()
        done = evaluate(design, chamber, executor)
        return time.perf_counter() - begin, done.timings["coverage"]


def cpu_seconds(call: Callable[[], Any]) -> tuple[float, Any]:
    before = time.process_time()
    result = call()
    return time.process_time() - before, result


# What the columns of the tables are, in the picture: the quantity, and its words.
TIME, RATE, MEMORY = "time [s]", "million collisions per CPU s", "peak of the memory [MB]"
WORDS = {
    "first_cpu_s": (TIME, "first set-up, CPU"),
    "again_cpu_s": (TIME, "each further set-up, CPU"),
    "packing_cpu_s": (TIME, "placing the balls, CPU"),
    "cpu_s": (TIME, "evaluation, CPU"),
    "wall_s": (TIME, "evaluation, by the clock"),
    "figures_s": (TIME, "its figures"),
    "peak_MB": (MEMORY, ""),
    "M_collisions_per_cpu_s": (RATE, ""),
}
KINDS: dict[str, tuple[Callable[[int], dict[str, Any]], tuple[int, ...]]] = {
    "triangles": (triangles, (100, 1_000, 10_000, 100_000, 1_000_000, 10_000_000)),
    "balls": (balls, (30, 100, 300, 1_000, 3_000, 10_000, 30_000, 100_000)),
    "replicas": (replicas, (4, 16, 64, 256)),
    "workers": (workers, (1, 2, 4, 8, 16)),
}


def in_a_process(kind: str, size: int) -> dict[str, Any]:
    """The row of one point, with the peak memory of the process that made it."""
    command = [sys.executable, __file__, "--here", kind, str(size)]
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
    row: dict[str, Any] = json.loads(done.stdout)
    return row


def measured(kind: str, quick: bool, rounds: int) -> list[dict[str, Any]]:
    """The rows of a kind: the median of each column over the rounds."""
    sizes = [size for size in KINDS[kind][1] if size <= QUICK or not quick]
    turns = [[in_a_process(kind, size) for size in sizes] for _ in range(rounds)]
    return [
        {name: float(f"{statistics.median(row[name] for row in rows):.3g}") for name in rows[0]}
        for rows in zip(*turns, strict=True)
    ]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="small scenes, one round, no files")
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    parser.add_argument("--draw", action="store_true", help="draw the tables of before anew")
    parser.add_argument("--here", nargs=2, metavar=("KIND", "SIZE"), help="one point as JSON")
    options = parser.parse_args()
    if options.here:
        kind, size = options.here
        row = KINDS[kind][0](int(size))
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0  # Linux counts kB
        print(json.dumps({**row, "peak_MB": peak}))
        return
    if options.draw:
        tables = {kind: read_csv(f"growth_{kind}.csv") for kind in options.kinds}
        growth_picture(IMAGES / "growth.png", tables, WORDS)
        return
    tables = {}
    for kind in options.kinds:
        tables[kind] = measured(kind, options.quick, 1 if options.quick else options.rounds)
        print_table(tables[kind])
        if not options.quick:
            write_csv(f"growth_{kind}.csv", tables[kind])
    if not options.quick:
        growth_picture(IMAGES / "growth.png", tables, WORDS)


if __name__ == "__main__":
    main()
