"""Do the figures belong to the surface, or to the facets of its rounds?

    python benchmarks/facet_invariance.py [--part NAME ...] [--csv FILE]

Each part is simulated with coarse facets, in strips as CAD programs write them and in irregular
triangles, as its design smooths them and without smoothing. Every mesh is simulated on its own, so
that chaos makes the impacts independent, and so is a mesh of facets so fine that it needs no
smoothing. A row gives the figures and, for each, its difference from that of the fine mesh over the
half-width of the difference. By chance 1 in 20 is above 1.
"""

import argparse
import importlib.util
import math
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

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
from tests.helpers.scenes.rounded_solids import Mesh, Solid, circle, outline, stacked

ROOT = Path(__file__).parents[1]
FIGURES = ("mean_coverage", "uniform_coverage", "p05_coverage", "time_to_98_s")
FINE, SIZE = np.radians(2.5), 3.0  # rad a facet of the fine meshes; mm, irregular triangles
BALL = 0.75  # radius of the balls [mm]
WHOLE = {
    "part.target.direction": None,
    "part.target.angle_deg": None,
    "part.target.box_mm": None,
    "process.accuracy.replicas": 8,
}
IN_SMALL_CHAMBER = WHOLE | {
    "chamber.diameter_mm": 40,
    "chamber.height_mm": 26,
    "chamber.sonotrode_distance_mm": 8,
    "shot.mass_g": 3,
    "process.treatment_time_s": 60,
    "process.accuracy.simulated_time_s": 4.0,
}
OFF = {"part.smoothing": "off"}
Draw = Callable[[Path], None]  # writes an STL


class Case(NamedTuple):
    """A part in a chamber: how its fine mesh and its coarse ones are written."""

    design: Design
    fine: Draw
    coarse: Mapping[str, Draw]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--part", action="append", choices=[name for name, _ in cases()])
    parser.add_argument("--csv", help="name of a file in benchmarks/results")
    arguments = parser.parse_args()
    found = []
    for name, case in cases():
        if not arguments.part or name in arguments.part:
            rows = rows_of(name, case)
            print_table(rows)
            sys.stdout.flush()
            found += rows
    print(summary(found))
    if arguments.csv:
        write_csv(arguments.csv, found)


def cases() -> Iterator[tuple[str, Case]]:
    """The parts by name."""
    gear = load_design(ROOT / "designs/gear.toml")
    small = gear.changed(IN_SMALL_CHAMBER)
    for times in (1.0, 1.5, 3.0):
        corners = [(0, 0), (12, 0), (12, 4, 1.5), (5, 4, times * BALL), (5, 9, 1.5), (0, 9)]
        yield f"block, R = {times:g} r", of_solid(small, Solid(outline(corners), 8.0))
    lathe = Solid(outline([(0, 0), (8, 0), (8, 4, 1.5), (4, 4, 2.0 * BALL), (4, 10, 1.5), (0, 10)]))
    yield "lathe part", of_solid(small, lathe)
    cone = Solid(outline([(0, 0), (8, 0), (4, 10), (0, 10)]))
    yield "cone", of_solid(small, cone)
    yield "torus ring", of_solid(small, Solid(circle(2.0, 7.0)))
    for name, helix, counts in (
        ("spur gear", 0.0, (1.0, 2.0, 4.0, 8.0)),
        ("helical gear", np.radians(27.0), (1.0, 2.0)),
    ):
        coarse = {
            f"fillet points {k:g} times as close": partial(gear_file, fillet=k, helix=helix)
            for k in counts
        }
        resolved = gear.changed({"process.accuracy.simulated_time_s": 2.5})
        yield name, Case(resolved, partial(gear_file, fillet=16.0, helix=helix), coarse)
    blade = load_design(ROOT / "designs/blade.toml")
    coarse = {
        f"{degrees} degrees at edges": partial(blade_file, edge=1.2, turn=np.radians(degrees))
        for degrees in (20, 33)
    }
    fine = partial(blade_file, edge=0.6, turn=np.radians(4.0))
    yield "blade", Case(blade.changed({"process.accuracy.simulated_time_s": 2.5}), fine, coarse)


def of_solid(design: Design, solid: Solid) -> Case:
    """The case of a solid of lines and arcs."""

    def strips(path: Path, step: float) -> None:
        write(path, solid.strips(step))

    coarse: dict[str, Draw] = {
        f"strips of {degrees} degrees": partial(strips, step=np.radians(degrees))
        for degrees in (15, 30)
    }
    coarse["irregular, 22.5 degrees"] = lambda path: write(
        path, solid.irregular(np.radians(22.5), SIZE)
    )
    return Case(design, partial(strips, step=FINE), coarse)


def write(path: Path, mesh: Mesh) -> None:
    """Write a mesh [mm]."""
    trimesh.Trimesh(*mesh, process=False).export(path)


def gear_file(path: Path, fillet: float, helix: float) -> None:
    """The shipped gear without its shaft, with points of the fillet so many times as close.

    Args:
        helix: angle of the teeth on the pitch circle [rad].
    """
    gear, evenly = part_module("gear"), part_module("gear").evenly
    flank = max(1.0, 0.25 * fillet) if fillet > 8.0 else 1.0  # points of the fine mesh
    # Only the space between the teeth asks for less than a whole edge.
    gear.evenly = lambda curve, spacing: evenly(
        curve, spacing / (fillet if spacing < gear.EDGE else flank)
    )
    twist = gear.FACE_WIDTH * math.tan(helix) / gear.PITCH_RADIUS
    rows = 2 + (8 if fillet <= 8.0 else 12) * bool(helix)
    levels = []
    for part in np.linspace(0.0, 1.0, rows):
        c, s = math.cos(part * twist), math.sin(part * twist)
        points = gear.profile() @ np.array([[c, s], [-s, c]])
        levels.append(np.c_[points, np.full(len(points), part * gear.FACE_WIDTH)])
    write(path, stacked(np.stack(levels, axis=1)))


def blade_file(path: Path, edge: float, turn: float) -> None:
    """The shipped blade with edges of a length [mm] that turn by no more than an angle [rad]."""
    blade = part_module("blade")
    blade.EDGE, blade.TURN_PER_EDGE = edge, turn
    blade.main(path)


def part_module(name: str) -> Any:
    """A script of designs/parts as a module of its own."""
    folder = str(ROOT / "designs/parts")
    if folder not in sys.path:
        sys.path.append(folder)
    spec = importlib.util.spec_from_file_location(name, f"{folder}/{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Figures(NamedTuple):
    """The figures of a mesh, the share of the target that a ball can touch, and its triangles."""

    estimates: dict[str, Estimate]
    reach: float
    triangles: int


def figures_of(design: Design, draw: Draw) -> Figures:
    """Simulate a design with the mesh that is drawn."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "part.stl"
        draw(path)
        design = design.changed({"part.mesh": str(path), "part.unit": "mm"})
        chamber = build_chamber(design)
        with ThreadPoolExecutor(core_count()) as workers:
            found = evaluate(design, chamber, workers)
    uniform = weighted_sum(parse_objective("uniform_coverage"), found.metrics)
    estimates = {"uniform_coverage": uniform} | found.metrics
    return Figures(
        {name: estimates[name] for name in FIGURES}, found.reachable, int(chamber.part.target.sum())
    )


def rows_of(name: str, case: Case) -> list[dict[str, Any]]:
    """A row for each mesh of a part."""
    fine = figures_of(case.design.changed(OFF), case.fine)
    rows = [row_of(name, "fine", "off", fine, fine)]
    for mesh, draw in case.coarse.items():
        for smoothing, changes in (("on", {}), ("off", OFF)):
            found = figures_of(case.design.changed(changes), draw)
            rows.append(row_of(name, mesh, smoothing, found, fine))
            print(rows[-1], file=sys.stderr, flush=True)
    return rows


def row_of(name: str, mesh: str, smoothing: str, found: Figures, fine: Figures) -> dict[str, Any]:
    """The row of a mesh beside the fine one."""
    row: dict[str, Any] = {"part": name, "mesh": mesh, "smoothing": smoothing}
    row |= {"triangles": found.triangles, "reach": round(found.reach, 4)}
    for key, one in found.estimates.items():
        row[key] = one.in_words or f"{one.value:.4g} ± {one.half_width:.2g}"
        row[f"{key} apart"] = "" if found is fine else apart(one, fine.estimates[key])
    return row


def apart(one: Estimate, other: Estimate) -> float | str:
    """The difference of two figures over its half-width, or nothing if either is not resolved."""
    width = math.hypot(one.half_width, other.half_width)
    if one.in_words or other.in_words or not 0.0 < width < math.inf:
        return ""
    return round((one.value - other.value) / width, 2)


def summary(rows: list[dict[str, Any]]) -> str:
    """How many differences are above one half-width, and above two."""
    lines = []
    for smoothing in ("on", "off"):
        sizes = [
            abs(row[f"{key} apart"])
            for row in rows
            for key in FIGURES
            if row["smoothing"] == smoothing and row[f"{key} apart"] != ""
        ]
        lines.append(
            f"smoothing {smoothing}: of {len(sizes)} differences {sum(s > 1.0 for s in sizes)} are "
            f"above one half-width, {sum(s > 2.0 for s in sizes)} above two"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    main()
