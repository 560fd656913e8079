"""Simulate independent replicas of a candidate on any number of workers."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np

from chamberopt.chamber.analytic import impacts_on_chamber
from chamberopt.chamber.checks.place_names import around
from chamberopt.chamber.flexure import flexure_of_surfaces
from chamberopt.chamber.part import turning_axis
from chamberopt.chamber.replica_seed import replica_seed, step_seed
from chamberopt.chamber.scene import build_scene
from chamberopt.common.errors import WorkerLostError
from chamberopt.common.executor import result_of, share
from chamberopt.coverage.part_impacts import Hits, hits_on_part, in_pose_of, join_hits
from chamberopt.simulation.resting_balls import RestingBalls, find_resting_balls
from chamberopt.simulation.settling import dented_halves
from chamberopt.simulation.trapped_balls import NOT_TRAPPED, TrappedBalls, find_trapped_balls

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.common.progress import Progress
    from chamberopt.coverage.field.target_field import TargetField
    from chamberopt.design.load import Design
    from sim_core import AnalyticCavity, SimulationResult, TriangleMesh

S = TypeVar("S")
T = TypeVar("T")


class ReplicaSetting(NamedTuple):
    """Input of all replicas of a candidate: design, chamber and the chamber's surface."""

    design: Design
    chamber: Chamber
    mesh: TriangleMesh | AnalyticCavity


@dataclass(frozen=True)
class Replica:
    """The result of one replica, without its impact log, which would take too much memory."""

    collisions: dict[str, int]  # number of collisions of each kind
    resting: RestingBalls | None  # the balls at rest at its end; None if there are none
    trapped: TrappedBalls  # balls that hopped on one spot or rattled in a gap
    hits: Hits
    # What was dented on the target in its two halves, as of `dented_halves`; None if not known.
    halves: tuple[float, float] | None = None
    # Of each step of a design with steps, with hits in the step's own pose. Those of the replica
    # then are of all steps together, in the pose of the first.
    steps: tuple[Replica, ...] = ()


@dataclass
class ReplicaSet:
    """The replicas of one candidate so far, and its target.

    The target has windows, discs in which dents are counted. It is None until it is prepared.
    """

    replicas: list[Replica] = field(default_factory=list)
    target: TargetField | None = None  # by `prepare_target`; None until it is called


class Underway:
    """How many replicas are simulated so far, with the simulated parts of those that run.

    Parts are known of threads of this process; other workers tell of nothing but the end.

    Args:
        setting: the setting of the replicas.
        shared: the same, as executor.share returns it: itself where threads take it.
    """

    def __init__(self, setting: ReplicaSetting, shared: ReplicaSetting) -> None:
        self._is_here, self._steps = shared is setting, max(len(setting.chamber.steps), 1)
        self._shares: dict[int, float] = {}  # of the time of a replica or of a step, by its seed
        self._held: dict[int, np.ndarray] = {}  # places of balls that are held then, by the same

    @property
    def task(self) -> Callable[[ReplicaSetting, int], Replica]:
        """What simulates a replica, and tells here how far it has come."""
        return partial(simulate_replica, told=self.tell) if self._is_here else simulate_replica

    def tell(self, seed: int, part: float, held: np.ndarray) -> None:
        """Take note of the part of its time that a replica, or a step of one, has behind it.

        Args:
            held: places of the balls that are held in gaps now [m], (k, 3).
        """
        self._shares[seed], self._held[seed] = part, held if part < 1.0 else held[:0]

    def held(self) -> dict[str, object]:
        """Return how many balls are held in gaps in the replica with most, and the place of one."""
        places = max([*self._held.values()], key=len, default=np.empty((0, 3)))
        return {"balls": len(places), "place": around(places[:1]) if len(places) else ""}

    @property
    def done(self) -> float:
        return sum([*self._shares.values()]) / self._steps


def simulate_replicas(
    setting: ReplicaSetting,
    executor: Executor,
    progress: Progress | None = None,
    numbers: range | None = None,
) -> list[Replica]:
    """Simulate replicas of a design, and return them in a fixed order.

    Args:
        numbers: numbers of the replicas; by default the first, as many as the design asks for.
    """
    found: list[Replica] = []
    process, shared = setting.design.process, share(executor, setting)
    wanted = range(process.accuracy.replicas) if numbers is None else numbers
    how = process.seed, executor, "search", wanted, len(wanted)
    underway = Underway(setting, shared)

    def tell() -> None:
        if progress:
            progress(wanted.start + max(len(found), underway.done), wanted.stop, None)

    for replica in run_in_order(underway.task, shared, *how, tell):
        found.append(replica)
        tell()
    return found


def run_in_order(
    task: Callable[[S, int], T],
    setting: S,
    seed: int,
    executor: Executor,
    stream: str,
    numbers: Sequence[int],
    ahead: int,
    tell: Callable[[], None] | None = None,
) -> Iterator[T]:
    """Run a task for each replica on the workers, and yield the results in order.

    Each call is task(setting, seed of the replica). The results do not depend on the number of
    workers.

    Args:
        setting: the argument that all tasks share, as executor.share returns it.
        seed: seed of the design's process.
        stream: "search" or "confirm", which give replicas of equal number different seeds.
        numbers: numbers of the replicas.
        ahead: number of tasks that are started before their results are wanted. It bounds the
            memory that waiting results take.
        tell: called about every half second while a result is waited for.
    """
    waiting: deque[tuple[int, Future[T]]] = deque()
    try:
        for number in numbers:
            waiting.append(
                (number, executor.submit(task, setting, replica_seed(seed, number, stream)))
            )
            if len(waiting) > ahead:
                yield _result(*waiting.popleft(), tell)
        while waiting:
            yield _result(*waiting.popleft(), tell)
    finally:
        # If a replica fails or the user presses Ctrl-C, the replicas that wait are not simulated.
        for _, future in waiting:
            future.cancel()


def _result(number: int, future: Future[T], tell: Callable[[], None] | None) -> T:
    try:
        return result_of(future, tell)
    except WorkerLostError as error:
        raise WorkerLostError(f"replica {number}: {error}") from None


def simulate_replica(
    setting: ReplicaSetting, seed: int, told: Callable[[int, float, np.ndarray], None] | None = None
) -> Replica:
    """Simulate one replica with this seed, and return its balls and its impacts on the part.

    With steps, each step is simulated from a start of its own, for its share of the time.

    Args:
        told: called as told(seed, part of the time that is simulated, places of balls held in gaps
            then [m]), now and then; with steps by the seed of each.
    """
    design, chamber, _ = setting
    if not chamber.steps:
        return replica_of(setting, simulate_seed(*setting, seed, told))
    own = zip(design.in_steps.values(), chamber.steps, strict=True)
    return join_steps(
        [
            simulate_replica(ReplicaSetting(one, room, room.mesh), step_seed(seed, k), told)
            for k, (one, room) in enumerate(own)
        ],
        chamber,
    )


def join_steps(steps: Sequence[Replica], chamber: Chamber) -> Replica:
    """Return the replicas of all steps as one, with impacts in the part's pose in the first.

    Balls that are at rest or trapped are told of each step.
    """
    halves = [one.halves for one in steps if one.halves is not None]
    hits = [
        in_pose_of(one.hits, room.part, chamber.part)
        for one, room in zip(steps, chamber.steps, strict=True)
    ]
    return Replica(
        collisions={
            kind: sum(one.collisions[kind] for one in steps) for kind in steps[0].collisions
        },
        resting=None,
        trapped=NOT_TRAPPED,
        hits=join_hits(hits),
        halves=(sum(one for one, _ in halves), sum(two for _, two in halves)) if halves else None,
        steps=tuple(steps),
    )


def replica_of(setting: ReplicaSetting, result: SimulationResult) -> Replica:
    """Return what is kept of a simulated replica."""
    design, chamber, _ = setting
    part_turns, end = design.effects.part_turn is not None, design.process.recorded_time
    hits, time = hits_on_part(result.impacts, chamber, design), times_on_part(chamber, result)
    return Replica(
        collisions={
            kind: int(getattr(result.collisions, kind))
            for kind in ("walls", "balls", "sonotrode", "total")
        },
        resting=find_resting_balls(result.resting, design.shot.diameters, chamber, part_turns),
        trapped=find_trapped_balls(result, end, chamber, part_turns),
        hits=hits,
        halves=dented_halves(hits, time, chamber.part.target, end),
    )


def times_on_part(chamber: Chamber, result: SimulationResult) -> np.ndarray:
    """Return the time [s] of each impact on the part, in the order of a replica's hits, (k,)."""
    impacts = result.impacts
    return np.asarray(impacts.time[chamber.source[impacts.triangle] >= 0])


def simulate_seed(
    design: Design,
    chamber: Chamber,
    mesh: TriangleMesh | AnalyticCavity,
    seed: int,
    told: Callable[[int, float, np.ndarray], None] | None = None,
) -> SimulationResult:
    """Run the simulator once with this seed, and return its result.

    The impacts in the result are on triangles of the chamber.

    Args:
        told: as of `simulate_replica`.
    """
    from sim_core import TriangleMesh, simulate

    axis, flexure = turning_axis(design, chamber.part), flexure_of_surfaces(design, chamber, mesh)
    scene = build_scene(design, mesh, seed, axis, flexure)

    places = np.empty((0, 3))

    def hold(now: np.ndarray) -> None:
        nonlocal places
        places = now

    def tell(seconds: float) -> None:
        if told:
            told(seed, seconds / (scene.warmup + scene.duration), places)

    result = simulate(scene, progress=tell, held=hold)
    if isinstance(mesh, TriangleMesh):
        return result
    return replace(result, impacts=impacts_on_chamber(result.impacts, chamber))
