"""The candidates of a study: each judged once, remembered, and the best judged again on fresh seeds."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.accuracy import Evaluation
from chamberopt.history import Trial
from chamberopt.judge import Evaluator, Judge
from chamberopt.record import Record
from chamberopt.replicas import Progress
from chamberopt.surrogate import recommend

if TYPE_CHECKING:
    from chamberopt.config import Design, Study

# Candidates nearer to each other than this share of the bounds count as one when the best are picked.
DISTINCT = 0.02

Stop = Callable[[], bool]


@dataclass(frozen=True)
class Confirmed:
    """A candidate judged on fresh seeds; searched: its trial number, None if the surrogate proposed it."""

    searched: int | None
    parameters: dict[str, float]
    design: Design
    evaluation: Evaluation
    feasible: bool
    reason: str


class Candidates:
    """Maps points of the unit cube to designs and scores; keeps every trial, and judges none that is on record.

    stop() is asked before each evaluation: KeyboardInterrupt when it says True.
    """

    def __init__(
        self,
        study: Study,
        record: Record,
        evaluator: Evaluator,
        progress: Progress | None = None,
        stop: Stop | None = None,
    ) -> None:
        self._study, self._record = study, record
        self._progress, self._stop = progress, stop
        self._judge = Judge(study, evaluator)
        self.start = self._judge.start
        self.trials: list[Trial] = []
        self._points: list[np.ndarray] = []

    def score(self, point: np.ndarray) -> float:
        """Judge one point: objective less penalties. The first, the start, raises if it fails."""
        trial, _ = self._judged(point, "search", None)
        self._points.append(point)
        return trial.score

    def confirm(self) -> list[Confirmed]:
        """The start, then the best candidates, on fresh seeds at the design's own accuracy; failures are left out.

        With more replicas, unless the design asks for an accuracy, which then says how many.
        """
        settings = self._study.optimizer
        replicas = settings.confirm_replicas if self._study.design.process.accuracy.coverage is None else None
        confirmed = []
        for searched, point in self._promising(settings.confirm):
            trial, evaluation = self._judged(point, "confirm", replicas)
            if evaluation is not None:
                design = self._judge.design(point)
                confirmed.append(
                    Confirmed(searched, trial.parameters, design, evaluation, trial.feasible, trial.reason)
                )
        return confirmed

    def _promising(self, count: int) -> list[tuple[int | None, np.ndarray]]:
        """The start and up to `count` distinct others: the best feasible, and the surrogate's choice."""
        chosen: list[tuple[int | None, np.ndarray]] = [(0, self._points[0])]

        def is_new(point: np.ndarray) -> bool:
            return all(np.abs(point - other).max() > DISTINCT for _, other in chosen)

        scores = np.array([trial.score for trial in self.trials[: len(self._points)]])
        recommended = recommend(np.array(self._points), scores, self._study.optimizer.seed)
        best_first = [int(i) for i in np.argsort(-scores, kind="stable") if self.trials[i].feasible]
        # The recommendation takes one of the places, but never the only one.
        places = count - 1 if recommended is not None and count > 1 else count
        for i in best_first:
            if len(chosen) <= places and is_new(self._points[i]):
                chosen.append((i, self._points[i]))
        if recommended is not None and len(chosen) <= count and is_new(recommended):
            chosen.append((None, recommended))
        return chosen

    def _judged(self, point: np.ndarray, stage: str, replicas: int | None) -> tuple[Trial, Evaluation | None]:
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
            trial, evaluation = self._judge.trial(number, point, stage, replicas)
            self._record.append(trial, evaluation, time.perf_counter() - began)
        self.trials.append(trial)
        if number + 1 >= len(self._record.trials):
            self._report(stage)
        return trial, evaluation

    def _report(self, stage: str) -> None:
        if self._progress:
            settings = self._study.optimizer
            total = settings.evaluations + 1 + settings.confirm
            best = max((t.score for t in self.trials if t.feasible and t.stage == stage), default=None)
            self._progress(len(self.trials), total, best)
