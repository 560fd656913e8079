"""Tell how long a run will take, by how long the latest run of a like design took.

Where there is none, the design itself is simulated for a moment. This tells less, as the shot is
still at its beginning.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.child import Child, ChildLostError
from chamberopt.common.errors import InputError
from chamberopt.common.executor import core_count
from chamberopt.common.toml_fields import read_toml
from chamberopt.design.design import Design
from chamberopt.design.load import is_study, load_design
from chamberopt.results.load import Result, load_result
from chamberopt.search.ask_and_tell import most_evaluations
from chamberopt.search.study import load_study
from chamberopt.simulation.effort import Effort
from chamberopt.simulation.replicas import simulate_seed
from sim_core import SceneError, SimulationError

ROUND_S, LONG_S = 5, 90  # shorter times are told in steps of seconds, longer ones in minutes
MINUTE, HOUR = 60, 3600
# Times as long as one design's replicas that a study may take, as each candidate takes replicas
# until it can be told from the best: 2 min were foretold of a study that took 228 s.
SPREAD = 3
# A design is tried for MOMENT_S of simulation, and given up after TRY_S. Its pace then is so many
# times off: the balls fly higher later on, and other work takes cores.
MOMENT_S, TRY_S, UNSURE = 2.0, 120.0, 1.5


def duration_in_words(path: Path, results: Iterable[Path]) -> str:
    """Return how long a design or study will take, such as "about 2 minutes"; "" if unknown.

    Args:
        path: file of the design or study.
        results: folders of results, the newest first.
    """
    evaluations = 1
    if is_study(read_toml(path, "design")[1]):
        study = load_study(path)
        design, evaluations = study.at_search_accuracy(study.design), most_evaluations(study)
    else:
        design = load_design(path)
    for folder in results:
        with suppress(InputError):
            result = load_result(folder)
            if _is_like(design, result.design):
                seconds = _whole_seconds(design, evaluations, result)
                is_rough = evaluations > 1 and result.record.study is None
                return _in_words(seconds, SPREAD * seconds if is_rough else seconds)
    return ""


def tried_duration(path: Path) -> str:
    """Return how long a design will take by a moment of it, such as "about 2 to 5 minutes".

    It runs in a child process, as building a chamber may take long. It is "" for a study, and where
    the design cannot be tried within TRY_S.
    """
    if is_study(read_toml(path, "design")[1]):
        return ""
    with suppress(InputError, SceneError, SimulationError, ChildLostError), Child(TRY_S) as child:
        child.ask(_tried_seconds, path)
        least, most = child.answer()
        return _in_words(least, most)
    return ""


class _TriedError(Exception):
    """Raised to end a simulation of which enough is known."""


def _tried_seconds(path: Path) -> tuple[float, float]:
    """Return the least and the most time [s] of a design's figures, by a moment of one replica.

    Replicas run beside each other on all cores, and there may be more until they are sure.
    """
    design = load_design(path)
    built = build_chamber(design)
    one = next(iter(design.in_steps.values()))
    chamber = (*built.steps, built)[0]
    clock: list[tuple[float, float]] = []  # share of the replica, and the time that was [s]

    def tell(_: int, part: float, __: object) -> None:
        clock.append((part, time.perf_counter()))
        if clock[-1][1] - clock[0][1] > MOMENT_S:
            raise _TriedError

    mesh = chamber_mesh(chamber)
    with suppress(_TriedError):
        simulate_seed(one, chamber, mesh, one.process.seed, tell)
    (first, began), (last, ended) = clock[0], clock[-1]
    if last <= first:
        raise SimulationError("it is too short to be tried")
    replica = (ended - began) / (last - first) * max(len(built.steps), 1)
    effort, cores = Effort.of(design.process.accuracy), core_count()
    least, most = (replica * math.ceil(count / cores) for count in (effort.first, effort.most))
    return least / UNSURE, most * UNSURE


def _is_like(one: Design, other: Design) -> bool:
    """Return whether two designs have the same part in a chamber of the same shape."""
    return _form(one) == _form(other)


def _form(design: Design) -> tuple[str, str]:
    return design.part.mesh_path.name, design.chamber.shape


def _whole_seconds(design: Design, evaluations: int, result: Result) -> float:
    """Return the time [s] that a design, or so many evaluations of a study, take, by a result."""
    if evaluations == 1:
        ranges = result.record.ranges  # whose ends are simulated after the figures
        return _seconds(design, result) * (1.0 + (ranges.cost if ranges else 0.0))
    if study := result.record.study:  # many of its candidates take fewer replicas than its best
        return evaluations * study.seconds / study.evaluations
    return evaluations * _seconds(design, result)


def _seconds(design: Design, result: Result) -> float:
    """Return the time [s] that a design takes, by that of a result.

    It grows with the balls and with the simulated time of all replicas. A design that is simulated
    until it is as sure as the result takes as many replicas.
    """
    wanted, then = (one.process.accuracy for one in (design, result.design))
    replicas = result.record.replicas
    is_as_sure = wanted.objective_half_width == then.objective_half_width is not None
    effort = _balls_s(design) * (replicas if is_as_sure else wanted.replicas)
    return sum(result.record.timings_s.values()) * effort / (_balls_s(result.design) * replicas)


def _balls_s(design: Design) -> float:
    """Return the balls of a replica times its simulated time [s]."""
    process = design.process
    return design.shot.count * (process.recorded_time + process.accuracy.warmup_time)


def _in_words(least: float, most: float) -> str:
    """Return a time between two, which may be the same, in the unit that suits the longer one."""
    if most < LONG_S:
        texts = [f"{max(1, round(one / ROUND_S)) * ROUND_S}" for one in (least, most)]
        unit = "s"
    elif most < 1.5 * HOUR:
        texts = [f"{max(1, round(one / MINUTE))}" for one in (least, most)]
        unit = "minutes"
    else:
        texts = [f"{one / HOUR:.2g}" for one in (least, most)]
        unit = "hours"
    return f"about {' to '.join(dict.fromkeys(texts))} {unit}"
