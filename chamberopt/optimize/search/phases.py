"""Where to look next: phases one after another on one budget, by NLopt on the scores or on a model of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from chamberopt.optimize.search.acquisition import propose_point
from chamberopt.optimize.search.gaussian_process import MOST_POINTS, GaussianProcess
from chamberopt.optimize.search.nlopt_search import LOCAL, run_nlopt, seed_nlopt

# Phases that are not NLopt algorithms: points evenly over the bounds, and a model on which NLopt climbs.
SPREAD, MODEL = "sobol", "surrogate"
AUTO = (SPREAD, MODEL, LOCAL)
# Of two objectives, where no single score rises: each step of the model weighs them anew.
PARETO_PHASES = ((SPREAD, 0.3), (MODEL, 0.7))
# "auto" spreads this share of the budget, or two points per parameter and two more where that is more, and then
# follows the model; BOBYQA takes over where there are more points than a model can hold. benchmarks/optimizers.py.
SPREAD_SHARE, SPREAD_PER_PARAMETER = 0.3, 2
# Every so many steps the model is taken to be rougher than it seems, its length scales this times the fitted: it may
# have missed a peak between its points.
DOUBT_EVERY, ROUGH = 4, 0.5
# First steps of the local searches, in shares of the bounds, one after another from the best so far.
STEP = 0.15
SMALLER = (1.0, 0.5, 0.25)
# A step this small, in shares of the bounds, moves a simulated score less than its noise.
TOLERANCE = 0.02

Seen = Callable[[], tuple[np.ndarray, np.ndarray]]
"""Scores (n,) and their variances (n,) of the points judged so far, in order, as the model is to learn them."""


def maximise(
    score: Callable[[np.ndarray], float],
    start: np.ndarray,
    algorithm: str,
    budget: int,
    seed: int,
    *,
    step: float = STEP,
    tolerance: float = TOLERANCE,
    phases: Sequence[tuple[str, float]] = (),
    seen: Seen | None = None,
) -> str:
    """Maximise over the unit cube with `budget` calls of `score`, the first at `start`; says which phases ran.

    score(point (n,)) -> finite float is called once per different point and keeps its own record: NLopt's
    return value is never looked at. algorithm: "auto" or a phase; phases, in its place: several, with their shares of
    the budget, the last has what the others leave. step, tolerance: of local algorithms, in shares of the bounds.
    seen: what the model learns from; absent: the scores, their noise unknown. The same seed and the same answers make
    the same search.

    Raises InputError for an algorithm that cannot take these parameters, and whatever `score` raises.
    """
    search = _Search(score, start, budget, seed, step, tolerance, seen)
    try:
        search.judge(start)
        if phases:
            ends = np.cumsum([share for _, share in phases]).tolist()
            plan = list(zip([name for name, _ in phases], [*ends[:-1], 1.0], strict=True))
        else:
            plan = search.auto_plan() if algorithm == "auto" else [(algorithm, 1.0)]
        for phase, end in plan:
            search.run(phase, max(1, round(end * budget)))
        if algorithm == "auto" and not phases:
            search.search_and_confirm(LOCAL)
    except _BudgetSpentError:
        pass
    return ", then ".join(search.ran) or "none"


class _BudgetSpentError(Exception):
    """Ends a phase or the search from inside an algorithm."""


class _Search:
    """The points judged and what is left of the budget; a point seen before costs nothing."""

    def __init__(
        self,
        score: Callable[[np.ndarray], float],
        start: np.ndarray,
        budget: int,
        seed: int,
        step: float,
        tolerance: float,
        seen: Seen | None,
    ) -> None:
        self._score, self._start, self._budget, self._seed = score, start, budget, seed
        self._step, self._tolerance = step, tolerance
        self._seen = seen or (
            lambda: (np.array(list(self.scores.values())), np.zeros(len(self.scores)))
        )
        self.scores: dict[bytes, float] = {}  # by the point's exact bytes
        self.points: list[np.ndarray] = []
        self.ran: list[str] = []
        self._best, self._best_score = start, -np.inf
        self._rng = np.random.default_rng(seed)
        seed_nlopt(seed)

    def auto_plan(self) -> list[tuple[str, float]]:
        """The phases of "auto", and how far into the budget each goes."""
        modelled = min(self._budget, MOST_POINTS)
        spread = max(SPREAD_SHARE * modelled, SPREAD_PER_PARAMETER * len(self._start) + 2)
        ends = (spread, modelled, self._budget)
        return [
            (phase, min(1.0, end / self._budget)) for phase, end in zip(AUTO, ends, strict=True)
        ]

    def run(self, phase: str, stop_at: int) -> None:
        """One phase, until it converges or so many points are judged."""
        if len(self.scores) >= min(stop_at, self._budget):
            return
        self.ran.append(phase)
        if phase == SPREAD:
            self._spread(stop_at)
        elif phase == MODEL:
            self._follow_model(stop_at)
        else:
            self._climb(phase, stop_at, self._step)

    def search_and_confirm(self, algorithm: str) -> None:
        """Rounds of local searches with ever smaller steps, until the budget or no new point comes."""
        spent = 0
        while spent < len(self.scores):
            spent = len(self.scores)
            for smaller in SMALLER:
                self._climb(algorithm, self._budget, smaller * self._step)

    def _spread(self, stop_at: int) -> None:
        from scipy.stats.qmc import Sobol

        wanted = min(stop_at, self._budget) - len(self.scores)
        for point in Sobol(len(self._start), seed=self._seed).random_base2(
            max(1, (wanted - 1).bit_length())
        )[:wanted]:
            self.judge(point)

    def _follow_model(self, stop_at: int) -> None:
        while len(self.scores) < min(stop_at, self._budget):
            scores, variances = self._seen()
            if np.ptp(scores) == 0.0:  # nothing to learn from
                self.judge(self._rng.random(len(self._start)))
                continue
            rough = ROUGH if len(self.points) % DOUBT_EVERY == 0 else 1.0
            self.judge(
                propose_point(
                    GaussianProcess(np.array(self.points), scores, variances, rough), self._rng
                )
            )

    def _climb(self, algorithm: str, stop_at: int, step: float) -> None:
        def within(point: np.ndarray) -> float:
            if len(self.scores) >= stop_at and point.tobytes() not in self.scores:
                raise _BudgetSpentError
            return self.judge(point)

        try:
            # `most`: a safety net for algorithms that keep asking for points already seen.
            run_nlopt(
                within,
                self._best,
                algorithm,
                step=step,
                tolerance=self._tolerance,
                most=100 * self._budget,
            )
        except _BudgetSpentError:
            if stop_at >= self._budget:
                raise

    def judge(self, point: np.ndarray) -> float:
        """The score of a point, asked for once."""
        key = point.tobytes()
        if key not in self.scores:
            if len(self.scores) >= self._budget:
                raise _BudgetSpentError
            self.points.append(point)
            try:
                self.scores[key] = float(self._score(point))
            except BaseException:
                self.points.pop()
                raise
            if self.scores[key] > self._best_score:
                self._best, self._best_score = point, self.scores[key]
        return self.scores[key]
