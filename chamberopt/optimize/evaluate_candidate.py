"""A candidate judged: from a point of the unit cube to the row that a study's history has of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from concurrent.futures import BrokenExecutor
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.common.errors import InputError, WorkerLostError
from chamberopt.coverage.metrics import METRICS, parse_objective
from chamberopt.coverage.statistics.confidence_interval import Estimate
from chamberopt.optimize.constraints import shortfall, violations
from chamberopt.optimize.storage.trial_log import Trial
from chamberopt.simulation.evaluate import weighted_sum
from chamberopt.simulation.evaluation import Evaluation

if TYPE_CHECKING:
    from chamberopt.design.load import Design
    from chamberopt.optimize.study import Study

# What the optimiser is told of a candidate that could not be simulated: so many of the objective's scale below the
# start. Finite because NLopt's models break on inf and NaN.
FAILED = 2.0

Simulator = Callable[["Design", str, "int | None"], Evaluation]
"""simulator(design, stream, replicas) judges one candidate; raises InputError or sim_core's two errors."""


class Reference(NamedTuple):
    """What candidates are measured by: the start's score, and how much a whole unit of the objective is."""

    score: float = 0.0
    scale: float = 1.0


class CandidateEvaluator:
    """Maps points of the unit cube, shares of a study's bounds, to designs and their figures; remembers but the
    ``reference``, which a search sets when it has judged its start.
    """

    def __init__(self, study: Study, simulator: Simulator) -> None:
        self._study, self._evaluator = study, simulator
        self._low, self._high = np.array(list(study.vary.values()), dtype=float).T
        begin = np.array([study.design.value(name) for name in study.vary], dtype=float)
        self.start = (begin - self._low) / (self._high - self._low)
        self.reference = Reference()

    def parameters(self, point: np.ndarray) -> dict[str, float]:
        """The varied parameters at a point of the unit cube, in the file's units."""
        if np.array_equal(
            point, self.start
        ):  # as written in the file: through the unit cube they could be rounded
            return {name: self._study.design.value(name) for name in self._study.vary}
        # BOBYQA can leave the bounds by rounding.
        values = np.clip(self._low + point * (self._high - self._low), self._low, self._high)
        return dict(zip(self._study.vary, values.tolist(), strict=True))

    def design(self, point: np.ndarray) -> Design:
        return self._study.design.changed(self.parameters(point))

    def goals(self, evaluation: Evaluation) -> tuple[Estimate, ...]:
        """Every objective of the study."""
        others = self._study.objective.goals[1:]
        return (
            evaluation.objective,
            *(weighted_sum(parse_objective(name), evaluation.metrics) for name in others),
        )

    def constrained(
        self, parameters: dict[str, float], evaluation: Evaluation
    ) -> dict[str, Estimate]:
        """The figures that the constraints are about: metrics, and numbers of the design, which are exact."""
        design = self._study.design
        return {
            name: evaluation.metrics[name]
            if name in evaluation.metrics
            else Estimate(parameters[name] if name in parameters else design.value(name), 0.0)
            for name in self._study.constraints
        }

    def trial(
        self,
        number: int,
        point: np.ndarray,
        stage: str,
        replicas: int | None = None,
        bar: float | None = None,
    ) -> tuple[Trial, Evaluation | None]:
        """The candidate's row, and its evaluation unless it failed. A search's first, the start, raises if it fails.

        All but a confirmation are judged at the accuracy of a search, on its seeds. bar: of a search, an objective that
        the best has for sure.
        """
        from sim_core import SceneError, SimulationError

        evaluation: Evaluation | None = None
        goals: tuple[Estimate, ...] = ()
        parameters, penalty = self.parameters(point), 0.0
        try:
            evaluation = self._evaluation(self.design(point), stage, replicas, bar)
            goals = self.goals(evaluation)
            if not all(math.isfinite(goal.value) for goal in goals):
                raise InputError(f"its objective is {goals[0].value}, not a number to compare")
        except (InputError, SceneError, SimulationError) as error:
            if stage == "search" and number == 0:
                raise
            evaluation, goals = None, ()
            score, reason = self.reference.score - FAILED * self.reference.scale, str(error)
        except Exception as error:  # a fault of ours or of the machine, not of the candidate: it has no place on record
            values = ", ".join(f"{name} = {value!r}" for name, value in parameters.items())
            error.add_note(f"in evaluation {number + 1} ({stage}): {values}")
            raise
        else:
            first = stage == "search" and number == 0
            unit = (
                scale(self._study.objective.goals[0], evaluation.metrics)
                if first
                else self.reference.scale
            )
            figures = self.constrained(parameters, evaluation)
            penalty = sum(
                shortfall(figures[name], limits) for name, limits in self._study.constraints.items()
            )
            missed = [
                miss
                for name, limits in self._study.constraints.items()
                for miss in violations(name, figures[name], limits)
            ]
            score, reason = goals[0].value - unit * penalty, "; ".join(missed)
        trial = Trial(
            number=number,
            stage=stage,
            point=tuple(point.tolist()),
            parameters=parameters,
            goals=goals,
            metrics={name: _bare(metric) for name, metric in evaluation.metrics.items()}
            if evaluation
            else {},
            penalty=penalty,
            score=score,
            feasible=not reason,
            reason=reason,
        )
        return trial, evaluation

    def _evaluation(
        self, design: Design, stage: str, replicas: int | None, bar: float | None
    ) -> Evaluation:
        """A candidate of the search that a few replicas show to be plainly worse than the best gets no more of them."""
        if stage == "confirm":
            return self._simulate(design, "confirm", replicas)
        design = self._study.at_search_accuracy(design)
        few, accuracy = self._study.optimizer.first_replicas, design.process.accuracy
        if (
            bar is not None
            and 0 < few < accuracy.replicas
            and accuracy.objective_half_width is None
        ):
            first = self._simulate(design, "search", few)
            if len(self._study.objective.goals) == 1 and first.objective.high < bar:
                return first
        return self._simulate(design, "search", replicas)

    def _simulate(self, design: Design, stream: str, replicas: int | None) -> Evaluation:
        """Once more where a worker died: the executor may have mended itself."""
        try:
            return self._evaluator(design, stream, replicas)
        except WorkerLostError:  # it has tried twice itself
            raise
        except BrokenExecutor:
            return self._evaluator(design, stream, replicas)


def _bare(estimate: Estimate) -> Estimate:
    """As a row keeps it: without pseudo-values, which a confirmation has in a file of its own."""
    return Estimate(estimate.value, estimate.half_width)


def scale(goal: str, metrics: Mapping[str, Estimate]) -> float:
    """How much a whole unit of an objective is: its heaviest term, of a metric within 0..1 the weight itself."""
    sizes = [
        abs(weight) * (1.0 if METRICS[name].highest <= 1.0 else abs(metrics[name].value))
        for name, weight in parse_objective(goal).terms.items()
    ]
    return max(sizes) or 1.0
