"""Run a search as questions and answers: it asks for candidates, and is told their figures.

    search = Search(study)
    while (candidate := search.ask()) is not None:
        search.tell(candidate, measure(candidate.design))
    search.best.parameters

A candidate is a design to evaluate. Its figures, the objectives and metrics, may come from a
simulation or from experiments. A trial is a candidate with its figures. First the search asks for
new candidates, then for the best of them again, to confirm them with new seeds. A sweep asks for
the candidates of a given list.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.errors import InputError, UnreadableError
from chamberopt.common.estimate import Estimate
from chamberopt.common.progress import Progress
from chamberopt.coverage.metrics import highest_objective
from chamberopt.search.candidate import (
    Candidate,
    ConfirmedCandidate,
    Figures,
    RefusedError,
    close_to_best,
    limited_figures,
    simulated_figures,
)
from chamberopt.search.judge import Judge
from chamberopt.search.observe import FIRST_OBJECTIVE, fit_model, observe
from chamberopt.search.optimiser.acquisition import recommend_points
from chamberopt.search.optimiser.point_search import PARETO_PHASES, End, PointSearch
from chamberopt.search.optimiser.scalarisation import draw_weights
from chamberopt.search.optimiser.search_model import Observations, SearchModel
from chamberopt.search.study.constraints import NOT_KNOWN, assess_feasibility
from chamberopt.search.study.parameters import ParameterSpace
from chamberopt.search.trial_log import HISTORY, Trial
from chamberopt.simulation.evaluation import Evaluation

if TYPE_CHECKING:
    from chamberopt.search.study import Study
    from chamberopt.search.study_folder import StudyFolder

# Candidates nearer to each other than this share of the bounds count as one in the confirmation.
MIN_DISTANCE = 0.02

Answer = Evaluation | Mapping[str, Estimate | float] | InputError | str
"""The evaluation of a simulation, measured figures by their names, or why there are none."""
Place = tuple[int | None, np.ndarray]
"""The number of a trial in the search, or None, and its point (d,)."""


@dataclass
class _Asked:
    """A candidate that the search has asked for, and whose figures it has not taken yet."""

    candidate: Candidate
    began: float  # by the clock [s]
    recorded: Trial | None = None
    # What is known without an evaluation: its answer on record, or why there cannot be one.
    answer: Figures | InputError | None = None


class Search:
    """Runs the search of a study: asks for candidates, and is told their figures.

    Up to `optimizer.batch` candidates may be under evaluation at a time. Their figures are told in
    the order in which the candidates were asked for, and the next candidate follows from the
    figures told so far, so that nothing depends on speed. `trials` are all candidates with their
    figures. `confirmed` are the candidates that were evaluated again with new seeds.

    Args:
        folder: where trials are recorded; trials on record are not asked for again. By default
            nothing is recorded.
        progress: called after each trial as progress(done, total, best score). It counts in trials
            of a sweep. Of a study it counts in evaluations with all replicas that the search gives
            to a candidate, and `total` is the most that may follow, so that it never grows.
        points: the candidates of a sweep as points of the unit cube, shape (n, d); by default the
            search finds its candidates itself.
        has_promise: whether a candidate that was never evaluated is worth a confirmation.
    """

    def __init__(
        self,
        study: Study,
        folder: StudyFolder | None = None,
        progress: Progress | None = None,
        points: np.ndarray | None = None,
        has_promise: Callable[[Candidate], bool] | None = None,
    ) -> None:
        self._study, self._folder, self._progress = study, folder, progress
        self._has_promise = has_promise or (lambda one: _why_impossible(one) is None)
        self._judge = Judge(study)
        counts_worst = study.objective.over_tolerances == "worst"
        self.space = ParameterSpace(study.design, study.vary, counts_worst)
        self.trials: list[Trial] = []
        self.confirmed: tuple[ConfirmedCandidate, ...] = ()
        self._asked: deque[_Asked] = deque()
        self._answers: dict[int, Figures] = {}  # of confirmations, by number
        self._best: dict[str, float] = {}  # score among the feasible trials of each stage
        self._last_end = 0.0  # of an evaluation, by the clock
        # Of the confirmation, in evaluations: what a candidate of this round costs, what is done,
        # and the most that is left. They only tell the progress.
        self._round_cost, self._confirm_done = 0.0, 0.0
        self._confirm_left = confirmation_cost(study)
        settings = study.optimizer
        if study.objective.pareto and settings.algorithm == "auto" and not settings.phases:
            settings = settings.model_copy(update={"phases": PARETO_PHASES})
        snap, first = self.space.domain.snap, [self.space.point_of(x) for x in study.begin_with]
        self._search = PointSearch(
            self.space.start,
            settings,
            self.observations,
            self.space.domain,
            [snap(point[None])[0] for point in first],
        )
        self._sweep = points
        self._steps = (
            self._begin_search()
            if points is None
            else (self._candidate("sweep", point) for point in points)
        )

    def ask(self) -> Candidate | None:
        """Return the next candidate to evaluate.

        The result is None if figures of earlier candidates must be told first, and when the search
        has ended. Raises InputError if an algorithm cannot take the study's parameters.
        """
        while True:
            candidate = next(self._steps, None)
            if candidate is not None:
                asked = self._with_answer(candidate)
                self._asked.append(asked)
                if asked.answer is None:
                    return candidate
            elif self._asked and self._asked[0].answer is not None:
                self._take(self._asked[0].answer)
            else:
                return None

    def tell(self, candidate: Candidate, answer: Answer) -> Trial:
        """Take the figures of the oldest candidate without figures, and return its trial.

        Args:
            answer: an evaluation, measured figures by name, or the reason why there are no figures.
                Measured figures are at least the names in `figures`; a number without an interval
                is exact.
        Raises:
            InputError: an older candidate has no figures yet, a figure is missing or not finite, or
                the start has no figures.
        """
        self._require_turn(candidate)
        given = self._read(candidate, answer)
        if candidate.is_start and isinstance(given, InputError):
            text = f"tell: the design as it is has no figures ({given}), which all others are"
            raise InputError(f"{text} compared with; change the design")
        while self._asked[0].answer is not None:
            self._take(self._asked[0].answer)
        return self._take(given)

    @property
    def figures(self) -> tuple[str, ...]:
        """Names of the figures that `tell` needs: the objectives, and the metrics with limits."""
        return self._judge.names

    @property
    def phases(self) -> str:
        """The algorithms that the search has used in turn, e.g. "sobol, then surrogate"."""
        return ", then ".join(self._search.phases)

    @property
    def counts(self) -> float:
        """Smallest gain of the objective that counts; 0 with two objectives."""
        return self._judge.counts

    @property
    def possible_gain(self) -> float:
        """What may still be gained at most, by the search's model or the objective's definition."""
        return min(self._search.possible_gain, self._below_highest)

    @property
    def ended_by(self) -> End:
        """Why a search that has ended did so."""
        return "gain" if self._below_highest < self.counts else self._search.ended_by

    @property
    def _below_highest(self) -> float:
        """How far the best objective so far is, at most, below what no design exceeds."""
        return highest_objective(self._study.objective.goals[0], 1.0) - self._best_low

    @property
    def best(self) -> ConfirmedCandidate:
        """The confirmed candidate with the best first objective that meets the constraints.

        If no candidate surely meets the constraints, candidates that may meet them count. Raises
        InputError if the search has not ended, if the start (the unchanged design) could not be
        confirmed, or if no candidate meets the constraints.
        """
        start = self.confirmed[0] if self.confirmed else None
        if start is None or start.searched != 0:
            reasons = [one.reason for one in self.trials if one.stage == "confirm"]
            text = "the start could not be simulated with the seeds of the confirmation"
            raise InputError(f"{text}: {reasons[0]}" if reasons else "best: the search goes on")
        unknown = [one for one in self.confirmed if one.feasibility == NOT_KNOWN]
        winners = [one for one in self.confirmed if one.feasible] or unknown
        if not winners:
            history = self._folder.path / HISTORY if self._folder else None
            where = f"; every evaluation is in {history}" if history else ""
            raise InputError(
                f"constraints: no candidate meets them (the start: {start.reason}); loosen them, "
                f"widen [vary] or raise optimizer.evaluations{where}"
            )
        return max(winners, key=lambda one: one.goals[0].value - one.lost_to_tolerances)

    def observations(self, weight: np.ndarray | None = None) -> Observations:
        """Return what the model of the search learns from the trials so far.

        Args:
            weight: weights of two objectives in the score, (2,); by default random weights for this
                step.
        """
        if weight is None:
            weight = draw_weights(self._study.optimizer.seed, len(self._search.points))
        searched = [trial for trial in self.trials if trial.stage == "search"]
        seen = observe(searched, self._study.all_constraints, weight)
        return replace(seen, counts=self.counts)

    @cached_property
    def objective_model(self) -> SearchModel | None:
        """Model of the first objective, fitted to all trials of a search that has ended.

        The reach of the balls limits the objective of candidates that were not simulated; the model
        also learns these limits. It is None if there are too few points for a model.
        """
        return self._model(FIRST_OBJECTIVE, learns_bounds=True)

    def _model(self, weight: np.ndarray, learns_bounds: bool = False) -> SearchModel | None:
        """Return a model of the score, fitted to all trials of the search; see `fit_model`."""
        searched = [trial for trial in self.trials if trial.stage == "search"]
        limits = self._study.all_constraints
        return fit_model(self.space.domain, searched, limits, weight, learns_bounds)

    # Questions. None where the candidates that are out must be told first.

    def _candidate(
        self,
        stage: str,
        point: np.ndarray,
        replicas: int | None = None,
        first: int | None = None,
        bar: float | None = None,
    ) -> Candidate:
        number = len(self.trials) + len(self._asked)
        return Candidate(number, stage, point, self.space, replicas, first, bar)

    def _begin_search(self) -> Iterator[Candidate | None]:
        while (point := self._next_point()) is not None or self._asked:
            if point is None:
                yield None
            else:
                bar = self._best_low if self.trials else None
                is_start = not self.trials and not self._asked
                few = None if is_start else self._study.first_look
                yield self._candidate("search", point, first=few, bar=bar)
        yield from self._confirm()

    def _next_point(self) -> np.ndarray | None:
        """Return the next point (d,) of the search; None if there is none yet, or none any more."""
        return None if self._below_highest < self.counts else self._search.ask()

    @property
    def _best_low(self) -> float:
        """What the search's best objective is at least: the highest lower end of all intervals."""
        searched = (one for one in self.trials if one.stage == "search" and one.feasible)
        return max((one.objective.low for one in searched if one.objective), default=-np.inf)

    def _confirm(self) -> Iterator[Candidate | None]:
        """Ask for the start and the best candidates with new seeds and the design's own accuracy.

        Each gets more replicas than in the search, unless the first of them tell that more would
        bring nothing. If the design asks for an accuracy, this sets the number of replicas. While
        the noise of replicas hides which candidate is best, and the study has rounds left, the
        close candidates and the start get twice the replicas. Candidates whose evaluation fails are
        left out.
        """
        settings = self._study.optimizer
        asks_for_accuracy = self._study.design.process.accuracy.objective_half_width is not None
        replicas = None if asks_for_accuracy else settings.confirm_replicas
        first = self._study.first_look_of_confirmation
        places = self._promising(settings.confirm)
        confirmed: dict[int, ConfirmedCandidate] = {}  # by position in places
        again = list(range(len(places)))
        for number in range(settings.confirm_rounds):
            self._round_cost = confirmation_cost(self._study, 1, number, rounds=1)
            self._confirm_left = confirmation_cost(self._study, len(again), number)
            begun = []
            for i in again:
                while len(self._asked) >= settings.batch:
                    yield None
                begun.append(self._candidate("confirm", places[i][1], replicas, first))
                yield begun[-1]
            while self._asked:
                yield None
            for i, candidate in zip(again, begun, strict=True):
                if (one := self._confirmed(places[i][0], candidate)) is not None:
                    confirmed[i] = one
            best = close_to_best(list(confirmed.values())) if replicas else []
            again = [i for i, one in confirmed.items() if i == 0 or any(one is x for x in best)]
            replicas, first = 2 * (replicas or 0), None
            if not best:
                break
        self.confirmed = tuple(confirmed.values())
        self._confirm_left = 0.0
        self._tell_progress(None)

    def _confirmed(self, searched: int | None, candidate: Candidate) -> ConfirmedCandidate | None:
        """Return a candidate with its confirmed figures; None if its evaluation failed.

        Args:
            searched: number of the candidate's trial in the search; None if the search did not
                evaluate it.
        """
        figures = self._answers.pop(candidate.number, None)
        if figures is None:
            return None
        limited = limited_figures(self._study, candidate, figures)
        standing = assess_feasibility(self._study.all_constraints, limited)
        lost = self._lost_to_tolerances(candidate.point)
        return ConfirmedCandidate(searched, candidate, figures, *standing, figures.goals, lost)

    def _lost_to_tolerances(self, point: np.ndarray) -> float:
        model = self.objective_model
        if model is None or not model.domain.has_misses:
            return 0.0
        lost = float(model.score(point[None])[0][0] - model.expected(point[None])[0][0])
        return max(0.0, lost)  # where the model rises beyond a bound, nobody has looked

    def _promising(self, count: int) -> list[Place]:
        """Return the start and up to `count` other points to confirm, each with its trial number.

        With one objective, these are the best feasible candidates and the two points that the model
        recommends, of which one was evaluated. With two objectives, these are the points that the
        model recommends for `count` weights, from one end of the Pareto front to the other.
        """
        points, best_low = self._search.points, self._best_low
        chosen: list[Place] = [(0, points[0])]
        numbers = {point.tobytes(): i for i, point in reversed(list(enumerate(points)))}
        for point in self._wanted(count):
            number = numbers.get(point.tobytes())
            is_new = all(np.abs(point - other).max() > MIN_DISTANCE for _, other in chosen)
            if (
                len(chosen) <= count
                and is_new
                and (
                    number is not None
                    or self._has_promise(self._candidate("search", point, bar=best_low))
                )
            ):
                chosen.append((number, point))
        return chosen

    def _wanted(self, count: int) -> list[np.ndarray]:
        """Return points (d,) that are worth a confirmation, the most promising first.

        Some of the points may be equal, or nearly so.
        """
        has_two_objectives = len(self._study.objective.goals) > 1
        first = (np.arange(count) + 0.5) / count
        weights = np.stack([first, 1.0 - first], axis=1) if has_two_objectives else FIRST_OBJECTIVE
        models = [self._model(weight) for weight in np.atleast_2d(weights)]
        seed, points = self._study.optimizer.seed, self._search.points
        recommended = [recommend_points(model, seed) for model in models if model is not None]
        best_first = np.argsort(-np.array(self._search.scores), kind="stable").tolist()
        seen = [points[i] for i in best_first if self.trials[i].feasible]
        if has_two_objectives:
            return [new for _, new in recommended] or seen
        # The luckiest one first, then what the model recommends, then the next ones.
        by_model = (one for both in recommended for one in reversed(both))
        return [*seen[:1], *by_model, *seen[1:]]

    # Answers.

    def _with_answer(self, candidate: Candidate) -> _Asked:
        """Return a candidate with its answer, if the answer is known without an evaluation.

        The answer is known if it is on record, or if the design cannot have the candidate's
        parameters.
        """
        asked = _Asked(candidate, time.perf_counter())
        if self._folder:
            place = candidate.number, candidate.stage, candidate.point.tolist()
            asked.recorded = self._folder.recorded.find(*place)
        if asked.recorded is not None:
            in_file = candidate.stage == "confirm" and asked.recorded.objective is not None
            found = self._folder.evaluation(asked.recorded) if self._folder and in_file else None
            asked.answer = self._read(candidate, found or asked.recorded.reason)
        elif candidate.stage != "sweep" and not candidate.is_start:  # workers make those of a sweep
            asked.answer = _why_impossible(candidate)
        return asked

    def _require_turn(self, candidate: Candidate) -> None:
        """Raise InputError unless no older candidate than this waits for its figures."""
        first = next((one.candidate for one in self._asked if one.answer is None), None)
        if first is not None and candidate is first:
            return
        if getattr(candidate, "space", None) is not self.space:
            raise InputError(f"tell: given {candidate!r}; give a candidate that ask returned")
        number = candidate.number + 1
        if first is None or not any(candidate is one.candidate for one in self._asked):
            raise InputError(f"tell: candidate {number} was told already")
        raise InputError(
            f"tell: candidate {number} comes after {first.number + 1}, which has no figures yet; "
            "tell in the order of ask"
        )

    def _read(self, candidate: Candidate, answer: Answer) -> Figures | InputError:
        if isinstance(answer, Evaluation):
            return simulated_figures(self._study, candidate, answer)
        if isinstance(answer, Mapping):
            return self._judge.measured(answer)
        return InputError(answer) if isinstance(answer, str) else answer

    def _take(self, answer: Figures | InputError) -> Trial:
        """Make the trial of the oldest candidate without a trial from its answer, and return it."""
        asked = self._asked[0]
        trial = asked.recorded or self._record(asked, answer)
        self._asked.popleft()
        self.trials.append(trial)
        self._learn(asked.candidate, trial, answer)
        # Trials from the record but the last one are not shown.
        known = len(self._folder.recorded.trials) if self._folder else 0
        if trial.stage == "confirm":
            self._confirm_done += self._round_cost
            self._confirm_left -= self._round_cost
        if len(self.trials) >= known:
            # The best of the few that are confirmed would look like a fall of the best so far.
            self._tell_progress(None if trial.stage == "confirm" else self._best.get(trial.stage))
        return trial

    def _record(self, asked: _Asked, answer: Figures | InputError) -> Trial:
        trial = self._judge.trial(asked.candidate, answer)
        # The clock's seconds of evaluations that run at a time count once.
        now = time.perf_counter()
        seconds, self._last_end = now - max(asked.began, self._last_end), now
        if self._folder:
            whole = answer.evaluation if isinstance(answer, Figures) else None
            self._folder.append(trial, whole, seconds)
        return trial

    def _learn(self, candidate: Candidate, trial: Trial, answer: Figures | InputError) -> None:
        if candidate.is_start:
            self._judge.reference = trial.score
            self._judge.unit = self._judge.unit_of(Figures(trial.goals, trial.metrics))
        if candidate.stage == "search":
            self._search.tell(trial.score, self._judge.cost(trial))
        elif candidate.stage == "confirm" and isinstance(answer, Figures):
            self._answers[candidate.number] = answer
        if trial.feasible:
            self._best[trial.stage] = max(trial.score, self._best.get(trial.stage, -math.inf))

    def _tell_progress(self, best: float | None) -> None:
        """Tell what is done and the most that there will be, and the best score so far.

        Candidates that cost only a part of an evaluation, or nothing, leave budget for more
        candidates. So trials would be no measure.
        """
        if self._progress is None:
            return
        if best is not None and self._study.objective.is_cost:
            best = -best  # as its figure is shown
        if self._sweep is not None:
            self._progress(len(self.trials), len(self._sweep), best)
            return
        budget = self._study.optimizer.evaluations
        is_over = any(one.stage == "confirm" for one in self.trials[-1:])
        searched = budget if is_over else min(self._search.spent, budget)
        whole = _whole(budget + self._confirm_done + self._confirm_left)
        left = _whole(budget - searched + self._confirm_left)
        self._progress(whole - left, whole, best)


def _whole(cost: float) -> int:
    """Return a cost rounded up to whole evaluations, but for rounding errors."""
    return math.ceil(cost - 1e-6)


def most_evaluations(study: Study) -> int:
    """Return the most evaluations that a study may take, its confirmation included."""
    return _whole(study.optimizer.evaluations + confirmation_cost(study))


def confirmation_cost(
    study: Study, count: int | None = None, begin: int = 0, rounds: int | None = None
) -> float:
    """Return the most that rounds of confirmation may cost, in evaluations of the search.

    Args:
        count: number of candidates in each; by default all that are confirmed and the start.
        begin: number of the first round.
        rounds: number of rounds; by default all that may follow.
    """
    settings, accuracy = study.optimizer, study.design.process.accuracy
    count = 1 + settings.confirm if count is None else count
    if accuracy.objective_half_width is not None:  # one round, in which it sets the replicas
        return float(count) if begin == 0 else 0.0
    each = settings.confirm_replicas / accuracy.replicas
    end = settings.confirm_rounds if rounds is None else begin + rounds
    # A further round doubles the replicas, and keeps those that there are.
    return count * sum(each * 2.0 ** max(0, number - 1) for number in range(begin, end))


def _why_impossible(candidate: Candidate) -> InputError | None:
    """Return the error why the design cannot have a candidate's parameters; None if it can."""
    try:
        _ = candidate.design
    except UnreadableError:
        raise
    except InputError as error:
        return RefusedError(str(error))
    return None
