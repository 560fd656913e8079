"""Measure by a short run how fast a proposed design dents its target, and what simulating costs.

The run is at the slow end of what is known of friction, with windows (discs in which dents are
counted) as narrow as its dents resolve: wide ones even out the least covered places, whose time
is sought. It is bounded by its collisions, never by a clock, so that the same design has the same
result on any computer.
"""

from __future__ import annotations

import math
from concurrent.futures import Executor
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.chamber.propose.proposal import REPLICAS as FEWEST
from chamberopt.chamber.propose.proposed_budget import (
    COVERED,
    MODEST_GB,
    WIDEST,
    Measured,
    TooSlowError,
)
from chamberopt.chamber.replica_seed import step_seed
from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.errors import InputError
from chamberopt.common.executor import share
from chamberopt.common.number_text import rounded
from chamberopt.common.progress import Progress
from chamberopt.coverage.field.memory import time_within
from chamberopt.coverage.metrics import NEVER, exposed_target
from chamberopt.design.intensity import PredictedIntensity, Z
from chamberopt.design.ranges import variants
from chamberopt.simulation.evaluate import ReplicaPlan, evaluate, require_figures
from chamberopt.simulation.evaluation import Evaluation
from chamberopt.simulation.replicas import (
    Replica,
    ReplicaSet,
    ReplicaSetting,
    join_steps,
    replica_of,
    run_in_order,
    simulate_seed,
    times_on_part,
)
from chamberopt.simulation.settling import settled_after

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design

REPLICAS = 4
FIRST_TIME, GROWTH = 0.125, 4.0  # s of each replica; over that of the run before
DENTS = 300  # in a wide window, after which no longer run is begun
POINTS = 5000  # middles of windows; with 20,000 the time of a hip stem differed by 0.6 %
FEW = 40.0  # dents in the median of the narrowest windows; 25 are needed (proposed_budget)
# Of all replicas: a run that would have more is not begun, unless it is the first. The second is
# for a shot that still slows down, the third where poses are not told apart otherwise.
COLLISIONS, UNSETTLED, LONGER = 2e6, 8e6, 8e6
ENOUGH = 30  # dents from which on they bound the time to 98 %


def _least_time(squares: float, hits: int, area_time: float) -> float:
    """Return a time [s] before which 98 % of a target cannot be dented; 0 if too little is known.

    No target is covered sooner than one on which the same dents lie evenly, by Avrami's law, as far
    as its area counts. At the start of a simulation the shot is as quick as it will ever be.

    Args:
        squares: sum of the squared diameters of its dents [m²].
        hits: number of these dents.
        area_time: area of the target times the time in which they fell [m² s].
    """
    if hits < ENOUGH:
        return 0.0
    most = 0.25 * math.pi * squares / area_time * (1.0 + Z / math.sqrt(hits))
    return COVERED * math.log(50.0) / most


class _TimedReplica(NamedTuple):
    """A replica, and the times of its impacts on the part [s], (k,)."""

    replica: Replica
    time: np.ndarray


def _timed_replica(setting: ReplicaSetting, seed: int) -> _TimedReplica:
    """Simulate one replica with this seed. In each step time goes from 0 to that of all steps."""
    design, chamber, _ = setting
    if chamber.steps:
        timed, times = [], []
        for k, (one, room) in enumerate(zip(design.in_steps.values(), chamber.steps, strict=True)):
            own = ReplicaSetting(one, room, room.mesh)
            timed.append(_timed_replica(own, step_seed(seed, k)))
            times.append(timed[k].time * design.process.recorded_time / one.process.recorded_time)
        joined = join_steps([one.replica for one in timed], chamber)
        return _TimedReplica(joined, np.concatenate(times))
    result = simulate_seed(*setting, seed)
    return _TimedReplica(replica_of(setting, result), times_on_part(setting.chamber, result))


def _after(warmup: float, timed: _TimedReplica) -> Replica:
    """Return a replica with its impacts after a time [s]."""
    one, late = timed.replica, timed.time > warmup
    of_steps = np.split(late, np.cumsum([len(step.hits) for step in one.steps])[:-1])
    steps = (
        replace(step, hits=step.hits.select(rows))
        for step, rows in zip(one.steps, of_steps, strict=False)
    )
    return replace(one, hits=one.hits.select(late), halves=None, steps=tuple(steps))


def at_slow_end(design: Design) -> tuple[Design, bool]:
    """Return a design with the most friction that may be, and whether that is a change."""
    ends = variants(design).get("friction")
    return (ends[1], True) if ends else (design, False)


def measure_budget(
    design: Design,
    chamber: Chamber,
    executor: Executor,
    progress: Progress | None = None,
    longest: float = math.inf,
    is_brief: bool = False,
    most: float = COLLISIONS,
) -> Measured:
    """Simulate a design briefly, and return what its budget follows from.

    Args:
        longest: time to 98 % [s] above which nothing more is wanted.
        is_brief: the shot need not settle, as one of several designs is chosen first.
        most: collisions above which no further run is begun, once the shot settles.
    Raises:
        TooSlowError: the design takes longer than that.
        InputError: the shot does not fit, the target has no figures, or it was not hit.
        sim_core.SimulationError: a replica cannot be simulated.
    """
    slow, friction = at_slow_end(design)
    area = float(chamber.part.area[chamber.part.target].sum())
    target, mesh, time = exposed_target(chamber), chamber_mesh(chamber), FIRST_TIME
    enough = DENTS / WIDEST * most / COLLISIONS
    while True:
        accuracy = {
            "replicas": REPLICAS,
            "simulated_time_s": time,
            "warmup_time_s": 0.0,
            "gauge_mm2": max(1.0, 1e6 * WIDEST * area),
            "points": min(POINTS, slow.process.accuracy.points),
            "objective_half_width": None,
        }
        slow = slow.changed({f"process.accuracy.{key}": one for key, one in accuracy.items()})
        require_figures(slow, chamber, mesh)
        setting = share(executor, ReplicaSetting(slow, chamber, mesh))
        how = slow.process.seed, executor, "search", range(REPLICAS), REPLICAS
        timed = []
        for one in run_in_order(_timed_replica, setting, *how):
            timed.append(one)
            if progress:
                progress(len(timed), REPLICAS, None)
        on = [target[one.replica.hits.triangle] for one in timed]
        sizes = [
            np.square(one.replica.hits.dent[rows]) for one, rows in zip(timed, on, strict=True)
        ]
        times = [one.time[rows] for one, rows in zip(timed, on, strict=True)]
        warmup, settled = settled_after(np.concatenate(times), np.concatenate(sizes), time)
        hits = sum(map(len, times))
        least = _least_time(sum(map(np.sum, sizes)), hits, area * REPLICAS * time)
        if least > longest:
            raise TooSlowError(f"98 % after more than {rounded(least, 1)} s")
        collisions = sum(one.replica.collisions["total"] for one in timed)
        allowed = most if settled or is_brief else UNSETTLED
        if (settled and hits >= enough) or GROWTH * collisions > allowed:
            break
        time *= GROWTH
    replicas = [_after(warmup, one) for one in timed]
    recorded = {"simulated_time_s": time - warmup, "warmup_time_s": warmup}
    slow = slow.changed({f"process.accuracy.{key}": one for key, one in recorded.items()})
    wide = found = _seen(slow, chamber, executor, replicas)
    narrow = slow.process.accuracy.gauge_mm2 * FEW / max(found.resolution.dents, 1.0)
    if narrow < slow.process.accuracy.gauge_mm2:
        narrower = slow.changed({"process.accuracy.gauge_mm2": max(1.0, narrow)})
        again = _seen(narrower, chamber, executor, replicas)
        if _resolved(again) or not _resolved(found):
            slow, found = narrower, again
    places, mean = found.metrics["time_to_98_s"], found.metrics["exposure"].value
    dents, simulated = found.resolution.dents, found.simulated_time
    if not dents or not mean > 0.0:
        raise InputError(f"the shot hardly hits the target in {simulated:.3g} simulated s")
    resolved = _resolved(found)
    mean_time = slow.process.treatment_time / mean
    return Measured(
        room=modest_time(design, chamber),
        dent_rate=dents / (simulated * slow.process.accuracy.gauge),
        collision_rate=collisions / (REPLICAS * time),
        time_to_98=places.value if resolved else mean_time,
        places=resolved,
        spread=places.half_width if resolved else math.inf,
        friction=friction,
        dents_for_mean=found.resolution.needed_for_mean / slow.process.treatment_time,
        target=area,
        simulated=REPLICAS * time,
        mean_time=mean_time,
        warmup=warmup,
        settled=settled,
        intensity=PredictedIntensity.of(wide.metrics, design.calibration),
    )


def modest_time(design: Design, chamber: Chamber) -> float:
    """Return the simulated time of all replicas [s] that MODEST_GB have room for."""
    usual = design.changed({"process.accuracy.gauge_mm2": 1.0})
    counts = FEWEST, max(FEWEST, design.process.accuracy.max_replicas)
    return min(time_within(1e9 * MODEST_GB, usual, chamber, count) for count in counts)


def _seen(
    design: Design, chamber: Chamber, executor: Executor, replicas: list[Replica]
) -> Evaluation:
    """Return the figures of replicas in windows of the design's size."""
    plan = ReplicaPlan(count=REPLICAS, wide_windows=False, single_steps=False)
    return evaluate(design, chamber, executor, plan=plan, known=ReplicaSet(list(replicas)))


def _resolved(found: Evaluation) -> bool:
    """Return whether the time of single places is known."""
    places = found.metrics["time_to_98_s"]
    return math.isfinite(places.half_width) and places.value < NEVER
