"""Evaluate one candidate: from a point of the unit cube to its row of the trial log."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from concurrent.futures import BrokenExecutor
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.common.errors import InputError, UnreadableError, WorkerLostError
from chamberopt.common.estimate import Estimate
from chamberopt.coverage.metrics import find_metric, highest_objective, parse_objective
from chamberopt.search.study.constraints import describe_violations, exact, expected_violation
from chamberopt.search.study.parameters import ParameterSpace
from chamberopt.search.trial_log import Trial
from chamberopt.simulation.estimates import weighted_sum
from chamberopt.simulation.evaluation import Evaluation

if TYPE_CHECKING:
    from chamberopt.design.design import Design
    from chamberopt.search.study import Study

# Score of a candidate that cannot be simulated: this many units of the objective below the start.
# It is finite, because NLopt's models fail with inf and NaN.
FAILURE_PENALTY = 2.0
# Share of an evaluation with all its replicas that is spent before the first of them ends: chamber,
# search tree, reach (benchmarks/study_cores.py).
SET_UP = 0.25

Simulator = Callable[["Design", str, "int | None"], Evaluation]
"""simulator(design, stream of seeds, number of replicas or None) evaluates one candidate; it raises
InputError or an error of sim_core for a candidate that cannot be simulated."""


class NoPromiseError(InputError):
    """A candidate is not worth a simulation: its objective is at most `highest`."""

    def __init__(self, text: str, highest: float) -> None:
        super().__init__(text)
        self.highest = highest


class Reference(NamedTuple):
    """What scores are measured by, known once the start is evaluated."""

    score: float = 0.0  # of the start
    unit: float = 1.0  # of the objective, see CandidateEvaluator.unit


class CandidateEvaluator:
    """Evaluates the candidates of a study; a search sets `reference` once it has the start."""

    def __init__(self, study: Study, simulator: Simulator) -> None:
        self._study, self._simulator = study, simulator
        counts_worst = study.objective.over_tolerances == "worst"
        self.space = ParameterSpace(study.design, study.vary, counts_worst)
        self.reference = Reference()
        self._first_look = study.first_look
        self._replicas = study.at_search_accuracy(study.design).process.accuracy.replicas

    def goals(self, evaluation: Evaluation) -> tuple[Estimate, ...]:
        """Estimate of each objective of the study."""
        metrics, (_, *others) = evaluation.metrics, self._study.objective.goals
        return evaluation.objective, *(weighted_sum(parse_objective(x), metrics) for x in others)

    def constrained(
        self, parameters: Mapping[str, float | str], evaluation: Evaluation
    ) -> dict[str, Estimate]:
        """The figures that may have limits: metrics, and numbers of the design, which are exact."""
        figures = exact(parameters) | evaluation.metrics
        design = self._study.design
        others = (name for name in self._study.all_constraints if name not in figures)
        return figures | {name: Estimate(design.value(name), 0.0) for name in others}

    def evaluate(
        self,
        number: int,
        point: np.ndarray,
        stage: str,
        replicas: int | None = None,
        best_low: float | None = None,
    ) -> Evaluation | InputError:
        """Simulate the candidate at a point (d,); the error with the reason if that is impossible.

        Several threads may call this at a time.

        Args:
            stage: "search", "confirm" or "sweep"; all but "confirm" are evaluated at the accuracy
                and with the seeds of a search.
            best_low: lower end of the best objective's interval so far. A candidate of a search
                that is clearly below it gets only a few replicas.
        Raises:
            InputError or an error of sim_core: the start of a search cannot be simulated.
            UnreadableError: a file that the design names cannot be read now.
        """
        from sim_core import SceneError, SimulationError

        try:
            evaluation = self._evaluate(self.space.design_at(point), stage, replicas, best_low)
            goals = self.goals(evaluation)
            if not all(math.isfinite(goal.value) for goal in goals):
                raise InputError(f"its objective is {goals[0].value}, not a number to compare")
        except (InputError, SceneError, SimulationError) as error:
            if is_start(number, stage) or isinstance(error, UnreadableError):
                raise
            return error if isinstance(error, InputError) else InputError(str(error))
        except Exception as error:
            # A fault of the program or the machine, not of the candidate: it is not recorded.
            parameters = self.space.values_at(point)
            values = ", ".join(f"{name} = {value!r}" for name, value in parameters.items())
            error.add_note(f"in evaluation {number + 1} ({stage}): {values}")
            raise
        return evaluation

    def cost(self, trial: Trial) -> float:
        """What a trial of the search took of an evaluation with all replicas; 0 if not simulated.

        It follows from the number of replicas, not from a clock, so that it is the same everywhere.
        """
        if not trial.goals:
            return 0.0
        if self._first_look is None or trial.replicas != self._first_look:
            return 1.0
        return evaluation_cost(self._first_look, self._replicas)

    def trial(
        self, number: int, point: np.ndarray, stage: str, evaluation: Evaluation | InputError
    ) -> Trial:
        """The row of an evaluated candidate; its score needs `reference`."""
        parameters = self.space.values_at(point)
        worst = self.reference.score - FAILURE_PENALTY * self.reference.unit
        at = tuple(point.tolist())
        failed = Trial(number, stage, at, parameters, (), {}, 0.0, worst, False, "")
        if isinstance(evaluation, NoPromiseError):
            highest = evaluation.highest
            return replace(failed, reason=str(evaluation), score=highest, highest=highest)
        if isinstance(evaluation, InputError):
            return replace(failed, reason=str(evaluation))
        unit = self.reference.unit
        if is_start(number, stage):
            unit = self.unit(evaluation.metrics)
        goals = self.goals(evaluation)
        figures, constraints = self.constrained(parameters, evaluation), self._study.all_constraints
        penalty = sum(expected_violation(figures[k], limits) for k, limits in constraints.items())
        violations: list[str] = []
        for name, limits in constraints.items():
            violations += describe_violations(name, figures[name], limits)
        return replace(
            failed,
            goals=goals,
            # Without pseudo-values, which a confirmation has in a file of its own.
            metrics={
                k: replace(one, pseudovalues=(), bias=0.0, shared=())
                for k, one in evaluation.metrics.items()
            },
            penalty=penalty,
            score=goals[0].value - unit * penalty,
            feasible=not violations,
            reason="; ".join(violations),
            replicas=evaluation.replicas,
        )

    def _evaluate(
        self, design: Design, stage: str, replicas: int | None, best_low: float | None
    ) -> Evaluation:
        if stage == "confirm":
            return self._simulate(design, "confirm", replicas)
        design = self._study.at_search_accuracy(design)
        if best_low is not None:
            self._require_promise(design, best_low)
        if best_low is not None and self._first_look is not None:
            first = self._simulate(design, "search", self._first_look)
            if first.objective.high < best_low:
                return first
        return self._simulate(design, "search", replicas)

    def has_promise(self, point: np.ndarray, best_low: float) -> bool:
        """Whether a point can be built and may be better than the best, as far as reach tells."""
        try:
            design = self._study.at_search_accuracy(self.space.design_at(point))
            self._require_promise(design, best_low)
        except UnreadableError:
            raise
        except InputError:
            return False
        return True

    def _require_promise(self, design: Design, best_low: float) -> None:
        """Raise NoPromiseError if reach alone shows that a candidate is worse than the best."""
        find_reachable = getattr(self._simulator, "reachable", None)
        goals = self._study.objective.goals
        if find_reachable is None or len(goals) > 1:
            return
        reachable = find_reachable(design)
        highest = highest_objective(goals[0], reachable)
        if highest < best_low:
            raise NoPromiseError(
                f"not simulated: {1.0 - reachable:.1%} of the target is out of reach of the balls, "
                f"so that the objective is at most {highest:.4g}, and the best's is at least "
                f"{best_low:.4g}",
                highest,
            )

    def _simulate(self, design: Design, stream: str, replicas: int | None) -> Evaluation:
        try:
            return self._simulator(design, stream, replicas)
        except WorkerLostError:  # the executor has tried twice already
            raise
        except BrokenExecutor:  # the executor may have recovered from a lost worker
            return self._simulator(design, stream, replicas)

    def unit(self, metrics: Mapping[str, Estimate]) -> float:
        """Size of one unit of the first objective: that of its largest term.

        For a metric between 0 and 1 this is its weight, for another also the size of the metric.
        """
        sizes = []
        for name, weight in parse_objective(self._study.objective.goals[0]).terms.items():
            metric = find_metric(name)
            is_share = metric is not None and metric.highest <= 1.0
            sizes.append(abs(weight) * (1.0 if is_share else abs(metrics[name].value)))
        return max(sizes) or 1.0


def evaluation_cost(replicas: int, all_replicas: int) -> float:
    """The cost of so many replicas of a candidate, where that of all of them is 1."""
    return SET_UP + (1.0 - SET_UP) * replicas / all_replicas


def is_start(number: int, stage: str) -> bool:
    """Whether this is the first candidate of a search, the design as it is."""
    return number == 0 and stage == "search"
