"""The ladder of accuracy: every knob that trades it for time, each at several settings, against one reference.

The reference has every knob at its finest setting; each rung has one knob coarser. All are simulated in turns, a few
replicas each, so that a machine that slows down slows them all. Sub-pools of the reference's replicas say how the
error falls with their number; the difference of a rung from the reference is its bias. Dents one by one take a whole
treatment: they are compared with the rates of the same impacts.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.chamber.scene import chamber_mesh, replica_seed
from chamberopt.common.errors import InputError
from chamberopt.common.progress import Progress
from chamberopt.coverage.coverage_from_impacts import Tally
from chamberopt.coverage.statistics.confidence_interval import Estimate
from chamberopt.design.design import Design
from chamberopt.simulation.convergence.dent_runs import dent_rungs
from chamberopt.simulation.convergence.error_law import Law, Level, law_of, rms_error, rms_interval
from chamberopt.simulation.convergence.parameters import REFERENCE, designs
from chamberopt.simulation.convergence.runs import Pool, Run, dents_alone
from chamberopt.simulation.replicas import ReplicaSetting, simulate_replica

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.shapes import ChamberTable
    from sim_core import TriangleMesh

LEAST_ROUNDS = 3  # fewer replicas of a rung have no interval
LEAST_REPLICAS = 32  # of the reference: two levels
MOST_REPLICAS = 1024  # of the reference: what they leave takes a few hundred MB
LEAST_BLOCKS = 4  # sub-pools of a level
DENT_SHARE = 0.2  # of the budget, for dents one by one
NO_ERROR = 1e-12  # of a share of area: rounding


@dataclass(frozen=True)
class ConvergenceStudy:
    """All that was simulated.

    settings: of the reference, by knob · rungs: one knob coarser each, and the design as it is · levels, law: error
    against CPU seconds of sub-pools of the reference · dents: rates, then dents one by one from coarse to fine, all
    from the same impacts of dent_time s of treatment; their bias is against the last · spent_s: CPU seconds.
    """

    design: Design
    settings: dict[str, Any]
    reference: Run
    rungs: tuple[Run, ...]
    levels: tuple[Level, ...]
    law: Law
    dents: tuple[Run, ...]
    dent_time: float
    spent_s: float
    wall_s: float


def require_budget(budget_s: float) -> None:
    """InputError for CPU seconds that are none."""
    if not 0.0 < budget_s < math.inf:
        raise InputError(
            f"--budget-s: given {budget_s:g}; give the CPU seconds to spend, more than 0"
        )


def run_convergence_study(
    design: Design,
    budget_s: float,
    executor: Executor,
    progress: Progress | None = None,
    ready: Callable[[Design, Chamber], None] = lambda design, chamber: None,
) -> ConvergenceStudy:
    """Simulate the whole ladder for about so many CPU seconds; at least three replicas of every rung.

    Each round has one replica of every rung, and of the reference as many as there are rungs.

    ready: called for each design of the ladder before any is simulated, to compile. Raises InputError for a budget
    that is none, and what evaluate() raises.
    """
    from chamberopt.chamber.build import build_chamber

    require_budget(budget_s)
    started = time.perf_counter()
    settings, ladder = designs(design)
    shapes: dict[ChamberTable, tuple[Chamber, TriangleMesh]] = {}
    pools = {}
    for key, one in ladder.items():
        if one.chamber not in shapes:
            first = next(iter(shapes.values()), None)
            chamber = build_chamber(one, first and first[0].part.target)
            shapes[one.chamber] = chamber, chamber_mesh(chamber)
        pools[key] = Pool(one, *shapes[one.chamber])
        ready(one, pools[key].chamber)
    reference, *others = pools.values()
    rounds, spent = 0, 0.0
    while len(reference.tallies) < MOST_REPLICAS:
        few = rounds < LEAST_ROUNDS or len(reference.tallies) < LEAST_REPLICAS
        if not few and spent >= (1.0 - DENT_SHARE) * budget_s:
            break
        spent += _play_round([*others, *[reference] * len(others)], executor)
        rounds += 1
        if progress:
            progress(min(round(spent), round(budget_s)), round(budget_s), None)
    dents, dent_time, dents_spent = dent_rungs(reference, budget_s - spent, executor)
    levels = _levels(reference)
    own = reference.rung(REFERENCE, "", reference)
    nothing = Estimate(0.0, 0.0)
    return ConvergenceStudy(
        design=design,
        settings=settings,
        reference=replace(own, bias=nothing, mean_bias=nothing),
        rungs=tuple(
            pool.rung(*key, reference) for key, pool in pools.items() if pool is not reference
        ),
        levels=levels,
        law=law_of(levels, own.objective.pseudovalues),
        dents=dents,
        dent_time=dent_time,
        spent_s=spent + dents_spent,
        wall_s=time.perf_counter() - started,
    )


def _play_round(pools: Sequence[Pool], executor: Executor) -> float:
    """One replica more of each of these, of one named twice two; CPU seconds."""
    futures = []
    for pool in pools:
        number = len(pool.cpu)
        pool.cpu.append(0.0)
        futures.append(
            (pool, number, executor.submit(_replica, pool.design, pool.chamber, pool.mesh, number))
        )
    spent = 0.0
    try:
        for pool, number, future in futures:
            left, pool.cpu[number] = future.result()
            pool.tallies.append(left)
            spent += pool.cpu[number]
    finally:
        for _, _, future in futures:
            future.cancel()
    return spent


def _replica(
    design: Design, chamber: Chamber, mesh: TriangleMesh, number: int
) -> tuple[Tally, float]:
    """The dents of one replica, and its CPU seconds on this thread."""
    begin = time.thread_time()
    seed = replica_seed(design.process.seed, number)
    left = simulate_replica(ReplicaSetting(design, chamber, mesh, None), seed).tally
    return dents_alone(left), time.thread_time() - begin


def _levels(pool: Pool) -> tuple[Level, ...]:
    """Sub-pools of 4, 8, 16 ... replicas."""
    whole, size = pool.figures()[0].value, len(pool.tallies)
    levels, count = [], 4
    while size // count >= LEAST_BLOCKS:
        blocks = size // count
        begin = time.thread_time()
        found = [pool.figures(slice(b * count, (b + 1) * count)) for b in range(blocks)]
        estimating = (time.thread_time() - begin) / blocks
        rms = rms_error(np.array([goal.value for goal, _, _ in found]), whole, count / size)
        said = float(np.mean([goal.half_width for goal, _, _ in found]))
        cpu = count * pool.cost.value + estimating
        if min(rms, said) < NO_ERROR:
            why = "no dent on the target was simulated, so there is no error to measure"
            raise InputError(
                f"process.accuracy.simulated_time_s: {why}; raise it, or see chamberopt check"
            )
        joined = any(one[2] for one in found)
        levels.append(Level(count, blocks, rms, *rms_interval(rms, blocks), said, cpu, joined))
        count *= 2
    return tuple(levels)
