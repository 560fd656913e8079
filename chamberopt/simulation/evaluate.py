"""How sure a number is: a candidate is simulated in independent replicas, and every metric gets its interval.

Coverage figures have their own estimators (figures.py). The others are ratios of sums: the delete-one jackknife
over replicas (B. Efron and R. J. Tibshirani, "An Introduction to the Bootstrap", Chapman & Hall 1993, chapter 11)
corrects their bias of order 1/n and gives the standard error.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from concurrent.futures import Executor
from functools import reduce
from operator import add
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.chamber.analytic import cavity_note
from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.parallel.executor import share
from chamberopt.common.progress import Progress
from chamberopt.coverage.coverage_estimators import (
    coverage_estimates,
    few_dents_note,
    target_patches,
    time_to_98_estimate,
)
from chamberopt.coverage.coverage_from_impacts import Tally
from chamberopt.coverage.dent_marking import (
    SamplePoints,
    few_points_note,
    marked_share,
    sample_points,
)
from chamberopt.coverage.intensity import intensity_uniformity
from chamberopt.coverage.metrics import (
    METRICS,
    Metric,
    ObjectiveFunction,
    parse_objective,
    target_coverage,
)
from chamberopt.coverage.statistics.confidence_interval import Estimate, estimate, student_quantile
from chamberopt.simulation.evaluation import Evaluation
from chamberopt.simulation.replicas import (
    MIN_REPLICAS_TO_STOP,
    Replica,
    next_replica_count,
    simulate_replicas,
)
from chamberopt.simulation.resting_balls import bouncing_notes, resting_notes

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from sim_core import AnalyticCavity

OWN_ESTIMATORS = ("time_to_98_s", "intensity_uniformity")  # beside those of coverage
CURVE = 50  # points of coverage against time


def jackknife(
    replicas: Sequence[Tally], statistics: Sequence[Metric], chamber: Chamber, design: Design
) -> list[Estimate]:
    """Each statistic with its 95 % interval; with a single replica: the value, half-width infinite.

    Pseudo-value of replica j: n · statistic(all) - (n - 1) · statistic(all but j); their mean is the
    corrected value and their scatter its standard error. Figures of coverage are made by figures.py.
    """
    n = len(replicas)
    total = reduce(add, replicas)
    parts = [total - replica for replica in replicas] if n > 1 else []
    figures = {}
    if any(metric.from_coverage or metric.name in OWN_ESTIMATORS for metric in statistics):
        ground = target_patches(replicas, chamber, design)
        figures = coverage_estimates(replicas, chamber, ground)
        figures["time_to_98_s"] = time_to_98_estimate(
            figures["p05_coverage"], design.process.treatment_time
        )
        figures["intensity_uniformity"] = intensity_uniformity(replicas, ground)
    estimates = []
    for metric in statistics:
        if metric.name in figures:
            estimates.append(figures[metric.name])
            continue
        plain = metric.function(total, chamber, design)
        without = np.array([metric.function(part, chamber, design) for part in parts])
        pseudovalues = n * plain - (n - 1) * without if n > 1 else np.array([plain])
        estimates.append(estimate(pseudovalues, metric.lowest, metric.highest))
    return estimates


def marked_coverage_estimates(
    shares: Sequence[np.ndarray], chamber: Chamber
) -> dict[str, Estimate]:
    """The figures of parts peened to the end, dent by dent: plain means over them, (m,) coverage each.

    Such a part has the grain of its dents in it: std_coverage is larger, and p05_coverage lower, than of the
    coverage to expect, the more so the smaller the triangles.
    """
    each = [target_coverage(share, chamber) for share in shares]
    return {
        name: estimate([metric.from_coverage(*one) for one in each], metric.lowest, metric.highest)
        for name, metric in METRICS.items()
        if metric.from_coverage
    }


def weighted_sum(goal: ObjectiveFunction, metrics: dict[str, Estimate]) -> Estimate:
    """The objective from the metrics: their corrected values, and an interval that knows how they move together."""
    value = sum(weight * metrics[name].value for name, weight in goal.terms.items())
    columns = [weight * np.array(metrics[name].pseudovalues) for name, weight in goal.terms.items()]
    bias = sum(abs(weight) * metrics[name].bias for name, weight in goal.terms.items())
    spread = estimate(np.sum(columns, axis=0), bias=bias)
    return Estimate(value, spread.half_width, spread.pseudovalues, bias)


def evaluate(
    design: Design,
    chamber: Chamber,
    executor: Executor,
    progress: Progress | None = None,
    *,
    objective_name: str = "uniform_coverage",
    stream: str = "search",
    replicas: int | None = None,
    cavity: AnalyticCavity | None = None,
    done: list[Replica] | None = None,
) -> Evaluation:
    """Simulate a candidate in independent replicas and estimate its objective and metrics.

    replicas: number of them; when None as many as the design's accuracy asks for. stream: which of the two seed
    streams ("search", "confirm"). cavity: `analytic_cavity`'s, in place of the chamber's mesh. done: the first replicas
    of this very candidate, simulated before; the others are added to it. The same numbers come out whatever the number
    of workers: replicas are added in order, and what they say, never a clock, decides how many there are.

    Raises InputError (the shot does not fit) and sim_core.SimulationError.
    """
    accuracy = design.process.accuracy
    wanted = accuracy.objective_half_width if replicas is None else None
    planned = replicas or accuracy.replicas
    if wanted is not None:
        planned = min(max(planned, MIN_REPLICAS_TO_STOP), accuracy.max_replicas)
    mesh = cavity or chamber_mesh(chamber)
    samples = (
        sample_points(chamber, accuracy.sample_spacing)
        if accuracy.coverage_model == "dents"
        else None
    )
    setting = share(executor, (design, chamber, mesh, samples))
    done = [] if done is None else done
    clock = {"simulate": 0.0, "coverage": 0.0}
    while True:
        started = time.perf_counter()
        numbers = range(len(done), planned)
        for replica in simulate_replicas(setting, design.process.seed, executor, stream, numbers):
            done.append(replica)
            if progress:
                progress(len(done), planned, None)
        simulated = time.perf_counter()
        metrics = _metrics(done, chamber, design, samples)
        goal = weighted_sum(parse_objective(objective_name), metrics)
        clock["simulate"] += simulated - started
        clock["coverage"] += time.perf_counter() - simulated
        if wanted is None:
            break
        planned = next_replica_count(len(done), goal.half_width, wanted, accuracy.max_replicas)
        if planned == len(done):
            break
    tallies = [replica.tally for replica in done]
    stopped_by = (
        "replicas"
        if wanted is None
        else "accuracy"
        if goal.half_width <= wanted
        else "max_replicas"
    )
    notes: tuple[str, ...] = (cavity_note(cavity),) if cavity else ()
    notes += _accuracy_note(stopped_by, len(done), goal, wanted)
    if samples is not None:
        notes += few_points_note(samples, chamber)
    else:
        notes += few_dents_note(tallies, target_patches(tallies, chamber, design))
    shares = None if samples is None else _shares(done, samples, chamber, design)
    return Evaluation(
        objective_name=objective_name,
        objective=goal,
        metrics=metrics,
        total=reduce(add, tallies),
        replicas=tuple(tallies),
        timings=clock,
        collisions={
            kind: sum(replica.collisions[kind] for replica in done) for kind in done[0].collisions
        },
        notes=(*notes, *_motion_notes(done)),
        stream=stream,
        stopped_by=stopped_by,
        analytic=cavity is not None,
        hits=tuple(replica.hits for replica in done),
        marked=None if shares is None else np.mean(shares, axis=0),
        marked_interval=None if shares is None else _width(shares),
        against_time=() if samples is None else _against_time(done, samples, chamber, design),
    )


def _motion_notes(done: Sequence[Replica]) -> tuple[str, ...]:
    """What became of the shot by the replicas' ends."""
    stuck = [replica.stuck for replica in done if replica.stuck]
    return (
        *resting_notes(stuck, len(done)),
        *bouncing_notes([replica.on_the_spot for replica in done]),
    )


def _metrics(
    done: Sequence[Replica], chamber: Chamber, design: Design, samples: SamplePoints | None
) -> dict[str, Estimate]:
    tallies = [replica.tally for replica in done]
    if samples is None:
        return dict(
            zip(METRICS, jackknife(tallies, list(METRICS.values()), chamber, design), strict=True)
        )
    others = [metric for metric in METRICS.values() if metric.from_coverage is None]
    named = {
        m.name: e for m, e in zip(others, jackknife(tallies, others, chamber, design), strict=True)
    }
    named |= marked_coverage_estimates(_shares(done, samples, chamber, design), chamber)
    return {name: named[name] for name in METRICS}


def _shares(
    done: Sequence[Replica], samples: SamplePoints, chamber: Chamber, design: Design
) -> list[np.ndarray]:
    """Marked share of each part triangle at the treatment time, (m,), a replica each."""
    return _shares_at(done, samples, chamber, design.process.treatment_time)


def _width(shares: Sequence[np.ndarray]) -> np.ndarray:
    """Width (m,) of the 95 % interval of the mean of these (m,), each a replica's; NaN where it has only one."""
    n = len(shares)
    if n < 2:
        return np.full(len(shares[0]), np.nan)
    return np.asarray(2.0 * student_quantile(n - 1) * np.std(shares, axis=0, ddof=1) / math.sqrt(n))


def _shares_at(
    done: Sequence[Replica], samples: SamplePoints, chamber: Chamber, at: float
) -> list[np.ndarray]:
    firsts = [replica.first_marked for replica in done if replica.first_marked is not None]
    return [marked_share(samples, first, at, len(chamber.part.triangles)) for first in firsts]


def _against_time(
    done: Sequence[Replica], samples: SamplePoints, chamber: Chamber, design: Design
) -> tuple[tuple[float, Estimate], ...]:
    """Mean coverage of the target at even steps of time up to the treatment's end."""
    times = np.linspace(0.0, design.process.treatment_time, CURVE + 1)[1:]
    return tuple(
        (
            float(at),
            marked_coverage_estimates(_shares_at(done, samples, chamber, at), chamber)[
                "mean_coverage"
            ],
        )
        for at in times
    )


def _accuracy_note(
    stopped_by: str, replicas: int, goal: Estimate, wanted: float | None
) -> tuple[str, ...]:
    """Which of the two ended an evaluation that was to be accurate: the accuracy or the budget."""
    if stopped_by == "accuracy":
        return (f"the accuracy asked for, ± {wanted:g}, was reached after {replicas} replicas",)
    if stopped_by == "replicas" or wanted is None:
        return ()
    more = (
        math.ceil(replicas * (goal.half_width / wanted) ** 2)
        if math.isfinite(goal.half_width)
        else "many more"
    )
    remedy = "raise process.accuracy.max_replicas or simulated_time_s"
    return (
        f"the accuracy asked for, ± {wanted:g}, was not reached: process.accuracy.max_replicas = {replicas} ended it "
        f"at ± {goal.half_width:.2g}, some {more} would be needed; {remedy}",
    )
