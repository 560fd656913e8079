"""What happens to an interval if its replicas are added, or end, by how wide it looks.

    python benchmarks/intervals.py --stopping [--json]
    python benchmarks/intervals.py --early [--json]

Each row stands for many candidates, whose replicas are normally distributed about 0, and says how
often the 95 % interval held the truth. With --stopping replicas are added until the interval is
narrow enough; a row has the first number of replicas, how many the wanted half-width needs and how
many were spent. With --early a candidate has an error that all its replicas share, such as that by
the choice of points, and ends after a few of them if more would hardly narrow the interval; a row
has the standard error in common over that of a replica, how many ended early, and the mean interval
over that of all replicas. It takes seconds. --json prints the rows as JSON on stdout instead of a
table. benchmarks/coverage_calibration.py tests the intervals of coverage and intensity.
"""

import argparse
import json
from collections.abc import Iterator
from typing import Any

import numpy as np

from benchmarks.table import print_table, write_csv
from chamberopt.common.estimate import estimate
from chamberopt.simulation.effort import MIN_REPLICAS_TO_STOP, Effort, Step, narrows


def stopping_rows(runs: int) -> Iterator[dict[str, Any]]:
    """Rows from normally distributed replicas whose truth is 0.

    The rule of evaluate() adds replicas, from several first numbers on, until the half-width is at
    most 1.96/sqrt(wanted).
    """
    for first in (3, 5, MIN_REPLICAS_TO_STOP):
        for wanted in (8, 16, 30, 60):
            rng = np.random.default_rng(3)
            effort = Effort(first, 400, 20_000, wanted=1.96 / np.sqrt(wanted))
            held, spent = 0, 0
            for _ in range(runs):
                sample, step = rng.normal(size=400), Step(first)
                while not step.stopped_by:
                    got = estimate(sample[: step.replicas])
                    step = effort.after(step.replicas, got, 1.0, step)
                held, spent = held + (got.low <= 0.0 <= got.high), spent + step.replicas
            yield {
                "first_replicas": first,
                "needed": wanted,
                "spent": round(spent / runs, 1),
                "held": held / runs,
            }


def early_rows(runs: int) -> Iterator[dict[str, Any]]:
    """Rows from normally distributed replicas and a normal error that they share."""
    for few, most in ((3, 8), (4, 8), (4, 16)):
        for shared in (0.0, 0.1, 0.3, 0.5, 1.0, 3.0):
            rng = np.random.default_rng(4)
            held, ended, widths = 0, 0, []
            for _ in range(runs):
                sample = shared * rng.normal() + rng.normal(size=most)
                whole = estimate(sample, shared=[shared])
                early = estimate(sample[:few], shared=[shared])
                got = whole if narrows(early) else early
                held, ended = held + (got.low <= 0.0 <= got.high), ended + (got is early)
                widths.append(got.half_width / whole.half_width)
            yield {
                "replicas": f"{few} of {most}",
                "shared": shared,
                "ended_early": ended / runs,
                "width": round(float(np.mean(widths)), 3),
                "held": held / runs,
            }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    which = parser.add_mutually_exclusive_group(required=True)
    which.add_argument("--stopping", action="store_true", help="the rule that adds replicas")
    which.add_argument("--early", action="store_true", help="the rule that ends candidates")
    parser.add_argument("--runs", type=int, default=4000)
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args()
    rows = list((early_rows if asked.early else stopping_rows)(asked.runs))
    if asked.json:
        print(json.dumps(rows, indent=1))
        return
    print_table(rows)
    name = "intervals_early.csv" if asked.early else "intervals_stopping.csv"
    print(f"written to {write_csv(name, rows)}")


if __name__ == "__main__":
    main()
