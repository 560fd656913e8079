"""Tell how long a run will take, by how long the latest run of a like design took.

Where there is none, the design itself is simulated for a moment. This tells less, as the shot is
still at its beginning.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from chamberopt.chamber.build import Chamber, build_chamber
from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.child import Child, ChildLostError
from chamberopt.common.errors import InputError
from chamberopt.common.executor import core_count
from chamberopt.common.number_text import plain
from chamberopt.common.toml_fields import read_toml
from chamberopt.coverage.coverage_intervals import DENTS_FOR_PLACES
from chamberopt.design.design import Design
from chamberopt.design.load import is_study, load_design
from chamberopt.design.ranges import unknowns
from chamberopt.results.load import Result, load_result
from chamberopt.search.ask_and_tell import most_evaluations
from chamberopt.search.study import load_study
from chamberopt.simulation.effort import SCALES, Effort, Scale, scaled
from chamberopt.simulation.evaluate import prepare_target
from chamberopt.simulation.replicas import simulate_seed
from sim_core import SceneError, SimulationError

ROUND_S, LONG_S = 5, 90  # shorter times are told in steps of seconds, longer ones in minutes
MINUTE, HOUR = 60, 3600
# Times as long as one design's replicas that a study may take, as each candidate takes replicas
# until it can be told from the best: 2 min were foretold of a study that took 228 s.
SPREAD = 3
# A design is tried on all cores for MOMENT_S of simulation, and given up after TRY_S. Its pace then
# is so many times off: the balls fly higher later on, and other work takes cores.
MOMENT_S, TRY_S, UNSURE = 3.0, 120.0, 1.3
# Least and most time [s] beside the replicas: to start, build and check, and to write and draw what
# is found. 7 to 14 s were measured of plate, blade and gear, 20 s of a bracket beside other work.
AROUND_S = (7.0, 20.0)
# Time of the ends of what is not calibrated over that of the figures, as proposals count it too.
ENDS = 1.2
# Of a moment that tells the rate of impacts [s]; and what is asked for over what is needed.
LEAST_S, MARGIN = 0.02, 1.1
AS_ASKED = "asked"
EFFORTS: dict[str, Scale | None] = {AS_ASKED: None, **{scale: scale for scale in SCALES}}


class Foretold(NamedTuple):
    """What is known before a run.

    Attributes:
        words: how long it takes, such as "about 2 minutes"; "" if that is not known.
        few: why it tells too little, and the remedy; "" if it is enough, or not known.
    """

    words: str
    few: str = ""


def foretold(path: Path, results: Iterable[Path], ranges: bool = True) -> dict[str, Foretold]:
    """Return what is known of each effort that a design may take, by names of EFFORTS.

    A study has the one that it asks for. Nothing is known without a result of a like design.

    Args:
        path: file of the design or study.
        results: folders of results, the newest first.
        ranges: whether the ends of what is not calibrated are simulated too. A study leaves that to
            itself.
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
            if not _is_like(design, result.design):
                continue
            if evaluations > 1:
                seconds = _whole_seconds(design, evaluations, result)
                most = SPREAD * seconds if result.record.study is None else seconds
                return {AS_ASKED: Foretold(_in_words(seconds, most))}
            return {
                name: _by_result(design, scale, result, ranges) for name, scale in EFFORTS.items()
            }
    return {}


def tried(path: Path, ranges: bool = True) -> dict[str, Foretold]:
    """Return how long a design will take by a moment of it, as of `foretold`.

    It runs in a child process, as building a chamber may take long. Nothing is known of a study,
    nor where the design cannot be tried within TRY_S.
    """
    if is_study(read_toml(path, "design")[1]):
        return {}
    with suppress(InputError, SceneError, SimulationError, ChildLostError), Child(TRY_S) as child:
        child.ask(_tried_pace, path)
        (pace, rate), design = child.answer(), load_design(path)
        return {name: _by_moment(design, one, pace, rate, ranges) for name, one in EFFORTS.items()}
    return {}


class _TriedError(Exception):
    """Raised to end a simulation of which enough is known."""


def _tried_pace(path: Path) -> tuple[float, float]:
    """Return the time [s] that a simulated second of a design's replicas takes, one on each core.

    It is that of all steps of a design with steps. The second number is the rate of impacts on the
    target [1/(m² s)], in the first step; 0 where that would take too long.
    """
    design = load_design(path)
    built = build_chamber(design)
    one = next(iter(design.in_steps.values()))
    chamber = (*built.steps, built)[0]
    mesh = chamber_mesh(chamber)

    def pace(seed: int) -> float:
        clock: list[tuple[float, float]] = []  # share of the replica, and the time that was [s]

        def tell(_: int, part: float, __: object) -> None:
            clock.append((part, time.perf_counter()))
            if clock[-1][1] - clock[0][1] > MOMENT_S:
                raise _TriedError

        with suppress(_TriedError):
            simulate_seed(one, chamber, mesh, seed, tell)
        (first, began), (last, ended) = clock[0], clock[-1]
        if last <= first:
            raise SimulationError("it is too short to be tried")
        return (ended - began) / (last - first)

    seeds = range(design.process.seed, design.process.seed + core_count())
    with ThreadPoolExecutor(len(seeds)) as threads:
        replica = max(threads.map(pace, seeds))
    own = replica / _replica_s(one)
    return own * max(len(built.steps), 1), _impact_rate(one, chamber, MOMENT_S / own)


def _impact_rate(design: Design, chamber: Chamber, seconds: float) -> float:
    """Return the impacts on the target over its area and time [1/(m² s)].

    Places that are alike, as on the teeth of a gear, are dented for each other.

    Args:
        seconds: to simulate, with the warm-up; where these are too few, the rate is 0.
    """
    time = min(seconds - design.process.accuracy.warmup_time_s, design.process.recorded_time)
    if time < LEAST_S:
        return 0.0
    short = design.changed({"process.accuracy.simulated_time_s": float(f"{time:.3g}")})
    mesh = chamber_mesh(chamber)
    found = simulate_seed(short, chamber, mesh, design.process.seed)
    hits = int(chamber.on_target[found.impacts.triangle].sum())
    area = float(chamber.exposed_area[chamber.part.target].sum())
    alike = prepare_target(short, chamber, mesh).alike
    return alike * hits / (area * short.process.recorded_time)


def _by_moment(
    design: Design, scale: Scale | None, pace: float, rate: float, ranges: bool
) -> Foretold:
    """Return how long an effort takes, and if it is too little, by what a moment of it told.

    Not every impact leaves a dent, so that a little more may be too little.

    Args:
        pace, rate: as of `_tried_pace`.
    """
    taken = scaled(design, scale)
    accuracy, few = taken.process.accuracy, ""
    simulated = Effort.of(accuracy).most * accuracy.simulated_time_s
    dents = rate * accuracy.gauge * simulated
    if 0.0 < dents < DENTS_FOR_PLACES:
        few = (
            f"too little to tell single places: about {plain(dents, 2)} dents in each window of "
            f"{plain(accuracy.gauge_mm2)} mm², where {DENTS_FOR_PLACES:g} would do; "
            f"{_remedy(accuracy.simulated_time_s, scale, DENTS_FOR_PLACES / dents)}"
        )
    return Foretold(_at_pace(taken, pace, ranges), few)


def _remedy(time_s: float, scale: Scale | None, times: float) -> str:
    """Return what to do where an effort is too little.

    Args:
        time_s: its simulated time of a replica [s], of which it takes so many `times`.
    """
    if scale == "quick":
        return "take more of it"
    enough = MARGIN * times * time_s / (SCALES[scale] if scale else 1.0)
    return f"it takes process.accuracy.simulated_time_s = {plain(float(f'{enough:.2g}'))} s"


def _at_pace(design: Design, pace: float, ranges: bool) -> str:
    """Return in words how long a design takes, by the time that a simulated second takes [s]."""
    effort, cores = Effort.of(design.process.accuracy), core_count()
    times = 1.0 + ENDS if ranges and unknowns(design) else 1.0
    least, most = (
        times * pace * _replica_s(design) * math.ceil(count / cores)
        for count in (effort.first, effort.most)
    )
    words = _with_start(least / UNSURE, least * UNSURE)
    if most <= UNSURE * least:
        return words
    longest = _with_start(most * UNSURE, most * UNSURE).rpartition(" to ")[2].removeprefix("about ")
    return f"{words}, and up to {longest} until it is as sure as it asks"


def _by_result(design: Design, scale: Scale | None, result: Result, ranges: bool) -> Foretold:
    """Return how long an effort takes by a result of a like design, and if it is too little."""
    taken = scaled(design, scale)
    seconds = _whole_seconds(taken, 1, result, ranges)
    needed = result.record.field.simulated_s_needed.mean_and_std
    accuracy, few = taken.process.accuracy, ""
    most = Effort.of(accuracy).most * accuracy.simulated_time_s
    if needed is not None and most < needed:
        few = (
            f"too little to tell the mean coverage, as the result {result.folder.name} shows: "
            f"{_remedy(accuracy.simulated_time_s, scale, needed / most)}"
        )
    return Foretold(_with_start(seconds, seconds), few)


def _with_start(least: float, most: float) -> str:
    """Return in words the time between two times [s] of replicas, with what is beside them."""
    return _in_words(AROUND_S[0] + least, AROUND_S[1] + most)


def _is_like(one: Design, other: Design) -> bool:
    """Return whether two designs have the same part in a chamber of the same shape."""
    return _form(one) == _form(other)


def _form(design: Design) -> tuple[str, str]:
    return design.part.mesh_path.name, design.chamber.shape


def _whole_seconds(design: Design, evaluations: int, result: Result, ranges: bool = True) -> float:
    """Return the time [s] that a design, or so many evaluations of a study, take, by a result.

    Args:
        ranges: whether the ends of what is not calibrated are simulated after the figures too.
    """
    if evaluations == 1:
        known, cost = result.record.ranges, 0.0
        if ranges:
            cost = known.cost if known else ENDS if unknowns(design) else 0.0
        return _seconds(design, result) * (1.0 + cost)
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


def _replica_s(design: Design) -> float:
    """Return the simulated time of a replica with its warm-up [s]."""
    return design.process.recorded_time + design.process.accuracy.warmup_time


def _balls_s(design: Design) -> float:
    """Return the balls of a replica times its simulated time [s]."""
    return design.shot.count * _replica_s(design)


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
