"""Do the figures belong to the surface, or to the triangles of its mesh?

    python benchmarks/split_invariance.py [--part NAME ...] [--csv FILE]

Each part is simulated with its target as given, with each triangle split in 4 and in 16, remeshed
irregularly, and with flat faces in as few triangles as possible. Every mesh is simulated on its own
with the same seeds; chaos makes the impacts independent. The bar has rounded edges of 2 mm in
facets of 15 and of 3 degrees. A row gives the figures and, for each, its largest difference from
those of the other meshes over the half-width of that difference. By chance 1 in 20 is above 1.
"""

import argparse
import math
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from benchmarks.table import print_table, write_csv
from chamberopt.chamber.build import build_chamber
from chamberopt.common.estimate import Estimate
from chamberopt.common.executor import core_count
from chamberopt.coverage.metrics import parse_objective
from chamberopt.design.design import Design
from chamberopt.design.load import load_design
from chamberopt.simulation.estimates import weighted_sum
from chamberopt.simulation.evaluate import evaluate

ROOT = Path(__file__).parents[1]
FIGURES = ("mean_coverage", "std_coverage", "p05_coverage", "time_to_98_s", "intensity_uniformity")
# Shipped design, changes, elements of irregular meshes [mm].
PARTS: dict[str, tuple[str, dict[str, Any], float]] = {
    "gear": ("gear", {}, 0.4),
    "blade": ("blade", {}, 0.8),
    "plate": ("plate", {}, 1.0),
}
BAR = {"bar, facets of 15 degrees": 15.0, "bar, facets of 3 degrees": 3.0}
BAR_CHANGES = {
    "process.accuracy.simulated_time_s": 8.0,
    "part.target.direction": None,
    "part.target.angle_deg": None,
    "part.target.box_mm": None,
    "chamber.height_mm": 50,
}


def rounded_bar(step: float) -> trimesh.Trimesh:
    """A bar of 40 x 10 x 20 mm with edges along x rounded by 2 mm in facets of `step` degrees."""
    turns = np.radians(np.arange(0.0, 90.0 + 0.5 * step, step))
    outline = []
    for quarter, (y, z) in enumerate([(3.0, 8.0), (-3.0, 8.0), (-3.0, -8.0), (3.0, -8.0)]):
        angle = turns + quarter * np.pi / 2.0
        outline += list(zip(y + 2.0 * np.cos(angle), z + 2.0 * np.sin(angle), strict=True))
    section = trimesh.path.polygons.Polygon(outline)
    bar = trimesh.creation.extrude_polygon(section, 40.0)
    bar.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2.0, [0, 1, 0]))
    bar.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2.0, [1, 0, 0]))
    bar.apply_translation([-bar.centroid[0], -bar.centroid[1], 10.0 - bar.centroid[2]])
    return bar


def meshes_of(design: Design, folder: Path, element: float) -> Iterator[tuple[str, Design]]:
    """The design with its target in other triangles, each with a name."""
    part = trimesh.load_mesh(design.part.mesh_path)
    yield "as given", design
    for name, rounds in (("split in 4", 1), ("split in 16", 2)):
        path = folder / f"{design.part.mesh_path.stem}-{rounds}.stl"
        split = part
        for _ in range(rounds):
            split = split.subdivide()
        split.export(path)
        yield name, design.changed({"part.mesh": str(path)})
    yield "irregular", design.changed({"part.target.element_mm": element})
    yield "decimated where flat", design.changed({"part.target.element_mm": 10.0})


def figures_of(design: Design) -> tuple[dict[str, Estimate], int]:
    """The figures of a design, and the number of triangles of its target."""
    chamber = build_chamber(design)
    with ThreadPoolExecutor(core_count()) as workers:
        found = evaluate(design, chamber, workers)
    uniform = weighted_sum(parse_objective("uniform_coverage"), found.metrics)
    figures = {"uniform_coverage": uniform} | {name: found.metrics[name] for name in FIGURES}
    return figures, int(chamber.part.target.sum())


def rows_of(name: str, design: Design, element: float) -> list[dict[str, Any]]:
    """A row for each mesh of a part."""
    with tempfile.TemporaryDirectory() as folder:
        found = {mesh: figures_of(one) for mesh, one in meshes_of(design, Path(folder), element)}
    rows = []
    for mesh, (figures, triangles) in found.items():
        row: dict[str, Any] = {"part": name, "mesh": mesh, "triangles": triangles}
        for key, one in figures.items():
            apart = [
                abs(one.value - others[key].value)
                / math.hypot(one.half_width, others[key].half_width)
                for other, (others, _) in found.items()
                if other != mesh and one.half_width > 0.0
            ]
            row[key] = one.in_words or f"{one.value:.4g} ± {one.half_width:.2g}"
            row[f"{key} apart"] = round(max(apart, default=0.0), 2)
        rows.append(row)
    return rows


def cases(folder: Path) -> Iterator[tuple[str, Design, float]]:
    """Name, design and size of irregular elements [mm] of each part."""
    for name, (design, changes, element) in PARTS.items():
        yield name, load_design(ROOT / "designs" / f"{design}.toml").changed(changes), element
    for name, step in BAR.items():
        path = folder / f"bar-{step:g}.stl"
        rounded_bar(step).export(path)
        gear = load_design(ROOT / "designs/gear.toml")
        yield name, gear.changed(BAR_CHANGES | {"part.mesh": str(path)}), 0.5


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--part", action="append", choices=[*PARTS, *BAR])
    parser.add_argument("--csv", help="name of a file in benchmarks/results")
    arguments = parser.parse_args()
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for name, design, element in cases(Path(folder)):
            if arguments.part and name not in arguments.part:
                continue
            rows = rows_of(name, design, element)
            print_table(rows)
            found += rows
    if arguments.csv:
        write_csv(arguments.csv, found)


if __name__ == "__main__":
    main()
