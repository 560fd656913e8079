"""The candidates of a study: each judged once, remembered, and the best judged again on fresh seeds."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from concurrent.futures import BrokenExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.accuracy import Evaluation
from chamberopt.errors import InputError
from chamberopt.estimate import Estimate
from chamberopt.history import Trial
from chamberopt.record import Record
from chamberopt.replicas import Progress
from chamberopt.surrogate import recommend

if TYPE_CHECKING:
    from chamberopt.config import Design, Limits, Study

# What the optimiser is told of a candidate that could not be simulated: below any uniform_coverage (which
# cannot be less than -0.21), finite because NLopt's models break on inf and NaN.
FAILED_SCORE = -1.0
# Candidates nearer to each other than this share of the bounds count as one when the best are picked.
DISTINCT = 0.02

Stop = Callable[[], bool]
Evaluator = Callable[["Design", str, "int | None"], Evaluation]
"""evaluator(design, stream, replicas) judges one candidate; raises InputError or sim_core's two errors."""


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
        self._study, self._record, self._evaluator = study, record, evaluator
        self._progress, self._stop = progress, stop
        self._low, self._high = np.array(list(study.vary.values()), dtype=float).T
        begin = np.array([study.design.value(name) for name in study.vary], dtype=float)
        self.start = (begin - self._low) / (self._high - self._low)
        self.trials: list[Trial] = []
        self._points: list[np.ndarray] = []

    def score(self, point: np.ndarray) -> float:
        """Judge one point: objective less penalties. The first, the start, raises if it fails."""
        trial, _ = self._judge(point, "search", None)
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
            trial, evaluation = self._judge(point, "confirm", replicas)
            if evaluation is not None:
                design = self._design(point)
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

    def parameters(self, point: np.ndarray) -> dict[str, float]:
        """The varied parameters at a point of the unit cube, in the file's units."""
        if np.array_equal(point, self.start):  # as written in the file: through the unit cube they could be rounded
            return {name: self._study.design.value(name) for name in self._study.vary}
        # BOBYQA can leave the bounds by rounding.
        values = np.clip(self._low + point * (self._high - self._low), self._low, self._high)
        return dict(zip(self._study.vary, values.tolist(), strict=True))

    def _design(self, point: np.ndarray) -> Design:
        return self._study.design.with_values(self.parameters(point))

    def _judge(self, point: np.ndarray, stage: str, replicas: int | None) -> tuple[Trial, Evaluation | None]:
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
            trial, evaluation = self._evaluated(number, point, stage, replicas)
            self._record.append(trial, evaluation, time.perf_counter() - began)
        self.trials.append(trial)
        if number + 1 >= len(self._record.trials):
            self._report(stage)
        return trial, evaluation

    def _evaluated(
        self, number: int, point: np.ndarray, stage: str, replicas: int | None
    ) -> tuple[Trial, Evaluation | None]:
        from sim_core import SceneError, SimulationError

        evaluation: Evaluation | None = None
        score, reason = FAILED_SCORE, ""
        try:
            design = self._design(point)
            design = self._study.drafted(design) if stage == "search" else design
            evaluation = self._simulated(design, stage, replicas)
            if not math.isfinite(evaluation.objective.value):
                raise InputError(f"its objective is {evaluation.objective.value}, not a number to compare")
        except (InputError, SceneError, SimulationError) as error:
            if number == 0:
                raise
            evaluation, reason = None, str(error)
        except Exception as error:  # a fault of ours or of the machine, not of the candidate: it has no place on record
            values = ", ".join(f"{name} = {value!r}" for name, value in self.parameters(point).items())
            error.add_note(f"in evaluation {number + 1} ({stage}): {values}")
            raise
        else:
            missed = [
                miss
                for name, limits in self._study.constraints.items()
                for miss in violations(name, evaluation.metrics[name].value, limits)
            ]
            score = evaluation.objective.value - sum(size for size, _ in missed)
            reason = "; ".join(text for _, text in missed)
        trial = Trial(
            number=number,
            stage=stage,
            point=tuple(point.tolist()),
            parameters=self.parameters(point),
            objective=_bare(evaluation.objective) if evaluation else None,
            metrics={name: _bare(metric) for name, metric in evaluation.metrics.items()} if evaluation else {},
            score=score,
            feasible=not reason,
            reason=reason,
        )
        return trial, evaluation

    def _simulated(self, design: Design, stage: str, replicas: int | None) -> Evaluation:
        try:
            return self._evaluator(design, stage, replicas)
        except BrokenExecutor:  # a worker died: once more, with an executor that may have mended itself
            return self._evaluator(design, stage, replicas)

    def _report(self, stage: str) -> None:
        if self._progress:
            settings = self._study.optimizer
            total = settings.evaluations + 1 + settings.confirm
            best = max((t.score for t in self.trials if t.feasible and t.stage == stage), default=None)
            self._progress(len(self.trials), total, best)


def _bare(estimate: Estimate) -> Estimate:
    """As a row keeps it: without pseudo-values, which a confirmation has in a file of its own."""
    return Estimate(estimate.value, estimate.half_width)


def violations(name: str, value: float, limits: Limits) -> list[tuple[float, str]]:
    """By how much a metric misses its limits, relative to the limit, and in words; empty if it does not."""
    missed = []
    if limits.min is not None and value < limits.min:
        missed.append(((limits.min - value) / (abs(limits.min) or 1.0), f"{name} {value:.4g} < min {limits.min:g}"))
    if limits.max is not None and value > limits.max:
        missed.append(((value - limits.max) / (abs(limits.max) or 1.0), f"{name} {value:.4g} > max {limits.max:g}"))
    return missed
