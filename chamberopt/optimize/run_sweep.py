"""Study -> a map: candidates on a grid, or evenly spread, over the same bounds that a search would have.

Each candidate is one task: its worker builds the chamber and simulates its replicas, and a row of figures comes back.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator
from concurrent.futures import Executor
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.common.errors import InputError, WorkerLostError
from chamberopt.common.parallel.executor import SerialExecutor, share
from chamberopt.common.progress import Progress
from chamberopt.optimize.evaluate_candidate import CandidateEvaluator, Simulator
from chamberopt.optimize.run_study import chamber_simulator, fixed_target, save_inputs
from chamberopt.optimize.storage.study_folder import StudyFolder, open_study_folder
from chamberopt.optimize.storage.trial_log import HISTORY, Trial

if TYPE_CHECKING:
    from chamberopt.optimize.study import Study
    from chamberopt.simulation.evaluation import Evaluation

MOST_CANDIDATES = 100_000


@dataclass(frozen=True)
class SweepPlan:
    """Which candidates: method "grid" or "sobol" · count: of values a parameter, or of points · points (n, d): in
    shares of the bounds · seed: of the points, None for a grid.
    """

    method: str
    count: int
    points: np.ndarray
    seed: int | None

    def asked(self) -> dict[str, Any]:
        """As plain JSON: the points follow from it."""
        return {"method": self.method, "count": self.count, "seed": self.seed}


@dataclass(frozen=True)
class SweepResult:
    """What was found. trials: in the plan's order · seconds: wall clock."""

    study: Study
    plan: SweepPlan
    folder: Path
    trials: tuple[Trial, ...]
    seconds: float

    @property
    def best(self) -> Trial | None:
        """The feasible candidate with the largest objective: the best of so many draws, a lucky one among them."""
        feasible = [trial for trial in self.trials if trial.feasible]
        return max(feasible, key=lambda trial: trial.score, default=None)


def plan_sweep(
    study: Study, grid: int | None, sobol: int | None, seed: int | None = None
) -> SweepPlan:
    """`grid` values of every parameter, bounds included, or `sobol` points in all; InputError unless one is given.

    Sobol points are scrambled (scipy.stats.qmc.Sobol, after A. B. Owen, "Scrambling Sobol' and Niederreiter-Xing
    points", J. Complexity 14, 1998) with `seed`, or the seed of the study's optimizer.
    """
    dimensions = len(study.vary)
    if (grid is None) == (sobol is None):
        given = "neither" if grid is None else "both"
        raise InputError(
            f"--grid, --sobol: {given} given; give one: values a parameter, or points in all"
        )
    if grid is not None:
        if seed is not None:
            raise InputError(
                f"--seed: given {seed}, but a grid draws nothing; leave it out, or take --sobol"
            )
        if grid < 2:
            raise InputError(f"--grid: given {grid}; give at least 2 values a parameter")
        _require_few(grid**dimensions, f"--grid: {grid} values of {dimensions} parameters")
        axis = np.linspace(0.0, 1.0, grid)
        return SweepPlan("grid", grid, np.array(list(product(axis, repeat=dimensions))), None)
    assert sobol is not None
    if sobol < 1:
        raise InputError(f"--sobol: given {sobol}; give at least 1 point")
    _require_few(sobol, "--sobol")
    seed = study.optimizer.seed if seed is None else seed
    if seed < 0:
        raise InputError(f"--seed: given {seed}; give 0 or more")
    return SweepPlan("sobol", sobol, _sobol(dimensions, sobol, seed), seed)


def run_sweep(
    study: Study,
    plan: SweepPlan,
    folder: str | Path,
    executor: Executor,
    progress: Progress | None = None,
    simulator: Simulator | None = None,
) -> SweepResult:
    """CandidateEvaluator every candidate of the plan, at the accuracy of a search and on its seeds.

    folder: new, empty, or where this very sweep was stopped; receives design.toml, study.toml and history.jsonl, its
    rows in the plan's order whatever the number of workers. simulator: stands in for the simulation; must go to the
    workers. A candidate that fails is a row with its reason. Raises InputError when all fail, or the folder is of
    another sweep.
    """
    with open_study_folder(study, folder, plan.asked()) as record:
        if record.finished:
            raise InputError(
                f"{folder}: this sweep is finished, nothing was run; to run it anew give another folder (--out)"
            )
        return _go_on(study, plan, record, executor, progress, simulator)


def _go_on(
    study: Study,
    plan: SweepPlan,
    record: StudyFolder,
    executor: Executor,
    progress: Progress | None,
    simulator: Simulator | None,
) -> SweepResult:
    """From where the record stands."""
    record.begin()
    save_inputs(study, record.path)
    trials: list[Trial] = []
    for number, point in enumerate(plan.points):
        trial = record.replayed(number, "sweep", point.tolist())
        if trial is None:
            break
        trials.append(trial)
    best = max((trial.score for trial in trials if trial.feasible), default=None)
    for trial, seconds in _judged(study, plan, len(trials), executor, simulator):
        record.append(trial, None, seconds)
        trials.append(trial)
        if trial.feasible:
            best = trial.score if best is None else max(best, trial.score)
        if progress:
            progress(len(trials), len(plan.points), best)
    if all(trial.objective is None for trial in trials):
        raise InputError(
            f"no candidate of the sweep could be simulated, the first for: {trials[0].reason}; change [vary] or the "
            f"design; every candidate is in {record.path / HISTORY}"
        )
    return SweepResult(study, plan, record.path, tuple(trials), record.seconds)


def _judged(
    study: Study, plan: SweepPlan, first: int, executor: Executor, simulator: Simulator | None
) -> Iterator[tuple[Trial, float]]:
    """The trials from the ``first`` on in the plan's order, and the seconds that each took; all tasks are there from
    the start, so that no worker waits for another.
    """
    target = share(executor, fixed_target(study) if simulator is None else None)
    numbers = range(first, len(plan.points))
    futures = [
        executor.submit(evaluate_point, study, number, plan.points[number], target, simulator)
        for number in numbers
    ]
    try:
        for number, future in zip(numbers, futures, strict=True):
            try:
                yield future.result()
            except WorkerLostError as error:
                yield _lost(study, number, plan.points[number], error), 0.0
    finally:
        for future in futures:
            future.cancel()


def evaluate_point(
    study: Study,
    number: int,
    point: np.ndarray,
    target: np.ndarray | None = None,
    simulator: Simulator | None = None,
) -> tuple[Trial, float]:
    """One candidate from chamber to figures, on one worker, and the seconds it took."""
    began = time.perf_counter()
    simulator = simulator or chamber_simulator(study, SerialExecutor(), target)
    trial = CandidateEvaluator(study, simulator).trial(number, point, "sweep")[0]
    return trial, time.perf_counter() - began


def _lost(study: Study, number: int, point: np.ndarray, error: WorkerLostError) -> Trial:
    """The row of a candidate that took its workers down."""

    def fail(*_: object) -> Evaluation:
        raise InputError(str(error))

    return CandidateEvaluator(study, fail).trial(number, point, "sweep")[0]


def _sobol(dimensions: int, count: int, seed: int) -> np.ndarray:
    from scipy.stats import qmc

    with warnings.catch_warnings():
        warnings.simplefilter(
            "ignore", UserWarning
        )  # not a power of 2: spread a little less evenly, no error
        return np.asarray(qmc.Sobol(dimensions, scramble=True, seed=seed).random(count))


def _require_few(count: int, what: str) -> None:
    if count > MOST_CANDIDATES:
        raise InputError(f"{what}: {count:,} candidates, more than {MOST_CANDIDATES:,}; give fewer")
