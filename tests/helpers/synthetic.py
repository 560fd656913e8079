"""Impacts without a simulation, and parts of which the answer is known."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import trimesh

from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.chamber.part import Part
from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.estimate import Estimate, estimate
from chamberopt.coverage.coverage_intervals import Resolution
from chamberopt.coverage.metrics import OBJECTIVES, metric_names
from chamberopt.coverage.part_impacts import Hits
from chamberopt.design.load import Design, load_design
from chamberopt.geometry.triangles import areas
from chamberopt.simulation.estimates import (
    SeenDents,
    estimate_metrics,
    estimate_zones,
    resolution_notes,
    weighted_sum,
)
from chamberopt.simulation.evaluate import prepare_target, zone_fields
from chamberopt.simulation.evaluation import Evaluation
from sim_core import closest_points

DESIGNS = Path(__file__).resolve().parents[2] / "designs"
SPEED, ANGLE = 3.0, 70.0  # of all made-up impacts [m/s, degrees]

MANY_DENTS = Resolution(
    dents=100.0, needed_for_mean=3.0, needed_for_places=25.0, simulated_time=8.0
)


def plate_design(**values: float) -> Design:
    """The shipped plate, with other numbers: plate_design(shot__mass_g=3) sets shot.mass_g."""
    changes = {name.replace("__", "."): value for name, value in values.items()}
    return load_design(DESIGNS / "plate.toml").changed(changes)


def machine_values(**sds: float) -> dict[str, Any]:
    """The table of a calibration: what is named has this standard deviation of its logarithm."""
    count = len(sds)
    return {
        "program": "0",
        "parameters": tuple(sds),
        "log_mean": (0.0,) * count,
        "log_covariance": tuple(map(tuple, (np.diag(list(sds.values())) ** 2).tolist())),
        "amplitude_um": (20.0, 30.0),
        "ball_diameter_mm": (3.0, 3.0),
        "ball_density_kg_m3": 7800.0,
    }


def chamber_round(
    mesh: trimesh.Trimesh,
    target: np.ndarray | None = None,
    gap: float = 5e-3,
    symmetric: bool = False,
) -> Chamber:
    """A part that floats in a box, which is a gap [m] larger on all sides.

    On one side it is a little more, unless the room may be symmetric.
    """
    vertices, triangles = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    bounds = mesh.bounds + np.array([[-gap], [gap]])
    bounds[1, 0] += 0.0 if symmetric else 0.1 * gap
    room = trimesh.creation.box(bounds=bounds)
    own, walls = len(triangles), len(room.faces)
    area = areas(vertices, triangles)
    wanted = np.ones(own, dtype=bool) if target is None else target
    return Chamber(
        vertices=np.concatenate([vertices, room.vertices]),
        triangles=np.concatenate([triangles[:, ::-1], room.faces + len(vertices)]).astype(np.int32),
        tags=np.repeat([0, 2], [own, walls]).astype(np.uint8),
        source=np.concatenate([np.arange(own), np.full(walls, -1)]).astype(np.int32),
        volume=float(room.volume - mesh.volume),
        part=Part(vertices, triangles.astype(np.int32), area, wanted, "synthetic"),
        exposed_area=area,
        notes=(),
    )


def plane_chamber(splits: int = 4, side: float = 0.02, margin: float = 2.5e-3) -> Chamber:
    """A slab whose target is the plane z = 0 up to a margin [m] from the sides of its square.

    Args:
        splits: how often the two triangles of the square are each split in four.
        side: of the square [m].
    """
    slab = trimesh.creation.box((side, side, 2e-3))
    for _ in range(splits):
        slab = slab.subdivide()
    slab.apply_translation((0.0, 0.0, -1e-3))
    middle = slab.triangles_center
    inside = (np.abs(middle[:, :2]).max(axis=1) < 0.5 * side - margin) & (middle[:, 2] > -1e-9)
    return chamber_round(slab, inside)


def impact_log(
    triangle: Any, velocity: Any, normal_speed: Any, ball: Any = 0, position: Any = (0.0, 0.0, 0.0)
) -> Any:
    """The columns of a sim_core.ImpactLog that coverage reads."""
    return SimpleNamespace(
        triangle=np.asarray(triangle, dtype=np.int32),
        ball=np.broadcast_to(np.asarray(ball, dtype=np.int32), np.shape(triangle)),
        velocity=np.asarray(velocity, dtype=float).reshape(-1, 3),
        normal_speed=np.asarray(normal_speed, dtype=float),
        position=np.broadcast_to(np.asarray(position, dtype=float), (len(triangle), 3)),
    )


def triangles_at(chamber: Chamber, place: np.ndarray) -> np.ndarray:
    """The part triangle on which each place (k, 3) lies, (k,)."""
    found = closest_points(chamber_mesh(chamber), place, 1e-6)
    return chamber.source[found.triangle]


def dents_at(
    design: Design, triangle: np.ndarray, place: np.ndarray, diameter: float | np.ndarray
) -> Hits:
    """Dents of given diameters [m] at given places, of the design's balls at SPEED."""
    count, shot = len(triangle), design.shot
    mass = shot.density * np.pi / 6.0 * max(shot.diameters) ** 3
    columns = (SPEED, ANGLE, diameter, 0.5 * mass * SPEED**2)
    return Hits(
        np.asarray(triangle, dtype=np.int32),
        np.asarray(place, dtype=np.float32).reshape(-1, 3),
        *(np.broadcast_to(column, count).astype(np.float32) for column in columns),
    )


def random_dents(
    design: Design,
    chamber: Chamber,
    mean: np.ndarray,
    rng: np.random.Generator,
    diameter: float = np.sqrt(4e-8 / np.pi),
) -> Hits:
    """Dents anywhere on each part triangle, in numbers that follow Poisson's law.

    Args:
        mean: number on each triangle, (m,).
        diameter: of the dents [m].
    """
    triangle = np.repeat(np.arange(len(mean)), rng.poisson(mean))
    share = rng.random((2, len(triangle), 1))
    u, v = np.where(share.sum(axis=0) > 1.0, 1.0 - share, share)
    a, b, c = chamber.part.vertices[chamber.part.triangles[triangle]].transpose(1, 0, 2)
    return dents_at(design, triangle, a + u * (b - a) + v * (c - a), diameter)


def no_hits() -> Hits:
    """A replica in which nothing reaches the part."""
    return Hits(np.zeros(0, np.int32), np.zeros((0, 3), np.float32), *np.zeros((4, 0), np.float32))


@cache
def _metrics_of_the_plate() -> tuple[str, ...]:
    return tuple(metric_names(plate_design()))


def judged(objective: np.ndarray, **metrics: float) -> Evaluation:
    """An evaluation whose replicas have these objectives; metrics given are exact, the others 0."""
    exact = {
        name: Estimate(metrics.get(name, 0.0), 0.0, (metrics.get(name, 0.0),) * 3)
        for name in {*_metrics_of_the_plate(), *metrics}
    }
    count = len(objective)
    return Evaluation(
        objective_name="uniform_coverage",
        objective=estimate(objective),
        metrics=exact,
        metrics_of_wide={},
        gauge_mm2=1.0,
        resolution=MANY_DENTS,
        reachable=1.0,
        crease_share=0.0,
        replicas=count,
        simulated_time=float(count),
        hits=(no_hits(),) * count,
        timings={"simulate": 0.0},
        collisions={},
    )


def poisson_evaluation(
    design: Design, chamber: Chamber, per_mm2: float = 60.0, replicas: int = 4, seed: int = 0
) -> Evaluation:
    """An evaluation of a real chamber with random dents, ``per_mm2`` in all, not simulated."""
    rng = np.random.default_rng(seed)
    mean = per_mm2 * 1e6 * chamber.exposed_area / replicas
    return evaluation_of(
        design, chamber, [random_dents(design, chamber, mean, rng) for _ in range(replicas)]
    )


@cache
def plate_evaluation() -> tuple[Chamber, Evaluation]:
    """The plate's chamber and an evaluation of it with random dents, once in each process."""
    chamber = build_chamber(plate_design())
    return chamber, poisson_evaluation(plate_design(), chamber)


def evaluation_of(design: Design, chamber: Chamber, hits: Sequence[Hits]) -> Evaluation:
    """The evaluation of replicas whose impacts are known."""
    seen = SeenDents.none(prepare_target(design, chamber, chamber_mesh(chamber)))
    seen.add(hits)
    found = estimate_metrics(seen, hits, chamber, design)
    fields = zone_fields(design, chamber, chamber_mesh(chamber))
    zones = {name: SeenDents.none(one) for name, one in fields.items()}
    for one in zones.values():
        one.add(hits)
    of_zones, zone_notes = estimate_zones(zones, hits, chamber, design)
    return Evaluation(
        objective_name="uniform_coverage",
        objective=weighted_sum(OBJECTIVES["uniform_coverage"], found.metrics),
        metrics=found.metrics | of_zones,
        metrics_of_wide=found.metrics_of_wide,
        gauge_mm2=design.process.accuracy.gauge_mm2,
        resolution=found.resolution,
        reachable=seen.field.reachable,
        crease_share=seen.crease_share,
        alike=seen.field.alike,
        replicas=len(hits),
        simulated_time=len(hits) * design.process.recorded_time,
        hits=tuple(hits),
        timings={"chamber": 0.1, "simulate": 1.0, "coverage": 0.1},
        collisions={"walls": 5, "balls": 3, "sonotrode": 2, "total": 10},
        notes=(*resolution_notes(found.resolution), *zone_notes),
        zones={name: one.field.reachable for name, one in zones.items()},
    )
