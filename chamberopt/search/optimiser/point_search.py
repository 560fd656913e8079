"""Search the unit cube for the best score, with one algorithm after another on one budget.

A caller asks for the next point, evaluates it, and tells its score. The budget is a number of
evaluations, and each algorithm with its share of the budget is a phase of the search.

A search ends for one of these reasons:

1. The budget is spent: what is left of `optimizer.evaluations` is less than a whole evaluation
   (SearchEndedError). A point that got only a few replicas, as it is clearly worse than the best
   point, costs a part of an evaluation. A point that cannot be simulated, or that geometry alone
   shows to be no better, costs nothing, until there are as many of these points as the budget.
2. All points were evaluated, where every parameter has a finite number of values.
3. It has converged: the last phase ends because the steps of its local algorithm are below
   `optimizer.tolerance` (nlopt_search.py), or rounds of local searches find no new point.
4. Nothing is left to gain: by the model, no point is better than the best by as much as counts
   (possible_gain in acquisition.py).
5. The user stops it: run_study.py asks `stop()` before each evaluation, finishes those that run and
   raises KeyboardInterrupt. The study can be resumed.
6. An error ends it: the start cannot be simulated, an algorithm cannot take the parameters, the
   disk is full, or workers are lost. A candidate that cannot be simulated does not end it.

A phase ends in the same ways, at its share of the budget.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Sequence
from contextlib import closing, suppress
from typing import Literal

import numpy as np

from chamberopt.search.optimiser.acquisition import possible_gain, propose_point
from chamberopt.search.optimiser.domain import Axis, Domain
from chamberopt.search.optimiser.gaussian_process import MAX_POINTS
from chamberopt.search.optimiser.nlopt_search import LOCAL, NloptThread
from chamberopt.search.optimiser.search_model import POINTS_PER_PARAMETER, Observations, SearchModel
from chamberopt.search.study.schema import Optimizer, Phase

# Two phases are not algorithms of NLopt: evenly spread points, and the model of the scores.
SPREAD, MODEL = "sobol", "surrogate"
AUTO = (SPREAD, MODEL, LOCAL)
# Two objectives have no single score to climb. Each step of the model weights them differently.
PARETO_PHASES = (Phase(algorithm="sobol", share=0.3), Phase(algorithm="surrogate", share=0.7))
# "auto" spreads this share of the budget, or two points per parameter plus two if that is more,
# and then follows the model. BOBYQA takes over where there are more points than the model can
# hold. Measured in benchmarks/optimizers.py.
SPREAD_SHARE, SPREAD_PER_PARAMETER = 0.3, 2
# The model may have missed a peak between its points. Every 4th step therefore assumes half the
# fitted length scales, so that the model is less certain away from its points.
ROUGH_STEP_INTERVAL, ROUGH_LENGTH_FACTOR = 4, 0.5
# First steps of the local searches from the best point so far, as factors of the initial step.
LOCAL_STEP_FACTORS = (1.0, 0.5, 0.25)
# What the model proposes and geometry refuses costs nothing. It is pulled back to the middle of it
# and the best point, up to so many times, until it can be simulated: the best often lies at the
# edge of what can be built, which the model knows less sharply.
HALVINGS = 3
ROUNDING = 1e-9  # of a sum of costs

Observe = Callable[[], Observations]
"""Returns what the model learns from the first points, those with scores."""
Wait = Generator[np.ndarray | None, None, None]
"""Yields points to evaluate, and None where it needs one more score first."""


End = Literal["budget", "values", "converged", "gain"]
"""Why a search ended: reasons 1 to 4 above."""


class SearchEndedError(Exception):
    """Raised inside an algorithm when its phase, or the search, has no more points to evaluate."""


class PointSearch:
    """Searches the unit cube for the point with the largest score, beginning at the start.

    Each point is asked for once. Evenly spread points and points of the model may be evaluated
    `settings.batch` at a time: the next point is proposed when all but the last `batch - 1` points
    have scores. Other algorithms take one point after another. The same seed and the same scores
    give the same search. `points` (d,) are all points that were asked for. `scores` are the scores
    of the first of these points. `phases` are the algorithms that ran. `possible_gain` is what may
    still be gained, at most, by the model's last look, and infinite before the first.

    Args:
        start: first point, shape (d,).
        settings: the table [optimizer] of the study: algorithm, budget and so on.
        observe: function that returns what the model learns; by default these are the scores, with
            unknown noise.
        domain: which values each parameter can have; by default any value.
        begin_with: points (d,) that are evaluated after the start.
    """

    def __init__(
        self,
        start: np.ndarray,
        settings: Optimizer,
        observe: Observe | None = None,
        domain: Domain | None = None,
        begin_with: Sequence[np.ndarray] = (),
    ) -> None:
        self._settings, self._budget = settings, settings.evaluations
        self._domain = domain or Domain([Axis()] * len(start))
        self._observe = observe or self._scores_without_noise
        self._rng = np.random.default_rng(settings.seed)
        self._numbers: dict[bytes, int] = {}  # by the exact bytes of the point
        self._costs: list[float] = []  # of the scores
        self.points: list[np.ndarray] = []
        self.scores: list[float] = []
        self.phases: list[str] = []
        self.possible_gain, self._counts = math.inf, 0.0
        self._steps = self._search([start, *begin_with])

    def ask(self) -> np.ndarray | None:
        """Return the next point (d,) to evaluate.

        The result is None if scores of earlier points must be told first, and when the search has
        ended. Raises InputError if an algorithm cannot take these parameters.
        """
        return next(self._steps, None)

    def tell(self, score: float, cost: float = 1.0) -> None:
        """Take the score of the oldest point that has no score yet.

        Args:
            score: a finite number, to be maximised.
            cost: cost of the point's evaluation: 1 with all replicas, less with fewer replicas.
        """
        self.scores.append(score)
        self._costs.append(cost)

    @property
    def ended_by(self) -> End:
        """Why a search that has ended did so, if nobody stopped it."""
        if self.possible_gain < self._counts:
            return "gain"
        if len(self.points) >= self._domain.size:
            return "values"
        return "budget" if self._whole_left(self._budget) < 1 else "converged"

    @property
    def spent(self) -> float:
        """Cost of all points with scores, where an evaluation with all its replicas costs 1."""
        return sum(self._costs)

    def _search(self, first: Sequence[np.ndarray]) -> Wait:
        settings = self._settings
        with closing(NloptThread(settings.seed)) as nlopt, suppress(SearchEndedError):
            for point in first:
                yield from self._evaluate(point, self._budget)
            for phase, end in self._plan():
                yield from self._run(phase, max(1, round(end * self._budget)), nlopt)
            if settings.algorithm == "auto" and not settings.phases:
                yield from self._repeat_climbs(nlopt)

    def _repeat_climbs(self, nlopt: NloptThread) -> Wait:
        """Repeat rounds of local searches with smaller steps until a round finds no new point."""
        before = 0
        while before < len(self.points):
            before = len(self.points)
            for factor in LOCAL_STEP_FACTORS:
                step = factor * self._settings.initial_step
                yield from self._climb(LOCAL, self._budget, step, nlopt)

    def _plan(self) -> list[tuple[str, float]]:
        """Return the algorithm of each phase, and the share of the budget at the phase's end."""
        phases, budget = self._settings.phases, self._budget
        if phases:
            ends = np.cumsum([phase.share for phase in phases]).tolist()
            return list(zip([phase.algorithm for phase in phases], [*ends[:-1], 1.0], strict=True))
        if self._settings.algorithm != "auto":
            return [(self._settings.algorithm, 1.0)]
        modelled = min(budget, MAX_POINTS)
        spread = max(SPREAD_SHARE * modelled, SPREAD_PER_PARAMETER * len(self._domain) + 2)
        counts = (spread, modelled, budget)
        return [(phase, min(1.0, n / budget)) for phase, n in zip(AUTO, counts, strict=True)]

    def _run(self, phase: str, limit: int, nlopt: NloptThread) -> Wait:
        """Run an algorithm until it converges, or until all points so far cost `limit`."""
        limit = min(limit, self._budget)
        left = yield from self._left(limit)
        if not left:
            return
        self.phases.append(phase)
        if phase == SPREAD:
            yield from self._spread(limit, left)
        elif phase == MODEL:
            yield from self._follow_model(limit)
        else:
            yield from self._climb(phase, limit, self._settings.initial_step, nlopt)

    def _spread(self, limit: int, wanted: int) -> Wait:
        from scipy.stats.qmc import Sobol

        sobol = Sobol(len(self._domain), seed=self._settings.seed)
        for point in sobol.random_base2(max(1, (wanted - 1).bit_length()))[:wanted]:
            yield from self._evaluate(self._snapped(point), self._budget)

    def _follow_model(self, limit: int) -> Wait:
        if not self.scores:
            yield from self._wait()
        halvings: dict[int, int] = {}  # that are left, by the position of a point of this phase
        while True:
            yield from self._wait(self._settings.batch - 1)
            if not (yield from self._left(limit)):
                return
            seen, points = self._observe(), np.array(self.points)
            refused = [k for k in halvings if k < len(seen.scores) and not seen.simulated[k]]
            if refused:
                left = halvings.pop(refused[-1]) - 1
                best = points[np.argmax(np.where(seen.simulated, seen.scores, -np.inf))]
                middle = self._snapped(0.5 * (points[refused[-1]] + best))
                if left >= 0 and middle.tobytes() not in self._numbers:
                    halvings[(yield from self._evaluate(middle, self._budget))] = left
                    continue
            if np.ptp(seen.scores[seen.simulated]) == 0.0:  # nothing to learn
                point = self._snapped(self._rng.random(len(self._domain)))
            else:
                is_rough = len(points) % ROUGH_STEP_INTERVAL == 0
                factor = ROUGH_LENGTH_FACTOR if is_rough else 1.0
                model = SearchModel(self._domain, points, seen, factor)
                if not is_rough:
                    self._require_gain(model, seen)
                point = propose_point(model, self._rng)
            halvings[(yield from self._evaluate(point, self._budget))] = HALVINGS

    def _require_gain(self, model: SearchModel, seen: Observations) -> None:
        """Raise SearchEndedError if nothing is left to gain that counts.

        A model of fewer than POINTS_PER_PARAMETER points for each parameter does not tell.
        """
        if seen.counts and seen.simulated.sum() >= POINTS_PER_PARAMETER * len(self._domain):
            self.possible_gain, self._counts = (
                possible_gain(model, self._settings.seed),
                seen.counts,
            )
            if self.possible_gain < self._counts:
                raise SearchEndedError

    def _climb(self, algorithm: str, limit: int, step: float, nlopt: NloptThread) -> Wait:
        """Run an algorithm of NLopt from the best point so far, and yield each point to evaluate.

        Args:
            algorithm: NLopt's name of the algorithm.
            limit: cost of all points of the search, in evaluations, at which the algorithm ends.
            step: first step, as a share of the unit cube's side.
            nlopt: thread in which NLopt runs.
        """
        yield from self._wait()
        best = self.points[int(np.argmax(self.scores))]
        # Some algorithms keep asking for points that have scores already: 100 calls per point of
        # the budget end them.
        run = nlopt.points(best, algorithm, step, self._settings.tolerance, 100 * self._budget)
        try:
            with closing(run), suppress(StopIteration):
                point = next(run)
                while True:
                    number = yield from self._evaluate(self._snapped(point), limit)
                    yield from self._wait()
                    point = run.send(self.scores[number])
        except SearchEndedError:
            if limit >= self._budget:
                raise

    def _evaluate(self, point: np.ndarray, limit: int) -> Generator[np.ndarray | None, None, int]:
        """Ask for a point unless it was asked for already, and return its position in `points`.

        Raises SearchEndedError if the point is new and `limit` evaluations, or the whole budget,
        are spent.
        """
        key = point.tobytes()
        if key not in self._numbers:
            yield from self._wait(self._settings.batch - 1)
            if not (yield from self._left(limit)):
                raise SearchEndedError
            self._numbers[key] = len(self.points)
            self.points.append(point)
            yield point
        return self._numbers[key]

    def _left(self, limit: int) -> Generator[np.ndarray | None, None, int]:
        """Return how many more whole evaluations may begin before all evaluations cost `limit`.

        If none may begin, wait for the evaluations that run, because they may cost less than a
        whole evaluation.
        """
        if len(self.points) >= self._domain.size:
            return 0
        for _ in range(2):
            if left := self._whole_left(limit):
                return left
            yield from self._wait()
        return 0

    def _whole_left(self, limit: int) -> int:
        """Return how many more whole evaluations may begin if those that run cost 1 each."""
        free = max(0, self._costs.count(0.0) - self._budget)
        running = len(self.points) - len(self.scores)
        left = min(limit, self._budget) - math.fsum(self._costs) - free - running
        return max(0, int(left + ROUNDING))

    def _wait(self, running: int = 0) -> Wait:
        """Wait for scores until at most the last `running` points have none."""
        while len(self.points) - len(self.scores) > running:
            yield None

    def _snapped(self, point: np.ndarray) -> np.ndarray:
        snapped: np.ndarray = self._domain.snap(point[None])[0]
        return snapped

    def _scores_without_noise(self) -> Observations:
        scores = np.array(self.scores)
        return Observations(scores, np.zeros(len(scores)), np.ones(len(scores), dtype=bool))
