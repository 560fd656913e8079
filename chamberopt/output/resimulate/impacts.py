"""Every impact of a result. Impact logs are not kept on disk: the same seeds give the same bits, so that the replicas
are simulated again, and what they say is held against the result.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import reduce
from operator import add
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.errors import InputError
from chamberopt.common.parallel.executor import core_count, share
from chamberopt.common.progress import Progress
from chamberopt.coverage.coverage_from_impacts import Tally, mean_speed_per_triangle, tally_impacts
from chamberopt.output.resimulate.rebuild import REMEDY, RebuiltChamber, made_by
from chamberopt.output.vtp_files import COVERAGE, read_surface
from chamberopt.simulation.replicas import run_in_order, simulate_seed

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.output.results.load import Result
    from sim_core import ImpactLog

AT_ONCE = 4e6  # impacts in memory, some 200 bytes each while they are simulated


@dataclass(frozen=True)
class ReplicaImpacts:
    """What hit the part in one replica, in order of time.

    number: of the replica, from 0 · log: as the simulator wrote it, its triangles the chamber's · part_triangle (n,)
    int32: the part's own triangle that was hit, as coverage.vtp counts them.
    """

    number: int
    log: ImpactLog
    part_triangle: np.ndarray


def simulate_impacts(
    result: Result,
    ground: RebuiltChamber,
    executor: Executor,
    replicas: int | None = None,
    progress: Progress | None = None,
) -> Iterator[ReplicaImpacts]:
    """Every impact on the part, one replica after another; only a few replicas are in memory at a time.

    ground: `rebuild_chamber` the result. replicas: only so many, the first ones. After the last of all replicas InputError
    unless they gave the result's own figures, triangle by triangle, to the last bit; of fewer that cannot be said.
    """
    design, chamber = result.design, ground.chamber
    count = replica_count(result, replicas)
    seed, stream = result.seeds
    setting = share(executor, (design, chamber, ground.cavity or chamber_mesh(chamber)))
    logs = run_in_order(_log, setting, seed, executor, stream, range(count), _ahead(result))
    tallies = []
    for number, log in enumerate(logs):
        counted = tally_impacts(log, chamber, design)
        tallies.append(
            replace(counted, dent_triangle=np.zeros(0, dtype=np.int32), dent_area=np.zeros(0))
        )
        yield _on_part(number, log, chamber)
        if progress:
            progress(number + 1, count, None)
    if count == result.data["replicas"]:
        _require_same_figures(result, reduce(add, tallies))


def replica_count(result: Result, replicas: int | None) -> int:
    """How many replicas: all of the result's unless fewer are asked for. InputError for more, or for none."""
    there = int(result.data["replicas"])
    if replicas is not None and not 1 <= replicas <= there:
        raise InputError(f"--replicas: given {replicas}; the result has {there}, give 1 to {there}")
    return replicas or there


def _ahead(result: Result) -> int:
    """How many replicas to begin before the one that is handed on: one a core, unless their logs are long."""
    kept, seconds = read_surface(result.folder / COVERAGE), result.design.process.treatment_time
    times = result.data["simulated_time_s"] / seconds / result.data["replicas"]
    each = float(np.nansum(kept["impacts_per_mm2"] * kept["exposed_area_mm2"])) * times
    return max(0, min(core_count(), int(AT_ONCE / max(each, 1.0)) - 1))


def _log(setting: Any, seed: int) -> ImpactLog:
    """One replica, on a worker."""
    design, chamber, mesh = setting
    return simulate_seed(design, chamber, mesh, seed).impacts


def _on_part(number: int, log: ImpactLog, chamber: Chamber) -> ReplicaImpacts:
    source = chamber.source[log.triangle]
    if (source < 0).any():
        on_part = source >= 0
        log, source = log.only(on_part), source[on_part]
    return ReplicaImpacts(number, log, source)


def _require_same_figures(result: Result, total: Tally) -> None:
    kept = read_surface(result.folder / COVERAGE)
    again = {
        "dents": total.dents,
        "impacts": total.impacts,
        "mean_normal_speed": mean_speed_per_triangle(total),
    }
    for name, values in again.items():
        if name not in kept.array_names:
            continue
        wrong = ~np.isclose(kept[name], values, rtol=0.0, atol=0.0, equal_nan=True)
        if wrong.any():
            raise InputError(
                f"{result.folder}: this program on this machine does not simulate it again bit for bit: {name} of "
                f"{wrong.sum()} of {len(wrong)} triangles differ, the first is triangle {np.flatnonzero(wrong)[0]} "
                f"(made by {made_by(result)}); {REMEDY}"
            )
