"""Do the 95 % intervals of the coverage's figures hold, and from how many dents on?

    python benchmarks/coverage_calibration.py [--case NAME ...] [--replicas N] [--group N]
        [--groups N] [--csv FILE]

For each case a pool of replicas is simulated once. Groups of eight, or N, are drawn from it
at random, 200 a row by default, and their figures are compared with those of the whole pool, which
is many times as large.
Rows are for groups with all and with half of the time of each replica. A row gives the
share of the intervals that held, the bias, the ratio of the median half-width to 1.96 standard
deviations of the figure, and in how many groups the figure was resolved. Rows are printed also for
figures that were not: their intervals are those that the program does not show.
"""

import argparse
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.table import print_table, write_csv
from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.chamber.replica_seed import replica_seed
from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.executor import core_count
from chamberopt.coverage.coverage_from_impacts import find_footprints
from chamberopt.coverage.metrics import OBJECTIVES
from chamberopt.coverage.part_impacts import Hits, hits_on_part
from chamberopt.design.design import Design
from chamberopt.design.load import load_design
from chamberopt.simulation import estimates
from chamberopt.simulation import evaluate as evaluation
from chamberopt.simulation.replicas import simulate_seed

ROOT = Path(__file__).parents[1]
GROUPS, GROUP = 200, 8
PARTS = (1.0, 0.5)  # of each replica's time


class Case(NamedTuple):
    """A design and what is changed in it; replicas simulate `seconds`."""

    design: str
    changes: dict[str, Any]
    seconds: float


SIZES = [{"diameter_mm": 2.0, "share": 0.5}, {"diameter_mm": 3.0, "share": 0.5}]
CASES = {
    "plate": Case("plate", {}, 4.0),
    "plate, two ball sizes": Case("plate", {"shot.diameter_mm": None, "shot.mix": SIZES}, 4.0),
    "blade": Case("blade", {}, 10.0),
    "gear": Case("gear", {}, 1.5),
    "gear as in the file": Case("gear", {"part.smoothing": "off"}, 1.5),
    "gear, turning": Case("gear_turning", {}, 4.0),
}


def simulate_pool(case: Case, count: int) -> tuple[Design, Chamber, list[tuple[Hits, np.ndarray]]]:
    """The impacts of many replicas, each with the times [s] at which they fell."""
    design = load_design(ROOT / "designs" / f"{case.design}.toml")
    seconds = {"process.accuracy.simulated_time_s": case.seconds}
    design = design.changed(case.changes | seconds)
    chamber = build_chamber(design)
    mesh = chamber_mesh(chamber)

    def one(number: int) -> tuple[Hits, np.ndarray]:
        seed = replica_seed(design.process.seed, number)
        impacts = simulate_seed(design, chamber, mesh, seed).impacts
        on_part = chamber.source[impacts.triangle] >= 0
        return hits_on_part(impacts, chamber, design), np.asarray(impacts.time)[on_part]

    with ThreadPoolExecutor(core_count()) as workers:
        return design, chamber, list(workers.map(one, range(count)))


def until(hits: Hits, rows: np.ndarray) -> Hits:
    """Some of the impacts."""
    return replace(hits, **{name: column[rows] for name, column in vars(hits).items()})


def rows_of(
    name: str, case: Case, replicas: int, group: int, count: int
) -> Iterator[dict[str, Any]]:
    """Calibration of all figures of a case, a row each for each part of the time."""
    whole, chamber, pool = simulate_pool(case, replicas)
    field = evaluation.prepare_target(whole, chamber, chamber_mesh(chamber))
    rng = np.random.default_rng(1)
    truth: dict[str, float] = {}
    for part in PARTS:
        seconds = part * case.seconds
        design = whole.changed({"process.accuracy.simulated_time_s": seconds})
        hits = [until(one, times < seconds) for one, times in pool]
        sizes = field.gauge, field.wide
        seen: list[Any] = [[find_footprints(field, gauge, one) for one in hits] for gauge in sizes]
        seen.append([field.in_sector(one) for one in hits])
        if not truth:
            of_pool = figures(field, seen, design)[0]
            truth = {key: one.value for key, one in of_pool.items()}
        groups = [
            figures(field, [[kind[i] for i in some] for kind in seen], design)
            for some in drawn(rng, replicas, group, count)
        ]
        for key, true in truth.items():
            found = [figures_of[key] for figures_of, _, _ in groups]
            resolved = np.mean([key in known for _, known, _ in groups])
            values = np.array([one.value for one in found])
            widths = np.array([one.half_width for one in found])
            spread = float(values.std())
            if spread == 0.0:
                continue
            yield {
                "case": name,
                "seconds": group * seconds,
                "dents": float(np.median([dents for _, _, dents in groups])),
                "figure": key,
                "truth": true,
                "bias": float(values.mean()) - true,
                "half_width": float(np.median(widths)),
                "width_ratio": float(np.median(widths)) / spread / 1.96,
                "held": float(np.mean(np.abs(values - true) <= widths)),
                "resolved": float(resolved),
            }


def drawn(rng: np.random.Generator, replicas: int, group: int, groups: int) -> Iterator[np.ndarray]:
    """Groups of replicas; no replica is in two groups until all have been in one."""
    count = 0
    while True:
        for some in rng.permutation(replicas)[: replicas // group * group].reshape(-1, group):
            yield some
            count += 1
            if count == groups:
                return


def figures(field: Any, seen: list[Any], design: Design) -> tuple[dict[str, Any], set[str], float]:
    """Estimates, which of them are resolved, and the dents in the median window."""
    dents = estimates.SeenDents(field, *seen)
    raw, resolution = estimates.raw_estimates(dents, design)
    known = {
        key for key, one in raw.items() if not estimates.as_resolved(key, one, resolution).in_words
    }
    raw["uniform_coverage"] = estimates.weighted_sum(OBJECTIVES["uniform_coverage"], raw)
    known |= {"uniform_coverage"} if resolution.has_mean else set()
    return raw, known, resolution.dents


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--case", action="append", choices=list(CASES))
    parser.add_argument("--replicas", type=int, default=320)
    parser.add_argument("--group", type=int, default=GROUP)
    parser.add_argument("--groups", type=int, default=GROUPS)
    parser.add_argument("--csv", help="name of a file in benchmarks/results")
    arguments = parser.parse_args()
    found = []
    for name in arguments.case or CASES:
        rows = list(
            rows_of(name, CASES[name], arguments.replicas, arguments.group, arguments.groups)
        )
        print_table(rows)
        found += rows
    if arguments.csv:
        write_csv(arguments.csv, found)


if __name__ == "__main__":
    main()
