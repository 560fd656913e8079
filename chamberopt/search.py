"""Where NLopt looks next: a global search, then local ones from its best, on one budget. The only file that imports
nlopt.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from chamberopt.errors import InputError

# Share of the budget "auto" gives to the global search before it refines the best. Measured on three noisy
# toys, 24 and 40 evaluations: MLSL for half, then BOBYQA has the least regret (0.010 at noise 0.02), before
# DIRECT_L then BOBYQA (0.011), MLSL alone (0.017), DIRECT_L alone (0.017), BOBYQA alone (0.04) and CRS2
# (0.08).
GLOBAL_SHARE = 0.5
LOCAL = "LN_BOBYQA"
# First steps of the local searches, in shares of the bounds, one after another from the best so far.
LOCAL_STEPS = (0.15, 0.08, 0.04)
# A step this small, in shares of the bounds, moves a simulated score less than its noise.
LOCAL_TOLERANCE = 0.02


def maximise(score: Callable[[np.ndarray], float], start: np.ndarray, algorithm: str, budget: int, seed: int) -> str:
    """Maximise over the unit cube with `budget` calls of `score`, the first at `start`; says which algorithms
    ran.

    score(point (n,)) -> finite float is called once per different point and keeps its own record: NLopt's
    return value is never looked at. Raises InputError for an algorithm that cannot take these parameters, and
    whatever `score` raises.
    """
    search = _Search(score, start, budget, seed)
    try:
        if algorithm != "auto":
            search.run(algorithm)
            return algorithm
        search.run("GN_MLSL_LDS", share=GLOBAL_SHARE)
        spent = 0
        while spent < len(search.scores):  # the budget, or a round of local searches that brings no new point
            spent = len(search.scores)
            for step in LOCAL_STEPS:
                search.run(LOCAL, step=step)
    except _BudgetSpentError:
        pass
    return algorithm if algorithm != "auto" else f"GN_MLSL_LDS, then {LOCAL}"


class _BudgetSpentError(Exception):
    """Ends a search from inside NLopt's callback."""


class _Search:
    """NLopt algorithms one after another on one budget; a point seen before costs nothing."""

    def __init__(self, score: Callable[[np.ndarray], float], start: np.ndarray, budget: int, seed: int) -> None:
        import nlopt

        self._score, self._start, self._budget = score, start, budget
        self.scores: dict[bytes, float] = {}  # by the point's exact bytes
        self._best, self._best_score = start, -np.inf
        nlopt.srand(seed)  # process-global: set once, before the first algorithm draws
        self._judge(start)

    def run(self, algorithm: str, share: float = 1.0, step: float = LOCAL_STEPS[0]) -> None:
        """One algorithm from the best point so far, until it converges or its share of the budget is gone."""
        import nlopt

        stop_at = max(1, round(share * self._budget))
        kept: list[BaseException] = []

        def callback(x: np.ndarray, gradient: np.ndarray) -> float:
            # An exception that crosses NLopt can turn into SystemError: keep it, stop, raise it outside.
            # After force_stop some algorithms still ask for a few points; any finite answer does.
            if kept:
                return 0.0
            try:
                if len(self.scores) >= stop_at and self._point(x).tobytes() not in self.scores:
                    raise _BudgetSpentError
                return -self._judge(self._point(x))
            except BaseException as error:
                kept.append(error)
                optimizer.force_stop()
                return 0.0

        optimizer = self._optimizer(algorithm, step)
        optimizer.set_min_objective(callback)
        try:
            optimizer.optimize(self._best)
        except (nlopt.ForcedStop, nlopt.RoundoffLimited):
            pass
        except Exception as error:  # NLopt's own exceptions share no base class from one version to the next
            if not kept:
                raise InputError(
                    f"optimizer.algorithm: NLopt's {algorithm} cannot search {len(self._start)} parameter(s) "
                    f'({error or type(error).__name__}); choose "auto"'
                ) from None
        if kept and not (isinstance(kept[0], _BudgetSpentError) and stop_at < self._budget):
            raise kept[0]

    def _optimizer(self, algorithm: str, step: float) -> Any:
        import nlopt

        count = len(self._start)
        # Any MLSL name takes the local search it is given only under the G_ name.
        name = algorithm.replace("GN_MLSL", "G_MLSL")
        optimizer = nlopt.opt(getattr(nlopt, name), count)
        optimizer.set_lower_bounds(np.zeros(count))
        optimizer.set_upper_bounds(np.ones(count))
        # A safety net for algorithms that keep asking for points already seen.
        optimizer.set_maxeval(100 * self._budget)
        if name.startswith("G_MLSL"):
            inner = nlopt.opt(getattr(nlopt, LOCAL), count)
            inner.set_initial_step(step)
            inner.set_xtol_abs(LOCAL_TOLERANCE)
            optimizer.set_local_optimizer(inner)
        elif name.startswith("LN_"):
            optimizer.set_initial_step(step)
            optimizer.set_xtol_abs(LOCAL_TOLERANCE)
        return optimizer

    def _point(self, x: np.ndarray) -> np.ndarray:
        """A copy, for x is NLopt's own reused view; clipped, for BOBYQA can leave the bounds by rounding."""
        return np.clip(np.array(x, dtype=float), 0.0, 1.0)

    def _judge(self, point: np.ndarray) -> float:
        key = point.tobytes()
        if key not in self.scores:
            if len(self.scores) >= self._budget:
                raise _BudgetSpentError
            self.scores[key] = float(self._score(point))
            if self.scores[key] > self._best_score:
                self._best, self._best_score = point, self.scores[key]
        return self.scores[key]
