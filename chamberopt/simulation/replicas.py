"""Replicas of one candidate: simulated on any number of workers, as many as the accuracy asked for takes."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from chamberopt.chamber.analytic import impacts_on_chamber
from chamberopt.chamber.scene import build_scene, replica_seed
from chamberopt.common.errors import WorkerLostError
from chamberopt.coverage.coverage_from_impacts import Tally, tally_impacts
from chamberopt.coverage.dent_marking import SamplePoints, first_marked_times
from chamberopt.coverage.part_impacts import Hits, hits_on_part
from chamberopt.simulation.resting_balls import RestingBalls, bouncing_share, find_resting_balls

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from sim_core import AnalyticCavity, SimulationResult, TriangleMesh

T = TypeVar("T")

# Looking at an interval until it is narrow enough favours moments when it is too narrow by chance. From 10 replicas
# on, with steps of a quarter or more, a 95 % interval still holds the truth 94 % of the time (normal replicas; 92 %
# from 5 on, 90 % from 3 on: docs/accuracy.md).
MIN_REPLICAS_TO_STOP = 10
STEP, LEAP = 1.25, 2.0


@dataclass(frozen=True)
class Replica:
    """What one replica leaves: never its impact log. first_marked (p,) s: see dents.py, None with rates alone."""

    tally: Tally
    collisions: dict[str, int]
    stuck: RestingBalls | None
    on_the_spot: float
    first_marked: np.ndarray | None
    hits: Hits


def simulate_replicas(
    setting: Any, seed: int, executor: Executor, stream: str, numbers: Sequence[int]
) -> Iterator[Replica]:
    """The replicas of these numbers, in order: the same come out whatever the number of workers.

    setting: (design, chamber, mesh, samples) as executor.shared hands them over; keep it until the last replica, for
    it goes to a worker once · seed: of the design's process.
    """
    return run_in_order(_replica, setting, seed, executor, stream, numbers, len(numbers))


def run_in_order(
    task: Callable[[Any, int], T],
    setting: Any,
    seed: int,
    executor: Executor,
    stream: str,
    numbers: Sequence[int],
    ahead: int,
) -> Iterator[T]:
    """task(setting, seed of the replica) of these numbers, in order, on the workers; begun are those that are asked for
    and ``ahead`` of them, so that no more wait in memory.
    """
    waiting: deque[tuple[int, Future[T]]] = deque()
    try:
        for number in numbers:
            waiting.append(
                (number, executor.submit(task, setting, replica_seed(seed, number, stream)))
            )
            if len(waiting) > ahead:
                yield _answer(*waiting.popleft())
        while waiting:
            yield _answer(*waiting.popleft())
    finally:
        # One replica failed, or the user pressed Ctrl-C: the rest need not be simulated.
        for _, future in waiting:
            future.cancel()


def _answer(number: int, future: Future[T]) -> T:
    try:
        return future.result()
    except WorkerLostError as error:
        raise WorkerLostError(f"replica {number}: {error}") from None


def next_replica_count(done: int, half_width: float, wanted: float, most: int) -> int:
    """How many replicas to have before the interval is looked at again: what its width foretells, within bounds."""
    if done >= most or half_width <= wanted:
        return done
    foretold = done * (half_width / wanted) ** 2 if math.isfinite(half_width) else math.inf
    return min(most, math.ceil(min(max(foretold, STEP * done), LEAP * done)))


def _replica(
    setting: tuple[Design, Chamber, TriangleMesh | AnalyticCavity, SamplePoints | None], seed: int
) -> Replica:
    return simulate_replica(*setting, seed)


def simulate_replica(
    design: Design,
    chamber: Chamber,
    mesh: TriangleMesh | AnalyticCavity,
    samples: SamplePoints | None,
    seed: int,
) -> Replica:
    """One replica, on a worker."""
    result = simulate_seed(design, chamber, mesh, seed)
    impacts = result.impacts
    shot, kinds = design.shot, ("walls", "balls", "sonotrode", "total")
    return Replica(
        tally=tally_impacts(impacts, chamber, design),
        collisions={kind: int(getattr(result.collisions, kind)) for kind in kinds},
        on_the_spot=bouncing_share(result.balls.velocities),
        stuck=find_resting_balls(
            result.resting,
            len(result.balls),
            shot.diameter,
            chamber,
            design.effects.part_turn is not None,
        ),
        first_marked=None
        if samples is None
        else first_marked_times(samples, impacts, chamber, design),
        hits=hits_on_part(impacts, chamber, design),
    )


def simulate_seed(
    design: Design, chamber: Chamber, mesh: TriangleMesh | AnalyticCavity, seed: int
) -> SimulationResult:
    """What the simulator has to say of one replica; its impacts are on the chamber's triangles."""
    from sim_core import TriangleMesh, simulate

    result = simulate(build_scene(design, mesh, seed))
    if isinstance(mesh, TriangleMesh):
        return result
    return replace(result, impacts=impacts_on_chamber(result.impacts, chamber))
