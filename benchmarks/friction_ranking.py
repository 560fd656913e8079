"""What friction changes in real chambers, and which conclusions of a study survive it.

    python benchmarks/friction_ranking.py [--chambers gear_pair|gear|flat|blade ...] [--csv FILE]

The first table has two chambers of the gear with several frictions, with smooth and with rough
faces: coverage of the teeth, dents on the whole part, and the time for as much dented area, on the
whole part and on the teeth, beside those without friction. The second ranks eight chambers of the
gear, 24 flat ones and the three of the blade by uniform coverage, without friction and with two
values of mu and rough faces. A swap is a pair of chambers whose order is another one, with both
differences beyond their 95 % intervals. The loss is what the best chamber without friction lacks,
with friction, of the one that is best there.
"""

import argparse
import sys
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from itertools import combinations, product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import qmc, spearmanr

from benchmarks.table import print_table, write_csv
from chamberopt.chamber.build import build_chamber
from chamberopt.common.estimate import Estimate
from chamberopt.common.executor import core_count
from chamberopt.design.load import Design, load_design
from chamberopt.simulation.evaluate import evaluate

DESIGNS = Path(__file__).parents[1] / "designs"
BETA0, SLOPE = 0.2, {"slope_deg": 3.0}
SMOOTH: dict[str, Any] = {"effects.friction": "none", "effects.roughness": "none"}
KEYS = ("chamber.height_mm", "chamber.sonotrode_distance_mm", "shot.mass_g")
PAIR = {"start": (45.0, 15.0, 5.0), "best": (32.0, 21.1, 10.0)}  # by KEYS
BOUNDS = ((28.0, 60.0), (4.0, 25.0), (2.0, 10.0))  # of gear chambers, by KEYS
DISTANCES, BALLS = (8.0, 10.0, 12.5, 15.0, 20.0, 25.0), (15, 30, 60, 150)
FLAT_TIME = 1.0  # s: longer, and many chambers would cover everything


class Figures(NamedTuple):
    """Of one chamber with one friction."""

    uniform: Estimate
    mean: Estimate
    dents: int  # on the whole part
    dented: float  # area of all dents, on the whole part [m²]
    exposure: float  # dented area per area of the target, as metrics have it


def effects(mu: float, rough: bool) -> dict[str, Any]:
    """Return the keys of a design for a friction; 0 is none."""
    if mu == 0.0:
        return SMOOTH | ({"effects.roughness": SLOPE} if rough else {})
    return {
        "effects.friction": {"mu": mu, "beta0": BETA0},
        "effects.roughness": SLOPE if rough else "none",
    }


def figures(design: Design, workers: ThreadPoolExecutor) -> Figures:
    """Simulate a design and return its figures."""
    found = evaluate(design, build_chamber(design), workers)
    dents = np.concatenate([one.dent for one in found.hits])
    return Figures(
        found.objective,
        found.metrics["mean_coverage"],
        int((dents > 0.0).sum()),
        float(np.pi / 4.0 * (dents.astype(float) ** 2).sum()),
        found.metrics["exposure"].value,
    )


def pair_rows(workers: ThreadPoolExecutor) -> Iterator[dict[str, Any]]:
    """Yield rows of the two gear chambers with each friction."""
    gear = load_design(DESIGNS / "gear.toml")
    cases = [(0.0, False), (0.1, False), (0.2, False), (0.3, False)]
    cases += [(0.0, True), (0.1, True), (0.2, True), (0.3, True)]
    for name, values in PAIR.items():
        plain: Figures | None = None
        for mu, rough in cases:
            design = gear.changed(dict(zip(KEYS, values, strict=True)) | effects(mu, rough))
            one = figures(design, workers)
            plain = plain or one
            yield {
                "chamber": name,
                "mu": mu,
                "slope_deg": SLOPE["slope_deg"] if rough else 0.0,
                "uniform": f"{one.uniform.value:.3f} ± {one.uniform.half_width:.3f}",
                "mean": f"{one.mean.value:.3f} ± {one.mean.half_width:.3f}",
                "dents": round(one.dents / plain.dents, 3),
                "time_for_the_same_area": round(plain.dented / one.dented, 3),
                "on_the_target": round(plain.exposure / one.exposure, 3),
            }


def gear_chambers() -> Iterator[tuple[str, Design]]:
    """Yield eight chambers of the gear that are spread evenly between the bounds."""
    gear = load_design(DESIGNS / "gear.toml").changed({"process.accuracy.replicas": 4})
    points = qmc.scale(qmc.Sobol(3, rng=1).random(8), *zip(*BOUNDS, strict=True))
    for height, distance, mass in points.round(1).tolist():
        distance = min(distance, height - 12.0)  # the gear is 10 mm high
        values = dict(zip(KEYS, (height, distance, mass), strict=True))
        yield f"gear {height:g}/{distance:g}/{mass:g}", gear.changed(values)


def flat_chambers() -> Iterator[tuple[str, Design]]:
    """Yield chambers with the plate as a flat lid: each distance with each number of balls."""
    plate = load_design(DESIGNS / "plate.toml")
    for distance, balls in product(DISTANCES, BALLS):
        values = {
            "chamber.sonotrode_distance_mm": distance,
            "chamber.height_mm": distance + 5.0,
            "shot.mass_g": balls * 1e3 * plate.shot.ball_mass,
            "process.treatment_time_s": FLAT_TIME,
        }
        yield f"flat {distance:g} mm, {balls} balls", plate.changed(values)


def blade_chambers() -> Iterator[tuple[str, Design]]:
    """Yield the shipped chambers of the blade, whose thin places bend with any friction."""
    for name in ("blade", "blade_conformal", "blade_oblong"):
        yield name, load_design(DESIGNS / f"{name}.toml").changed({"process.accuracy.replicas": 4})


def ranking(
    kind: str, chambers: Iterator[tuple[str, Design]], workers: ThreadPoolExecutor
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Return a row for each chamber, and one for each friction, which compares the orders."""
    worlds: Mapping[str, dict[str, Any]] = {
        "none": effects(0.0, rough=False),
        "mu 0.1, 3°": effects(0.1, rough=True),
        "mu 0.3, 3°": effects(0.3, rough=True),
    }
    names, found = [], []
    for name, design in chambers:
        names.append(name)
        found.append([figures(design.changed(keys), workers).uniform for keys in worlds.values()])
        print(name, *(f"{one.value:.3f} ± {one.half_width:.3f}" for one in found[-1]), sep="  ")
        sys.stdout.flush()
    rows = [
        {"chamber": name} | dict(zip(worlds, (f"{one.value:.3f}" for one in row), strict=True))
        for name, row in zip(names, found, strict=True)
    ]
    values = np.array([[one.value for one in row] for row in found])
    best, compared = int(values[:, 0].argmax()), []
    for k, world in enumerate(worlds):
        swaps = sum(_swapped(found[i], found[j], k) for i, j in combinations(range(len(found)), 2))
        top = int(values[:, k].argmax())
        compared.append(
            {
                "chambers": kind,
                "friction": world,
                "rank_correlation": round(float(spearmanr(values[:, 0], values[:, k])[0]), 3),
                "pairs": len(found) * (len(found) - 1) // 2,
                "swaps": swaps,
                "best": names[top],
                "loss": round(float(values[top, k] - values[best, k]), 3),
                "half_width": round(
                    float(np.hypot(found[top][k].half_width, found[best][k].half_width)), 3
                ),
            }
        )
    return rows, compared


def _swapped(one: list[Estimate], other: list[Estimate], k: int) -> bool:
    """True if two chambers are in another order with friction k, both times beyond the noise."""
    signs = []
    for column in (0, k):
        a, b = one[column], other[column]
        noise = np.hypot(a.half_width, b.half_width)
        signs.append(0 if abs(a.value - b.value) <= noise else np.sign(a.value - b.value))
    return signs[0] * signs[1] < 0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    kinds = ("gear_pair", "gear", "flat", "blade")
    parser.add_argument("--chambers", action="append", choices=kinds)
    parser.add_argument("--csv", help="beginning of the names of files in benchmarks/results")
    arguments = parser.parse_args()
    asked = arguments.chambers or kinds
    tables: dict[str, list[dict[str, Any]]] = {}
    with ThreadPoolExecutor(core_count()) as workers:
        if "gear_pair" in asked:
            tables["gear_pair"] = list(pair_rows(workers))
            print_table(tables["gear_pair"])
        compared = []
        ranked = {"gear": gear_chambers, "flat": flat_chambers, "blade": blade_chambers}
        for kind, chambers in ranked.items():
            if kind in asked:
                tables[kind], orders = ranking(kind, chambers(), workers)
                compared += orders
        if compared:
            tables["orders"] = compared
            print_table(compared)
    if arguments.csv:
        for name, rows in tables.items():
            print("wrote", write_csv(f"{arguments.csv}_{name}.csv", rows))


if __name__ == "__main__":
    main()
