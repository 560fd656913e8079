"""Run a sweep: evaluate candidates on a grid, or spread evenly, over the bounds of a study.

Each candidate is one task of a worker process, which builds the candidate's chamber, simulates its
replicas and returns its figures (coverage etc.).
"""

from __future__ import annotations

import math
import warnings
from concurrent.futures import Executor, Future
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.executor import SerialExecutor, share
from chamberopt.common.notebook import ShownInNotebook
from chamberopt.common.progress import Progress
from chamberopt.design.design import SHAPE
from chamberopt.search.ask_and_tell import Search
from chamberopt.search.candidate import Candidate, CandidateEvaluator, Simulator
from chamberopt.search.run_study import (
    ChamberSimulator,
    Outcome,
    fixed_target,
    run_search,
    save_inputs,
)
from chamberopt.search.study.parameters import ParameterSpace
from chamberopt.search.trial_log import HISTORY, Trial

if TYPE_CHECKING:
    from chamberopt.search.study import Study
    from chamberopt.search.study_folder import StudyFolder

MAX_CANDIDATES = 100_000


@dataclass(frozen=True)
class SweepPlan:
    """The candidates that a sweep evaluates: points on a grid, or points spread evenly (Sobol)."""

    method: str  # "grid" or "sobol"
    count: int  # values of each parameter, or number of points
    points: np.ndarray  # in the unit cube, shape (n, d)
    seed: int | None  # of the points; None for a grid

    def as_json(self) -> dict[str, object]:
        """Return method, count and seed as JSON values. The points follow from these values."""
        return {"method": self.method, "count": self.count, "seed": self.seed}


@dataclass(frozen=True)
class SweepResult(ShownInNotebook):
    """The result of a sweep: its trials in the order of the plan, and their total run time [s]."""

    study: Study
    plan: SweepPlan
    folder: Path
    trials: tuple[Trial, ...]
    seconds: float

    @property
    def best(self) -> Trial | None:
        """The feasible candidate with the largest objective; None if no candidate is feasible.

        A candidate is feasible if it meets the constraints. The best candidate is partly the
        luckiest in the noise. A candidate with an unresolved objective is chosen only if all
        objectives are unresolved.
        """
        feasible = [trial for trial in self.trials if trial.feasible]
        resolved = [one for one in feasible if one.objective and one.objective.has_number]
        return max(resolved or feasible, key=lambda one: one.score, default=None)


def plan_sweep(
    study: Study, grid: int | None, sobol: int | None, seed: int | None = None
) -> SweepPlan:
    """Plan a sweep of `grid` values of each parameter, bounds included, or `sobol` points in all.

    `seed` scrambles the Sobol points, by default the study's optimizer.seed. Raises InputError
    unless exactly one of grid and sobol is given, or if a number is out of range.

    Source: the Sobol points are scrambled as in A. B. Owen, "Scrambling Sobol' and
    Niederreiter-Xing points", J. Complexity 14, 1998 (scipy.stats.qmc.Sobol).
    """
    from scipy.stats.qmc import Sobol

    if SHAPE in study.vary:
        text = "not supported in a sweep; sweep each shape by itself"
        raise InputError(f"vary.{SHAPE}: {text}")
    domain, dimensions = ParameterSpace(study.design, study.vary).domain, len(study.vary)
    if (grid is None) == (sobol is None):
        given = "neither" if grid is None else "both"
        raise InputError(
            f"--grid, --sobol: {given} given; give one: --grid for the number of values of each "
            "parameter, or --sobol for the number of candidates"
        )
    if grid is not None:
        if seed is not None:
            text = "but a grid is not random; remove it, or use --sobol"
            raise InputError(f"--seed: given {seed}, {text}")
        if grid < 2:
            raise InputError(f"--grid: given {grid}; give at least 2 values of each parameter")
        counts = [min(grid, one.levels) if one.levels else grid for one in domain.axes]
        _require_few(math.prod(counts), f"--grid: {grid} values of {dimensions} parameters")
        axes = domain.snap(np.repeat(np.linspace(0.0, 1.0, grid)[:, None], dimensions, axis=1)).T
        each = [  # of few levels each once, and all choices
            np.unique(line) if axis.ordered else np.linspace(0.0, 1.0, axis.levels)
            for line, axis in zip(axes, domain.axes, strict=True)
        ]
        points = np.array(list(product(*each)))
        return SweepPlan("grid", grid, points, None)
    assert sobol is not None
    if sobol < 1:
        raise InputError(f"--sobol: given {sobol}; give at least 1 point")
    _require_few(sobol, "--sobol")
    seed = study.optimizer.seed if seed is None else seed
    if seed < 0:
        raise InputError(f"--seed: given {seed}; give 0 or more")
    with warnings.catch_warnings():
        # A count that is not a power of 2 is spread a little less evenly, which is no error.
        warnings.simplefilter("ignore", UserWarning)
        points = domain.snap(Sobol(dimensions, scramble=True, seed=seed).random(sobol))
    firsts = np.unique(points, axis=0, return_index=True)[1]  # of few levels each once
    return SweepPlan("sobol", sobol, points[np.sort(firsts)], seed)


def run_sweep(
    study: Study,
    plan: SweepPlan,
    folder: StudyFolder,
    executor: Executor,
    progress: Progress | None = None,
    simulator: Simulator | None = None,
) -> SweepResult:
    """Evaluate every candidate of a plan, with the same accuracy and seeds as in a search.

    A candidate that fails has a row in the log with the reason.

    Args:
        study: the study of the folder, with its effects resolved.
        folder: folder for design.toml, study.toml and history.jsonl. A sweep that was interrupted
            in it is resumed. The rows of history.jsonl are in the order of the plan for any number
            of workers.
        simulator: function to use in place of the simulation; it is sent to the workers.
    Raises:
        InputError: all candidates fail.
    """
    folder.begin()
    save_inputs(study, folder.path)
    search = Search(study, folder, progress, plan.points)
    target = share(executor, fixed_target(study) if simulator is None else None)

    def submit(one: Candidate) -> Future[Outcome]:
        return executor.submit(evaluate_point, study, one.number, one.point, target, simulator)

    run_search(search, submit)
    trials = tuple(search.trials)
    if all(trial.objective is None for trial in trials):
        raise InputError(
            "no candidate of the sweep could be simulated, the first because: "
            f"{trials[0].reason}; change [vary] or the design; every candidate is in "
            f"{folder.path / HISTORY}"
        )
    return SweepResult(study, plan, folder.path, trials, folder.seconds)


def evaluate_point(
    study: Study,
    number: int,
    point: np.ndarray,
    target: np.ndarray | None = None,
    simulator: Simulator | None = None,
) -> Outcome:
    """Evaluate one candidate of a sweep on one worker.

    Return the evaluation without its impacts, which are large. If the candidate fails, return an
    InputError with the reason.

    Args:
        number: number of the candidate.
        point: the candidate's parameters as a point in the unit cube, shape (d,).
        target: True for triangles of the part in the target, shape (m,) bool; None to select the
            target by the design.
        simulator: function to use in place of the simulation.
    """
    evaluator = CandidateEvaluator(
        study, simulator or ChamberSimulator(study, SerialExecutor(), target)
    )
    space = ParameterSpace(study.design, study.vary)
    found = evaluator.evaluate(Candidate(number, "sweep", point, space))
    return InputError(str(found)) if isinstance(found, InputError) else replace(found, hits=())


def _require_few(count: int, what: str) -> None:
    if count > MAX_CANDIDATES:
        raise InputError(f"{what}: {count:,} candidates, more than {MAX_CANDIDATES:,}; give fewer")
