"""A fine sweep of a real chamber over two parameters.

It is the truth that optimizers.py compares its searches with.

    python benchmarks/chamber_sweep.py plate
    python benchmarks/chamber_sweep.py gear --steps 15 --seconds 1.5

The first command sweeps 8 by 8 designs with 8 replicas of 0.4 s and takes one or two CPU minutes.

Each design adds its row to results/sweep_NAME.csv as soon as it is simulated. Rows that are already
there are not simulated again, so a sweep can be stopped and continued. Delete the table before a
sweep with other steps, replicas or seconds. In each row u and v are the parameters in shares of
their bounds, standard_error is the error of this sweep, and search_error is the error of one
evaluation in a search at the design's own accuracy.
"""

import argparse
import csv
import time
from typing import Any

import numpy as np

from benchmarks.noisy_problems import RESULTS
from benchmarks.table import write_csv
from chamberopt.chamber.build import build_chamber
from chamberopt.common.executor import SerialExecutor
from chamberopt.design.load import Design, load_design
from chamberopt.search.study.constraints import standard_error
from chamberopt.simulation.evaluate import ReplicaPlan, evaluate

ROOT = RESULTS.parents[1]
VARY = {
    "plate": {"chamber.sonotrode_distance_mm": (8.0, 19.0), "shot.mass_g": (1.5, 20.0)},
    "gear": {"chamber.sonotrode_distance_mm": (4.0, 27.0), "chamber.height_mm": (28.0, 60.0)},
}

# Treatment time [s]. With the time in the plate's own file the better half of the designs would
# reach 100 %.
TREATMENT = {"plate": 1.0, "gear": 120.0}


def swept(name: str) -> list[dict[str, Any]]:
    """The rows there are, without the machine's column."""
    path = RESULTS / f"sweep_{name}.csv"
    if not path.is_file():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        rows = [
            {key: float(value) for key, value in row.items() if key != "machine"}
            for row in csv.DictReader(file)
        ]
    return rows


def row(
    design: Design, vary: dict[str, tuple[float, float]], u: float, v: float, replicas: int
) -> dict[str, Any]:
    """One design of the sweep, simulated."""
    began = time.process_time()
    values = {
        name: low + x * (high - low)
        for (name, (low, high)), x in zip(vary.items(), (u, v), strict=True)
    }
    candidate = design.changed(values)
    chamber = build_chamber(candidate)
    found = evaluate(candidate, chamber, SerialExecutor(), plan=ReplicaPlan(replicas, "confirm"))
    objective = found.objective
    error = standard_error(objective)
    usual = usual_seconds(design)
    start = [(design.value(name) - low) / (high - low) for name, (low, high) in vary.items()]
    return {
        "u": u,
        "v": v,
        **values,
        "uniform_coverage": objective.value,
        "standard_error": error,
        "reachable": found.reachable,
        "search_error": error
        * np.sqrt(replicas * design.process.accuracy.simulated_time_s / usual),
        "start_u": start[0],
        "start_v": start[1],
        "cpu_s": round(time.process_time() - began, 2),
    }


def usual_seconds(design: Design) -> float:
    """Simulated seconds of all replicas of one evaluation at the shipped design's accuracy."""
    shipped = load_design(ROOT / "designs" / f"{design.part.mesh_path.stem}.toml").process.accuracy
    return shipped.replicas * shipped.simulated_time_s


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("name", choices=list(VARY))
    parser.add_argument("--steps", type=int, default=8, help="designs along each parameter")
    parser.add_argument("--replicas", type=int, default=8)
    parser.add_argument("--seconds", type=float, default=0.4, help="simulated, of each replica")
    asked = parser.parse_args()
    design = load_design(ROOT / "designs" / f"{asked.name}.toml")
    design = design.changed(
        {
            "process.accuracy.simulated_time_s": asked.seconds,
            "process.treatment_time_s": TREATMENT[asked.name],
        }
    )
    rows = swept(asked.name)
    done = {(one["u"], one["v"]) for one in rows}
    steps = np.round(np.linspace(0.0, 1.0, asked.steps), 6).tolist()
    for u, v in ((u, v) for u in steps for v in steps if (u, v) not in done):
        rows.append(row(design, VARY[asked.name], u, v, asked.replicas))
        print({key: round(value, 4) for key, value in rows[-1].items()}, flush=True)
        path = write_csv(f"sweep_{asked.name}.csv", rows)
    print(f"written to {path}" if len(rows) > len(done) else "nothing to do")


if __name__ == "__main__":
    main()
