"""Evaluate a candidate: simulate independent replicas and estimate its metrics with intervals.

Notation
    n     number of replicas
    S     a metric as a function of the impacts of some replicas
    y_j   pseudo-value of replica j: n S(all) - (n - 1) S(all but j)

Coverage, the time to full coverage and the intensity uniformity have estimators of their own
(coverage/coverage_intervals.py, coverage/intensity.py). The other metrics are ratios of sums: the
delete-one jackknife over replicas corrects their bias of order 1/n and gives the standard error (B.
Efron and R. J. Tibshirani, "An Introduction to the Bootstrap", Chapman & Hall 1993, chapter 11).
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.chamber.analytic import cavity_note
from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.estimate import Estimate, estimate, student_quantile
from chamberopt.common.parallel.executor import share
from chamberopt.common.progress import Progress
from chamberopt.coverage.coverage_from_impacts import Tally
from chamberopt.coverage.coverage_intervals import (
    TargetPatches,
    coverage_estimates,
    few_dents_note,
    target_patches,
    time_to_98_estimate,
)
from chamberopt.coverage.dent_marking import (
    SamplePoints,
    few_points_note,
    marked_share,
    sample_points,
)
from chamberopt.coverage.intensity import intensity_uniformity
from chamberopt.coverage.metrics import METRICS, ObjectiveFunction, parse_objective, target_coverage
from chamberopt.simulation.evaluation import Evaluation, MarkedCoverage
from chamberopt.simulation.replicas import (
    MIN_REPLICAS_TO_STOP,
    Replica,
    ReplicaSetting,
    next_replica_count,
    simulate_replicas,
)
from chamberopt.simulation.resting_balls import bouncing_notes, resting_notes

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from sim_core import AnalyticCavity

MARKED_CURVE_POINTS = 50


@dataclass(frozen=True)
class ReplicaPlan:
    """Which replicas to simulate."""

    # Number of replicas; None for as many as the design's [process.accuracy] asks for.
    count: int | None = None
    stream: str = "search"  # stream of seeds, "search" or "confirm"
    # The objective, whose interval decides when a wanted accuracy is reached.
    objective_name: str = "uniform_coverage"


def evaluate(
    design: Design,
    chamber: Chamber,
    executor: Executor,
    progress: Progress | None = None,
    plan: ReplicaPlan | None = None,
    cavity: AnalyticCavity | None = None,
    done: list[Replica] | None = None,
) -> Evaluation:
    """Simulate a candidate in independent replicas and estimate its objective and metrics.

    The result does not depend on the number of workers: replicas are added in order, and their
    results, never a clock, decide how many there are.

    Args:
        cavity: simulate in this exact cavity instead of the chamber's mesh.
        done: first replicas of this very candidate, already simulated; the new ones are appended.

    Raises:
        InputError: the shot does not fit into the chamber.
        sim_core.SimulationError: a replica cannot be simulated.
    """
    plan = plan or ReplicaPlan()
    accuracy = design.process.accuracy
    wanted = accuracy.objective_half_width if plan.count is None else None
    count = plan.count or accuracy.replicas
    if wanted is not None:
        count = min(max(count, MIN_REPLICAS_TO_STOP), accuracy.max_replicas)
    samples = (
        sample_points(chamber, accuracy.sample_spacing)
        if accuracy.coverage_model == "dents"
        else None
    )
    setting = share(
        executor, ReplicaSetting(design, chamber, cavity or chamber_mesh(chamber), samples)
    )
    objective = parse_objective(plan.objective_name)
    done = [] if done is None else done
    timings = {"simulate": 0.0, "coverage": 0.0}
    while True:
        started = time.perf_counter()
        for replica in simulate_replicas(
            setting, design.process.seed, executor, plan.stream, range(len(done), count)
        ):
            done.append(replica)
            if progress:
                progress(len(done), count, None)
        simulated = time.perf_counter()
        tallies = [replica.tally for replica in done]
        patches = target_patches(tallies, chamber, design.process.treatment_time)
        metrics = estimate_metrics(tallies, chamber, design, patches)
        if samples is not None:
            metrics |= marked_coverage_estimates(
                _marked_shares(done, samples, chamber, design.process.treatment_time), chamber
            )
        value = weighted_sum(objective, metrics)
        timings["simulate"] += simulated - started
        timings["coverage"] += time.perf_counter() - simulated
        if wanted is None:
            stopped_by = "replicas"
            break
        count = next_replica_count(len(done), value.half_width, wanted, accuracy.max_replicas)
        if count == len(done):
            stopped_by = "accuracy" if value.half_width <= wanted else "max_replicas"
            break
    return Evaluation(
        objective_name=plan.objective_name,
        objective=value,
        metrics=metrics,
        total=reduce(add, tallies),
        replicas=tuple(tallies),
        timings=timings,
        collisions={
            kind: sum(replica.collisions[kind] for replica in done) for kind in done[0].collisions
        },
        notes=(
            *((cavity_note(cavity),) if cavity else ()),
            *_accuracy_note(stopped_by, len(done), value, wanted),
            *(
                few_dents_note(tallies, patches)
                if samples is None
                else few_points_note(samples, chamber)
            ),
            *resting_notes([replica.resting for replica in done if replica.resting], len(done)),
            *bouncing_notes([replica.bouncing_share for replica in done]),
        ),
        stream=plan.stream,
        stopped_by=stopped_by,
        analytic=cavity is not None,
        hits=tuple(replica.hits for replica in done),
        marked=None if samples is None else _marked_coverage(done, samples, chamber, design),
    )


def estimate_metrics(
    replicas: Sequence[Tally],
    chamber: Chamber,
    design: Design,
    patches: TargetPatches | None = None,
) -> dict[str, Estimate]:
    """Estimate all metrics from replicas; with a single one the half-widths are infinite.

    Args:
        patches: the target in patches for these replicas, if it was made already.
    """
    n = len(replicas)
    treatment_time = design.process.treatment_time
    patches = patches or target_patches(replicas, chamber, treatment_time)
    special = coverage_estimates(replicas, chamber, patches)
    special["time_to_98_s"] = time_to_98_estimate(special["p05_coverage"], treatment_time)
    special["intensity_uniformity"] = intensity_uniformity(replicas, patches)
    total = reduce(add, replicas)
    without_each = [total - replica for replica in replicas] if n > 1 else []
    estimates = {}
    for name, metric in METRICS.items():
        if name in special:
            estimates[name] = special[name]
            continue
        plain = metric.value(total, chamber, design)
        without = np.array([metric.value(part, chamber, design) for part in without_each])
        pseudovalues = n * plain - (n - 1) * without if n > 1 else np.array([plain])
        estimates[name] = estimate(pseudovalues, metric.lowest, metric.highest)
    return estimates


def weighted_sum(objective: ObjectiveFunction, metrics: dict[str, Estimate]) -> Estimate:
    """The objective from the metrics, with an interval that knows how they move together."""
    terms = [(weight, metrics[name]) for name, weight in objective.terms.items()]
    value = sum(weight * metric.value for weight, metric in terms)
    columns = [weight * np.array(metric.pseudovalues) for weight, metric in terms]
    bias = sum(abs(weight) * metric.bias for weight, metric in terms)
    spread = estimate(np.sum(columns, axis=0), bias=bias)
    return Estimate(value, spread.half_width, spread.pseudovalues, bias)


def marked_coverage_estimates(
    shares: Sequence[np.ndarray], chamber: Chamber
) -> dict[str, Estimate]:
    """Coverage metrics of parts on which every dent is marked: plain means over the replicas.

    Such a part shows the grain of its dents. Its std_coverage is larger and its p05_coverage lower
    than those of the expected coverage, the more so the smaller the triangles are.

    Args:
        shares: marked share of each part triangle, (m,), a replica each.
    """
    replicas = [target_coverage(share, chamber) for share in shares]
    return {
        name: estimate(
            [metric.of_coverage(*one) for one in replicas], metric.lowest, metric.highest
        )
        for name, metric in METRICS.items()
        if metric.of_coverage
    }


def _marked_coverage(
    done: Sequence[Replica], samples: SamplePoints, chamber: Chamber, design: Design
) -> MarkedCoverage:
    treatment_time, n = design.process.treatment_time, len(done)
    shares = _marked_shares(done, samples, chamber, treatment_time)
    width = np.full(len(shares[0]), np.nan)
    if n > 1:
        width = 2.0 * student_quantile(n - 1) * np.std(shares, axis=0, ddof=1) / math.sqrt(n)
    curve = []
    for at in np.linspace(0.0, treatment_time, MARKED_CURVE_POINTS + 1)[1:]:
        then = marked_coverage_estimates(_marked_shares(done, samples, chamber, at), chamber)
        curve.append((float(at), then["mean_coverage"]))
    return MarkedCoverage(np.mean(shares, axis=0), width, tuple(curve))


def _marked_shares(
    done: Sequence[Replica], samples: SamplePoints, chamber: Chamber, time: float
) -> list[np.ndarray]:
    """Marked share of each part triangle after a peening time [s], (m,), a replica each."""
    firsts = [replica.first_marked for replica in done if replica.first_marked is not None]
    return [marked_share(samples, first, time, len(chamber.part.triangles)) for first in firsts]


def _accuracy_note(
    stopped_by: str, replicas: int, objective: Estimate, wanted: float | None
) -> tuple[str, ...]:
    """A note on whether the wanted accuracy was reached."""
    if wanted is None:
        return ()
    if stopped_by == "accuracy":
        return (f"the wanted accuracy of ± {wanted:g} was reached after {replicas} replicas",)
    needed = (
        f"about {math.ceil(replicas * (objective.half_width / wanted) ** 2)}"
        if math.isfinite(objective.half_width)
        else "many more"
    )
    return (
        f"the wanted accuracy of ± {wanted:g} was not reached: the simulation stopped at "
        f"process.accuracy.max_replicas = {replicas} with ± {objective.half_width:.2g}, and "
        f"{needed} replicas would be needed; raise process.accuracy.max_replicas or "
        "simulated_time_s",
    )
