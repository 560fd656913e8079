"""Candidates of a study, sets of parameter values with their designs, and their evaluation."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import BrokenExecutor
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.errors import InputError, UnreadableError, WorkerLostError
from chamberopt.common.estimate import Estimate, paired_difference
from chamberopt.coverage.metrics import highest_objective
from chamberopt.search.study.constraints import (
    FEASIBLE,
    INFEASIBLE,
    NOT_KNOWN,
    Violation,
    assess_feasibility,
    exact,
)
from chamberopt.simulation.effort import narrows
from chamberopt.simulation.estimates import objective_estimate
from chamberopt.simulation.evaluation import Evaluation

if TYPE_CHECKING:
    from chamberopt.design.design import Design
    from chamberopt.search.study import Study
    from chamberopt.search.study.parameters import ParameterSpace


# Share of an evaluation with all its replicas that is spent before the first of them ends: chamber,
# search tree, reach (benchmarks/study_cores.py).
SET_UP = 0.25

Simulator = Callable[["Design", str, "int | None"], Evaluation]
"""simulator(design, stream of seeds, number of replicas or None) evaluates one candidate; it raises
InputError or an error of sim_core for a candidate that cannot be simulated."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A set of values of a study's varied parameters, with its design, to be evaluated once."""

    number: int  # of its trial
    stage: str  # "search", "sweep", or "confirm" for one with new seeds, or to be measured anew
    point: np.ndarray  # place in the unit cube, (d,)
    space: ParameterSpace = field(repr=False)
    replicas: int | None = None  # that a confirmation gets; by default as the design says
    # Number of replicas after which it ends if these are enough; None if it gets all.
    first: int | None = None
    # Lower end of the best objective's interval so far: a candidate of a search that is clearly
    # below it is not worth more replicas.
    bar: float | None = None

    @cached_property
    def parameters(self) -> dict[str, float | str]:
        """Values of the varied parameters by dotted name, in the units of the design file."""
        return self.space.values_at(self.point)

    @cached_property
    def design(self) -> Design:
        """The study's design with these parameters. Raises InputError if it cannot have them."""
        return self.space.design_at(self.point)

    @property
    def is_start(self) -> bool:
        """Whether this is the first candidate of a search: the study's own design, unchanged."""
        return self.number == 0 and self.stage == "search"


@dataclass(frozen=True)
class Figures:
    """The objectives and metrics of an evaluated candidate."""

    goals: tuple[Estimate, ...]  # of each objective of the study
    metrics: Mapping[str, Estimate]
    # Both None if they were measured.
    replicas: int | None = None
    evaluation: Evaluation | None = field(default=None, repr=False)


def simulated_figures(study: Study, candidate: Candidate, evaluation: Evaluation) -> Figures:
    """Return the objectives and metrics of a simulated candidate from its evaluation."""
    metrics, (_, *others) = evaluation.metrics, study.objective.goals
    more = (objective_estimate(name, metrics, candidate.design) for name in others)
    return Figures((evaluation.objective, *more), metrics, evaluation.replicas, evaluation)


def limited_figures(study: Study, candidate: Candidate, figures: Figures) -> dict[str, Estimate]:
    """Return a candidate's figures that have limits, by name.

    The limits hold for metrics, and for numbers of the design, which are exact.
    """
    known = exact(candidate.parameters) | dict(figures.metrics)
    return {
        name: known[name] if name in known else Estimate(study.design.value(name), 0.0)
        for name in study.all_constraints
    }


@dataclass(frozen=True)
class ConfirmedCandidate:
    """A candidate that was evaluated again with new seeds, to confirm its figures."""

    searched: int | None  # number of its trial in the search; None if the model recommended it
    candidate: Candidate
    figures: Figures
    # FEASIBLE if the whole intervals of the constrained figures are within their limits, INFEASIBLE
    # if one is outside, else NOT_KNOWN.
    feasibility: str
    violations: tuple[Violation, ...]  # of limits, certain or possible
    goals: tuple[Estimate, ...]  # of each objective of the study
    # What the design's tolerances cost of the first objective on average, by the search's model;
    # those of numbers that do not vary are not in it. 0 if there is no model.
    lost_to_tolerances: float = 0.0

    @property
    def parameters(self) -> dict[str, float | str]:
        return self.candidate.parameters

    @property
    def design(self) -> Design:
        return self.candidate.design

    @property
    def evaluation(self) -> Evaluation:
        """The whole evaluation of a candidate that was simulated."""
        assert self.figures.evaluation is not None
        return self.figures.evaluation

    @property
    def feasible(self) -> bool:
        return self.feasibility == FEASIBLE

    @property
    def reason(self) -> str:
        """A text on the limits that the candidate violates, or may violate."""
        return "; ".join(one.text for one in self.violations)


def close_to_best(confirmed: Sequence[ConfirmedCandidate]) -> list[ConfirmedCandidate]:
    """Return the best candidate and the candidates that more replicas may tell from it.

    The list is empty if the best candidate is clearly better than all others, or if what hides the
    difference is in all replicas.
    """
    feasible = [one for one in confirmed if one.feasibility != INFEASIBLE]
    if not feasible:
        return []
    best = max(feasible, key=lambda one: one.goals[0].value)
    others = [one for one in feasible if one is not best]
    lead = [paired_difference(best.goals[0], one.goals[0]) for one in others]
    close = [one for one, by in zip(others, lead, strict=True) if by.low <= 0.0 and narrows(by)]
    return [best, *close] if close else []


class RefusedError(InputError):
    """Raised for a candidate that its geometry rules out before anything is simulated."""


class NoPromiseError(RefusedError):
    """Raised for a candidate not worth a simulation, as its objective cannot exceed `highest`."""

    def __init__(self, text: str, highest: float) -> None:
        super().__init__(text)
        self.highest = highest


class CandidateEvaluator:
    """Evaluates the candidates of a study with a simulator."""

    def __init__(self, study: Study, simulator: Simulator) -> None:
        self._study, self._simulator = study, simulator

    def evaluate(self, candidate: Candidate) -> Evaluation | InputError:
        """Simulate a candidate and return its evaluation, or the error why this is impossible.

        Confirmations have new seeds and the accuracy of the design. All other candidates have the
        seeds and the accuracy of the search. Several threads may call this function at a time.

        Raises:
            InputError or an error of sim_core: the start of a search cannot be simulated.
            UnreadableError: a file that the design names cannot be read now.
        """
        from sim_core import SceneError, SimulationError

        try:
            evaluation = self._evaluate(candidate)
            goals = simulated_figures(self._study, candidate, evaluation).goals
            if not all(math.isfinite(goal.value) for goal in goals):
                raise InputError(f"its objective is {goals[0].value}, not a number to compare")
        except (InputError, SceneError, SimulationError) as error:
            if candidate.is_start or isinstance(error, UnreadableError):
                raise
            return error if isinstance(error, InputError) else InputError(str(error))
        except Exception as error:
            # A fault of the program or the machine, not of the candidate: it is not recorded.
            values = ", ".join(f"{name} = {one!r}" for name, one in candidate.parameters.items())
            error.add_note(f"in evaluation {candidate.number + 1} ({candidate.stage}): {values}")
            raise
        return evaluation

    def has_promise(self, candidate: Candidate) -> bool:
        """Return whether a candidate can be built and may be as good as the best candidate so far.

        The share of the target that balls can reach limits its objective.
        """
        try:
            design = self._study.at_search_accuracy(candidate.design)
            self._require_buildable(design)
            self._require_promise(design, candidate.bar)
        except UnreadableError:
            raise
        except InputError:
            return False
        return True

    def _evaluate(self, candidate: Candidate) -> Evaluation:
        design, stream = candidate.design, "confirm"
        if candidate.stage != "confirm":
            design, stream = self._study.at_search_accuracy(design), "search"
            if candidate.stage == "search" and not candidate.is_start:
                self._require_buildable(design)
            self._require_promise(design, candidate.bar)
        if candidate.first is not None:
            found = self._simulate(design, stream, candidate.first)
            if self._tells_enough(candidate, found):
                return found
        return self._simulate(design, stream, candidate.replicas)

    def _tells_enough(self, candidate: Candidate, found: Evaluation) -> bool:
        """Return whether a candidate needs no more replicas than its first.

        In a search this is so if it is clearly worse than the best, or if what is asked of it has
        a number: the model of the scores takes noise, and further replicas are worth no more than
        further candidates (benchmarks/optimizers.py: ours against ours-sure). In a confirmation it
        is so if more would tell nothing that the study asks for.
        """
        if candidate.bar is not None and found.objective.high < candidate.bar:
            return True
        figures = simulated_figures(self._study, candidate, found)
        limits = self._study.all_constraints
        limited = limited_figures(self._study, candidate, figures)
        if candidate.stage == "search":
            return all(one.has_number for one in (*figures.goals, *limited.values()))
        if not found.resolution.has_places:
            return False
        is_known = assess_feasibility(limits, limited)[0] != NOT_KNOWN
        return is_known and not any(map(narrows, figures.goals))

    def _require_buildable(self, design: Design) -> None:
        """Raise RefusedError if a candidate has no chamber, or one with a gap in which balls jam.

        It is found by geometry, without a simulation.
        """
        from sim_core import SceneError

        find_fault = getattr(self._simulator, "unbuildable", None)
        try:
            fault = find_fault(design) if find_fault is not None else ""
        except UnreadableError:
            raise
        except (InputError, SceneError) as error:
            raise RefusedError(str(error)) from None
        if fault:
            raise RefusedError(f"not simulated: {fault}")

    def _require_promise(self, design: Design, bar: float | None) -> None:
        """Raise NoPromiseError if a candidate is clearly worse than the best candidate so far.

        The share of the target that balls can reach limits its objective, without a simulation.

        Args:
            bar: value that the best objective so far has at least; None if there is no objective
                yet.
        """
        find_reachable = getattr(self._simulator, "reachable", None)
        goals = self._study.objective.goals
        if bar is None or find_reachable is None or len(goals) > 1:
            return
        reachable = find_reachable(design)
        highest = highest_objective(goals[0], reachable)
        if highest < bar:
            raise NoPromiseError(
                f"not simulated: {1.0 - reachable:.1%} of the target is out of reach of the balls, "
                f"so that the objective is at most {highest:.4g}, and the best's is at least "
                f"{bar:.4g}",
                highest,
            )

    def _simulate(self, design: Design, stream: str, replicas: int | None) -> Evaluation:
        try:
            return self._simulator(design, stream, replicas)
        except WorkerLostError:  # the executor has tried twice already
            raise
        except BrokenExecutor:  # the executor may have recovered from a lost worker
            return self._simulator(design, stream, replicas)


def evaluation_cost(replicas: int, all_replicas: int) -> float:
    """Return the cost of some replicas of a candidate over the cost of all its replicas."""
    return SET_UP + (1.0 - SET_UP) * replicas / all_replicas
