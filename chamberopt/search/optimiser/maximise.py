"""The phases of a search: one algorithm after another on one budget."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from chamberopt.search.optimiser.acquisition import propose_point
from chamberopt.search.optimiser.domain import Axis, Domain
from chamberopt.search.optimiser.gaussian_process import MAX_POINTS
from chamberopt.search.optimiser.nlopt_search import LOCAL, run_nlopt, seed_nlopt
from chamberopt.search.optimiser.search_model import Observations, SearchModel
from chamberopt.search.optimiser.stopping import Begin, BudgetSpentError, ScoredPoints
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

Observe = Callable[[], Observations]
"""Returns what the model learns from the first points, those whose evaluations have ended."""


def maximise(
    begin: Begin,
    start: np.ndarray,
    settings: Optimizer,
    observe: Observe | None = None,
    domain: Domain | None = None,
    begin_with: Sequence[np.ndarray] = (),
) -> str:
    """Maximise a score over the unit cube, beginning at `start`.

    The function `begin` is called once per different point and keeps its own record; the same seed
    and the same scores give the same search. stopping.py lists the reasons to stop.

    Evenly spread points and those of the model are evaluated `settings.batch` at a time: the next
    is proposed when all but the last `batch - 1` have scores. Other algorithms take one point after
    another.

    Args:
        start: first point, shape (d,).
        observe: what the model learns; by default the scores, with unknown noise.
        domain: which values each parameter can have; by default any.
        begin_with: points (d,) that are evaluated after the start.
    Returns:
        The phases that ran, e.g. "sobol, then surrogate".
    Raises:
        InputError: an algorithm cannot take these parameters. Errors of `begin` pass unchanged.
    """
    search = _Search(begin, start, settings, observe, domain or Domain([Axis()] * len(start)))
    try:
        for point in (start, *begin_with):
            search.scored.begin(point)
        for phase, end in search.plan():
            search.run(phase, max(1, round(end * settings.evaluations)))
        if settings.algorithm == "auto" and not settings.phases:
            search.repeat_local_search()
    except BudgetSpentError:
        pass
    search.scored.wait()
    return ", then ".join(search.phases_run) or "none"


class _Search:
    """A search under way."""

    def __init__(
        self,
        begin: Begin,
        start: np.ndarray,
        settings: Optimizer,
        observe: Observe | None,
        domain: Domain,
    ) -> None:
        self._start, self._settings, self._domain = start, settings, domain
        budget, batch = settings.evaluations, settings.batch
        self.scored = ScoredPoints(begin, start, budget, batch, domain.size)
        self._observe = observe or self._scores_without_noise
        self.phases_run: list[str] = []
        self._rng = np.random.default_rng(settings.seed)
        seed_nlopt(settings.seed)

    def plan(self) -> list[tuple[str, float]]:
        """The phases, and the share of the budget at which each ends."""
        phases, budget = self._settings.phases, self._settings.evaluations
        if phases:
            ends = np.cumsum([phase.share for phase in phases]).tolist()
            return list(zip([phase.algorithm for phase in phases], [*ends[:-1], 1.0], strict=True))
        if self._settings.algorithm != "auto":
            return [(self._settings.algorithm, 1.0)]
        modelled = min(budget, MAX_POINTS)
        spread = max(SPREAD_SHARE * modelled, SPREAD_PER_PARAMETER * len(self._start) + 2)
        counts = (spread, modelled, budget)
        return [(phase, min(1.0, n / budget)) for phase, n in zip(AUTO, counts, strict=True)]

    def run(self, phase: str, limit: int) -> None:
        """Run one phase until it converges or there are `limit` points."""
        limit = min(limit, self.scored.budget)
        if not self.scored.left(limit):
            return
        self.phases_run.append(phase)
        if phase == SPREAD:
            self._spread(limit)
        elif phase == MODEL:
            self._follow_model(limit)
        else:
            self._search_with_nlopt(phase, limit, self._settings.initial_step)

    def _scores_without_noise(self) -> Observations:
        scores = np.array(self.scored.scores)
        return Observations(scores, np.zeros(len(scores)), np.ones(len(scores), dtype=bool))

    def repeat_local_search(self) -> None:
        """Repeat rounds of local searches with smaller steps until a round finds no new point."""
        before = 0
        while before < len(self.scored.points):
            before = len(self.scored.points)
            for factor in LOCAL_STEP_FACTORS:
                step = factor * self._settings.initial_step
                self._search_with_nlopt(LOCAL, self.scored.budget, step)

    def _spread(self, limit: int) -> None:
        from scipy.stats.qmc import Sobol

        wanted = self.scored.left(limit)
        sobol = Sobol(len(self._start), seed=self._settings.seed)
        for point in sobol.random_base2(max(1, (wanted - 1).bit_length()))[:wanted]:
            self.scored.begin(self._domain.snap(point[None])[0])

    def _follow_model(self, limit: int) -> None:
        if not self.scored.scores:
            self.scored.wait()
        while True:
            self.scored.wait_for_place()
            if not self.scored.left(limit):
                return
            seen, points = self._observe(), np.array(self.scored.points)
            if np.ptp(seen.scores[seen.simulated]) == 0.0:  # nothing to learn
                self.scored.begin(self._domain.snap(self._rng.random((1, len(self._start))))[0])
                continue
            is_rough = len(points) % ROUGH_STEP_INTERVAL == 0
            factor = ROUGH_LENGTH_FACTOR if is_rough else 1.0
            model = SearchModel(self._domain, points, seen, factor)
            self.scored.begin(propose_point(model, self._rng))

    def _search_with_nlopt(self, algorithm: str, limit: int, step: float) -> None:
        # Some algorithms keep asking for points that have scores already: 100 calls per point of
        # the budget end them.
        self.scored.wait()
        max_calls, tolerance = 100 * self.scored.budget, self._settings.tolerance

        def score(point: np.ndarray) -> float:
            return self.scored.score(self._domain.snap(point[None])[0], limit)

        try:
            run_nlopt(score, self.scored.best, algorithm, step, tolerance, max_calls)
        except BudgetSpentError:
            if limit >= self.scored.budget:
                raise
