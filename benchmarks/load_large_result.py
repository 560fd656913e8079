"""How long a large result takes to open: 10^7 impacts on a gear of 10^5 triangles.

    python benchmarks/load_large_result.py [--quick] [--json]

Impacts are drawn at random, not simulated. All files are written by the product. `picture` is
`chamberopt inspect --screenshot` with the result coloured by coverage. `pick` adds the numbers of
one triangle and the histogram of its impact speeds, which needs the single impacts. Each runs in a
fresh process. The table gives medians of a few runs in seconds of wall clock, and the peak of
memory (the larger of the command's and of the process that draws for it). Rows go to
benchmarks/results/opening.csv with the name of the machine.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT)]

SIZES = {"100k": 10_000_000}  # impacts, by the gear's triangles
REPLICAS = 4
RUNS = 3


def written(folder: Path, size: str, impacts: int) -> tuple[int, int]:
    """Writes a results folder of so many random impacts.

    Returns it with the number of the part's triangles and one triangle that was hit.
    """
    from benchmarks.chamber_build_time import gear_file
    from chamberopt.chamber.build import build_chamber
    from chamberopt.design.design import validate
    from chamberopt.design.load import load_design
    from chamberopt.workflows.save_run import save_simulation

    gear = load_design(ROOT / "designs" / "gear.toml")
    data = gear.model_dump()
    data["part"]["mesh"] = str(gear_file(folder, size))
    design = validate(type(gear), data)
    chamber = build_chamber(design)
    save_simulation(folder / "result", design, chamber, evaluation(design, chamber, impacts))
    return len(chamber.part.triangles), int(np.argmax(chamber.exposed_area * chamber.part.target))


def evaluation(design: Any, chamber: Any, impacts: int) -> Any:
    """So many impacts, anywhere on what is exposed, in replicas."""
    from chamberopt.chamber.scene import chamber_mesh
    from chamberopt.coverage.metrics import OBJECTIVES
    from chamberopt.coverage.part_impacts import Hits
    from chamberopt.simulation.estimates import SeenDents, estimate_metrics, weighted_sum
    from chamberopt.simulation.evaluate import prepare_target
    from chamberopt.simulation.evaluation import Evaluation

    rng, part = np.random.default_rng(1), chamber.part
    share = chamber.exposed_area / chamber.exposed_area.sum()
    hits = []
    for _ in range(REPLICAS):
        count = rng.poisson(impacts / REPLICAS * share)
        triangle = np.repeat(np.arange(len(count), dtype=np.int32), count)
        rng.shuffle(triangle)
        parts = rng.dirichlet(np.ones(3), len(triangle))
        place = np.einsum("ki,kij->kj", parts, part.vertices[part.triangles[triangle]])
        speed = rng.gamma(3.0, 1.0, len(triangle)).astype(np.float32)
        angle = rng.uniform(20.0, 90.0, len(triangle)).astype(np.float32)
        dent = np.float32(4e-5) * np.sqrt(speed)
        energy = np.float32(7e-6) * speed * speed
        hits.append(Hits(triangle, place.astype(np.float32), speed, angle, dent, energy))
    seen = SeenDents.none(prepare_target(design, chamber, chamber_mesh(chamber)))
    seen.add(hits)
    found = estimate_metrics(seen, hits, chamber, design)
    return Evaluation(
        objective_name="uniform_coverage",
        objective=weighted_sum(OBJECTIVES["uniform_coverage"], found.metrics),
        metrics=found.metrics,
        metrics_of_wide=found.metrics_of_wide,
        gauge_mm2=design.process.accuracy.gauge_mm2,
        resolution=found.resolution,
        reachable=seen.field.reachable,
        crease_share=seen.crease_share,
        alike=seen.field.alike,
        replicas=REPLICAS,
        simulated_time=REPLICAS * design.process.recorded_time,
        hits=tuple(hits),
        timings={},
        collisions={},
    )


def opened(result: Path, *options: str) -> tuple[float, float]:
    """Seconds, and peak of memory [MB], of one `inspect --screenshot`."""
    code = "import sys; from chamberopt.cli import main; sys.exit(main(sys.argv[1:]))"
    watch = (
        "import resource, subprocess, sys; subprocess.run(sys.argv[1:], check=True, "
        "stdout=subprocess.DEVNULL);"
        "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"
    )
    picture = str(result.parent / "picture.png")
    command = [
        sys.executable,
        "-c",
        code,
        "inspect",
        str(result),
        "--screenshot",
        picture,
        *options,
    ]
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]),
    }
    began = time.perf_counter()
    run = subprocess.run(
        [sys.executable, "-c", watch, *command],
        check=True,
        capture_output=True,
        text=True,
        env=environment,
    )
    unit = 1e6 if sys.platform == "darwin" else 1e3  # bytes there, kilobytes elsewhere
    return time.perf_counter() - began, int(run.stdout.split()[-1]) / unit


def row(size: str, impacts: int, runs: int) -> dict[str, Any]:
    """One result."""
    with tempfile.TemporaryDirectory() as temporary:
        began = time.perf_counter()
        triangles, picked = written(Path(temporary), size, impacts)
        wrote = time.perf_counter() - began
        result = Path(temporary) / "result"
        measured: dict[str, Any] = {
            "triangles": triangles,
            "impacts": impacts,
            "written_s": round(wrote, 1),
        }
        measured["result_mb"] = round(
            sum(file.stat().st_size for file in result.iterdir()) / 1e6, 1
        )
        for name, options in (("picture", ()), ("pick", ("--triangle", str(picked)))):
            seconds, peak = zip(*(opened(result, *options) for _ in range(runs)), strict=True)
            measured[f"{name}_s"] = round(statistics.median(seconds), 2)
            measured[f"{name}_mb"] = round(max(peak))
    return measured


def main(arguments: list[str] | None = None) -> None:
    """The table, and the CSV unless it is quick."""
    from benchmarks.table import print_table, write_csv

    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--quick", action="store_true", help="a small result, once, nothing written"
    )
    parser.add_argument("--json", action="store_true", help="print JSON")
    asked = parser.parse_args(arguments)
    sizes = {"10k": 100_000} if asked.quick else SIZES
    rows = [row(size, impacts, 1 if asked.quick else RUNS) for size, impacts in sizes.items()]
    if not asked.quick:
        write_csv("opening.csv", rows)
    if asked.json:
        print(json.dumps(rows))
    else:
        print_table(rows)


if __name__ == "__main__":
    main()
