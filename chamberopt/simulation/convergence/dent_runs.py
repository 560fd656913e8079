"""Runs of the coverage model: dents one by one take a whole treatment; rates are made of the same impacts."""

from __future__ import annotations

import time
from collections.abc import Sequence
from concurrent.futures import Executor
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.chamber.scene import build_scene, replica_seed
from chamberopt.common.errors import InputError
from chamberopt.coverage.coverage_from_impacts import Tally, tally_impacts
from chamberopt.coverage.dent_marking import (
    SamplePoints,
    first_marked_times,
    marked_share,
    sample_points,
)
from chamberopt.coverage.metrics import parse_objective
from chamberopt.coverage.statistics.confidence_interval import estimate, paired_difference
from chamberopt.design.design import Design
from chamberopt.design.process import MAX_SIMULATED_TREATMENT
from chamberopt.simulation.convergence.parameters import MODEL
from chamberopt.simulation.convergence.runs import Pool, Run, dents_alone, figures
from chamberopt.simulation.evaluate import marked_coverage_estimates, weighted_sum

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from sim_core import TriangleMesh

DENT_REPLICAS = 3  # the least that has an interval
DENT_LOAD = 8.0  # CPU seconds of simulating and marking over those of simulating, about


def dent_rungs(
    pool: Pool, budget_s: float, executor: Executor
) -> tuple[tuple[Run, ...], float, float]:
    """Rates, then dents one by one at finer and finer points; seconds of treatment; CPU seconds.

    The treatment is cut to what the budget buys. A bias is against the finest points, from the same impacts.

    Nothing where the points would not fit into memory.
    """
    accuracy = pool.design.process.accuracy
    pace = pool.cost.value / (accuracy.warmup_time + accuracy.simulated_time)
    affordable = max(
        budget_s / DENT_REPLICAS / pace / DENT_LOAD - accuracy.warmup_time, accuracy.simulated_time
    )
    seconds = float(min(pool.design.process.treatment_time, MAX_SIMULATED_TREATMENT, affordable))
    treated = pool.design.changed({"process.treatment_time_s": seconds, MODEL: "dents"})
    spacings = [2 * accuracy.sample_mm, accuracy.sample_mm, accuracy.sample_mm / 2]
    try:
        samples = [sample_points(pool.chamber, 1e-3 * spacing) for spacing in spacings]
    except InputError:
        return (), seconds, 0.0
    futures = [
        executor.submit(_marked, treated, pool.chamber, pool.mesh, samples, n)
        for n in range(DENT_REPLICAS)
    ]
    try:
        tallies, shares, costs = zip(*(future.result() for future in futures), strict=True)
    finally:
        for future in futures:
            future.cancel()
    goal, mean, _ = figures(tallies, pool.chamber, treated)
    rows = [("avrami", goal, mean)]
    for i, spacing in enumerate(spacings):
        found = marked_coverage_estimates([replica[i] for replica in shares], pool.chamber)
        goal, mean = (
            weighted_sum(parse_objective("uniform_coverage"), found),
            found["mean_coverage"],
        )
        rows.append((f"dents, sample_mm {spacing:g}", goal, mean))
    _, finest, finest_mean = rows[-1]
    rungs = [
        Run(
            knob=MODEL,
            setting=name,
            replicas=DENT_REPLICAS,
            cpu=estimate([cost[i] for cost in costs], 0.0),
            objective=goal,
            mean=mean,
            bias=paired_difference(goal, finest),
            mean_bias=paired_difference(mean, finest_mean),
        )
        for i, (name, goal, mean) in enumerate(rows)
    ]
    spent = sum(
        sum(each) - (len(each) - 1) * each[0] for each in costs
    )  # simulated once, marked once a spacing
    return tuple(rungs), seconds, spent


def _marked(
    design: Design,
    chamber: Chamber,
    mesh: TriangleMesh,
    samples: Sequence[SamplePoints],
    number: int,
) -> tuple[Tally, list[np.ndarray], list[float]]:
    """One whole treatment: its dents, the marked share of each triangle by spacing, CPU seconds with each way."""
    from sim_core import simulate

    begin = time.thread_time()
    impacts = simulate(build_scene(design, mesh, replica_seed(design.process.seed, number))).impacts
    simulated = time.thread_time() - begin
    left = tally_impacts(impacts, chamber, design)
    costs, shares = [time.thread_time() - begin], []
    for points in samples:
        begin = time.thread_time()
        first = first_marked_times(points, impacts, chamber, design)
        shares.append(
            marked_share(points, first, design.process.treatment_time, len(chamber.part.triangles))
        )
        costs.append(simulated + time.thread_time() - begin)
    return dents_alone(left), shares, costs
