"""CPU seconds that the figures of coverage take, beside those of the simulation.

    python benchmarks/coverage_cost.py

One row is the gear with its shipped budget. The other is the gear with each triangle split in 16,
158,720 in all, and a million impacts on it: those of the first row's replicas, again and again.
Each part is run five times, and the median counts.
"""

import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from benchmarks.table import print_table
from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.chamber.scene import chamber_mesh
from chamberopt.coverage.part_impacts import Hits
from chamberopt.design.design import Design
from chamberopt.design.load import load_design
from chamberopt.simulation import estimates
from chamberopt.simulation import evaluate as evaluation

GEAR = Path(__file__).parents[1] / "designs/gear.toml"
IMPACTS = 1_000_000
RUNS = 5


def median_cpu(task: Callable[[], Any]) -> float:
    """Median CPU seconds of a task, after a run that compiles."""
    task()
    found = []
    for _ in range(RUNS):
        begin = time.process_time()
        task()
        found.append(time.process_time() - begin)
    return float(np.median(found))


def row(name: str, design: Design, chamber: Chamber, hits: list[Hits]) -> dict[str, Any]:
    """CPU seconds of each step for some impacts."""
    mesh = chamber_mesh(chamber)
    field = evaluation.prepare_target(design, chamber, mesh)

    def seen() -> estimates.SeenDents:
        dents = estimates.SeenDents.none(field)
        dents.add(hits)
        return dents

    dents = seen()
    prepare = median_cpu(lambda: evaluation.prepare_target(design, chamber, mesh).wide)
    look = median_cpu(seen)
    estimate = median_cpu(lambda: estimates.estimate_metrics(dents, hits, chamber, design))
    return {
        "case": name,
        "impacts": sum(len(one) for one in hits),
        "triangles": len(chamber.part.triangles),
        "windows": design.process.accuracy.points,
        "prepare": prepare,
        "dents in windows": look,
        "figures": estimate,
        "all": prepare + look + estimate,
    }


def main() -> None:
    design = load_design(GEAR)
    chamber = build_chamber(design)
    with ThreadPoolExecutor(1) as worker:
        evaluation.evaluate(design, chamber, worker)  # compiles
        begin = time.process_time()
        found = evaluation.evaluate(design, chamber, worker)
        simulation = time.process_time() - begin
    rows = [row("gear as shipped", design, chamber, list(found.hits))]
    share = rows[0]["all"] / (simulation - rows[0]["all"])
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "gear.stl"
        trimesh.load_mesh(design.part.mesh_path).subdivide().subdivide().export(path)
        split = design.changed({"part.mesh": str(path)})
        fine = build_chamber(split)

    again, count = [], 0
    for one in cycle(found.hits):
        again.append(one)
        count += len(one)
        if count >= IMPACTS:
            break
    rows.append(row("gear, split in 16", split, fine, _moved(again, fine)))
    print_table(rows)
    print(f"share of the simulation, gear as shipped: {share:.1%} of {simulation:.2f} CPU s")


def _moved(hits: list[Hits], fine: Chamber) -> list[Hits]:
    """The same impacts with the triangles of the fine mesh, the nearest to each contact."""
    from dataclasses import replace

    from sim_core import TriangleMesh, closest_points

    part = fine.part
    surface = TriangleMesh(part.vertices, part.triangles, np.zeros(len(part.triangles), np.uint8))
    return [
        replace(one, triangle=closest_points(surface, one.place.astype(float), 1e-3).triangle)
        for one in hits
    ]


if __name__ == "__main__":
    main()
