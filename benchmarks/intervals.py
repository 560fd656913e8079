"""How honest the figures of a candidate are: bias and calibration against simulated time.

    python benchmarks/intervals.py
    python benchmarks/intervals.py --gear
    python benchmarks/intervals.py --stopping
    python benchmarks/intervals.py --json

The first command uses Poisson models whose truth is known, --gear the shipped gear's chamber; each
takes two CPU minutes. --stopping shows within seconds what happens to an interval if replicas are
added until it looks narrow enough. --json prints the rows as JSON on stdout instead of a table.

Each row stands for many candidates of eight replicas that simulate the given time [s] together. It
gives the mean of the value and of the half-width, the truth, the bias, and how often the 95 %
interval held the truth.
"""

import argparse
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.table import print_table, write_csv
from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.chamber.part import Part
from chamberopt.common.estimate import estimate
from chamberopt.coverage.coverage_from_impacts import Tally
from chamberopt.coverage.metrics import METRICS, OBJECTIVES
from chamberopt.design.load import Design, load_design
from chamberopt.simulation.evaluate import estimate_metrics, weighted_sum
from chamberopt.simulation.replicas import MIN_REPLICAS_TO_STOP, next_replica_count

ROOT = Path(__file__).parents[1]
NAMES = ("mean_coverage", "std_coverage", "p05_coverage")
REPLICAS = 8
TRIANGLES, SIDE, DENT = 2000, 1e-3, 0.02e-6  # of the models: number, side [m], mean dent [m²]
TREATMENT = 120.0


def models() -> dict[str, np.ndarray]:
    """Dented area over area at the treatment time, called x, of each triangle of a square surface.

    In every model x varies smoothly over the surface.
    """
    along = (np.arange(TRIANGLES) % 50) / 49.0
    return {
        "even": np.full(TRIANGLES, 1.0),
        "ramp": 0.3 + 1.7 * along,
        "steep": 3.0 * along**3,
        "shadow": np.where(along < 0.3, 0.0, 0.5 + 1.5 * along),
    }


def model_chamber() -> Chamber:
    """A flat square of separate triangles, 50 by 40."""
    row, column = np.divmod(np.arange(TRIANGLES), 50)
    corner = np.stack([column * SIDE, row * SIDE, np.zeros(TRIANGLES)], axis=1)
    vertices = np.concatenate(
        [corner + SIDE * np.array(step) for step in ((0, 0, 0), (1, 0, 0), (0, 1, 0))]
    )
    triangles = np.arange(3 * TRIANGLES, dtype=np.int32).reshape(3, -1).T
    area = np.full(TRIANGLES, 0.5 * SIDE**2)
    part = Part(vertices, triangles, area, np.ones(TRIANGLES, dtype=bool), "model")
    tags, source = np.zeros(TRIANGLES, dtype=np.uint8), np.arange(TRIANGLES, dtype=np.int32)
    return Chamber(vertices, triangles, tags, source, 1.0, part, area, ())


def poisson_replicas(rng: np.random.Generator, x: np.ndarray, seconds: float) -> list[Tally]:
    """Random dents whose areas vary as in a real chamber (standard deviation 0.75 of the mean)."""
    shape = 1.0 / 0.75**2
    tallies = []
    for _ in range(REPLICAS):
        count = rng.poisson(x * 0.5 * SIDE**2 / DENT * seconds / TREATMENT)
        triangle = np.repeat(np.arange(TRIANGLES), count)
        tallies.append(
            tally_of(
                seconds, triangle, DENT / shape * rng.gamma(shape, size=len(triangle)), TRIANGLES
            )
        )
    return tallies


def tally_of(seconds: float, triangle: np.ndarray, area: np.ndarray, triangles: int) -> Tally:
    """A replica's tally of nothing but dents."""
    count = np.bincount(triangle, minlength=triangles)
    return Tally(
        seconds, count, count, np.bincount(triangle, area, triangles), count, count, triangle, area
    )


def figures(replicas: list[Tally], chamber: Chamber, design: Design) -> dict[str, Any]:
    """The three figures of coverage and the objective, as evaluate() makes them."""
    found = estimate_metrics(replicas, chamber, design)
    got = {name: found[name] for name in NAMES}
    return {**got, "uniform_coverage": weighted_sum(OBJECTIVES["uniform_coverage"], got)}


def exact(x: np.ndarray, weight: np.ndarray) -> dict[str, float]:
    """The figures of known x."""
    share = -np.expm1(-x)
    true = {name: METRICS[name].of_coverage(share, weight / weight.sum()) for name in NAMES}  # type: ignore[misc]
    return {**true, "uniform_coverage": true["mean_coverage"] - true["std_coverage"]}


def rows_of(
    case: str, seconds: float, truth: dict[str, float], runs: list[dict[str, Any]]
) -> Iterator[dict[str, Any]]:
    for name, wanted in truth.items():
        got = [run[name] for run in runs]
        mean = float(np.mean([one.value for one in got]))
        yield {
            "case": case,
            "figure": name,
            "simulated_time": REPLICAS * seconds,
            "runs": len(runs),
            "mean": round(mean, 4),
            "truth": round(wanted, 4),
            "bias": round(mean - wanted, 4),
            "half_width": round(float(np.mean([one.half_width for one in got])), 4),
            "coverage_of_interval": float(np.mean([e.low <= wanted <= e.high for e in got])),
        }


def model_rows(runs: int) -> Iterator[dict[str, Any]]:
    chamber = model_chamber()
    design = load_design(ROOT / "designs" / "plate.toml").changed(
        {"process.treatment_time_s": TREATMENT}
    )
    for case, x in models().items():
        rng = np.random.default_rng(1)
        for seconds in (0.25, 1.0, 4.0, 16.0):
            done = [
                figures(poisson_replicas(rng, x, seconds), chamber, design) for _ in range(runs)
            ]
            yield from rows_of(case, seconds, exact(x, chamber.exposed_area), done)


def gear_rows(runs: int, replicas: int) -> Iterator[dict[str, Any]]:
    """Rows from replicas of the shipped gear that are simulated once.

    Each run draws eight of the replicas and a window of time in each.
    """
    from chamberopt.chamber.scene import build_scene, chamber_mesh, replica_seed
    from chamberopt.common.parallel.executor import local_executor
    from chamberopt.coverage.dents import dent_diameter
    from sim_core import simulate

    design = load_design(ROOT / "designs" / "gear.toml")
    chamber, whole = build_chamber(design), design.process.recorded_time
    mesh, count = chamber_mesh(chamber), len(chamber.part.triangles)
    material, shot = design.materials.part, design.shot

    def dents(number: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        log = simulate(
            build_scene(design, mesh, replica_seed(design.process.seed, number, "confirm"))
        ).impacts
        size = dent_diameter(
            log.normal_speed,
            shot.diameter,
            shot.density,
            material.hardness,
            material.restitution,
            material.yield_speed,
        )
        on = (size > 0.0) & (chamber.source[log.triangle] >= 0)
        return log.time[on], chamber.source[log.triangle[on]], np.pi / 4.0 * size[on] ** 2

    with local_executor() as executor:
        logs = list(executor.map(dents, range(replicas)))
    everything = [tally_of(whole, triangle, area, count) for _, triangle, area in logs]
    # The figures of all replicas together. Their own error is sqrt(8 / replicas) of the error of a
    # run over the whole time.
    truth = {name: one.value for name, one in figures(everything, chamber, design).items()}
    rng = np.random.default_rng(2)
    for seconds in (0.1, 0.375, whole):
        done = []
        for _ in range(runs):
            drawn = []
            for number in rng.choice(replicas, REPLICAS, replace=False):
                begin = rng.integers(round(whole / seconds)) * seconds
                when, triangle, area = logs[number]
                seen = (when >= begin) & (when < begin + seconds)
                drawn.append(tally_of(seconds, triangle[seen], area[seen], count))
            done.append(figures(drawn, chamber, design))
        yield from rows_of("gear", seconds, truth, done)


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
        "--gear", action="store_true", help="the shipped gear's chamber instead of models"
    )
    parser.add_argument(
        "--stopping", action="store_true", help="the rule that adds replicas instead"
    )
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument(
        "--replicas", type=int, default=400, help="of the gear, that runs draw from"
    )
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args()
    name, made = "intervals.csv", model_rows(asked.runs)
    if asked.gear:
        name, made = "intervals_gear.csv", gear_rows(asked.runs, asked.replicas)
    elif asked.stopping:
        name, made = "intervals_stopping.csv", stopping_rows(20 * asked.runs)
    rows = list(made)
    if asked.json:
        print(json.dumps(rows, indent=1))
        return
    print_table(rows)
    print(f"written to {write_csv(name, rows)}")


if __name__ == "__main__":
    main()
