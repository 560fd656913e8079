"""When a search stops, and the points and scores it has until then.

A search ends for one of these reasons:

1. The budget is spent: what is left of `optimizer.evaluations` is less than a whole evaluation
   (BudgetSpentError). A point that got only a few replicas, as it is clearly worse than the best,
   costs a part of one. A point that cannot be simulated, or that geometry alone shows to be no
   better, costs nothing, until there are as many of those as the budget.
2. All points were evaluated, where every parameter has levels.
3. It has converged: the last phase ends because the steps of its local algorithm are below
   `optimizer.tolerance` (nlopt_search.py), or rounds of local searches find no new point
   (maximise.py).
4. The user stops it: Candidates asks `stop()` before each evaluation, finishes those that run and
   raises KeyboardInterrupt. The study can be resumed.
5. An error ends it: the start cannot be simulated, an algorithm cannot take the parameters, the
   disk is full, or workers are lost. A candidate that cannot be simulated does not end it.

A phase ends in the same way, at its share of the budget.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

import numpy as np


class Scored(NamedTuple):
    """A score, a finite number to be maximised, and its cost: 1 for a whole evaluation, or less."""

    score: float
    cost: float = 1.0


ROUNDING = 1e-9  # of a sum of costs

Begin = Callable[[np.ndarray], Callable[[], Scored]]
"""begin(point (d,) of the unit cube) starts an evaluation, and returns a function that waits for
its score."""


class BudgetSpentError(Exception):
    """Ends a phase, or the search, from inside an algorithm."""


class ScoredPoints:
    """The points of a search; each is evaluated once.

    Up to `batch` evaluations run at a time. Scores are taken in the order in which the evaluations
    began, so that nothing depends on which of them ends first. `points` (d,) are all that began,
    of `size` that there are; the first of them have `scores`. `best` is the point with the highest
    score, or the start.
    """

    def __init__(
        self, begin: Begin, start: np.ndarray, budget: int, batch: int, size: float = math.inf
    ) -> None:
        self._begin, self.budget, self._batch, self._size = begin, budget, batch, size
        self._numbers: dict[bytes, int] = {}  # by the exact bytes of the point
        self._running: deque[Callable[[], Scored]] = deque()
        self._costs: list[float] = []  # of the scores
        self.points: list[np.ndarray] = []
        self.scores: list[float] = []
        self.best, self._best_score = start, -np.inf

    def left(self, limit: int) -> int:
        """How many more whole evaluations may begin, until they and those before cost `limit`.

        Where none is left, those that run are waited for: they may turn out to cost less.
        """
        if len(self.points) >= self._size:
            return 0
        for _ in range(2):
            free = max(0, self._costs.count(0.0) - self.budget)
            running = len(self.points) - len(self.scores)
            left = min(limit, self.budget) - math.fsum(self._costs) - free - running
            if left > 1.0 - ROUNDING:
                return int(left + ROUNDING)
            self.wait()
        return 0

    def score(self, point: np.ndarray, limit: int | None = None) -> float:
        """The score of a point, which nothing else is evaluated beside; errors as of `begin`."""
        number = self.begin(point, limit)
        self.wait()
        return self.scores[number]

    def begin(self, point: np.ndarray, limit: int | None = None) -> int:
        """Begin to evaluate a point, unless that was done; returns its place in `points`.

        BudgetSpentError if it is new, and `limit` or the budget has no place for it.
        """
        key = point.tobytes()
        if key not in self._numbers:
            self.wait_for_place()
            if not self.left(self.budget if limit is None else limit):
                raise BudgetSpentError
            self._running.append(self._begin(point))
            self._numbers[key] = len(self.points)
            self.points.append(point)
        return self._numbers[key]

    def wait_for_place(self) -> None:
        """Wait until one more evaluation may run."""
        self.wait(self._batch - 1)

    def wait(self, running: int = 0) -> None:
        """Wait for the scores of all evaluations but the last so many."""
        while len(self._running) > running:
            value, cost = self._running.popleft()()
            self._costs.append(cost)
            if value > self._best_score:
                self.best, self._best_score = self.points[len(self.scores)], value
            self.scores.append(value)
