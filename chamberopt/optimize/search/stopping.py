"""When a search stops, and the scores it has until then.

A search ends for one of these reasons:

1. The budget is spent: `optimizer.evaluations` different points have scores (BudgetSpentError).
2. It has converged: the last phase ends because the steps of its local algorithm are below
   `optimizer.tolerance` (nlopt_search.py), or rounds of local searches find no new point
   (maximise.py).
3. The user stops it: Candidates asks `stop()` before each evaluation and raises KeyboardInterrupt.
   The study can be resumed.
4. An error ends it: the start cannot be simulated, an algorithm cannot take the parameters, the
   disk is full, or workers are lost. A candidate that cannot be simulated does not end it.

A phase ends in the same way, at its share of the budget.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

Score = Callable[[np.ndarray], float]
"""score(point (d,) of the unit cube) -> finite number to be maximised."""


class BudgetSpentError(Exception):
    """Ends a phase, or the search, from inside an algorithm."""


class ScoredPoints:
    """The points that a search has scored; each is scored once and counts once in the budget.

    `points` (d,) are in the order of evaluation; `best` is the highest so far, or the start.
    """

    def __init__(self, score: Score, start: np.ndarray, budget: int) -> None:
        self._score, self.budget = score, budget
        self._scores: dict[bytes, float] = {}  # by the exact bytes of the point
        self.points: list[np.ndarray] = []
        self.best, self._best_score = start, -np.inf

    def __len__(self) -> int:
        return len(self.points)

    @property
    def scores(self) -> np.ndarray:
        """Scores (n,) in the order of evaluation."""
        return np.array(list(self._scores.values()))

    def score(self, point: np.ndarray, limit: int | None = None) -> float:
        """The score of a point.

        BudgetSpentError if it is new, and there are `limit` points, or as many as the budget.
        """
        key = point.tobytes()
        if key not in self._scores:
            if len(self) >= min(self.budget, self.budget if limit is None else limit):
                raise BudgetSpentError
            value = float(self._score(point))
            self._scores[key] = value
            self.points.append(point)
            if value > self._best_score:
                self.best, self._best_score = point, value
        return self._scores[key]
