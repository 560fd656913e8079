"""How many real collisions a CPU second, scene by scene, with yardsticks in the same run.

    python benchmarks/events.py [--quick] [--json] [--scenes NAME ...]

Steady state after 0.3 s; process CPU time; the median of several windows, with the best and the worst. Yardsticks
on the same meshes and flights: embree's batch ray (straight, no thickness: less than is asked of us), and the
paper's own method (every triangle a plane, faces only). Rows go to benchmarks/results/events.csv with the machine
named.
"""

import argparse
import csv
import json
import platform
import statistics
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks import paper_method
from benchmarks.scenes import MESHES, PHYSICS, mesh, scene
from sim_core import compile_simulator
from sim_core._compile import jit
from sim_core.detect.ball_mesh import first_contact
from sim_core.flight import point_at
from sim_core.impacts import new_page
from sim_core.simulate import Clock, _Run
from sim_core.surfaces.mesh import MAX_TAGS

STEADY = 0.3  # s
FLIGHT = 0.01  # s: the length of arc that the wall queries search
TARGET = 0.4  # CPU s a window


def steady(name: str, seed: int = 1) -> _Run:
    """The scene, played to its steady state."""
    run = _Run(scene(name, seed=seed))
    advance(run, STEADY)
    return run


def advance(run: _Run, seconds: float) -> tuple[int, float]:
    """Collisions and CPU seconds of so many simulated seconds, nothing recorded."""
    page = new_page(np.zeros(MAX_TAGS, dtype=np.bool_))
    now = float(run.now[0] + run.now[1] * run.window)
    before, start = int(run.count[:3].sum()), time.process_time()
    run._advance(Clock(run.now, run.window, now + seconds, 0.0), page)
    return int(run.count[:3].sum()) - before, time.process_time() - start


def rate(run: _Run, windows: int) -> list[float]:
    """Collisions a CPU second in each window."""
    _, spent = advance(run, 0.01)
    piece = 0.01 * TARGET / max(spent, 1e-6)
    return [collisions / spent for collisions, spent in (advance(run, piece) for _ in range(windows))]


@jit
def _queries(tree, scratch, motion, gravity, wave, seam, time, length, repeats):  # type: ignore[no-untyped-def]
    total = 0.0
    for _ in range(repeats):
        for ball in range(len(motion)):
            here = point_at(motion, ball, time, gravity)
            delay, obstacle = first_contact(tree, scratch, here, gravity, wave, seam, time, length)
            if obstacle >= 0:
                total += delay
    return total


def query_ns(run: _Run, repeats: int = 50) -> float:
    """Our wall query [ns]: first contact of every ball along its next FLIGHT, walls held still."""
    arguments = (run.ground.tree, run.scratch, run.motion, run.gravity, run.wave, run.ground.seam, run.now[0], FLIGHT)
    _queries(*arguments, 1)
    start = time.process_time()
    _queries(*arguments, repeats)
    return (time.process_time() - start) / (repeats * len(run.motion)) * 1e9


def flights(run: _Run) -> tuple[np.ndarray, np.ndarray]:
    """Positions [m] and velocities [m/s] of the balls now, (n, 3) each."""
    points = [point_at(run.motion, ball, run.now[0], run.gravity) for ball in range(len(run.motion))]
    return np.array([p.position for p in points]) + run.centre, np.array([p.velocity for p in points])


def embree_ns(name: str, run: _Run, repeats: int = 50) -> float | None:
    """Embree's batch ray [ns] from the same places in the same directions; None where embreex is not installed."""
    try:
        from embreex import rtcore_scene
        from embreex.mesh_construction import TriangleMesh as EmbreeMesh
    except ImportError:
        return None
    target = rtcore_scene.EmbreeScene()
    EmbreeMesh(target, mesh(name).corners.astype(np.float32))
    position, velocity = flights(run)
    origins = np.tile(position, (repeats, 1)).astype(np.float32)
    directions = np.tile(velocity, (repeats, 1)).astype(np.float32)
    target.run(origins[:10], directions[:10])
    start = time.process_time()
    target.run(origins, directions)
    return (time.process_time() - start) / len(origins) * 1e9


def two_threads(name: str) -> float:
    """How much more two threads do than one, on independent replicas, by the clock on the wall."""
    runs = [steady(name, seed) for seed in (1, 2)]
    ratios = []
    for _ in range(5):
        start = time.perf_counter()
        for run in runs:
            advance(run, 0.5)
        alone = time.perf_counter() - start
        with ThreadPoolExecutor(2) as pool:
            start = time.perf_counter()
            list(pool.map(lambda run: advance(run, 0.5), runs))
            ratios.append(alone / (time.perf_counter() - start))
    return statistics.median(ratios)


def measure(name: str, windows: int) -> dict[str, Any]:
    """One row of the table."""
    run = steady(name)
    rates = rate(run, windows)
    shares = run.count / run.count[:3].sum()
    arrays = [*run.ground.tree[:-1], *run.ground.locator]
    row: dict[str, Any] = {
        "scene": name,
        "balls": len(run.motion),
        "triangles": len(mesh(name).triangles),
        "collisions_per_cpu_s": round(statistics.median(rates)),
        "best": round(max(rates)),
        "worst": round(min(rates)),
        "searches_per_collision": round(float(shares[3]), 2),
        "wall_query_ns": round(query_ns(run)),
        "embree_ns": embree_ns(name, run),
        "bytes_per_triangle": round(sum(a.nbytes for a in arrays) / len(mesh(name).triangles)),
        "bytes_per_ball": round(
            (sum(a.nbytes for a in run.calendar) + run.motion.nbytes + run.shot.crowd.lanes.nbytes) / len(run.motion)
        ),
    }
    if row["embree_ns"] is not None:
        row["embree_ns"] = round(row["embree_ns"])
    return row


def ratios(rows: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """The yardsticks, from what was measured."""
    small, middle, large = (rows.get(f"cylinder-200-{size}") for size in ("1k", "10k", "100k"))
    answer: dict[str, Any] = {"scene": "ratios"}
    if small and large:
        answer["growth_1k_100k"] = round(small["collisions_per_cpu_s"] / large["collisions_per_cpu_s"], 2)
    queries = [row["wall_query_ns"] / row["embree_ns"] for row in rows.values() if row["embree_ns"]]
    answer["embree"] = round(statistics.median(queries), 2) if queries else None
    if middle:
        run = steady("cylinder-200-10k")
        paper = paper_method.query_ns(mesh("cylinder-200-10k"), *flights(run))
        answer["paper_method_10k"] = round(paper / query_ns(run))
        answer["threads_2"] = round(two_threads("cylinder-200-10k"), 2)
    return answer


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="three windows a scene, the two widest scenes left out")
    parser.add_argument("--json", action="store_true", help="rows as JSON on stdout")
    parser.add_argument("--scenes", nargs="*", choices=list(MESHES), help="only these")
    options = parser.parse_args()
    names = options.scenes or [n for n in MESHES if not (options.quick and n in ("wide-2000-10k", "gear-200-100k"))]
    compiled = compile_simulator(PHYSICS)
    rows = {}
    for name in names:
        rows[name] = measure(name, 3 if options.quick else 9)
        if not options.json:
            print(" ".join(f"{key} {value}" for key, value in rows[name].items()), flush=True)
    last = {**ratios(rows), "compile_s": round(compiled, 2)}
    if options.json:
        print(json.dumps([*rows.values(), last], indent=1))
    else:
        print(last)
    path = Path(__file__).parent / "results" / "events.csv"
    path.parent.mkdir(exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        machine = f"{platform.system()} {platform.machine()} {_processor()}, Python {platform.python_version()}"
        writer = csv.DictWriter(file, ["machine", *next(iter(rows.values()))])
        writer.writeheader()
        writer.writerows({"machine": machine, **row} for row in rows.values())


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        return next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor()


if __name__ == "__main__":
    main()
