"""The candidates of a study: each judged once, remembered, and the best judged again on fresh seeds."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.progress import Progress
from chamberopt.coverage.statistics.confidence_interval import Estimate, paired_difference
from chamberopt.optimize.constraints import FEASIBLE, feasibility_of
from chamberopt.optimize.evaluate_candidate import CandidateEvaluator, Reference, Simulator, scale
from chamberopt.optimize.search.acquisition import recommend_point
from chamberopt.optimize.search.gaussian_process import GaussianProcess, pool_variances
from chamberopt.optimize.search.scalarisation import draw_weights, scalarise
from chamberopt.optimize.storage.study_folder import StudyFolder
from chamberopt.optimize.storage.trial_log import Trial
from chamberopt.simulation.evaluation import Evaluation

if TYPE_CHECKING:
    from chamberopt.design.load import Design
    from chamberopt.optimize.study import Study

# Candidates nearer to each other than this share of the bounds count as one when the best are picked.
DISTINCT = 0.02
# Fewer points than this per parameter do not fix a length scale of a model.
POINTS_PER_PARAMETER = 4

FIRST_ALONE = np.array([1.0, 0.0])  # weights of two objectives

Stop = Callable[[], bool]


@dataclass(frozen=True)
class ConfirmedCandidate:
    """A candidate judged on fresh seeds; searched: its trial number, None if the surrogate proposed it.

    goals: every objective of the study · standing: "feasible" when all the intervals of the constraints' figures keep
    the limits, "infeasible" when one misses, else "not known" · reason: what is missed, or not known to be kept.
    """

    searched: int | None
    parameters: dict[str, float]
    design: Design
    evaluation: Evaluation
    feasibility: str
    reason: str
    goals: tuple[Estimate, ...]

    @property
    def feasible(self) -> bool:
        return self.feasibility == FEASIBLE


class Candidates:
    """Gives points of the unit cube their scores; keeps every trial, and judges none that is on record.

    stop() is asked before each evaluation: KeyboardInterrupt when it says True.
    """

    def __init__(
        self,
        study: Study,
        record: StudyFolder,
        simulator: Simulator,
        progress: Progress | None = None,
        stop: Stop | None = None,
    ) -> None:
        self._study, self._record = study, record
        self._progress, self._stop = progress, stop
        self._judge = CandidateEvaluator(study, simulator)
        self.start = self._judge.start
        self.trials: list[Trial] = []
        self._points: list[np.ndarray] = []

    @property
    def points(self) -> np.ndarray:
        """Points of the unit cube that the search judged, (n, d)."""
        return np.array(self._points)

    def score(self, point: np.ndarray) -> float:
        """Evaluate one point: objective less penalties. The first, the start, raises if it fails."""
        trial, _ = self._judged(point, "search", None)
        self._points.append(point)
        return trial.score

    def seen(self, weight: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Scores (n,) and variances (n,) as a model is to learn them; of two objectives, with these weights or new.

        Who could not be simulated counts as the worst of the others: how bad it is nobody knows, and a cliff would bend
        the model far beyond it.
        """
        searched = [trial.goals for trial in self.trials[: len(self._points)]]
        failed = np.array([not goals for goals in searched])
        some = next(goals for goals in searched if goals)
        rows = [goals or some for goals in searched]
        values = np.array([[goal.value for goal in goals] for goals in rows])
        variances = np.array([_variances([goals[k] for goals in rows]) for k in range(len(some))]).T
        score, variance = values[:, 0], variances[:, 0]
        penalty = self._judge.reference.scale * np.array(
            [trial.penalty for trial in self.trials[: len(rows)]]
        )
        if len(some) > 1 and weight is not FIRST_ALONE:
            weight = (
                draw_weights(self._study.optimizer.seed, len(rows)) if weight is None else weight
            )
            score, variance = scalarise(values, variances, weight, ~failed)
            penalty = penalty / self._judge.reference.scale
        score = score - penalty
        score[failed] = score[~failed].min()
        return score, variance

    def confirm(self) -> list[ConfirmedCandidate]:
        """The start, then the best candidates, on fresh seeds at the design's own accuracy; failures are left out.

        With more replicas, unless the design asks for an accuracy, which then says how many. While the best cannot be
        told from the next, and the study has rounds left, these and the start again with twice the replicas.
        """
        settings = self._study.optimizer
        replicas = (
            settings.confirm_replicas
            if self._study.design.process.accuracy.objective_half_width is None
            else None
        )
        promising = self._promising(settings.confirm)
        confirmed = {
            i: self._confirmed(searched, point, replicas)
            for i, (searched, point) in enumerate(promising)
        }
        for _ in range(settings.confirm_rounds - 1):
            again = (
                hard_to_tell_apart([one for one in confirmed.values() if one]) if replicas else []
            )
            if not again:
                break
            replicas = 2 * (replicas or 0)
            for i, one in confirmed.items():
                if one and (i == 0 or any(one is other for other in again)):
                    confirmed[i] = self._confirmed(*promising[i], replicas) or one
        return [one for one in confirmed.values() if one]

    def _confirmed(
        self, searched: int | None, point: np.ndarray, replicas: int | None
    ) -> ConfirmedCandidate | None:
        trial, evaluation = self._judged(point, "confirm", replicas)
        if evaluation is None or not trial.goals:
            return None
        figures = self._judge.constrained(trial.parameters, evaluation)
        standing, reason = feasibility_of(self._study.constraints, figures)
        design, goals = self._judge.design(point), self._judge.goals(evaluation)
        return ConfirmedCandidate(
            searched, trial.parameters, design, evaluation, standing, reason, goals
        )

    def _promising(self, count: int) -> list[tuple[int | None, np.ndarray]]:
        """The start and up to `count` distinct others: the best feasible, and what the surrogate recommends.

        Of two objectives: what it recommends for as many weights of the two, from one end of the front to the other.
        """
        chosen: list[tuple[int | None, np.ndarray]] = [(0, self._points[0])]

        def is_new(point: np.ndarray) -> bool:
            return all(np.abs(point - other).max() > DISTINCT for _, other in chosen)

        several = len(self._study.objective.goals) > 1
        first = (np.arange(count) + 0.5) / count
        recommended = [
            self._recommended(weight)
            for weight in (np.stack([first, 1.0 - first], axis=1) if several else [None])
        ]
        proposed = [point for point in recommended if point is not None]
        scores = np.array([trial.score for trial in self.trials[: len(self._points)]])
        best_first = [int(i) for i in np.argsort(-scores, kind="stable") if self.trials[i].feasible]
        # The recommendation takes one of the places, but never the only one; of two objectives it takes all.
        places = 0 if several and proposed else count - 1 if proposed and count > 1 else count
        for i in best_first:
            if len(chosen) <= places and is_new(self._points[i]):
                chosen.append((i, self._points[i]))
        for point in proposed:
            if len(chosen) <= count and is_new(point):
                chosen.append((None, point))
        return chosen

    def model(self, weight: np.ndarray | None = None) -> GaussianProcess | None:
        """What the whole search says of every point; None when it is too little."""
        scores, variances = self.seen(weight)
        if len(scores) < POINTS_PER_PARAMETER * len(self.start) or np.ptp(scores) == 0.0:
            return None
        return GaussianProcess(self.points, scores, variances)

    def _recommended(self, weight: np.ndarray | None) -> np.ndarray | None:
        model = self.model(weight)
        return None if model is None else recommend_point(model, self._study.optimizer.seed)

    def _judged(
        self, point: np.ndarray, stage: str, replicas: int | None
    ) -> tuple[Trial, Evaluation | None]:
        """From the record, or by an evaluation that is on record when this returns."""
        number = len(self.trials)
        trial = self._record.replayed(number, stage, point.tolist())
        if trial is not None:
            confirmed = stage == "confirm" and trial.objective is not None
            evaluation = self._record.evaluation(number) if confirmed else None
        else:
            if self._stop and self._stop():
                raise KeyboardInterrupt
            began = time.perf_counter()
            bar = max(
                (t.objective.low for t in self.trials if t.feasible and t.objective),
                default=-np.inf,
            )
            trial, evaluation = self._judge.trial(
                number, point, stage, replicas, bar if number else None
            )
            self._record.append(trial, evaluation, time.perf_counter() - began)
        if number == 0:
            self._judge.reference = Reference(
                trial.score, scale(self._study.objective.goals[0], trial.metrics)
            )
        self.trials.append(trial)
        if number + 1 >= len(self._record.trials):
            self._report(stage)
        return trial, evaluation

    def _report(self, stage: str) -> None:
        if self._progress:
            settings = self._study.optimizer
            total = max(len(self.trials), settings.evaluations + 1 + settings.confirm)
            best = max(
                (t.score for t in self.trials if t.feasible and t.stage == stage), default=None
            )
            self._progress(len(self.trials), total, best)


def _variances(goals: list[Estimate]) -> np.ndarray:
    """Squared standard errors (n,), pooled over the candidates."""
    replicas = np.array([max(1, len(goal.pseudovalues)) for goal in goals])
    spreads = [
        float(np.var(g.pseudovalues, ddof=1)) if len(g.pseudovalues) > 1 else np.nan for g in goals
    ]
    return pool_variances(np.array(spreads), replicas)


def hard_to_tell_apart(confirmed: list[ConfirmedCandidate]) -> list[ConfirmedCandidate]:
    """The best feasible one and those whose difference to it is within the noise; none when it stands alone."""
    feasible = [one for one in confirmed if one.feasibility != "infeasible"]
    if not feasible:
        return []
    best = max(feasible, key=lambda one: one.goals[0].value)
    close = [
        one
        for one in feasible
        if one is not best and paired_difference(best.goals[0], one.goals[0]).low <= 0.0
    ]
    return [best, *close] if close else []
