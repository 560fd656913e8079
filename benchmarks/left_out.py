"""How large is what the simulator leaves out: the contact's duration, and shot that wears away?

    python benchmarks/left_out.py [--csv FILE]

An impact takes no time in the simulator. By Hertz it lasts T = 2.87 (m²/(R E*² v))^(1/5), with the
ball's mass m and radius R, E* of ball and sonotrode, and the speed v (Johnson, "Contact Mechanics",
1985, section 11.4). Over that time the face moves, on average and at most, at sin(x)/x of its peak
speed, with x = pi f T for its frequency f. The second table simulates the gear with 10 % less shot.
"""

import argparse
import math
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.table import print_table, write_csv
from chamberopt.chamber.build import build_chamber
from chamberopt.common.executor import core_count
from chamberopt.design.load import load_design
from chamberopt.design.materials import alloy, ball
from chamberopt.simulation.evaluate import ReplicaPlan, evaluate

DESIGNS = Path(__file__).parents[1] / "designs"
FREQUENCY, SPEED = 20e3, 5.0  # Hz; m/s
DIAMETERS = (1.5, 3.0, 4.0, 6.0)  # mm
WORN, REPLICAS = 0.9, 16


def contact_row(diameter_mm: float) -> dict[str, Any]:
    """Return the duration of a steel ball's impact on titanium, and how far the face slows."""
    steel, titanium = ball("steel"), alloy("Ti-6Al-4V")
    radius = 0.5e-3 * diameter_mm
    mass = steel.density_kg_m3 * 4.0 / 3.0 * math.pi * radius**3
    modulus = 1.0 / (steel.elastic.compliance + titanium.elastic.compliance)
    time = 2.87 * (mass**2 / (radius * modulus**2 * SPEED)) ** 0.2
    x = math.pi * FREQUENCY * time
    return {
        "ball_mm": diameter_mm,
        "contact_us": round(1e6 * time, 1),
        "share_of_period": round(FREQUENCY * time, 3),
        "face_slower_by": round(1.0 - math.sin(x) / x, 3),
    }


def worn_row() -> dict[str, Any]:
    """Return how dents and coverage of the gear change with less shot."""
    gear = load_design(DESIGNS / "gear.toml")
    rates, coverages = [], []
    with ThreadPoolExecutor(core_count()) as workers:
        for mass in (gear.shot.mass_g, WORN * gear.shot.mass_g):
            design = gear.changed({"shot.mass_g": mass})
            plan = ReplicaPlan(REPLICAS)
            found = evaluate(design, build_chamber(design), workers, plan=plan)
            rates.append([float((one.dent > 0.0).sum()) for one in found.hits])
            coverages.append(found.metrics["mean_coverage"])
    full, worn = np.mean(rates[0]), np.mean(rates[1])
    error = math.hypot(*(np.std(one, ddof=1) / np.mean(one) for one in rates))
    return {
        "shot": f"{WORN:.0%}",
        "dents": f"{100.0 * (worn / full - 1.0):+.1f} ± {196.0 * error / REPLICAS**0.5:.1f} %",
        "mean_coverage": f"{coverages[0].value:.3f} -> {coverages[1].value:.3f}",
        "half_width": round(math.hypot(*(one.half_width for one in coverages)), 3),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--csv", help="name of a file in benchmarks/results")
    arguments = parser.parse_args()
    rows = [contact_row(one) for one in DIAMETERS]
    print_table(rows)
    worn = worn_row()
    print_table([worn])
    if arguments.csv:
        print("wrote", write_csv(arguments.csv, rows))


if __name__ == "__main__":
    main()
