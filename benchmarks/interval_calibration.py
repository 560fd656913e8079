"""Do the 95 % intervals of all figures hold, and are they as narrow as they can be?

    python benchmarks/interval_calibration.py [--surface NAME ...] [--setting DENTS REPLICAS ...]
        [--runs N] [--csv FILE]

Dents fall at random, with a known density and known speeds, on six surfaces: from a plate that is
hit evenly to a block with a hollow that is hit very unevenly. Each run draws all its replicas anew,
and its figures are those that the program gives. A row is for one figure, over all runs of a
surface with so many dents in the median window and so many replicas:

held    share of the runs, among those that show the figure, whose interval holds the truth
shown   share of the runs that show the figure
width   median half-width over that of Student's distribution with the root mean square error
bias    mean of the figure less the truth, over that error

The truth is the figure of all runs together, which have as many times more dents. What comes from
the choice of points is the same in all of them, so it is neither in the scatter nor in the truth;
the intervals have it all the same. Real simulations: coverage_calibration.py.
"""

import argparse
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import trimesh

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.table import print_table, write_csv
from chamberopt.chamber.build import Chamber
from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.estimate import Estimate, student_quantile
from chamberopt.common.number_text import plain
from chamberopt.coverage.coverage_from_impacts import (
    MAX_BATCHES,
    batches_of,
    coverage_from_dent_density,
)
from chamberopt.coverage.dents import dent_diameter
from chamberopt.coverage.field.target_field import WindowSetting, find_target_field
from chamberopt.coverage.metrics import OBJECTIVES
from chamberopt.coverage.part_impacts import Hits
from chamberopt.coverage.percentile import exposure_from_density, sum_dents
from chamberopt.coverage.strength_intervals import strength_estimates
from chamberopt.design.calibration import calibrated_strip
from chamberopt.design.load import Design
from chamberopt.simulation import estimates
from tests.helpers.synthetic import chamber_round, plane_chamber, plate_design

BALL, POINTS = 1.5e-3, 4000
SETTINGS = ((12, 8), (30, 8), (100, 3), (100, 4), (100, 8), (100, 24), (100, 64), (1000, 8))
STRENGTH = (
    "strength_um", "strength_p05_um", "strength_p95_um", "intensity_uniformity",
    "saturation_time_s",
)  # fmt: skip
FIGURES = (
    "mean_coverage", "std_coverage", "uniform_coverage", "p05_coverage", "p95_coverage",
    "exposure", "p95_exposure", "time_to_98_s", *STRENGTH,
)  # fmt: skip
ENOUGH = 5000  # dents in the median window, of which the true strength comes
COVERED = 0.5  # of the median window, after the treatment
MM = 1e-3


class Surface(NamedTuple):
    """A part, and how unevenly it is hit: by this times a pattern, the logarithm of the density."""

    chamber: Callable[[], Chamber]
    unevenness: float


def _divided(mesh: trimesh.Trimesh, longest: float) -> trimesh.Trimesh:
    vertices, faces = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, longest)
    return trimesh.Trimesh(vertices, faces)


def _prism(sides: int, radius: float, height: float) -> trimesh.Trimesh:
    return trimesh.creation.cylinder(radius, height, sections=sides)


def _side(mesh: trimesh.Trimesh) -> Chamber:
    """What is not an end face is the target."""
    return chamber_round(mesh, np.abs(mesh.face_normals[:, 2]) < 0.9)


def _star(teeth: int) -> trimesh.Trimesh:
    """A wheel with sharp teeth."""
    angle = np.pi * np.arange(2 * teeth) / teeth
    radius = np.where(np.arange(2 * teeth) % 2, 7.0, 10.0) * MM
    ring = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    count = len(ring)
    vertices = np.vstack([[*p, z] for z in (0.0, 8.0 * MM) for p in ring])
    vertices = np.vstack([vertices, [0.0, 0.0, 0.0], [0.0, 0.0, 8.0 * MM]])
    faces = []
    for i in range(count):
        j = (i + 1) % count
        faces += [(i, j, j + count), (i, j + count, i + count)]
        faces += [(2 * count, j, i), (2 * count + 1, i + count, j + count)]
    return trimesh.Trimesh(vertices, faces, process=False)


def _blade() -> trimesh.Trimesh:
    blade = trimesh.creation.cylinder(1.0, 24.0 * MM, sections=24)
    blade.apply_scale([6.0 * MM, 1.0 * MM, 1.0])
    return blade


def _hollow() -> Chamber:
    block = trimesh.creation.box((14.0 * MM, 10.0 * MM, 10.0 * MM))
    slot = trimesh.creation.box((5.0 * MM, 12.0 * MM, 6.0 * MM))
    slot.apply_translation((0.0, 0.0, 4.0 * MM))
    mesh = trimesh.boolean.difference([block, slot])
    return chamber_round(_divided(mesh, 2.0 * MM))


SURFACES = {
    "plate": Surface(lambda: plane_chamber(3), 0.02),
    "lathe part": Surface(lambda: _side(_divided(_prism(48, 5 * MM, 16 * MM), 2 * MM)), 0.15),
    "gear": Surface(lambda: _side(_divided(_star(12), 2 * MM)), 0.3),
    "prism with creases": Surface(lambda: _side(_divided(_prism(9, 5 * MM, 16 * MM), 2 * MM)), 0.4),
    "blade": Surface(lambda: _side(_divided(_blade(), 2 * MM)), 0.6),
    "block with a hollow": Surface(_hollow, 1.0),
}


class Rain:
    """Dents with a known density on a surface."""

    def __init__(self, surface: Surface, design: Design) -> None:
        self.design, self.chamber = design, surface.chamber()
        part = self.chamber.part
        middle = part.vertices[part.triangles].mean(axis=1)
        pattern = np.sin(400.0 * middle[:, 0] + 1.0) + np.sin(300.0 * middle[:, 1] + 2.0)
        pattern += np.sin(250.0 * middle[:, 2])
        self.density = np.exp(surface.unevenness * pattern)
        shot = design.shot
        setting = WindowSetting(1e-6, POINTS, BALL, self.dent(np.array([12.0])).item())
        self.field = find_target_field(self.chamber, chamber_mesh(self.chamber), setting)
        self.mass = shot.density * np.pi / 6.0 * BALL**3

    def dent(self, speed: np.ndarray) -> np.ndarray:
        return dent_diameter(speed, BALL, self.design.shot.density, self.design.materials.part)

    def replica(self, per_window: float, rng: np.random.Generator) -> Hits:
        """So many dents, on average, in a window of the mean density; an edge collects a tenth."""
        part, own = self.chamber.part, self.field.on_target
        mean = np.where(own, self.density * part.area * per_window / 1e-6, 0.0)
        triangle = np.repeat(np.arange(len(mean)), rng.poisson(mean))
        corner = rng.dirichlet((1.0, 1.0, 1.0), len(triangle))
        creases = self.field.creases
        on = rng.random(len(triangle)) < 0.1
        for side in range(3):  # onto one of the triangle's creases
            moved = np.flatnonzero(on & (creases.of_triangle[triangle, side] >= 0))
            at = rng.random(len(moved))
            corner[moved] = 0.0
            corner[moved, side], corner[moved, (side + 1) % 3] = at, 1.0 - at
        place = np.einsum("ij,ijk->ik", corner, part.vertices[part.triangles[triangle]])
        speed = rng.rayleigh(3.0, len(triangle))
        columns = (speed, np.full_like(speed, 70.0), self.dent(speed), 0.5 * self.mass * speed**2)
        return Hits(
            triangle.astype(np.int32),
            place.astype(np.float32),
            *(one.astype(np.float32) for one in columns),
        )


def seen_by(rain: Rain, hits: list[Hits]) -> estimates.SeenDents:
    seen = estimates.SeenDents.none(rain.field)
    seen.add(hits)
    return seen


def true_figures(rain: Rain, x: np.ndarray, time: float, hits: list[Hits]) -> dict[str, float]:
    """The figures from the mean dent density of each window, and from the impacts of many runs."""
    reach, design = rain.field.reach.share, rain.design
    coverage = np.concatenate(
        [coverage_from_dent_density(x), np.zeros(round(len(x) / reach) - len(x))]
    )
    of_all = np.concatenate([x, np.zeros(len(coverage) - len(x))])
    low, high = (float(np.quantile(coverage, q)) for q in (0.05, 0.95))
    found = {
        "mean_coverage": float(coverage.mean()),
        "std_coverage": float(coverage.std()),
        "p05_coverage": low,
        "p95_coverage": high,
        "exposure": float(exposure_from_density(of_all.mean())),
        "p95_exposure": float(exposure_from_density(np.quantile(of_all, 0.95))),
        "time_to_98_s": time * math.log(50.0) / -math.log1p(-low),
        "uniform_coverage": float(coverage.mean() - coverage.std()),
    }
    count = len(hits) // 8
    batches = [hits[k * count : (k + 1) * count] for k in range(8)]
    seconds = design.process.recorded_time
    strip = calibrated_strip(design.shot, design.calibration)
    density = design.shot.density
    strength = strength_estimates(rain.field, batches, seconds, density, strip)
    return found | {key: strength[key].value for key in STRENGTH}


def rows_of(name: str, dents: int, replicas: int, runs: int) -> Iterator[dict[str, Any]]:
    """The rows of one surface, dents in the median window and number of replicas."""
    design = plate_design(process__accuracy__simulated_time_s=1.0 / replicas)
    rain = Rain(SURFACES[name], design)
    # The time after which the median window is half covered, in units of the whole simulation.
    rng = np.random.default_rng([dents, replicas, len(name)])
    pilot = seen_by(rain, [rain.replica(10.0, rng)])
    sums = sum_dents(batches_of(pilot.gauge), len(rain.field.gauge.area))
    density = float(np.median(sums.share)) / float(np.median(sums.number)) * dents
    time = -np.log1p(-COVERED) / density
    per_window = dents / float(np.median(sums.number)) * 10.0 / replicas
    rain.design = design.changed({"process.treatment_time_s": time})
    found: list[dict[str, Estimate]] = []
    known: list[set[str]] = []
    kept: list[Hits] = []
    x = np.zeros(len(rain.field.gauge.area))
    for number in range(runs):
        seen = seen_by(rain, [rain.replica(per_window, rng) for _ in range(replicas)])
        raw, resolution = estimates.raw_estimates(seen, rain.design)
        shown = {
            key
            for key, one in raw.items()
            if estimates.as_resolved(key, one, resolution).has_number
        }
        raw["uniform_coverage"] = estimates.weighted_sum(OBJECTIVES["uniform_coverage"], raw)
        found.append({key: raw[key] for key in FIGURES})
        known.append(shown | ({"uniform_coverage"} if resolution.has_mean else set()))
        x += sum_dents(batches_of(seen.gauge), len(x)).share.sum(axis=0) * time / runs
        if number * dents < ENOUGH:
            kept += seen.in_sector
    truth = true_figures(rain, x, time, kept)
    for key, true in truth.items():
        values = np.array([one[key].value for one in found])
        widths = np.array([one[key].half_width for one in found])
        there = np.array([key in some for some in known])
        error = float(np.sqrt(np.mean((values - true) ** 2))) or 1e-12
        asked = student_quantile(min(replicas, MAX_BATCHES) - 1) * error
        yield {
            "surface": name,
            "dents": dents,
            "replicas": replicas,
            "figure": key,
            "truth": true,
            "held": float((np.abs(values - true) <= widths)[there].mean()) if there.any() else None,
            "shown": float(there.mean()),
            "width": float(np.median(widths[there])) / asked if there.any() else None,
            "bias": float(values.mean() - true) / error,
        }


def rows_of_surface(
    name: str, runs: int, settings: Sequence[Sequence[int]]
) -> list[dict[str, Any]]:
    """All rows of one surface; runs with very many dents are fewer."""
    return [
        row
        for dents, replicas in settings
        for row in rows_of(name, dents, replicas, max(runs // (4 if dents > 500 else 1), 20))
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--surface", action="append", choices=list(SURFACES))
    parser.add_argument(
        "--setting", nargs=2, type=int, action="append", metavar=("DENTS", "REPLICAS")
    )
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--csv", help="name of a file in benchmarks/results")
    arguments = parser.parse_args()
    found: list[dict[str, Any]] = []
    for name in arguments.surface or SURFACES:
        found += rows_of_surface(name, arguments.runs, arguments.setting or SETTINGS)
    print_table([{k: "-" if x is None else plain(x, 3) for k, x in row.items()} for row in found])
    if arguments.csv:
        write_csv(arguments.csv, found)


if __name__ == "__main__":
    main()
