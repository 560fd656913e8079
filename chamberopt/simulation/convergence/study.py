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
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.errors import InputError
from chamberopt.common.progress import Progress
from chamberopt.coverage.dent_marking import sample_points
from chamberopt.design.design import Design
from chamberopt.design.process import MAX_SIMULATED_TREATMENT
from chamberopt.simulation.convergence.error_law import (
    BatchSize,
    ErrorLaw,
    fit_error_law,
    rms_error,
    rms_interval,
)
from chamberopt.simulation.convergence.parameters import MODEL, study_designs
from chamberopt.simulation.convergence.runs import Replicas, Run, add_replicas
from chamberopt.simulation.replicas import ReplicaSetting

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


@dataclass(frozen=True)
class ConvergenceStudy:
    """Everything that was simulated.

    Args:
        settings: of the reference, by parameter.
        runs: one parameter coarser each, and the design as it is.
        sizes, law: error against CPU seconds of batches of the reference.
        models: dent rates, then marked dents from coarse to fine, all from the same impacts of
            model_time seconds of treatment; biases are against the last. Empty if the points do
            not fit into memory.
        cpu_s, wall_s: CPU seconds of the simulations, and time the study took.
    """

    design: Design
    settings: dict[str, Any]
    reference: Run
    runs: tuple[Run, ...]
    sizes: tuple[BatchSize, ...]
    law: ErrorLaw
    models: tuple[Run, ...]
    model_time: float
    cpu_s: float
    wall_s: float


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
    while len(reference.tallies) < MAX_REPLICAS:
        enough = rounds >= MIN_ROUNDS and len(reference.tallies) >= MIN_REPLICAS
        if enough and spent >= (1.0 - MODEL_SHARE) * budget_s:
            break
        spent += add_replicas([*(one for _, one in others), *[reference] * len(others)], executor)
        rounds += 1
        if progress:
            progress(min(round(spent), round(budget_s)), round(budget_s), None)
    models, model_time, models_spent = _run_coverage_models(reference, budget_s - spent, executor)
    sizes = _batch_sizes(reference)
    return ConvergenceStudy(
        design=design,
        settings=settings,
        reference=reference.run(*reference_key, reference),
        runs=tuple(one.run(*key, reference) for key, one in others),
        sizes=sizes,
        law=fit_error_law(sizes),
        models=models,
        model_time=model_time,
        cpu_s=spent + models_spent,
        wall_s=time.perf_counter() - started,
    )


def _run_coverage_models(
    reference: Replicas, budget_s: float, executor: Executor
) -> tuple[tuple[Run, ...], float, float]:
    """Compare dent rates with marked dents at finer and finer sample points.

    Returns:
        The runs, seconds of treatment that the budget allows, and CPU seconds.
    """
    design, chamber, mesh, _ = reference.setting
    accuracy = design.process.accuracy
    cpu_per_second = reference.cost.value / (accuracy.warmup_time + accuracy.simulated_time)
    affordable = budget_s / MODEL_REPLICAS / MODEL_LOAD / cpu_per_second - accuracy.warmup_time
    seconds = float(
        min(
            design.process.treatment_time,
            MAX_SIMULATED_TREATMENT,
            max(affordable, accuracy.simulated_time),
        )
    )
    treated = design.changed({"process.treatment_time_s": seconds, MODEL: "dents"})
    setting = ReplicaSetting(treated, chamber, mesh, None)
    models = {"avrami": Replicas(setting, skipped=0)}
    try:
        for spacing in (2 * accuracy.sample_mm, accuracy.sample_mm, accuracy.sample_mm / 2):
            samples = sample_points(chamber, 1e-3 * spacing)
            models[f"dents, sample_mm {spacing:g}"] = Replicas(
                setting._replace(samples=samples), skipped=0
            )
    except InputError:  # too many points for the memory
        return (), seconds, 0.0
    spent = sum(add_replicas(list(models.values()), executor) for _ in range(MODEL_REPLICAS))
    *_, finest = models.values()
    return tuple(one.run(MODEL, name, finest) for name, one in models.items()), seconds, spent


def _batch_sizes(reference: Replicas) -> tuple[BatchSize, ...]:
    """Errors of batches of 4, 8, 16 ... replicas."""
    whole, total = reference.estimates()[0].value, len(reference.tallies)
    sizes, count = [], 4
    while total // count >= MIN_BATCHES:
        batches = total // count
        begin = time.thread_time()
        estimates = [reference.estimates(slice(b * count, (b + 1) * count)) for b in range(batches)]
        estimating = (time.thread_time() - begin) / batches
        values = np.array([objective.value for objective, _, _ in estimates])
        rms = rms_error(values, whole, count / total)
        half_width = float(np.mean([objective.half_width for objective, _, _ in estimates]))
        if min(rms, half_width) < ZERO_ERROR:
            raise InputError(
                "process.accuracy.simulated_time_s: no dent on the target was simulated, so there "
                "is no error to measure; raise it, or see chamberopt check"
            )
        cpu_s = count * reference.cost.value + estimating
        are_merged = any(merged for _, _, merged in estimates)
        interval = rms_interval(rms, batches)
        sizes.append(BatchSize(count, batches, rms, *interval, half_width, cpu_s, are_merged))
        count *= 2
    return tuple(sizes)
