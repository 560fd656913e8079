"""Simulate the replicas of a result again to get the impacts on its part.

Replicas are simulations of one design with different seeds.

A result does not store its impact logs. The same design, chamber and seed give the same impacts to
the last bit. A command that needs impacts therefore simulates the replicas again. It compares the
triangles and speeds of the new impacts with hits.npz of the result.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.errors import InputError
from chamberopt.common.executor import core_count, share
from chamberopt.common.progress import Progress
from chamberopt.coverage.dents import Dents, dents_on_part
from chamberopt.coverage.field.surface_points import spread_points
from chamberopt.coverage.part_impacts import HITS_FILE, load_matching_hits
from chamberopt.results.arrays_file import load_result_arrays
from chamberopt.results.rebuild import REMEDY, RebuiltChamber, RebuiltReplica, made_by
from chamberopt.simulation.replicas import run_in_order, simulate_seed

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.results.load import Result
    from sim_core import ImpactLog

MAX_SIMULATED_TREATMENT = 600.0  # s; a longer dent map takes minutes to compute
COSTED = 0.02  # share of a simulation that is run to predict its cost
SAMPLES = 200_000  # sample points on the target, for the share inside dents
MAX_IMPACTS_IN_MEMORY = 4e6  # in all replicas being simulated; an impact takes about 200 bytes


@dataclass(frozen=True)
class ReplicaImpacts:
    """Impacts on the part in one replica, in order of time.

    number: number of the replica, from 0.
    log: the impacts; each names its triangle by the number in the chamber's mesh.
    part_triangle: the same triangle by its number in part.vtp, int32, shape (n,).
    """

    number: int
    log: ImpactLog
    part_triangle: np.ndarray


def simulate_impacts(
    result: Result,
    rebuilt: RebuiltChamber,
    executor: Executor,
    replicas: int | None = None,
    progress: Progress | None = None,
) -> Iterator[ReplicaImpacts]:
    """Simulate the replicas of a result again and yield the impacts of each on the part.

    Only a few replicas are in memory at a time.

    Args:
        result: result of a simulation or study.
        rebuilt: chamber of the result, from rebuild_chamber.
        executor: executor that runs the replicas.
        replicas: number of replicas, beginning with the first; None for all.
        progress: called after each replica.

    Raises:
        InputError: the new impacts or their speeds differ from hits.npz of the result. It is raised
            after the last replica, and only if all replicas were simulated.
    """
    design, chamber = result.design, rebuilt.chamber
    count = replica_count(result, replicas)
    seed, stream = result.seeds
    setting = share(executor, (design, chamber, rebuilt.cavity or chamber_mesh(chamber)))
    ahead = _replicas_ahead(result)
    logs = run_in_order(_impact_log, setting, seed, executor, stream, range(count), ahead)
    triangles, speeds = [], []
    for number, log in enumerate(logs):
        one = _on_part(number, log, chamber)
        triangles.append(one.part_triangle)
        speeds.append(one.log.normal_speed.astype(np.float32))
        yield one
        if progress:
            progress(number + 1, count, None)
    if count == result.record.replicas:
        _require_same_impacts(result, np.concatenate(triangles), np.concatenate(speeds))


def replica_count(result: Result, replicas: int | None) -> int:
    """Return `replicas`, or the number of all replicas of the result if it is None.

    Raises InputError if `replicas` is below 1 or above the result's number of replicas.
    """
    there = result.record.replicas
    if replicas is not None and not 1 <= replicas <= there:
        raise InputError(f"--replicas: given {replicas}; the result has {there}, give 1 to {there}")
    return replicas or there


def simulate_dents(
    replica: RebuiltReplica, time: float, progress: Callable[[float], None] = lambda seconds: None
) -> Dents:
    """Simulate a replica for `time` [s] and return its dents on the part.

    The time counts from the end of the warm-up. It may exceed the time that the result simulated.

    Args:
        progress: function that is called with the simulated time [s], warm-up included.

    Raises:
        InputError: the time is not above 0, or is above MAX_SIMULATED_TREATMENT.
        sim_core.SimulationError: the simulation had to stop.
    """
    from sim_core import simulate

    require_dent_time(time)
    scene = replace(replica.scene, duration=time)
    impacts = simulate(scene, progress=progress).impacts
    return dents_on_part(replica.on_chamber(impacts), replica.chamber, replica.design)


def require_dent_time(time: float) -> None:
    """Raise InputError unless `time` [s] is above 0 and at most MAX_SIMULATED_TREATMENT."""
    if not 0.0 < time <= MAX_SIMULATED_TREATMENT:
        raise InputError(
            f"--at-s: given {time:g}; a dent map simulates all of it: more than 0, at most "
            f"{MAX_SIMULATED_TREATMENT:g} s are supported"
        )


def simulation_seconds(replica: RebuiltReplica, time: float) -> float:
    """Estimate the computing time [s] to simulate `time` seconds of a replica.

    The estimate comes from a short trial simulation.
    """
    from sim_core import simulate

    scene, seconds = replica.scene, 0.0
    for part in (0.001, COSTED):  # the first loads compiled code
        began = perf_counter()
        simulate(replace(scene, duration=part * time))
        seconds = perf_counter() - began
    return seconds * (scene.warmup + time) / (scene.warmup + COSTED * time)


def dented_share(dents: Dents, chamber: Chamber) -> float:
    """Return the share of the target's area inside dents, from sample points on the target.

    A dent covers only surface whose normal is near the dent's own.
    """
    from chamberopt.coverage.field.smooth_faces import Places
    from chamberopt.coverage.field.windows import Windows

    if not len(dents):
        return 0.0
    part = chamber.part
    area = np.where(part.target, part.area, 0.0)
    samples = spread_points(part.vertices, part.triangles, area, SAMPLES)
    one_face = np.zeros(max(SAMPLES, len(dents)), dtype=int)  # dents reach round edges
    points = Places(samples.place, samples.normal, one_face[:SAMPLES])
    contacts = Places(dents.place, -dents.normal, one_face[: len(dents)])
    dented = np.zeros(SAMPLES, dtype=bool)
    for point, dent in Windows(points, float(dents.radius.max())).pairs(contacts):
        away = np.linalg.norm(samples.place[point] - dents.place[dent], axis=1)
        dented[point[away < dents.radius[dent]]] = True
    return float(dented.mean())


def _replicas_ahead(result: Result) -> int:
    """Return how many replicas may be simulated before the caller asks for their impacts.

    The number is the number of cores, or less if the impact logs would fill the memory.
    """
    impacts = float(load_result_arrays(result).elements["impacts"].sum()) / result.record.replicas
    return max(0, min(core_count(), int(MAX_IMPACTS_IN_MEMORY / max(impacts, 1.0)) - 1))


def _impact_log(setting: Any, seed: int) -> ImpactLog:
    """Simulate one replica on a worker and return its impact log.

    `setting` is the design, the chamber, and the mesh or analytical cavity to simulate.
    """
    design, chamber, mesh = setting
    return simulate_seed(design, chamber, mesh, seed).impacts


def _on_part(number: int, log: ImpactLog, chamber: Chamber) -> ReplicaImpacts:
    source = chamber.source[log.triangle]
    if (source < 0).any():
        on_part = source >= 0
        log, source = log.only(on_part), source[on_part]
    return ReplicaImpacts(number, log, source)


def _require_same_impacts(result: Result, triangle: np.ndarray, speed: np.ndarray) -> None:
    impacts = load_result_arrays(result).elements["impacts"]
    stored = load_matching_hits(result.path(HITS_FILE), impacts).hits
    order = np.argsort(triangle, kind="stable")
    triangle, speed = triangle[order], speed[order]
    count = np.bincount(triangle, minlength=len(impacts))
    wrong = count != impacts
    if not wrong.any():
        wrong[triangle[speed != stored.speed]] = True
    if wrong.any():
        raise InputError(
            f"{result.folder}: this program on this machine does not simulate it again bit for "
            f"bit: the impacts on {wrong.sum()} of {len(wrong)} triangles differ, the first is "
            f"triangle {np.flatnonzero(wrong)[0]} (made by {made_by(result)}); {REMEDY}"
        )
