"""Convergence study: each numerical parameter at several settings, compared with one reference.

The reference has every parameter at its finest setting; each other run has one parameter coarser.
All take turns, a few replicas each, so that a machine that slows down slows them all. The error
against the number of replicas comes from batches of the reference's replicas, and the bias of a
setting is its difference from the reference. Marking one dent at a time takes a whole treatment, so
the coverage models are compared in runs of their own, on the same impacts.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from chamberopt.chamber.scene import chamber_mesh, replica_seed
from chamberopt.common.errors import InputError
from chamberopt.common.estimate import Estimate, estimate, paired_difference
from chamberopt.common.progress import Progress
from chamberopt.coverage.coverage_from_impacts import Tally
from chamberopt.coverage.coverage_intervals import coverage_estimates, target_patches
from chamberopt.coverage.dent_marking import marked_share, sample_points
from chamberopt.coverage.metrics import parse_objective
from chamberopt.design.design import Design
from chamberopt.design.process import MAX_SIMULATED_TREATMENT
from chamberopt.simulation.convergence.error_law import (
    BatchSize,
    ErrorLaw,
    fit_error_law,
    rms_error,
)
from chamberopt.simulation.convergence.parameters import MODEL, study_designs
from chamberopt.simulation.evaluate import marked_coverage_estimates, weighted_sum
from chamberopt.simulation.replicas import ReplicaSetting, simulate_replica

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.shapes import ChamberTable
    from sim_core import TriangleMesh

MIN_ROUNDS = 3  # a run needs three replicas for an interval
MIN_REPLICAS, MAX_REPLICAS = 32, 1024  # of the reference: two batch sizes; a few hundred MB
MIN_BATCHES = 4  # of one size
MODEL_SHARE = 0.2  # of the budget, for the coverage models
MODEL_REPLICAS = 3
# CPU seconds of one replica with each coverage model over those of one simulation: four
# simulations, and about 7 for marking at three spacings.
MODEL_LOAD = 11.0
ZERO_ERROR = 1e-12  # of a share of area: rounding
ZERO = Estimate(0.0, 0.0)


@dataclass(frozen=True)
class Run:
    """Result of one setting."""

    parameter: str  # dotted name of the numerical parameter that differs from the reference
    setting: str  # its value as text
    replicas: int
    cpu: Estimate  # CPU seconds of a replica
    objective: Estimate
    mean: Estimate  # mean coverage
    bias: Estimate = ZERO  # of the objective: its difference from the reference
    mean_bias: Estimate = ZERO  # of the mean coverage

    @property
    def is_biased(self) -> bool:
        """Whether the bias differs from 0 by more than its interval."""
        return abs(self.bias.value) > self.bias.half_width

    @property
    def max_bias(self) -> float:
        """Absolute bias at the far end of its interval."""
        return max(self.bias.high, -self.bias.low)


@dataclass(frozen=True)
class ConvergenceStudy:
    """Everything that was simulated."""

    design: Design
    settings: dict[str, Any]  # of the reference, by parameter
    reference: Run
    runs: tuple[Run, ...]  # one parameter coarser each, and the design as it is
    sizes: tuple[BatchSize, ...]  # error against CPU seconds of batches of the reference
    law: ErrorLaw  # through the sizes
    # Dent rates, then marked dents from coarse to fine, all from the same impacts of `model_time`
    # seconds of treatment; biases are against the last. Empty if the points exceed the memory.
    models: tuple[Run, ...]
    model_time: float
    cpu_s: float  # of the simulations
    wall_s: float  # that the study took


class TimedReplica(NamedTuple):
    """Dents of one replica, marked share of each triangle, and CPU seconds."""

    tally: Tally
    share: np.ndarray | None  # None where coverage is estimated from dent rates
    cpu_s: float


@dataclass
class Replicas:
    """The replicas of one design."""

    setting: ReplicaSetting  # without sample points coverage is estimated from dent rates
    skipped: int = 1  # first replicas whose time does not count, because they build a search tree
    started: int = 0  # number of replicas that are simulated or under way
    done: list[TimedReplica] = field(default_factory=list)

    @property
    def cpu(self) -> Estimate:
        """CPU seconds of a replica."""
        return estimate([one.cpu_s for one in self.done[self.skipped :]], 0.0)

    def estimates(self, part: slice = slice(None)) -> tuple[Estimate, Estimate, bool]:
        """Objective, mean coverage, and whether triangles were merged for lack of dents."""
        design, chamber, _, samples = self.setting
        are_merged = False
        if samples is None:
            tallies = [one.tally for one in self.done[part]]
            patches = target_patches(tallies, chamber, design.process.treatment_time)
            metrics, are_merged = coverage_estimates(tallies, chamber, patches), patches.are_merged
        else:
            shares = [one.share for one in self.done[part] if one.share is not None]
            metrics = marked_coverage_estimates(shares, chamber)
        objective = weighted_sum(parse_objective("uniform_coverage"), metrics)
        return objective, metrics["mean_coverage"], are_merged

    def run(self, parameter: str, setting: str, reference: Run | None = None) -> Run:
        """The result of these replicas, compared with a reference unless they are its own."""
        objective, mean, _ = self.estimates()
        run = Run(parameter, setting, len(self.done), self.cpu, objective, mean)
        if reference is None:
            return run
        bias = paired_difference(objective, reference.objective)
        return replace(run, bias=bias, mean_bias=paired_difference(mean, reference.mean))


def require_budget(budget_s: float) -> None:
    """Raise InputError unless the budget is a positive, finite number."""
    if not 0.0 < budget_s < math.inf:
        raise InputError(
            f"--budget-s: given {budget_s:g}; give the CPU seconds to spend, more than 0"
        )


def run_convergence_study(
    design: Design,
    budget_s: float,
    executor: Executor,
    progress: Progress | None = None,
    prepare: Callable[[Design, Chamber], None] = lambda design, chamber: None,
) -> ConvergenceStudy:
    """Simulate all runs for about the budgeted CPU seconds, at least three replicas of each.

    Each round adds one replica to every run, and as many to the reference as there are runs.

    Args:
        prepare: called for each design before any is simulated, to compile.

    Raises:
        InputError: the budget is not positive, or evaluate() raises it.
    """
    from chamberopt.chamber.build import build_chamber

    require_budget(budget_s)
    started = time.perf_counter()
    settings, designs = study_designs(design)
    chambers: dict[ChamberTable, tuple[Chamber, TriangleMesh]] = {}
    replicas = {}
    for key, one in designs.items():
        if one.chamber not in chambers:
            first = next(iter(chambers.values()), None)
            chamber = build_chamber(one, first and first[0].part.target)
            chambers[one.chamber] = chamber, chamber_mesh(chamber)
        replicas[key] = Replicas(ReplicaSetting(one, *chambers[one.chamber], None))
        prepare(one, replicas[key].setting.chamber)
    (reference_key, reference), *others = replicas.items()
    rounds, spent = 0, 0.0
    while len(reference.done) < MAX_REPLICAS:
        enough = rounds >= MIN_ROUNDS and len(reference.done) >= MIN_REPLICAS
        if enough and spent >= (1.0 - MODEL_SHARE) * budget_s:
            break
        spent += _add_replicas([*(one for _, one in others), *[reference] * len(others)], executor)
        rounds += 1
        if progress:
            progress(min(round(spent), round(budget_s)), round(budget_s), None)
    models, model_time, models_spent = _run_coverage_models(reference, budget_s - spent, executor)
    reference_run = reference.run(*reference_key)
    sizes = _batch_sizes(reference, reference_run)
    return ConvergenceStudy(
        design=design,
        settings=settings,
        reference=reference_run,
        runs=tuple(one.run(*key, reference_run) for key, one in others),
        sizes=sizes,
        law=fit_error_law(sizes),
        models=models,
        model_time=model_time,
        cpu_s=spent + models_spent,
        wall_s=time.perf_counter() - started,
    )


def _add_replicas(designs: Sequence[Replicas], executor: Executor) -> float:
    """Simulate one more replica of each design for each time that it is listed; CPU seconds."""
    futures = []
    for one in designs:
        futures.append(executor.submit(simulate_timed, one.setting, one.started))
        one.started += 1
    try:
        for one, future in zip(designs, futures, strict=True):
            one.done.append(future.result())
    finally:
        for future in futures:
            future.cancel()
    return sum(future.result()[-1] for future in futures)


def simulate_timed(setting: ReplicaSetting, number: int) -> TimedReplica:
    """Simulate one replica; of its dents what coverage needs is kept, for hundreds of replicas."""
    begin = time.thread_time()
    process, samples = setting.design.process, setting.samples
    replica = simulate_replica(setting, replica_seed(process.seed, number))
    share = None
    if samples is not None and replica.first_marked is not None:
        triangles = len(setting.chamber.part.triangles)
        share = marked_share(samples, replica.first_marked, process.treatment_time, triangles)
    none = np.zeros(0)
    tally = replace(
        replica.tally, impacts=none, dents=none, dented_area=none, speed_sum=none, angle_sum=none
    )
    return TimedReplica(tally, share, time.thread_time() - begin)


def _run_coverage_models(
    reference: Replicas, budget_s: float, executor: Executor
) -> tuple[tuple[Run, ...], float, float]:
    """Compare dent rates with marked dents at finer and finer sample points.

    Returns:
        The runs, seconds of treatment that the budget allows, and CPU seconds.
    """
    design, chamber = reference.setting.design, reference.setting.chamber
    accuracy = design.process.accuracy
    cpu_per_second = reference.cpu.value / (accuracy.warmup_time + accuracy.simulated_time)
    affordable = budget_s / MODEL_REPLICAS / MODEL_LOAD / cpu_per_second - accuracy.warmup_time
    longest = min(design.process.treatment_time, MAX_SIMULATED_TREATMENT)
    seconds = float(min(longest, max(affordable, accuracy.simulated_time)))
    treated = design.changed({"process.treatment_time_s": seconds, MODEL: "dents"})
    setting = reference.setting._replace(design=treated)
    models = {"avrami": Replicas(setting, skipped=0)}
    try:
        for spacing in (2 * accuracy.sample_mm, accuracy.sample_mm, accuracy.sample_mm / 2):
            marked = setting._replace(samples=sample_points(chamber, 1e-3 * spacing))
            models[f"dents, sample_mm {spacing:g}"] = Replicas(marked, skipped=0)
    except InputError:  # too many points for the memory
        return (), seconds, 0.0
    spent = sum(_add_replicas(list(models.values()), executor) for _ in range(MODEL_REPLICAS))
    *others, (name, finest) = models.items()
    best = finest.run(MODEL, name)
    return (*(one.run(MODEL, other, best) for other, one in others), best), seconds, spent


def _batch_sizes(reference: Replicas, whole: Run) -> tuple[BatchSize, ...]:
    """Errors of batches of 4, 8, 16 ... replicas."""
    sizes, count = [], 4
    while (batches := whole.replicas // count) >= MIN_BATCHES:
        begin = time.thread_time()
        estimates = [reference.estimates(slice(b * count, (b + 1) * count)) for b in range(batches)]
        estimating = (time.thread_time() - begin) / batches
        values = np.array([objective.value for objective, _, _ in estimates])
        rms = rms_error(values, whole.objective.value, count / whole.replicas)
        half_width = float(np.mean([objective.half_width for objective, _, _ in estimates]))
        if min(rms, half_width) < ZERO_ERROR:
            raise InputError(
                "process.accuracy.simulated_time_s: no dent on the target was simulated, so there "
                "is no error to measure; raise it, or see chamberopt check"
            )
        cpu_s = count * whole.cpu.value + estimating
        are_merged = any(merged for _, _, merged in estimates)
        sizes.append(BatchSize(count, batches, rms, half_width, cpu_s, are_merged))
        count *= 2
    return tuple(sizes)
