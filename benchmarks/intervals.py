"""What happens to an interval if replicas are added until it looks narrow enough.

    python benchmarks/intervals.py --stopping [--json]

Each row stands for many candidates, whose replicas are normally distributed about 0. It gives the
first number of replicas, how many the wanted half-width needs, how many were spent, and how often
the 95 % interval held the truth. It takes seconds. --json prints the rows as JSON on stdout instead
of a table. benchmarks/coverage_calibration.py tests the intervals of coverage and intensity.
"""

import argparse
import json
from collections.abc import Iterator
from typing import Any

import numpy as np

from benchmarks.table import print_table, write_csv
from chamberopt.common.estimate import estimate
from chamberopt.simulation.replicas import MIN_REPLICAS_TO_STOP, next_replica_count


def stopping_rows(runs: int) -> Iterator[dict[str, Any]]:
    """Rows from normally distributed replicas whose truth is 0.

    The rule of evaluate() adds replicas, from several first numbers on, until the half-width is at
    most 1.96/sqrt(wanted).
    """
    for first in (3, 5, MIN_REPLICAS_TO_STOP):
        for wanted in (8, 16, 30, 60):
            rng = np.random.default_rng(3)
            half_width, held, spent = 1.96 / np.sqrt(wanted), 0, 0
            for _ in range(runs):
                sample, count = rng.normal(size=400), first
                while (
                    more := next_replica_count(
                        count, estimate(sample[:count]).half_width, half_width, 400
                    )
                ) > count:
                    count = more
                got = estimate(sample[:count])
                held, spent = held + (got.low <= 0.0 <= got.high), spent + count
            yield {
                "first_replicas": first,
                "needed": wanted,
                "spent": round(spent / runs, 1),
                "held": held / runs,
            }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--stopping", action="store_true", required=True, help="the rule that adds replicas"
    )
    parser.add_argument("--runs", type=int, default=4000)
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args()
    rows = list(stopping_rows(asked.runs))
    if asked.json:
        print(json.dumps(rows, indent=1))
        return
    print_table(rows)
    print(f"written to {write_csv('intervals_stopping.csv', rows)}")


if __name__ == "__main__":
    main()
