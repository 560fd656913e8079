"""A candidate judged: from a point of the unit cube to the row that a study's history has of it."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import BrokenExecutor
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.accuracy import Evaluation
from chamberopt.errors import InputError, WorkerLostError
from chamberopt.estimate import Estimate
from chamberopt.history import Trial

if TYPE_CHECKING:
    from chamberopt.config import Design, Limits, Study

# What the optimiser is told of a candidate that could not be simulated: below any uniform_coverage (which
# cannot be less than -0.21), finite because NLopt's models break on inf and NaN.
FAILED_SCORE = -1.0

Evaluator = Callable[["Design", str, "int | None"], Evaluation]
"""evaluator(design, stream, replicas) judges one candidate; raises InputError or sim_core's two errors."""


class Judge:
    """Maps points of the unit cube, shares of a study's bounds, to designs and their figures; remembers none."""

    def __init__(self, study: Study, evaluator: Evaluator) -> None:
        self._study, self._evaluator = study, evaluator
        self._low, self._high = np.array(list(study.vary.values()), dtype=float).T
        begin = np.array([study.design.value(name) for name in study.vary], dtype=float)
        self.start = (begin - self._low) / (self._high - self._low)

    def parameters(self, point: np.ndarray) -> dict[str, float]:
        """The varied parameters at a point of the unit cube, in the file's units."""
        if np.array_equal(point, self.start):  # as written in the file: through the unit cube they could be rounded
            return {name: self._study.design.value(name) for name in self._study.vary}
        # BOBYQA can leave the bounds by rounding.
        values = np.clip(self._low + point * (self._high - self._low), self._low, self._high)
        return dict(zip(self._study.vary, values.tolist(), strict=True))

    def design(self, point: np.ndarray) -> Design:
        return self._study.design.with_values(self.parameters(point))

    def trial(
        self, number: int, point: np.ndarray, stage: str, replicas: int | None = None
    ) -> tuple[Trial, Evaluation | None]:
        """The candidate's row, and its evaluation unless it failed. A search's first, the start, raises if it fails.

        All but a confirmation are judged at the accuracy of a search, on its seeds.
        """
        from sim_core import SceneError, SimulationError

        evaluation: Evaluation | None = None
        score, reason = FAILED_SCORE, ""
        try:
            evaluation = self._evaluation(self.design(point), stage, replicas)
            if not math.isfinite(evaluation.objective.value):
                raise InputError(f"its objective is {evaluation.objective.value}, not a number to compare")
        except (InputError, SceneError, SimulationError) as error:
            if stage == "search" and number == 0:
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

    def _evaluation(self, design: Design, stage: str, replicas: int | None) -> Evaluation:
        """Once more where a worker died: the executor may have mended itself."""
        stream = "confirm" if stage == "confirm" else "search"
        design = design if stage == "confirm" else self._study.drafted(design)
        try:
            return self._evaluator(design, stream, replicas)
        except WorkerLostError:  # it has tried twice itself
            raise
        except BrokenExecutor:
            return self._evaluator(design, stream, replicas)


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
