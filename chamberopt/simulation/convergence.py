"""Convergence study: each numerical parameter at several settings, compared with a reference.

A numerical parameter, such as the simulated time, sets how accurately a design is simulated. Its
settings are the values that are tried. The reference is a run, a series of replicas, with every
parameter at its finest setting. Each other run has one parameter coarser, and the bias of this
setting is its difference from the reference. All runs take turns, a few replicas each, so that a
computer that slows down slows all of them. The error against the number of replicas comes from
batches of the reference's replicas.
"""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable, Collection, Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from chamberopt.chamber.replica_seed import replica_seed
from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.errors import InputError
from chamberopt.common.estimate import Estimate, estimate, paired_difference
from chamberopt.common.executor import core_count
from chamberopt.common.progress import step
from chamberopt.coverage.coverage_from_impacts import Prints, kept_footprints, locate_dents
from chamberopt.coverage.field.memory import OF_POINT, PROCESS, evaluation_bytes, how_many_fit
from chamberopt.coverage.field.target_field import TargetField
from chamberopt.coverage.metrics import parse_objective
from chamberopt.design.design import Design
from chamberopt.design.process import MAX_POINTS, MIN_POINTS
from chamberopt.simulation import error_law
from chamberopt.simulation.error_law import BatchSize, ErrorLaw
from chamberopt.simulation.estimates import weighted_sum, window_estimates
from chamberopt.simulation.evaluate import prepare_target
from chamberopt.simulation.replicas import ReplicaSetting, simulate_replica

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.shapes import ChamberTable
    from sim_core import TriangleMesh

# The numerical parameters of a design, which trade accuracy for time, and settings to try.

FACETS, MOTION = "chamber.facets", "sonotrode.motion"
TIME, WARM_UP = "process.accuracy.simulated_time_s", "process.accuracy.warmup_time_s"
ELASTIC_SPEED = "process.accuracy.elastic_below_mm_s"
DRAG_STEP = "process.accuracy.drag_step_ms"
POINTS, GAUGE = "process.accuracy.points", "process.accuracy.gauge_mm2"
REFERENCE, DESIGNED = "reference", "as designed"


def numerical_parameters(design: Design) -> dict[str, tuple[object, ...]]:
    """Return the values to try of each numerical parameter of a design, by its dotted name.

    The last value is the value in the reference, with which all others are compared.
    """
    accuracy = design.process.accuracy
    settings: dict[str, Iterable[Any]] = {}
    if design.chamber.is_round:
        facets = design.value(FACETS)
        settings[FACETS] = sorted({16, facets, min(1024, max(256, 4 * facets))})
    if not design.sonotrodes:
        settings[MOTION] = "random_phase", "sinusoidal"
    warm_up, time_s = accuracy.warmup_time_s, accuracy.simulated_time_s
    settings[WARM_UP] = sorted({0.0, warm_up / 4, warm_up, min(1e4, 4 * max(warm_up, 0.05))})
    settings[ELASTIC_SPEED] = _falling(accuracy.elastic_below_mm_s, 10)
    if design.effects.drag:
        settings[DRAG_STEP] = _falling(accuracy.drag_step_ms, 4)
    points = accuracy.points
    settings[POINTS] = sorted({max(MIN_POINTS, points // 4), points, min(MAX_POINTS, 4 * points)})
    gauge = accuracy.gauge_mm2
    settings[GAUGE] = min(1e4, 4 * gauge), gauge
    settings[TIME] = max(1e-4, time_s / 4), min(1e4, 4 * time_s), time_s
    return {name: tuple(values) for name, values in settings.items()}


def _falling(value: float, factor: float) -> list[float]:
    """Return `factor` times a value, the value, and the value over `factor`, the largest first.

    They are cut off at 0.1 and 1000, the range that a design file allows.
    """
    return sorted({min(1e3, factor * value), value, max(0.1, value / factor)}, reverse=True)


def study_designs(design: Design) -> tuple[dict[str, object], dict[tuple[str, str], Design]]:
    """Return the finest setting of each numerical parameter, and all designs to simulate.

    The designs are the reference (all parameters finest), a copy of it for each other setting of a
    parameter, and the design as it is. Their keys are the parameter and its setting as text.
    """
    parameters = numerical_parameters(design)
    settings = {name: values[-1] for name, values in parameters.items()}
    reference = design.changed(settings)
    others: dict[tuple[str, str], Design] = {}
    for name, values in parameters.items():
        others |= {(name, setting_text(x)): reference.changed({name: x}) for x in values[:-1]}
    return settings, {(REFERENCE, ""): reference, **others, (DESIGNED, ""): design}


def setting_text(value: object) -> str:
    """Return the value of a numerical parameter as a design file writes it, without quotes."""
    return f"{value:g}" if isinstance(value, int | float) else str(value)


def short_name(parameter: str) -> str:
    """Return the name of a parameter in words, without its table and unit, as "simulated time"."""
    return re.sub("_(mm_s|mm2|ms|s)$", "", parameter.rsplit(".", 1)[-1]).replace("_", " ")


MIN_ROUNDS = 3  # a run needs three replicas for an interval
MIN_REPLICAS, MAX_REPLICAS = 32, 1024  # of the reference; 32 give two sizes of batches
LIKELY_REPLICAS = 256  # number of replicas of all settings together, whose dents are kept
MIN_BATCHES = 4  # of each size
ZERO_ERROR = 1e-12  # share of an area below which an error is a rounding error
ZERO = Estimate(0.0, 0.0)


@dataclass(frozen=True)
class Run:
    """The result of simulations in which one numerical parameter has one of its settings."""

    parameter: str  # dotted name of the numerical parameter that differs from the reference
    setting: str  # its value as text
    replicas: int
    cpu: Estimate  # CPU seconds of a replica
    objective: Estimate
    mean: Estimate  # mean coverage
    bias: Estimate = ZERO  # objective less the reference's
    mean_bias: Estimate = ZERO  # mean coverage less the reference's

    @property
    def is_biased(self) -> bool:
        """True if the bias, the difference from the reference, is certainly not 0."""
        return abs(self.bias.value) > self.bias.half_width

    @property
    def max_bias(self) -> float:
        """Largest absolute value that the bias may have by its interval."""
        return max(self.bias.high, -self.bias.low)


@dataclass(frozen=True)
class ConvergenceStudy:
    """The runs of a convergence study, their reference, and the errors of batches of replicas."""

    design: Design
    settings: dict[str, Any]  # of the reference, by parameter
    reference: Run
    runs: tuple[Run, ...]  # each with a coarser parameter, and the run of the design as it is
    sizes: tuple[BatchSize, ...]  # error against CPU seconds of batches of the reference
    law: ErrorLaw  # fitted to the sizes
    cpu_s: float  # CPU seconds of the simulations
    wall_s: float  # duration of the study [s]


class TimedReplica(NamedTuple):
    """The dents of a replica, as their footprints in windows, and the CPU seconds that it took.

    A window is a disc of the surface in which dents are counted.
    """

    footprints: Prints
    cpu_s: float


@dataclass
class Replicas:
    """The replicas of one design that have been simulated so far, and their figures."""

    setting: ReplicaSetting
    target: TargetField
    skipped: int = 1  # number of first replicas without a time, because they build a search tree
    started: int = 0  # number of replicas that are simulated or under way
    done: list[TimedReplica] = field(default_factory=list)

    @property
    def cpu(self) -> Estimate:
        """Estimate of the CPU seconds that a replica of this design takes."""
        return estimate([one.cpu_s for one in self.done[self.skipped :]], 0.0)

    def estimates(self, part: slice = slice(None)) -> tuple[Estimate, Estimate, bool]:
        """Return objective and mean coverage from some replicas, and if dents suffice for both."""
        prints = [one.footprints for one in self.done[part]]
        metrics, found = window_estimates(
            self.target, self.target.gauge, prints, self.setting.design
        )
        objective = weighted_sum(parse_objective("uniform_coverage"), metrics)
        return objective, metrics["mean_coverage"], found.has_mean

    def run(self, parameter: str, setting: str, reference: Run | None = None) -> Run:
        """Return the result of all replicas, with its difference from the result of a reference.

        Args:
            parameter, setting: name of the parameter that differs from the reference, and its
                value.
            reference: result of the reference; None if these replicas are the reference themselves.
        """
        objective, mean, _ = self.estimates()
        run = Run(parameter, setting, len(self.done), self.cpu, objective, mean)
        if reference is None:
            return run
        bias = paired_difference(objective, reference.objective)
        return replace(run, bias=bias, mean_bias=paired_difference(mean, reference.mean))


def require_budget(budget_s: float) -> None:
    """Raise InputError unless the budget is a positive, finite number."""
    if not 0.0 < budget_s < math.inf:
        remedy = "give the CPU seconds to spend, more than 0"
        raise InputError(f"--budget-s: given {budget_s:g}; {remedy}")


def describe_cost(design: Design, budget_s: float) -> str:
    """Return a sentence for the user on the cost of a study, to show before the study begins."""
    settings = len(study_designs(design)[1])
    return (
        f"{settings} settings, each in {MIN_ROUNDS} replicas or more: about {budget_s:g} CPU s "
        f"(--budget-s) on {core_count()} cores, more where one replica takes long; and compiling"
    )


def run_convergence_study(
    design: Design,
    budget_s: float,
    executor: Executor,
    prepare: Callable[[Design, Chamber], None] = lambda design, chamber: None,
) -> ConvergenceStudy:
    """Simulate each setting of each numerical parameter, for about the budgeted CPU seconds.

    Each round simulates a replica of every setting, and as many replicas of the reference as there
    are settings. There are at least three rounds. `prepare` is called for each design before the
    first simulation, to compile. Raises InputError if the budget is not positive, the memory is too
    small, or a design cannot be evaluated.
    """
    from chamberopt.chamber.build import build_chamber

    require_budget(budget_s)
    started = time.perf_counter()
    settings, designs = study_designs(design)
    chambers: dict[ChamberTable, tuple[Chamber, TriangleMesh]] = {}
    replicas: dict[tuple[str, str], Replicas] = {}
    with step("building and compiling, settings") as built:
        for key, one in designs.items():
            built(len(replicas), len(designs), None)
            if one.chamber not in chambers:
                first = next(iter(chambers.values()), None)
                chamber = build_chamber(one, first and first[0].part.target)
                chambers[one.chamber] = chamber, chamber_mesh(chamber)
            if not replicas:
                require_memory(designs.values(), chambers[one.chamber][0])
            setting = ReplicaSetting(one, *chambers[one.chamber])
            replicas[key] = Replicas(setting, prepare_target(one, *chambers[one.chamber]))
            prepare(one, replicas[key].setting.chamber)
    (reference_key, reference), *others = replicas.items()
    a_round = [*(one for _, one in others), *[reference] * len(others)]
    enough = max(MIN_REPLICAS, MIN_ROUNDS * len(others))
    spent, least = 0.0, budget_s
    with step("simulating, CPU seconds") as simulated:
        while (count := len(reference.done)) < MAX_REPLICAS and (
            count < enough or spent < budget_s
        ):
            spent += _add_replicas(a_round, executor)
            if not count:
                _require_error(reference.estimates()[1].value)
                least = max(budget_s, spent * math.ceil(enough / len(others)))
            simulated(min(round(spent), round(least)), round(least), None)
    reference_run = reference.run(*reference_key)
    sizes = _batch_sizes(reference, reference_run)
    return ConvergenceStudy(
        design=design,
        settings=settings,
        reference=reference_run,
        runs=tuple(one.run(*key, reference_run) for key, one in others),
        sizes=sizes,
        law=error_law.fit_error_law(sizes),
        cpu_s=spent,
        wall_s=time.perf_counter() - started,
    )


def require_memory(designs: Collection[Design], chamber: Chamber) -> None:
    """Raise InputError if a study's replicas do not fit into memory.

    Memory holds the windows (discs in which dents are counted) of all designs, and the dents of
    LIKELY_REPLICAS replicas.
    """
    reference = next(iter(designs))
    points = sum(one.process.accuracy.points for one in designs)
    each = evaluation_bytes(reference, chamber, LIKELY_REPLICAS)
    how_many_fit(1, each, PROCESS + OF_POINT * points)


def _add_replicas(designs: Sequence[Replicas], executor: Executor) -> float:
    """Simulate another replica of each design, and return the CPU seconds of all these replicas.

    A design that is listed several times gets as many replicas.
    """
    futures = []
    for one in designs:
        futures.append(executor.submit(simulate_timed, one.setting, one.target, one.started))
        one.started += 1
    try:
        for one, future in zip(designs, futures, strict=True):
            one.done.append(future.result())
    finally:
        for future in futures:
            future.cancel()
    return sum(future.result()[-1] for future in futures)


def simulate_timed(setting: ReplicaSetting, target: TargetField, number: int) -> TimedReplica:
    """Simulate the replica with this number, and return its dents' footprints and CPU seconds.

    Its other results are dropped, so that hundreds of replicas fit into memory.
    """
    begin = time.thread_time()
    replica = simulate_replica(setting, replica_seed(setting.design.process.seed, number))
    dents = locate_dents(target, target.in_sector(replica.hits))
    found = kept_footprints(target, target.gauge, dents)
    return TimedReplica(found, time.thread_time() - begin)


def _require_error(size: float) -> None:
    """Raise InputError if a coverage, or the error of a batch of replicas, is 0."""
    if size < ZERO_ERROR:
        why = "no dent on the target was simulated, so there is no error to measure"
        remedy = "raise it, or see chamberopt check"
        raise InputError(f"process.accuracy.simulated_time_s: {why}; {remedy}")


def _batch_sizes(reference: Replicas, whole: Run) -> tuple[BatchSize, ...]:
    """Return the errors of the objective from batches of 4, 8, 16 ... of the reference's replicas.

    The error of a batch is its difference from the objective of all the reference's replicas.
    """
    sizes, count = [], 4
    while (batches := whole.replicas // count) >= MIN_BATCHES:
        begin = time.thread_time()
        estimates = [reference.estimates(slice(b * count, (b + 1) * count)) for b in range(batches)]
        estimating = (time.thread_time() - begin) / batches
        values = np.array([objective.value for objective, _, _ in estimates])
        rms = error_law.rms_error(values, whole.objective.value, count / whole.replicas)
        half_width = float(np.mean([objective.half_width for objective, _, _ in estimates]))
        _require_error(min(rms, half_width))
        cpu_s = count * whole.cpu.value + estimating
        is_resolved = all(resolved for _, _, resolved in estimates)
        sizes.append(BatchSize(count, batches, rms, half_width, cpu_s, is_resolved))
        count *= 2
    return tuple(sizes)
