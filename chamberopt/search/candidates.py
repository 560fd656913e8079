"""The candidates of a study: each is evaluated once and recorded; the best are confirmed."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Self

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.common.estimate import Estimate, paired_difference, student_quantile
from chamberopt.common.progress import Progress
from chamberopt.coverage.coverage_intervals import NOT_RESOLVED
from chamberopt.search.evaluate_candidate import CandidateEvaluator, Reference, Simulator
from chamberopt.search.optimiser.acquisition import recommend_points
from chamberopt.search.optimiser.gaussian_process import moderate_variances
from chamberopt.search.optimiser.point_search import Scored
from chamberopt.search.optimiser.scalarisation import draw_weights, scalarise
from chamberopt.search.optimiser.search_model import LimitedFigure, Observations, SearchModel
from chamberopt.search.study.constraints import (
    FEASIBLE,
    INFEASIBLE,
    Limits,
    Violation,
    assess_feasibility,
    exact,
)
from chamberopt.search.study_folder import StudyFolder
from chamberopt.search.trial_log import Trial
from chamberopt.simulation.evaluation import Evaluation

if TYPE_CHECKING:
    from chamberopt.design.design import Design
    from chamberopt.search.study import Study
    from chamberopt.search.trial_log import Trial

# What the trials of a search tell its models.

# A figure counts as at most so many times as far outside its limit as the median candidate is away
# from it.
MAX_OUTSIDE = 3.0
FIRST_OBJECTIVE = np.array([1.0, 0.0])  # weights of two objectives


def observe(
    trials: Sequence[Trial], constraints: Mapping[str, Limits], weight: np.ndarray
) -> Observations:
    """What the trials of a search have shown.

    Args:
        weight: of two objectives, (2,); not looked at where there is one.
    """
    simulated = np.array([bool(trial.goals) for trial in trials])
    spared = np.array([trial.highest is not None for trial in trials])
    some = next(trial.goals for trial in trials if trial.goals)
    rows = [trial.goals or some for trial in trials]
    values = np.array([[goal.value for goal in goals] for goals in rows])
    variances = np.array([_variances([goals[k] for goals in rows]) for k in range(len(some))]).T
    score, variance = values[:, 0], variances[:, 0]
    if len(some) > 1 and weight is not FIRST_OBJECTIVE:
        score, variance = scalarise(values, variances, weight, simulated)
    score = np.where(spared, [trial.score for trial in trials], score)
    # A limited number of the design that does not vary is the same in all trials, and not in them.
    known = next(trial.metrics.keys() | trial.parameters.keys() for trial in trials if trial.goals)
    limited = ((name, limits) for name, limits in constraints.items() if name in known)
    figures = (_limited_figure(name, limits, trials) for name, limits in limited)
    return Observations(score, variance, simulated, tuple(figures), spared)


def _limited_figure(name: str, limits: Limits, trials: Sequence[Trial]) -> LimitedFigure:
    """A figure of the trials with limits, as a model learns it.

    One that is not resolved tells next to nothing. One far outside, such as a time that stands for
    never, is brought nearer to its limit: how far outside it is decides nothing, and would bend the
    model.
    """
    figures = [(trial.metrics | exact(trial.parameters)).get(name) for trial in trials]
    known = np.array([one.value if one else np.nan for one in figures])
    errors = np.array([_error(one, trial) for one, trial in zip(figures, trials, strict=True)])
    unresolved = np.array([one is not None and one.in_words == NOT_RESOLVED for one in figures])
    low = -np.inf if limits.min is None else limits.min
    high = np.inf if limits.max is None else limits.max
    outside = np.maximum(np.maximum(low - known, known - high), 0.0)
    inside = float(np.nanmedian(np.minimum(np.abs(known - low), np.abs(known - high))))
    far = MAX_OUTSIDE * (inside or 1.0)
    values = np.clip(known, low - far, high + far)
    usual = errors[np.isfinite(errors) & (outside < far)]
    errors = np.where(np.isfinite(errors), errors, usual.max() if len(usual) else 0.0)
    errors = np.where(unresolved, far, np.minimum(errors, far))
    return LimitedFigure(np.nan_to_num(values), errors**2, low, high)


def _error(figure: Estimate | None, trial: Trial) -> float:
    """Standard error of a figure, whose pseudo-values the log does not keep."""
    if figure is None or not math.isfinite(figure.half_width):
        return math.nan
    return figure.half_width / student_quantile(max(1, (trial.replicas or 2) - 1))


def _variances(goals: list[Estimate]) -> np.ndarray:
    """Squared standard errors (n,) of one objective, drawn towards those of all candidates."""
    samples = [goal.pseudovalues for goal in goals]
    spreads = [float(np.var(one, ddof=1)) if len(one) > 1 else np.nan for one in samples]
    return moderate_variances(np.array(spreads), np.array([max(1, len(one)) for one in samples]))


# Candidates nearer to each other than this share of the bounds count as one in the confirmation.
MIN_DISTANCE = 0.02
# With fewer points for each parameter the length scales of a model are not determined.
POINTS_PER_PARAMETER = 4

Stop = Callable[[], bool]
"""Returns True when the user wants to stop the study."""


@dataclass(frozen=True)
class ConfirmedCandidate:
    """A candidate simulated with new seeds."""

    searched: int | None  # number of its trial in the search; None if the model recommended it
    parameters: dict[str, float | str]
    design: Design
    evaluation: Evaluation
    # FEASIBLE if the whole intervals of the constrained figures are within their limits, INFEASIBLE
    # if one is outside, else NOT_KNOWN.
    feasibility: str
    violations: tuple[Violation, ...]  # of limits, certain or possible
    goals: tuple[Estimate, ...]  # of each objective of the study
    # What the design's tolerances cost of the first objective on average, by the search's model;
    # those of numbers that do not vary are not in it. 0 if there is no model.
    lost_to_tolerances: float = 0.0

    @property
    def feasible(self) -> bool:
        return self.feasibility == FEASIBLE

    @property
    def reason(self) -> str:
        """The limits that are, or may be, violated, in words."""
        return "; ".join(one.text for one in self.violations)


class Candidates:
    """Scores points of the unit cube; candidates on record are not evaluated again.

    Up to `optimizer.batch` candidates are evaluated at a time, in threads that share the workers:
    while one builds its chamber or estimates its metrics, the workers have replicas of another.
    Trials are recorded in the order in which their evaluations began. What a candidate is evaluated
    with follows from the trials that are recorded by then, so that nothing depends on speed.

    `start` is the design of the study as a point (d,); `trials` has those of the search first. When
    `stop`, called before each evaluation, returns True, those that run are finished and recorded,
    and KeyboardInterrupt is raised. Leaving the `with` block by an error does not wait for them.
    """

    def __init__(
        self,
        study: Study,
        folder: StudyFolder,
        simulator: Simulator,
        progress: Progress | None = None,
        stop: Stop | None = None,
        at_once: int | None = None,
    ) -> None:
        self._study, self._folder = study, folder
        self._progress, self._stop = progress, stop
        self._evaluator = CandidateEvaluator(study, simulator)
        self.space = self._evaluator.space
        self.start = self.space.start
        self.trials: list[Trial] = []
        self._points: list[np.ndarray] = []  # of the search, those that run included
        self._running: deque[_Running] = deque()
        self._confirmations: dict[int, Evaluation] = {}  # by number, until they are asked for
        # With fewer threads than a batch has candidates, some of them wait: figures are the same.
        batch = study.optimizer.batch
        self._threads = ThreadPoolExecutor(min(batch, at_once or batch), "candidate")
        self._last_end = 0.0  # of an evaluation, by the clock

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._threads.shutdown(wait=error[0] is None, cancel_futures=True)

    def begin(self, point: np.ndarray) -> Callable[[], Scored]:
        """Begin to evaluate a point of the search; the function waits for its score.

        The score is the objective less penalties. InputError or an error of sim_core if the start,
        which comes first, cannot be simulated.
        """
        number = self._begin(point, "search", None)
        self._points.append(point)

        def wait() -> Scored:
            trial = self._finish(number)
            return Scored(trial.score, self._evaluator.cost(trial))

        return wait

    def observations(self, weight: np.ndarray | None = None) -> Observations:
        """What the trials of the search tell a model.

        The weights of two objectives are by default random ones for this step.
        """
        if weight is None:
            weight = draw_weights(self._study.optimizer.seed, len(self._points))
        searched = [trial for trial in self.trials if trial.stage == "search"]
        return observe(searched, self._study.all_constraints, weight)

    def _model(self, weight: np.ndarray, learns_bounds: bool = False) -> SearchModel | None:
        """A model of the whole search; None if there are too few points."""
        seen = self.observations(weight)
        scores = seen.scores[seen.simulated]
        if len(scores) < POINTS_PER_PARAMETER * len(self.start) or np.ptp(scores) == 0.0:
            return None
        points = np.array(self._points)
        return SearchModel(self.space.domain, points, seen, learns_bounds=learns_bounds)

    @cached_property
    def objective_model(self) -> SearchModel | None:
        """A model of the first objective when the search has ended, with all that bounds it.

        None with too few points.
        """
        return self._model(FIRST_OBJECTIVE, learns_bounds=True)

    @property
    def _best_low(self) -> float:
        """The highest lower end of the objective's intervals so far."""
        lows = (t.objective.low for t in self.trials if t.feasible and t.objective)
        return max(lows, default=-np.inf)

    def confirm(self) -> list[ConfirmedCandidate]:
        """Simulate the start and the best candidates with new seeds and the design's own accuracy.

        They get more replicas than in the search, unless the design asks for an accuracy, which
        then sets the number. While the best cannot be told from the next, and the study has rounds
        left, these and the start are simulated with twice the replicas. Failures are left out.
        """
        settings = self._study.optimizer
        asks_for_accuracy = self._study.design.process.accuracy.objective_half_width is not None
        replicas = None if asks_for_accuracy else settings.confirm_replicas
        promising = self._promising(settings.confirm)
        confirmed = self._confirm(promising, replicas)
        for _ in range(settings.confirm_rounds - 1):
            close = close_to_best([one for one in confirmed if one]) if replicas else []
            if not close:
                break
            replicas = 2 * (replicas or 0)
            again = [
                i
                for i, one in enumerate(confirmed)
                if one and (i == 0 or any(one is other for other in close))
            ]
            more = self._confirm([promising[i] for i in again], replicas)
            for i, one in zip(again, more, strict=True):
                confirmed[i] = one or confirmed[i]
        return [one for one in confirmed if one]

    def _confirm(
        self, places: list[tuple[int | None, np.ndarray]], replicas: int | None
    ) -> list[ConfirmedCandidate | None]:
        """Simulate candidates, given with their trial numbers in the search, with new seeds."""
        begun = [self._begin(point, "confirm", replicas) for _, point in places]
        return [self._confirmed(*one, n) for one, n in zip(places, begun, strict=True)]

    def _confirmed(
        self, searched: int | None, point: np.ndarray, number: int
    ) -> ConfirmedCandidate | None:
        trial = self._finish(number)
        evaluation = self._confirmations.pop(number, None)
        if evaluation is None:
            return None
        parameters, goals = trial.parameters, self._evaluator.goals(evaluation)
        figures = self._evaluator.constrained(parameters, evaluation)
        standing = assess_feasibility(self._study.all_constraints, figures)
        design = self.space.design_at(point)
        lost = self._lost_to_tolerances(point)
        return ConfirmedCandidate(searched, parameters, design, evaluation, *standing, goals, lost)

    def _lost_to_tolerances(self, point: np.ndarray) -> float:
        model = self.objective_model
        if model is None or not model.domain.has_misses:
            return 0.0
        lost = float(model.score(point[None])[0][0] - model.expected(point[None])[0][0])
        return max(0.0, lost)  # where the model rises beyond a bound, nobody has looked

    def _promising(self, count: int) -> list[tuple[int | None, np.ndarray]]:
        """The start and up to `count` distinct others, each with its trial number.

        For one objective: the best feasible candidates and the two that the model recommends, of
        which one was evaluated. For two: what the model recommends for `count` weights, from one
        end of the front to the other.
        """
        chosen: list[tuple[int | None, np.ndarray]] = [(0, self._points[0])]

        def is_new(point: np.ndarray) -> bool:
            return all(np.abs(point - other).max() > MIN_DISTANCE for _, other in chosen)

        has_two_objectives = len(self._study.objective.goals) > 1
        first = (np.arange(count) + 0.5) / count
        weights = np.stack([first, 1.0 - first], axis=1) if has_two_objectives else FIRST_OBJECTIVE
        models = [self._model(weight) for weight in np.atleast_2d(weights)]
        seed = self._study.optimizer.seed
        recommended = [recommend_points(model, seed) for model in models if model is not None]
        scores = np.array([trial.score for trial in self.trials[: len(self._points)]])
        best_first = [int(i) for i in np.argsort(-scores, kind="stable") if self.trials[i].feasible]
        seen = [self._points[i] for i in best_first]
        if has_two_objectives:
            wanted = [new for _, new in recommended] or seen
        else:  # the luckiest one first, then what the model recommends, then the next ones
            by_model = (one for both in recommended for one in reversed(both))
            wanted = [*seen[:1], *by_model, *seen[1:]]
        numbers = {point.tobytes(): i for i, point in reversed(list(enumerate(self._points)))}
        best_low = self._best_low
        for point in wanted:
            number = numbers.get(point.tobytes())
            if (
                len(chosen) <= count
                and is_new(point)
                and (number is not None or self._evaluator.has_promise(point, best_low))
            ):
                chosen.append((number, point))
        return chosen

    def _begin(self, point: np.ndarray, stage: str, replicas: int | None) -> int:
        """Begin to evaluate a candidate, or take it from the record; returns its number."""
        while len(self._running) >= self._study.optimizer.batch:
            self._finish_oldest()
        number = len(self.trials) + len(self._running)
        recorded = self._folder.recorded.find(number, stage, point.tolist())
        if recorded is not None:
            evaluation: Future[Evaluation | InputError] = Future()
            in_file = stage == "confirm" and recorded.objective is not None
            evaluation.set_result(self._folder.evaluation(recorded) if in_file else InputError(""))
        else:
            if self._stop and self._stop():
                while self._running:
                    self._finish_oldest()
                raise KeyboardInterrupt
            best_low = self._best_low if self.trials else None
            what = number, point, stage, replicas, best_low
            evaluation = self._threads.submit(self._evaluator.evaluate, *what)
        began = time.perf_counter()
        self._running.append(_Running(number, point, stage, began, recorded, evaluation))
        return number

    def _finish(self, number: int) -> Trial:
        """Wait for the trial of this number, and record it and those before it."""
        while len(self.trials) <= number:
            self._finish_oldest()
        return self.trials[number]

    def _finish_oldest(self) -> None:
        one = self._running[0]
        # A signal that another thread was given wakes nobody who waits without end.
        while not one.evaluation.done():
            wait([one.evaluation], timeout=0.2)
        evaluation, trial = one.evaluation.result(), one.recorded
        if trial is None:
            trial = self._evaluator.trial(one.number, one.point, one.stage, evaluation)
            # The clock's seconds of evaluations that run at a time count once.
            now = time.perf_counter()
            seconds, self._last_end = now - max(one.began, self._last_end), now
            self._folder.append(trial, evaluation, seconds)
        self._running.popleft()
        if one.number == 0:
            self._evaluator.reference = Reference(trial.score, self._evaluator.unit(trial.metrics))
        self.trials.append(trial)
        if one.stage == "confirm" and isinstance(evaluation, Evaluation):
            self._confirmations[one.number] = evaluation
        # Trials from the record but the last one are not shown.
        if self._progress and one.number + 1 >= len(self._folder.recorded.trials):
            settings = self._study.optimizer
            searched = [t for t in self.trials if t.stage == "search"]
            expected = len(searched) + 1 + settings.confirm
            if one.stage == "search":  # at most: some will cost a part of an evaluation
                spent = sum(map(self._evaluator.cost, searched))
                expected += math.ceil(settings.evaluations - spent)
            total = max(len(self.trials), expected)
            scores = (t.score for t in self.trials if t.feasible and t.stage == one.stage)
            self._progress(len(self.trials), total, max(scores, default=None))


@dataclass(frozen=True)
class _Running:
    """A candidate whose evaluation runs, or is on record."""

    number: int
    point: np.ndarray
    stage: str
    began: float  # by the clock [s]
    recorded: Trial | None
    evaluation: Future[Evaluation | InputError]  # or why there is none


def close_to_best(confirmed: list[ConfirmedCandidate]) -> list[ConfirmedCandidate]:
    """The best candidate and those within the noise of it; empty if it stands alone."""
    feasible = [one for one in confirmed if one.feasibility != INFEASIBLE]
    if not feasible:
        return []
    best = max(feasible, key=lambda one: one.goals[0].value)
    others = [one for one in feasible if one is not best]
    close = [one for one in others if paired_difference(best.goals[0], one.goals[0]).low <= 0.0]
    return [best, *close] if close else []
