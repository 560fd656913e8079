"""Do the ranges of what is not calibrated hold the figures of designs within them?

    python benchmarks/ranges.py [--csv FILE]

The shipped plate with friction and rough faces stands for machines whose friction, v0 and slopes
are anywhere in their ranges, each as likely. They are simulated on seeds of their own. The ranges
are those that `chamberopt simulate` says for the plate as designed, for several seeds. "held" is
the share of pairs of a machine and a seed whose range, with the interval of counting at both ends,
holds the machine's figure.
"""

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.table import print_table, write_csv
from chamberopt.chamber.build import build_chamber
from chamberopt.common.executor import local_executor
from chamberopt.design.load import load_design
from chamberopt.design.ranges import unknowns
from chamberopt.peening.ranges import find_ranges, simulate_ends
from chamberopt.simulation.evaluate import evaluate

PLATE = Path(__file__).resolve().parents[1] / "designs/plate.toml"
MACHINES, SEEDS = 60, 12
ROUGH = {
    "effects.friction": {"mu": 0.3, "beta0": 0.2},
    "effects.roughness": {"slope_deg": 3.0},
    "process.accuracy.simulated_time_s": 2.0,
}
FIGURES = (
    "mean_coverage", "uniform_coverage", "p05_coverage", "time_to_98_s", "exposure", "strength_um",
    "mean_normal_speed_m_s", "impacts_per_mm2_s",
)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--csv")
    given = parser.parse_args()
    design = load_design(PLATE).changed(ROUGH)
    chamber, rng = build_chamber(design), np.random.default_rng(1)
    machines, found = [], []
    with local_executor() as executor:
        for number in range(MACHINES):
            values: dict[str, Any] = {"process.seed": 1000 + number}
            for group in unknowns(design):
                place = rng.uniform()
                for name, one in group.numbers.items():
                    values[name] = one.low + place * (one.high - one.low)
            machines.append(evaluate(design.changed(values), chamber, executor))
        for seed in range(SEEDS):
            seeded = design.changed({"process.seed": seed})
            whole = evaluate(seeded, chamber, executor)
            runs = simulate_ends(seeded, chamber, whole, executor)
            assert runs is not None
            found.append((whole, find_ranges(runs)))
    rows = []
    for name in FIGURES:
        truth = np.array([one.metrics.get(name, one.objective).value for one in machines])
        held, ends = [], []
        for whole, ranges in found:
            figure, counted = ranges.figures[name], whole.metrics.get(name, whole.objective)
            low = figure.low.value - counted.half_width
            high = figure.high.value + counted.half_width
            held.append(np.mean((low <= truth) & (truth <= high)))
            ends.append((figure.low.value, figure.high.value))
        low, high = np.median(ends, axis=0)
        true_low, true_high = np.quantile(truth, [0.05, 0.95])
        rows.append(
            {
                "figure": name,
                "machines, 5 %": f"{true_low:.4g}",
                "95 %": f"{true_high:.4g}",
                "low": f"{low:.4g}",
                "high": f"{high:.4g}",
                "held": f"{100.0 * np.mean(held):.0f} %",
            }
        )
    print_table(rows)
    if given.csv:
        print(write_csv(given.csv, rows))


if __name__ == "__main__":
    main()
