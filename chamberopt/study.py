"""Study -> a better design: NLopt proposes candidates, the best are judged again on fresh seeds."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.accuracy import Evaluation, evaluate
from chamberopt.candidates import Candidates, Confirmed, Evaluator
from chamberopt.config import save_design
from chamberopt.disk import new_folder, write_text
from chamberopt.errors import InputError
from chamberopt.estimate import Estimate, paired_difference
from chamberopt.history import History, Trial
from chamberopt.replicas import Progress

if TYPE_CHECKING:
    from chamberopt.config import Design, Study

# Share of the budget "auto" gives to the global search before it refines the best. Measured on three noisy
# toys, 24 and 40 evaluations: MLSL for half, then BOBYQA has the least regret (0.010 at noise 0.02), before
# DIRECT_L then BOBYQA (0.011), MLSL alone (0.017), DIRECT_L alone (0.017), BOBYQA alone (0.04) and CRS2
# (0.08).
GLOBAL_SHARE = 0.5
LOCAL = "LN_BOBYQA"
# First steps of the local searches, in shares of the bounds, one after another from the best so far.
LOCAL_STEPS = (0.15, 0.08, 0.04)
# A step this small, in shares of the bounds, moves a simulated score less than its noise.
LOCAL_TOLERANCE = 0.02


@dataclass(frozen=True)
class StudyResult:
    """What a study found.

    start, best, confirmed: judged on the same fresh seeds · gain: objective of best minus start with its 95 %
    interval from those paired replicas · trials: search and confirmation, as they ran · seconds: wall clock.
    """

    study: Study
    folder: Path
    algorithm: str
    trials: tuple[Trial, ...]
    start: Confirmed
    confirmed: tuple[Confirmed, ...]
    best: Confirmed
    gain: Estimate
    seconds: float

    @property
    def at_bounds(self) -> tuple[str, ...]:
        """A sentence for each parameter whose best value lies on its bound, where the search could not go on."""
        said = []
        for name, (low, high) in self.study.vary.items():
            value = self.best.design.value(name)
            for bound, side in ((low, "lower"), (high, "upper")):
                if abs(value - bound) < 1e-3 * (high - low):
                    said.append(f"{name} = {value:g} lies on its {side} bound: better may lie beyond; widen [vary]")
        return tuple(said)

    @property
    def improved(self) -> bool:
        """Whether the best beats the start by more than the interval of the gain."""
        return self.gain.low > 0.0


def run_study(
    study: Study,
    folder: str | Path,
    executor: Executor,
    progress: Progress | None = None,
    evaluator: Evaluator | None = None,
) -> StudyResult:
    """Search for a better design within the budget, then confirm the best and the start on fresh seeds.

    folder: new or empty; receives design.toml, study.toml and history.jsonl while the study runs. evaluator:
    stands in for the simulation (tests, other models). progress(done, total, best): after each evaluation.

    Every candidate of the search gets the same seeds. The best candidates and the start are then simulated
    with more replicas on a second stream of seeds, and the answer is the best of those: the search's own
    figures favour the lucky. (Of the few confirmed the best is still picked by the figures reported: a little
    in its favour.)

    Raises InputError when the folder is in use, the start cannot be simulated, or nothing meets the
    constraints.
    """
    began = time.perf_counter()
    folder = new_folder(folder)
    _save_inputs(study, folder)
    candidates = Candidates(study, History(folder), evaluator or _simulation(study, executor), progress)
    settings = study.optimizer
    algorithm = maximise(candidates.score, candidates.start, settings.algorithm, settings.evaluations, settings.seed)
    confirmed = candidates.confirm()
    if not confirmed or confirmed[0].searched != 0:
        first = next(trial for trial in candidates.trials if trial.stage == "confirm")
        raise InputError(f"the start could not be simulated on the confirmation's seeds: {first.reason}")
    start = confirmed[0]
    winners = [candidate for candidate in confirmed if candidate.feasible]
    if not winners:
        raise InputError(
            f"constraints: no candidate meets them (the start: {start.reason}); loosen them, widen [vary] or "
            f"raise optimizer.evaluations; every evaluation is in {folder / 'history.jsonl'}"
        )
    best = max(winners, key=lambda candidate: candidate.evaluation.objective.value)
    return StudyResult(
        study=study,
        folder=folder,
        algorithm=algorithm,
        trials=tuple(candidates.trials),
        start=start,
        confirmed=tuple(confirmed),
        best=best,
        gain=paired_difference(best.evaluation.objective, start.evaluation.objective),
        seconds=time.perf_counter() - began,
    )


def _save_inputs(study: Study, folder: Path) -> None:
    """What was asked, first of all: a study that is killed still says what it was."""
    import tomli_w

    save_design(study.design, folder / "design.toml")
    asked = study.model_dump(mode="json", exclude={"design"}, exclude_none=True)
    write_text(folder / "study.toml", tomli_w.dumps({"design": "design.toml", **asked}))


def _simulation(study: Study, executor: Executor) -> Evaluator:
    """The real thing: chamber, replicas, coverage."""
    from chamberopt.chamber import build_chamber

    def simulate_candidate(design: Design, stream: str, replicas: int | None) -> Evaluation:
        began = time.perf_counter()
        chamber = build_chamber(design)
        built = time.perf_counter() - began
        name = study.objective.name
        result = evaluate(design, chamber, executor, objective_name=name, stream=stream, replicas=replicas)
        return replace(result, timings={"chamber": built, **result.timings})

    return simulate_candidate


def maximise(score: Callable[[np.ndarray], float], start: np.ndarray, algorithm: str, budget: int, seed: int) -> str:
    """Maximise over the unit cube with `budget` calls of `score`, the first at `start`; says which algorithms
    ran.

    score(point (n,)) -> finite float is called once per different point and keeps its own record: NLopt's
    return value is never looked at. Raises InputError for an algorithm that cannot take these parameters, and
    whatever `score` raises.
    """
    search = _Search(score, start, budget, seed)
    try:
        if algorithm != "auto":
            search.run(algorithm)
            return algorithm
        search.run("GN_MLSL_LDS", share=GLOBAL_SHARE)
        spent = 0
        while spent < len(search.scores):  # the budget, or a round of local searches that brings no new point
            spent = len(search.scores)
            for step in LOCAL_STEPS:
                search.run(LOCAL, step=step)
    except _BudgetSpentError:
        pass
    return algorithm if algorithm != "auto" else f"GN_MLSL_LDS, then {LOCAL}"


class _BudgetSpentError(Exception):
    """Ends a search from inside NLopt's callback."""


class _Search:
    """NLopt algorithms one after another on one budget; a point seen before costs nothing."""

    def __init__(self, score: Callable[[np.ndarray], float], start: np.ndarray, budget: int, seed: int) -> None:
        import nlopt

        self._score, self._start, self._budget = score, start, budget
        self.scores: dict[bytes, float] = {}  # by the point's exact bytes
        self._best, self._best_score = start, -np.inf
        nlopt.srand(seed)  # process-global: set once, before the first algorithm draws
        self._judge(start)

    def run(self, algorithm: str, share: float = 1.0, step: float = LOCAL_STEPS[0]) -> None:
        """One algorithm from the best point so far, until it converges or its share of the budget is gone."""
        import nlopt

        stop_at = max(1, round(share * self._budget))
        kept: list[BaseException] = []

        def callback(x: np.ndarray, gradient: np.ndarray) -> float:
            # An exception that crosses NLopt can turn into SystemError: keep it, stop, raise it outside.
            # After force_stop some algorithms still ask for a few points; any finite answer does.
            if kept:
                return 0.0
            try:
                if len(self.scores) >= stop_at and self._point(x).tobytes() not in self.scores:
                    raise _BudgetSpentError
                return -self._judge(self._point(x))
            except BaseException as error:
                kept.append(error)
                optimizer.force_stop()
                return 0.0

        optimizer = self._optimizer(algorithm, step)
        optimizer.set_min_objective(callback)
        try:
            optimizer.optimize(self._best)
        except (nlopt.ForcedStop, nlopt.RoundoffLimited):
            pass
        except Exception as error:  # NLopt's own exceptions share no base class from one version to the next
            if not kept:
                raise InputError(
                    f"optimizer.algorithm: NLopt's {algorithm} cannot search {len(self._start)} parameter(s) "
                    f'({error or type(error).__name__}); choose "auto"'
                ) from None
        if kept and not (isinstance(kept[0], _BudgetSpentError) and stop_at < self._budget):
            raise kept[0]

    def _optimizer(self, algorithm: str, step: float) -> Any:
        import nlopt

        count = len(self._start)
        # Any MLSL name takes the local search it is given only under the G_ name.
        name = algorithm.replace("GN_MLSL", "G_MLSL")
        optimizer = nlopt.opt(getattr(nlopt, name), count)
        optimizer.set_lower_bounds(np.zeros(count))
        optimizer.set_upper_bounds(np.ones(count))
        # A safety net for algorithms that keep asking for points already seen.
        optimizer.set_maxeval(100 * self._budget)
        if name.startswith("G_MLSL"):
            inner = nlopt.opt(getattr(nlopt, LOCAL), count)
            inner.set_initial_step(step)
            inner.set_xtol_abs(LOCAL_TOLERANCE)
            optimizer.set_local_optimizer(inner)
        elif name.startswith("LN_"):
            optimizer.set_initial_step(step)
            optimizer.set_xtol_abs(LOCAL_TOLERANCE)
        return optimizer

    def _point(self, x: np.ndarray) -> np.ndarray:
        """A copy, for x is NLopt's own reused view; clipped, for BOBYQA can leave the bounds by rounding."""
        return np.clip(np.array(x, dtype=float), 0.0, 1.0)

    def _judge(self, point: np.ndarray) -> float:
        key = point.tobytes()
        if key not in self.scores:
            if len(self.scores) >= self._budget:
                raise _BudgetSpentError
            self.scores[key] = float(self._score(point))
            if self.scores[key] > self._best_score:
                self._best, self._best_score = point, self.scores[key]
        return self.scores[key]
