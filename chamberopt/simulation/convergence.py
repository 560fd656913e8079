"""Convergence study: each numerical parameter at several settings, compared with a reference.

A numerical parameter, such as the simulated time, sets how accurately a design is simulated. Its
settings are the values that are tried. The reference is a run, a series of replicas, with every
parameter at its finest setting, but for what more replicas do as well: simulated time and points.
Each other run has one parameter off the reference, and the bias of this setting is its difference
from the reference. All runs take turns, a replica each, so that a computer that slows down slows
all of them. The error against the number of replicas comes from batches of the reference's
replicas.

The study keeps to a budget of CPU seconds, and to the time by the clock that it takes on free
cores. A replica of the reference tells what each setting will take. Settings that the budget does
not allow are left out, in the order of LEFT_OUT_FIRST.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field
from itertools import count
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.errors import InputError
from chamberopt.common.executor import SerialExecutor, core_count, result_of
from chamberopt.common.number_text import plain
from chamberopt.common.progress import Progress, step
from chamberopt.coverage.field.memory import OF_POINT, PROCESS, evaluation_bytes, how_many_fit
from chamberopt.coverage.field.target_field import TargetField, WindowSetting, find_target_field
from chamberopt.design.design import Design
from chamberopt.simulation import error_law
from chamberopt.simulation.error_law import BatchSize, ErrorLaw
from chamberopt.simulation.evaluate import ReplicaPlan, evaluate, window_setting
from chamberopt.simulation.numerical_parameters import (
    DESIGNED,
    LEFT_OUT_FIRST,
    numerical_parameters,
    short_name,
    study_designs,
)
from chamberopt.simulation.replicas import ReplicaSet, ReplicaSetting
from chamberopt.simulation.timed_replicas import (
    Replicas,
    Run,
    TimedReplica,
    simulate_timed,
    timed_figures,
)

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.shapes import ChamberTable
    from sim_core import TriangleMesh

MIN_ROUNDS = 3  # replicas of a run, for an interval
MIN_REPLICAS, MAX_REPLICAS = 32, 1024  # of the reference; 32 give two sizes of batches
LIKELY_REPLICAS = 256  # number of replicas of all settings together, whose dents are kept
MIN_BATCHES = 4  # of each size
TIMED_REPLICAS = 4  # of the evaluation whose cost is measured; strength takes four
# CPU seconds of a command beside those of the study itself: imports, tables and picture.
OF_COMMAND = 4.0
SERIAL = 0.1  # share of the CPU seconds in which only one core has work
ZERO_ERROR = 1e-12  # share of an area below which an error is a rounding error


class EvaluationCost(NamedTuple):
    """What an evaluation of the design as it is costs, in CPU seconds.

    Attributes:
        fixed: to build the chamber and its search tree, and to place the windows (discs in which
            dents are counted).
        figures: to locate the dents of a replica, and for its share of all figures.
    """

    fixed: float
    figures: float


@dataclass(frozen=True)
class ConvergenceStudy:
    """The runs of a convergence study, their reference, and the errors of batches of replicas."""

    design: Design
    settings: dict[str, Any]  # of the reference, by parameter
    reference: Run
    runs: tuple[Run, ...]  # each with a coarser parameter, and the run of the design as it is
    sizes: tuple[BatchSize, ...]  # error against CPU seconds of batches of the reference
    law: ErrorLaw | None  # fitted to the sizes; None if there are fewer than two
    resolved_s: float  # simulated time [s] that gives the dents which the objective needs
    cost: EvaluationCost
    cpu_s: float  # CPU seconds of the study, without compiling
    wall_s: float  # duration of the study [s]
    left_out: tuple[str, ...] = ()  # parameters that the budget did not allow to try


def require_budget(budget_s: float) -> None:
    """Raise InputError unless the budget is a positive, finite number."""
    if not 0.0 < budget_s < math.inf:
        remedy = "give the CPU seconds to spend, more than 0"
        raise InputError(f"--budget-s: given {budget_s:g}; {remedy}")


def describe_cost(budget_s: float) -> str:
    """Return a sentence for the user on the cost of a study, to show before the study begins."""
    return (
        f"at most about {plain(budget_s, 3)} CPU s (--budget-s), and {plain(_wall(budget_s), 2)} s "
        f"on {core_count()} cores: with fewer of them free it simulates less; and compiling, once "
        "ever"
    )


def _wall(cpu_s: float) -> float:
    """Return the duration [s] of a study of so many CPU seconds if all cores are free."""
    return cpu_s * (SERIAL + (1.0 - SERIAL) / core_count())


def run_convergence_study(
    design: Design,
    budget_s: float,
    executor: Executor,
    prepare: Callable[[Design, Chamber], None] = lambda design, chamber: None,
    tell: Callable[[str], None] = lambda text: None,
) -> ConvergenceStudy:
    """Simulate each setting of each numerical parameter, for about the budgeted CPU seconds.

    Args:
        prepare: called for each design before its first simulation, to compile.
        tell: called with sentences for the user.

    Raises:
        InputError: the budget is not positive, or too small even for the fewest settings; the
            memory is too small; or a design cannot be evaluated.
    """
    require_budget(budget_s)
    study = _Study(design, budget_s, executor, prepare, time.perf_counter())
    with step("building and timing the reference"):
        left_out = study.leave_out()
    if left_out:
        tell(f"left out by --budget-s = {budget_s:g}: {', '.join(map(short_name, left_out))}")
    settings, designs = study_designs(design, left_out)
    with step("building, settings") as built:
        replicas: dict[tuple[str, str], Replicas] = {}
        for key, design_of_key in designs.items():
            built(len(replicas), len(designs), None)
            replicas[key] = study.replicas_of(design_of_key)
    (reference_key, reference), *others = replicas.items()
    whole_evaluation, of_figures = study.time_evaluation(replicas[DESIGNED, ""])
    with step("simulating, CPU seconds") as progress:
        study.simulate(reference, [one for _, one in others], progress)
    if study.is_late:
        tell("the cores were not free, so less was simulated than the budget allows")
    with step("figures"):
        whole, sizes, resolved_s = study.figures_of_reference(reference, reference_key)
        found = [executor.submit(timed_figures, one, [range(one.started)]) for _, one in others]
        runs = []
        for (key, one), future in zip(others, found, strict=True):
            (figures,), seconds, cpu_s = result_of(future)
            runs.append(one.run(key, figures, seconds, whole))
            study.spent += cpu_s
    each = runs[-1].cpu.value + of_figures  # the last run is of the design as it is
    cost = EvaluationCost(max(0.0, whole_evaluation - TIMED_REPLICAS * each), of_figures)
    return ConvergenceStudy(
        design=design,
        settings=settings,
        reference=whole,
        runs=tuple(runs),
        sizes=sizes,
        law=error_law.fit_error_law(sizes) if len(sizes) > 1 else None,
        resolved_s=resolved_s,
        cost=cost,
        cpu_s=study.spent,
        wall_s=study.elapsed,
        left_out=left_out,
    )


@dataclass
class _Study:
    """A study that runs: what it has built, and the CPU seconds that it has spent."""

    design: Design
    budget_s: float
    executor: Executor
    prepare: Callable[[Design, Chamber], None]
    began: float  # by the clock [s]
    spent: float = 0.0  # CPU seconds, without compiling
    seconds: float = 0.0  # CPU seconds of a simulated second of the reference
    of_figures: float = 0.0  # CPU seconds of a point and simulated second, for the figures
    chambers: dict[ChamberTable, tuple[Chamber, TriangleMesh]] = field(default_factory=dict)
    targets: dict[tuple[ChamberTable, WindowSetting], TargetField] = field(default_factory=dict)
    built: list[float] = field(default_factory=list)  # CPU seconds to build for each new design
    known: dict[str, Replicas] = field(default_factory=dict)
    compiled: float = 0.0  # seconds by the clock that `prepare` took
    is_late: bool = False  # whether the clock ended it before the CPU seconds were spent

    @property
    def elapsed(self) -> float:
        """Duration so far [s], with compiling."""
        return time.perf_counter() - self.began

    def replicas_of(self, design: Design) -> Replicas:
        """Return the replicas of a design, and build its chamber and windows if they are new.

        The first replica in a chamber builds a search tree, so it is simulated here, without a
        time.
        """
        from chamberopt.chamber.build import build_chamber

        key = design.model_dump_json()
        if key in self.known:
            return self.known[key]
        begin, table = time.thread_time(), design.chamber
        is_new = table not in self.chambers
        if is_new:
            first = next(iter(self.chambers.values()), None)
            chamber = build_chamber(design, first and first[0].part.target)
            self.chambers[table] = chamber, chamber_mesh(chamber)
        chamber, mesh = self.chambers[table]
        window = window_setting(design, chamber)
        if (table, window) not in self.targets:
            require_memory([*self.targets.values()], design, chamber)
            self.targets[table, window] = target = find_target_field(chamber, mesh, window)
            _ = target.gauge
        self.built.append(time.thread_time() - begin)
        self.spent += self.built[-1]
        before = self.elapsed
        self.prepare(design, chamber)
        self.compiled += self.elapsed - before
        found = Replicas(ReplicaSetting(design, chamber, mesh), self.targets[table, window])
        self.known[key] = found
        if is_new:
            found.skipped = 1
            self.add(found)
        return found

    def add(self, one: Replicas) -> None:
        """Simulate the next replica of a design now."""
        one.started += 1
        one.done.append(simulate_timed(one.setting, one.target, one.started - 1))
        self.spent += one.done[-1].cpu_s

    def leave_out(self) -> tuple[str, ...]:
        """Time a replica of the reference, and return the parameters that the budget leaves out.

        Raises InputError if the budget is too small even without them.
        """
        reference = self.replicas_of(next(iter(study_designs(self.design)[1].values())))
        self.add(reference)
        for _ in range(2):  # the first loads compiled code
            (figures,), _, cpu_s = timed_figures(reference, [range(2)])
            self.spent += cpu_s
        _require_error(figures.mean.value)
        self.seconds = reference.done[1].cpu_s / reference.length
        self.of_figures = 0.5 * cpu_s / (reference.length * len(reference.target.gauge.area))
        can_go = [name for name in LEFT_OUT_FIRST if name in numerical_parameters(self.design)]
        for number in range(len(can_go) + 1):
            least = self.spent + self.least_cost(can_go[:number])
            if least <= self.budget_s:
                return tuple(can_go[:number])
        remedy = f"give at least {math.ceil(1.1 * least)}, or a shorter simulated_time_s"
        raise InputError(
            f"--budget-s: given {self.budget_s:g}, but {MIN_REPLICAS} replicas of the reference "
            f"and {MIN_ROUNDS} of each simulated time take about {plain(least, 2)} CPU s; {remedy}"
        )

    def least_cost(self, left_out: Collection[str]) -> float:
        """Return the CPU seconds of the fewest replicas of a study, without some parameters."""
        (reference, *others) = study_designs(self.design, left_out)[1].values()
        chambers = {one.chamber for one in others} - self.chambers.keys()
        windows = {(one.chamber, *_windows_of(one)) for one in others}
        # The first was slower, because it loaded libraries.
        cost = 0.5 * self.built[0] * len(windows)
        cost += OF_COMMAND + 0.5 * self.built[0]
        cost += TIMED_REPLICAS * 3.0 * self._cost_of(self.design)
        cost += (MIN_REPLICAS + len(chambers)) * 1.5 * self._cost_of(reference)
        return cost + MIN_ROUNDS * sum(map(self._cost_of, others))

    def _cost_of(self, design: Design) -> float:
        """Return the likely CPU seconds of a replica of a design and of its figures."""
        accuracy = design.process.accuracy
        length = design.process.recorded_time + accuracy.warmup_time
        return length * (self.seconds + self.of_figures * accuracy.points)

    def time_evaluation(self, own: Replicas) -> tuple[float, float]:
        """Evaluate the design as it is in a few replicas.

        Return the CPU seconds of all that this takes, and of the figures for each replica.
        """
        spent, whole, of_figures = timed_evaluation(own.setting, own.target)
        self.spent += spent
        return whole, of_figures

    def simulate(self, reference: Replicas, others: Sequence[Replicas], progress: Progress) -> None:
        """Simulate replicas in turns, until the budget is spent but for what the figures take.

        It ends earlier if the rest would end late by the clock, at the pace so far. The reference
        has MIN_REPLICAS and each other design MIN_ROUNDS in any case.
        """
        waiting: deque[tuple[Replicas, Future[TimedReplica]]] = deque()

        def take() -> None:
            one, future = waiting.popleft()
            one.done.append(result_of(future))
            self.spent += one.done[-1].cpu_s
            progress(min(round(self.spent), total), total, None)

        total = round(self.budget_s)
        try:
            for one in _turns(reference, others):
                is_least = any(other.started < MIN_ROUNDS for other in others)
                is_least |= reference.started < MIN_REPLICAS
                likely = sum(self._cost_of(running.setting.design) for running, _ in waiting)
                ahead = OF_COMMAND + likely + self._cost_of_figures(reference, others)
                is_spent = self.spent + ahead > self.budget_s
                late = (self.elapsed - self.compiled) * (1.0 + ahead / self.spent)
                self.is_late = not is_spent and late > _wall(self.budget_s)
                is_enough = is_spent or self.is_late or reference.started >= MAX_REPLICAS
                if is_enough and not is_least:
                    break
                task = self.executor.submit(simulate_timed, one.setting, one.target, one.started)
                waiting.append((one, task))
                one.started += 1
                while len(waiting) > 2 * core_count():
                    take()
            while waiting:
                take()
        finally:
            for _, future in waiting:
                future.cancel()

    def _cost_of_figures(self, reference: Replicas, others: Sequence[Replicas]) -> float:
        each = (
            one.started * one.length * one.setting.design.process.accuracy.points
            for one in (reference, reference, *others)  # batches of the reference come on top
        )
        return self.of_figures * sum(each)

    def figures_of_reference(
        self, reference: Replicas, key: tuple[str, str]
    ) -> tuple[Run, tuple[BatchSize, ...], float]:
        """Return the result of the reference, and the errors of batches of 4, 8, 16 ... replicas.

        The error of a batch is its difference from the objective of all the reference's replicas.
        The last number is the simulated time [s] that gives the dents which the objective needs.
        """
        whole, size = range(len(reference.done)), 4
        batches: dict[int, list[range]] = {}
        while (number := len(whole) // size) >= MIN_BATCHES:
            batches[size] = [whole[b * size : (b + 1) * size] for b in range(number)]
            size *= 2
        parts = [whole, *(one for of_size in batches.values() for one in of_size)]
        found, seconds, cpu_s = timed_figures(reference, parts)
        self.spent += cpu_s
        of_part = dict(zip(parts, found, strict=True))
        run, sizes = reference.run(key, of_part[whole], seconds), []
        for size, of_size in batches.items():
            objectives = [of_part[one].objective for one in of_size]
            values = np.array([one.value for one in objectives])
            rms = error_law.rms_error(values, run.objective.value, size / run.replicas)
            half_width = float(np.mean([one.half_width for one in objectives]))
            _require_error(min(rms, half_width))
            is_resolved = all(of_part[one].resolution.has_mean for one in of_size)
            cost = size * run.cpu.value
            sizes.append(BatchSize(size, len(of_size), rms, half_width, cost, is_resolved))
        resolution = of_part[whole].resolution
        return run, tuple(sizes), resolution.time_for(resolution.needed_for_mean)


def _turns(reference: Replicas, others: Sequence[Replicas]) -> Iterator[Replicas]:
    """Yield without end which design gets the next replica.

    A round has one replica of each other design. The reference, with which all are compared, gets
    the square root of their number: this makes the differences as sure as the work allows (C. W.
    Dunnett, J. Am. Stat. Assoc. 50 (1955) 1096). In the first rounds it gets MIN_REPLICAS.
    """
    for number in count():
        least = math.ceil(MIN_REPLICAS / MIN_ROUNDS) if number < MIN_ROUNDS else 0
        of_reference = max(least, math.ceil(math.sqrt(len(others))))
        ends = np.linspace(0, of_reference, len(others) + 1).astype(int)
        for one, more in zip(others, np.diff(ends), strict=True):
            yield one
            yield from [reference] * int(more)


def _windows_of(design: Design) -> tuple[int, float]:
    return design.process.accuracy.points, design.process.accuracy.gauge_mm2


def timed_evaluation(setting: ReplicaSetting, target: TargetField) -> tuple[float, float, float]:
    """Evaluate a design in TIMED_REPLICAS replicas, and time that.

    Return the CPU seconds of this function, of building the chamber and evaluating the design, and
    of the figures for each replica.
    """
    from chamberopt.chamber.build import build_chamber

    plan, known, design = ReplicaPlan(TIMED_REPLICAS), ReplicaSet(target=target), setting.design
    clock = [time.process_time()]
    for _ in range(2):  # the first loads all code, the second knows the replicas
        evaluate(design, setting.chamber, SerialExecutor(), plan=plan, known=known)
        clock.append(time.process_time())
    chamber = build_chamber(design, setting.chamber.part.target)
    evaluate(design, chamber, SerialExecutor(), plan=plan)
    clock.append(time.process_time())
    begin, loaded, known_again, end = clock
    return end - begin, end - known_again, (known_again - loaded) / TIMED_REPLICAS


def require_memory(known: Sequence[TargetField], design: Design, chamber: Chamber) -> None:
    """Raise InputError if a study's replicas do not fit into memory.

    Memory holds the windows (discs in which dents are counted) of all designs, and the dents of
    LIKELY_REPLICAS replicas.
    """
    points = sum(one.setting.points for one in known)
    each = evaluation_bytes(design, chamber, LIKELY_REPLICAS)
    how_many_fit(1, each, PROCESS + OF_POINT * points)


def _require_error(size: float) -> None:
    """Raise InputError if a coverage, or the error of a batch of replicas, is 0."""
    if size < ZERO_ERROR:
        why = "no dent on the target was simulated, so there is no error to measure"
        remedy = "raise it, or see chamberopt check"
        raise InputError(f"process.accuracy.simulated_time_s: {why}; {remedy}")
