"""Does `chamberopt accuracy` keep its promises: its budget, and what it recommends?

    python benchmarks/accuracy_promise.py designs/plate.toml [--budget-s 80] [--seeds 6]
        [--study FOLDER] [--csv FILE]

The command runs in a process of its own, or its results are read from a folder. Then the design is
evaluated with the recommended settings on new seeds, one thread each, after a run that loads all
code. A row is for one accuracy:

replicas    recommended number
reached     evaluations whose interval is within the accuracy, of all
half_width  the widest of them
predicted   CPU seconds that the command foretold
cpu_s       median CPU seconds to build the chamber and to evaluate the design

The first line has the CPU seconds and the peak memory of the command itself, compiling included.
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.table import print_table, write_csv
from chamberopt.chamber.build import build_chamber
from chamberopt.common.executor import local_executor
from chamberopt.design.design import Design
from chamberopt.design.load import load_design
from chamberopt.simulation.evaluate import evaluate

FIRST_SEED = 1001


def command(design: Path, budget_s: float, folder: Path) -> None:
    """Run the command, and print what it took."""
    asked = ["accuracy", str(design), f"--budget-s={budget_s}", "--out", str(folder)]
    subprocess.run([sys.executable, "-m", "chamberopt", *asked], check=True, stdout=sys.stderr)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu_s, peak = used.ru_utime + used.ru_stime, used.ru_maxrss / 1e6
    print(f"{design.name}, --budget-s {budget_s:g}: {cpu_s:.0f} CPU s, {peak:.2f} GB at most")


def evaluated(design: Design) -> tuple[float, float]:
    """Half-width of the objective of a design, and the CPU seconds of chamber and evaluation."""
    begin = time.process_time()
    with local_executor(1) as executor:
        found = evaluate(design, build_chamber(design), executor)
    return found.objective.half_width, time.process_time() - begin


def row(design: Design, advice: dict[str, Any], seeds: int) -> dict[str, Any]:
    """What the recommended settings for one accuracy give on new seeds."""
    settings = {**advice["settings"], "process.accuracy.replicas": advice["replicas"]}
    asked = design.changed({**settings, "process.accuracy.objective_half_width": None})
    runs = [evaluated(asked.changed({"process.seed": FIRST_SEED + k})) for k in range(seeds)]
    widths, seconds = np.array(runs).T
    return {
        "accuracy": advice["accuracy"],
        "replicas": advice["replicas"],
        "reached": f"{int(np.sum(widths <= advice['accuracy']))} of {seeds}",
        "half_width": round(float(widths.max()), 4),
        "predicted": round(advice["cpu_s"], 2),
        "cpu_s": round(float(np.median(seconds)), 2),
        "ratio": round(float(np.median(seconds)) / advice["cpu_s"], 2),
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("design", type=Path)
    parser.add_argument("--budget-s", type=float, default=80.0)
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--study", type=Path, help="folder of results of the command")
    parser.add_argument("--csv", help="name of a file in benchmarks/results")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.study or Path(temporary, "accuracy")
        if not options.study:
            command(options.design, options.budget_s, folder)
        found = json.loads((folder / "accuracy.json").read_text(encoding="utf-8"))
    design = load_design(options.design)
    evaluated(design)
    advices = [one for one in found["recommendations"] if one["replicas"]]
    rows = [row(design, one, options.seeds) for one in advices]
    print_table(rows)
    if options.csv:
        write_csv(options.csv, [{"design": options.design.stem, **one} for one in rows])


if __name__ == "__main__":
    main()
