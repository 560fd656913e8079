"""How far to move a number for its response: noise of a short step against curvature of a long one.

Measured on the shipped plate, for its mean coverage on its scale, ln of the dent density:

    python benchmarks/response_steps.py            # writes benchmarks/results/response_steps.csv
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from chamberopt.chamber.build import build_chamber
from chamberopt.common.executor import local_executor
from chamberopt.common.files import csv_text, write_text
from chamberopt.design.load import load_design
from chamberopt.peening.responses import combine, on_scale, scale_of
from chamberopt.simulation.variations import RunsProgress, Variations

ROOT = Path(__file__).resolve().parents[1]
FIGURE = "mean_coverage"
FACTORS = (0.7, 0.8, 0.9, 1.1, 1.2, 1.4)
NUMBERS = ("sonotrode.amplitude_um", "shot.mass_g")
REPLICAS = 24


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--replicas", type=int, default=REPLICAS)
    parser.add_argument("--out", type=Path, default=ROOT / "benchmarks/results/response_steps.csv")
    given = parser.parse_args()
    plate = load_design(ROOT / "designs/plate.toml")
    plate = plate.changed({"process.accuracy.replicas": given.replicas})
    rows, scale = [], scale_of(FIGURE)
    with local_executor() as executor:
        runs = Variations(plate, build_chamber(plate), executor, RunsProgress(None, 1))
        nominal = on_scale(runs.nominal.metrics[FIGURE], scale)
        for name in NUMBERS:
            for factor in FACTORS:
                changed = plate.changed({name: factor * plate.value(name)})
                found = runs.run(changed, build_chamber(changed)).metrics[FIGURE]
                pair = {"changed": on_scale(found, scale), "nominal": nominal}
                step = math.log(factor)
                slope = combine(pair, {"changed": 1.0 / step, "nominal": -1.0 / step})
                rows.append(
                    {
                        "number": name,
                        "factor": factor,
                        "elasticity": f"{slope.value:.3f}",
                        "half_width": f"{slope.half_width:.3f}",
                    }
                )
                print(*rows[-1].values(), sep="\t", flush=True)
    write_text(given.out, csv_text(rows))


if __name__ == "__main__":
    main()
