"""What a turning part costs: collisions a CPU second of the gear's chamber, still and turning.

    python benchmarks/turning_part.py [--quick] [--json]

Each speed is measured in its steady state, after 0.3 s, in CPU time of the process. The runs take
turns, window by window, so that a busy machine slows all alike. The table gives the median of
several windows with the best and the worst, and the cost of a collision and of a simulated second
as multiples of the still scene. A slow turn (100 rpm and less) should cost at most twice the still
scene. A fast one heats the shot, which then collides more.
"""

import argparse
import json
import statistics
import sys
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.events import STEADY, TARGET, advance
from benchmarks.scenes import PART, PHYSICS, scene
from sim_core import PartRotation, Scene, compile_simulator
from sim_core.loop.simulate import Simulation

NAME = "gear-200-10k"
MOTIONS: dict[str, PartRotation | None] = {
    "still": None,
    **{f"{rpm} rpm": PartRotation(PART, rpm=float(rpm)) for rpm in (0, 1, 30, 100, 1000)},
    "20 deg at 1 Hz": PartRotation(PART, amplitude=float(np.radians(20.0)), frequency=1.0),
}


def steady(turn: PartRotation | None) -> Simulation:
    """The gear's chamber with this motion, played to its steady state."""
    still = scene(NAME)
    run = Simulation(
        Scene(still.mesh, still.balls, PHYSICS._replace(part_rotation=turn), still.duration)
    )
    advance(run, STEADY)
    return run


def measure(windows: int) -> list[dict[str, Any]]:
    """One row a motion."""
    runs = {name: steady(turn) for name, turn in MOTIONS.items()}
    seconds = 0.05 * TARGET / max(advance(runs["still"], 0.05)[1], 1e-6)
    rates: dict[str, list[float]] = {name: [] for name in runs}
    costs: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(windows):
        for name, run in runs.items():
            collisions, spent = advance(run, seconds)
            rates[name].append(collisions / spent)
            costs[name].append(spent / seconds)
    still = statistics.median(rates["still"]), statistics.median(costs["still"])
    return [
        {
            "scene": NAME,
            "motion": name,
            "collisions_per_cpu_s": round(statistics.median(rates[name])),
            "best": round(max(rates[name])),
            "worst": round(min(rates[name])),
            "times_still_a_collision": round(still[0] / statistics.median(rates[name]), 2),
            "times_still_a_simulated_s": round(statistics.median(costs[name]) / still[1], 2),
        }
        for name in runs
    ]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--quick", action="store_true", help="three windows a motion instead of nine"
    )
    parser.add_argument("--json", action="store_true", help="rows as JSON on stdout")
    options = parser.parse_args()
    for physics in (PHYSICS, PHYSICS._replace(part_rotation=MOTIONS["1 rpm"])):
        compile_simulator(physics)
    rows = measure(3 if options.quick else 9)
    if options.json:
        print(json.dumps(rows, indent=1))
        return
    for row in rows:
        print(" ".join(f"{key} {value}" for key, value in row.items()))


if __name__ == "__main__":
    main()
