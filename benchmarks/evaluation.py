"""One full evaluation: the gear's chamber with 200 balls to ± 0.01 on the objective.

    python benchmarks/evaluation.py [--quick] [--json]

It runs in a process of its own on two threads, once with an empty cache of compiled code and once
with the cache that the first run left. The table gives wall and CPU seconds from before the first
import to the figure, and coverage with its intervals. It also gives the shares of CPU seconds:
imports, compiling (or loading compiled code), building the chamber (CSG), and of the replicas the
fixed part (packing the shot, counting dents), the warm-up and the recorded time. The parts of a
replica are told apart by timing shortened replicas afterwards. Rows go to
benchmarks/results/evaluation.csv with the name of the machine. With --quick the accuracy is ± 0.03,
your own cache is used and no row is written.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

BEGIN = time.perf_counter(), time.process_time()
ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

MASS_G = 2.757  # 200 balls of 1.5 mm
THREADS = 2
TIMED = 10  # replicas of each length, for the shares
NO_TIME = 1e-4  # s, the least that can be simulated
ASKED, ASKED_QUICK = 0.01, 0.03


def evaluation(accuracy: float) -> dict[str, Any]:
    """The row of one evaluation in this process, in which chamberopt is not imported yet."""
    from chamberopt.chamber.build import build_chamber
    from chamberopt.chamber.scene import build_scene, chamber_mesh
    from chamberopt.common.executor import local_executor
    from chamberopt.design.load import load_design
    from chamberopt.simulation.evaluate import evaluate
    from sim_core import compile_simulator

    asked = {
        "shot.mass_g": MASS_G,
        "process.accuracy.objective_half_width": accuracy,
        "process.accuracy.max_replicas": 1000,
    }
    clock = [("import", time.process_time())]
    design = load_design(ROOT / "designs" / "gear.toml").changed(asked)
    chamber = build_chamber(design)
    clock.append(("csg", time.process_time()))
    scene = build_scene(design, chamber_mesh(chamber), 1)
    compile_simulator(scene.physics, len(scene.balls), scene.balls.alike)
    clock.append(("compile", time.process_time()))
    with local_executor(THREADS) as executor:
        done = evaluate(design, chamber, executor)
    wall, cpu = time.perf_counter() - BEGIN[0], time.process_time() - BEGIN[1]
    spent, before = {}, BEGIN[1]
    for step, now in clock:
        spent[step], before = now - before, now
    estimating = done.timings["coverage"]  # one thread, while the others wait
    replicas = BEGIN[1] + cpu - before - estimating
    spent |= {part: share * replicas for part, share in replica_shares(design, chamber).items()}
    spent["coverage"] = estimating
    return {
        "balls": design.shot.count,
        "triangles": len(chamber.triangles),
        "objective": round(done.objective.value, 4),
        "half_width": round(done.objective.half_width, 4),
        "stopped_by": done.stopped_by,
        "replicas": done.replicas,
        "collisions": done.collisions["total"],
        "wall_s": round(wall, 2),
        "cpu_s": round(cpu, 2),
        **{f"{part}_share": round(seconds / cpu, 3) for part, seconds in spent.items()},
    }


def replica_shares(design: Any, chamber: Any) -> dict[str, float]:
    """Shares of start, warm-up and recorded time in the CPU seconds of a replica.

    Measured with replicas that have neither warm-up nor recorded time, the first, and both.
    """
    from chamberopt.chamber.replica_seed import replica_seed
    from chamberopt.chamber.scene import chamber_mesh
    from chamberopt.simulation.numerical_parameters import TIME, WARM_UP
    from chamberopt.simulation.replicas import ReplicaSetting, simulate_replica

    mesh = chamber_mesh(chamber)
    lengths = [
        design.changed({TIME: NO_TIME, WARM_UP: 0.0}),
        design.changed({TIME: NO_TIME}),
        design,
    ]
    # Builds the search tree, once for all replicas.
    simulate_replica(ReplicaSetting(lengths[0], chamber, mesh), 0)
    spent = [0.0] * len(lengths)
    for number in range(TIMED):
        for i, cut in enumerate(lengths):
            begin = time.process_time()
            simulate_replica(
                ReplicaSetting(cut, chamber, mesh), replica_seed(cut.process.seed, number)
            )
            spent[i] += time.process_time() - begin
    fixed, warm, whole = spent
    return {
        "fixed": fixed / whole,
        "warm_up": (warm - fixed) / whole,
        "recorded": (whole - warm) / whole,
    }


def in_a_process(accuracy: float, cache: str | None) -> dict[str, Any]:
    """The same in a fresh process, with its compiled code in that folder."""
    setting = {**os.environ, **({"NUMBA_CACHE_DIR": cache} if cache else {})}
    command = [sys.executable, __file__, "--here", str(accuracy)]
    done = subprocess.run(
        command, env=setting, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True
    )
    row: dict[str, Any] = json.loads(done.stdout)
    return row


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--quick", action="store_true", help="± 0.03 with your own cache of compiled code"
    )
    parser.add_argument("--json", action="store_true", help="rows as JSON on stdout")
    parser.add_argument(
        "--here", type=float, metavar="ACCURACY", help="in this process, a row as JSON"
    )
    options = parser.parse_args()
    if options.here:
        print(json.dumps(evaluation(options.here)))
        return
    if options.quick:
        rows = [{"cache": "yours", **in_a_process(ASKED_QUICK, None)}]
    else:
        with tempfile.TemporaryDirectory() as folder:
            rows = [
                {"cache": cache, **in_a_process(ASKED, folder)} for cache in ("empty", "filled")
            ]
    if options.json:
        print(json.dumps(rows, indent=1))
    else:
        for row in rows:
            print("\n".join(f"{name:18}{value}" for name, value in row.items()), end="\n\n")
    if not options.quick:
        from benchmarks.table import write_csv

        write_csv("evaluation.csv", rows)


if __name__ == "__main__":
    main()
