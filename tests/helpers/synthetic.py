"""Parts without geometry, impacts without a simulation: problems whose answer is known."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from chamberopt.chamber.build import Chamber
from chamberopt.chamber.part import Part
from chamberopt.common.estimate import Estimate, estimate
from chamberopt.coverage.coverage_from_impacts import Tally
from chamberopt.coverage.metrics import METRICS, OBJECTIVES
from chamberopt.coverage.part_impacts import Hits
from chamberopt.design.load import Design, load_design
from chamberopt.simulation.evaluate import estimate_metrics, weighted_sum
from chamberopt.simulation.evaluation import Evaluation

DESIGNS = Path(__file__).resolve().parents[2] / "designs"


def plate_design(**values: float) -> Design:
    """The shipped plate, with other numbers: plate_design(shot__mass_g=3) sets shot.mass_g."""
    changes = {name.replace("__", "."): value for name, value in values.items()}
    return load_design(DESIGNS / "plate.toml").changed(changes)


def patchwork(
    area: np.ndarray, exposed: np.ndarray | None = None, target: np.ndarray | None = None
) -> Chamber:
    """A chamber whose part is m separate triangles of the given areas [m²].

    Each of them is also a triangle of the cavity.
    """
    m = len(area)
    corner = np.stack([np.arange(m) * 1.0, np.zeros(m), np.zeros(m)], axis=1)
    side = np.sqrt(2.0 * area)[:, None]
    vertices = np.concatenate(
        [corner, corner + side * [1.0, 0.0, 0.0], corner + side * [0.0, 1.0, 0.0]]
    )
    triangles = np.stack([np.arange(m), np.arange(m) + m, np.arange(m) + 2 * m], axis=1).astype(
        np.int32
    )
    target = np.ones(m, dtype=bool) if target is None else target
    return Chamber(
        vertices=vertices,
        triangles=triangles,
        tags=np.zeros(m, dtype=np.uint8),
        source=np.arange(m, dtype=np.int32),
        volume=1.0,
        part=Part(vertices, triangles, area, target, "patchwork"),
        exposed_area=area if exposed is None else exposed,
        notes=(),
    )


def impact_log(triangle: Any, velocity: Any, normal_speed: Any, ball: Any = 0) -> Any:
    """The columns of a sim_core.ImpactLog that coverage reads."""
    return SimpleNamespace(
        triangle=np.asarray(triangle, dtype=np.int32),
        ball=np.broadcast_to(np.asarray(ball, dtype=np.int32), np.shape(triangle)),
        velocity=np.asarray(velocity, dtype=float).reshape(-1, 3),
        normal_speed=np.asarray(normal_speed, dtype=float),
    )


def dented(
    area: np.ndarray, time: float, dents: np.ndarray | None = None, speed: float = 1.0
) -> Tally:
    """A tally of given dented areas [m²]."""
    count = np.ones(len(area), dtype=int) if dents is None else dents
    return Tally(time, count, count, np.asarray(area, dtype=float), speed * count, 90.0 * count)


def equal_dents(
    time: float, dents: np.ndarray, size: float, speed: float = 1.0, angle: float = 90.0
) -> Tally:
    """One replica's tally: so many dents (m,) of one size [m²]."""
    triangle = np.repeat(np.arange(len(dents)), dents)
    each = np.full(len(triangle), size)
    return Tally(time, dents, dents, size * dents, speed * dents, angle * dents, triangle, each)


def judged(objective: np.ndarray, **metrics: float) -> Evaluation:
    """An evaluation whose replicas said these objectives; metrics given are exact, the others 0."""
    empty = dented(np.zeros(1), 1.0)
    exact = {
        name: Estimate(metrics.get(name, 0.0), 0.0, (metrics.get(name, 0.0),) * 3)
        for name in METRICS
    }
    goal = estimate(objective)
    return Evaluation(
        "uniform_coverage", goal, exact, empty, (empty,) * len(objective), {"simulate": 0.0}, {}
    )


def poisson_evaluation(
    design: Design, chamber: Chamber, per_mm2: float = 20.0, replicas: int = 4, seed: int = 0
) -> Evaluation:
    """An evaluation of a real chamber with random dents, ``per_mm2`` in all, not simulated."""
    rng = np.random.default_rng(seed)
    mean = per_mm2 * 1e6 * chamber.exposed_area / replicas
    seconds = design.process.accuracy.simulated_time
    return evaluation_of(
        design,
        chamber,
        [equal_dents(seconds, rng.poisson(mean), 1e-8, 3.0, 70.0) for _ in range(replicas)],
    )


def evaluation_of(design: Design, chamber: Chamber, tallies: list[Tally]) -> Evaluation:
    """The evaluation of replicas whose dents are known, with hits that leave these dents."""
    metrics = estimate_metrics(tallies, chamber, design)
    return Evaluation(
        "uniform_coverage",
        weighted_sum(OBJECTIVES["uniform_coverage"], metrics),
        metrics,
        sum(tallies[1:], tallies[0]),
        tuple(tallies),
        {"chamber": 0.1, "simulate": 1.0, "coverage": 0.1},
        {"walls": 5, "balls": 3, "sonotrode": 2, "total": 10},
        hits=tuple(hits_of(tally) for tally in tallies),
    )


def hits_of(tally: Tally) -> Hits:
    """The dents of a replica as hits of 1 µJ, with the mean speed and angle of their triangle."""
    triangle = tally.dent_triangle.astype(np.int32)
    speed, angle = (
        sums[triangle] / tally.impacts[triangle] for sums in (tally.speed_sum, tally.angle_sum)
    )
    dent = np.sqrt(4.0 / np.pi * tally.dent_area)
    return Hits(
        triangle,
        *(column.astype(np.float32) for column in (speed, angle, dent, np.full(len(dent), 1e-6))),
    )
