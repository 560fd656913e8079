"""Turn the figures of a study's candidate into a trial: score, penalty, feasibility and cost."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from chamberopt.common.errors import InputError
from chamberopt.common.estimate import Estimate
from chamberopt.coverage.metrics import find_metric, unit_of_objective
from chamberopt.search.candidate import (
    Candidate,
    Figures,
    NoPromiseError,
    RefusedError,
    evaluation_cost,
    limited_figures,
)
from chamberopt.search.study.constraints import describe_violations, expected_violation
from chamberopt.search.trial_log import Trial

if TYPE_CHECKING:
    from chamberopt.search.study import Study

# Score of a candidate that cannot be simulated: this many units of the objective below the start.
# It is finite, because NLopt's models fail with inf and NaN.
FAILURE_PENALTY = 2.0
COUNTS = 0.01  # gain that counts, in units of the objective, if the design asks for no accuracy


class Judge:
    """Judges candidates by the objectives and limits of a study: score, penalty, feasibility, cost.

    A search sets `reference` to the score of the start, the study's own design, from which the
    score of a failed candidate follows. It sets `unit`, by which penalties are multiplied, to the
    size of the largest term of the start's objective.
    """

    def __init__(self, study: Study) -> None:
        self._study, self.reference, self.unit = study, 0.0, 1.0
        self._replicas = study.at_search_accuracy(study.design).process.accuracy.replicas
        self._first_look = study.first_look

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the figures that a candidate must have: objectives, and metrics with limits."""
        limited = (name for name in self._study.all_constraints if find_metric(name))
        return tuple(dict.fromkeys((*self._study.objective.goals, *limited)))

    @property
    def counts(self) -> float:
        """Smallest gain of the objective that counts; 0 with two objectives, where any may.

        It is the accuracy that the design asks for, else COUNTS, in units of the start's objective:
        a share of 1, or of the start's time.
        """
        if len(self._study.objective.goals) > 1:
            return 0.0
        wanted = self._study.design.process.accuracy.objective_half_width
        return (wanted or COUNTS) * self.unit

    def unit_of(self, figures: Figures) -> float:
        """Return the unit of the first objective of a candidate with these figures."""
        name, objective = self._study.objective.goals[0], figures.goals[0]
        return unit_of_objective(name, figures.metrics, objective)

    def measured(self, told: Mapping[str, Estimate | float]) -> Figures:
        """Return the figures of a candidate that was measured instead of simulated.

        Raises InputError if a figure in `names` is missing, or if a figure is not finite.

        Args:
            told: measured figures by name; a number without an interval is exact.
        """
        if missing := [name for name in self.names if name not in told]:
            raise InputError(f"tell: {missing[0]} is missing; give {', '.join(self.names)}")
        figures = {name: _finite(name, one) for name, one in told.items()}
        return Figures(tuple(figures[name] for name in self._study.objective.goals), figures)

    def cost(self, trial: Trial) -> float:
        """Return what a trial of the search has cost, as a share of a trial with all replicas.

        The cost is 0 if the candidate was not simulated. It follows from the number of replicas,
        not from a clock, so that it is the same on all computers.
        """
        if not trial.goals:
            return 0.0
        few = self._first_look
        return 1.0 if few is None or trial.replicas != few else evaluation_cost(few, self._replicas)

    def trial(self, candidate: Candidate, answer: Figures | InputError) -> Trial:
        """Return the trial of a candidate, a row of the trial log.

        Args:
            answer: the candidate's figures, or the reason why it has none.
        """
        worst = self.reference - FAILURE_PENALTY * self.unit
        at = candidate.number, candidate.stage, tuple(candidate.point.tolist())
        failed = Trial(*at, candidate.parameters, (), {}, 0.0, worst, False, "")
        if isinstance(answer, InputError):
            highest = answer.highest if isinstance(answer, NoPromiseError) else None
            score = worst if highest is None else highest
            refused = isinstance(answer, RefusedError)
            return replace(
                failed, reason=str(answer), score=score, highest=highest, refused=refused
            )
        unit = self.unit_of(answer) if candidate.is_start else self.unit
        figures = limited_figures(self._study, candidate, answer)
        constraints = self._study.all_constraints
        penalty = sum(expected_violation(figures[k], limits) for k, limits in constraints.items())
        violations = [
            text
            for name, limits in constraints.items()
            for text in describe_violations(name, figures[name], limits)
        ]
        return replace(
            failed,
            goals=answer.goals,
            # Without pseudo-values, which a confirmation has in a file of its own.
            metrics={
                name: replace(one, pseudovalues=(), bias=0.0, shared=())
                for name, one in answer.metrics.items()
            },
            penalty=penalty,
            score=answer.goals[0].value - unit * penalty,
            feasible=not violations,
            reason="; ".join(violations),
            replicas=answer.replicas,
            reachable=None if answer.evaluation is None else answer.evaluation.reachable,
        )


def _finite(name: str, given: Estimate | float) -> Estimate:
    """Return a measured figure as an estimate; a number without an interval is exact.

    Raises InputError if the figure is not finite.
    """
    if isinstance(given, Estimate):
        if math.isfinite(given.value) and given.half_width >= 0.0:
            return given
    elif isinstance(given, (int, float)) and math.isfinite(given):
        return Estimate(float(given), 0.0)
    raise InputError(f"tell: {name}: given {given!r}; give a finite number, or an Estimate of it")
