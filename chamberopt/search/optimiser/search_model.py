"""Model what a search has learnt: the score, figures with limits, and what can be simulated.

Source for constraints with models of their own: J. R. Gardner et al., "Bayesian optimization with
inequality constraints", ICML 2014.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from chamberopt.search.optimiser.domain import Domain
from chamberopt.search.optimiser.gaussian_process import GaussianProcess

# Scores are raised to at least the median minus 3 times the distance from median to maximum.
# Otherwise those of bad candidates would bend the model.
MAX_DEPTH = 3.0
# Of 1 where a candidate could be simulated and 0 where it could not.
LEAST_SIMULATED = 0.5
# With fewer points for each parameter the length scales of a model are not determined.
POINTS_PER_PARAMETER = 4


View = Callable[[np.ndarray], np.ndarray]
"""Returns points (k, d) with what a figure depends on, and 0 in the place of the rest."""


def _whole(points: np.ndarray) -> np.ndarray:
    return points


@dataclass(frozen=True)
class LimitedFigure:
    """A figure of each candidate that must stay within limits.

    values: the figure of each candidate, (n,).
    variances: squared standard errors of the values, (n,).
    low: least value allowed, or -inf.
    high: largest value allowed, or inf.
    """

    values: np.ndarray
    variances: np.ndarray
    low: float
    high: float


@dataclass(frozen=True)
class Observations:
    """What the candidates of a search have shown, in the order in which they began.

    scores: score of each candidate, to be maximised, (n,).
    variances: squared standard errors of the scores, (n,).
    simulated: which candidates were simulated, (n,) bool; figures of other candidates are not used.
    figures: the figures that have limits.
    spared: which candidates were not simulated because geometry shows them to be no better, (n,)
        bool. Their scores are the largest scores that they can have. The other candidates without
        a simulation could not be simulated.
    counts: smallest gain of the score that counts; 0 if any gain does.
    by_geometry: whether geometry refused all candidates that were not simulated.
    """

    scores: np.ndarray
    variances: np.ndarray
    simulated: np.ndarray
    figures: tuple[LimitedFigure, ...] = ()
    spared: np.ndarray | None = None
    counts: float = 0.0
    by_geometry: bool = False


class SearchModel:
    """Models of a search: of the score, of each figure with limits, and of what can be simulated.

    Args:
        points: all points whose evaluation began, shape (m, d). The first n are the points of
            `seen`; the evaluation of the other points still runs.
        seen: what is known of the points that were evaluated.
        length_factor: multiplies the fitted length scales; below 1 the models are less certain away
            from their points.
        learns_bounds: whether the model of the score learns the largest possible scores of
            candidates that were spared a simulation, for pictures. A search does better without
            them, because a sudden drop of the score bends a smooth model, also on the good side.
            For the model of what can be simulated, spared candidates are like candidates that fail.
    """

    def __init__(
        self,
        domain: Domain,
        points: np.ndarray,
        seen: Observations,
        length_factor: float = 1.0,
        learns_bounds: bool = False,
    ) -> None:
        self.domain, count, there = domain, len(seen.scores), seen.simulated
        running = points[count:]

        def model(
            values: np.ndarray, variances: np.ndarray, of: np.ndarray, view: View = _whole
        ) -> GaussianProcess:
            at, still = view(points[:count][of]), view(running)
            return GaussianProcess(at, values[of], variances[of], length_factor, still, domain)

        known = there if seen.spared is None or not learns_bounds else there | seen.spared
        middle, top = float(np.median(seen.scores[there])), float(seen.scores[there].max())
        raised = middle - MAX_DEPTH * (top - middle)
        scores = np.maximum(seen.scores, raised)
        # [score] at and below which the model says no more than that it is no better
        self.floor = raised if (seen.scores[known] < raised).any() else -np.inf
        self.score = model(scores, seen.variances, known)
        self.points = points
        self.lowest = float(scores[known].min())
        self._limits: list[tuple[GaussianProcess, View, float, float]] = [
            (model(one.values, one.variances, there), _whole, one.low, one.high)
            for one in seen.figures
            if np.ptp(one.values[there]) > 0.0
        ]
        if not known.all():
            view = domain.shape_of if seen.by_geometry else _whole
            everywhere = np.ones(count, dtype=bool)
            simulated = model(known.astype(float), np.zeros(count), everywhere, view)
            self._limits.append((simulated, view, LEAST_SIMULATED, np.inf))

    def expected(self, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return mean and standard deviation of the score that a shop gets at points (k, d), (k,).

        The shop aims at each point, and gets a point near it that the tolerances allow. Mean and
        deviation are averaged over these points. If the study counts the worst value over
        tolerances, they are taken at the worst of these points.
        """
        if self.domain.counts_worst:
            return self.score(self._worst(at))
        mean, deviation = np.mean([self.score(one) for one in self.domain.around(at)], axis=0)
        return mean, deviation

    def _worst(self, aims: np.ndarray) -> np.ndarray:
        """Return the worst points (k, d) that a shop may get when it aims at points (k, d)."""
        around = self.domain.around(aims)
        worst = np.argmin([self.score(one)[0] for one in around], axis=0)
        places: np.ndarray = around[worst, np.arange(len(aims))]
        return places

    def covariance(self, at: np.ndarray, aims: np.ndarray) -> np.ndarray:
        """Return the covariance (k, m) between scores at points and scores that a shop gets.

        Args:
            at: points whose scores are taken exactly there, (k, d).
            aims: points at which a shop aims, (m, d); it gets a point near each that the tolerances
                allow.
        """
        if self.domain.counts_worst:
            return self.score.covariance(at, self._worst(aims))
        around = self.domain.around(aims)
        whole: np.ndarray = np.mean([self.score.covariance(at, one) for one in around], axis=0)
        return whole

    def feasible(self, at: np.ndarray, margin: float = 0.0) -> np.ndarray:
        """Return the probability (k,) that a shop that aims at points (k, d) meets all limits.

        It is the lowest probability among the points that the tolerances allow.

        Args:
            margin: by how many standard errors of an evaluation a figure must be inside its limits.
        """
        around = self.domain.around(at)
        worst: np.ndarray = np.min([self._feasible(one, margin) for one in around], axis=0)
        return worst

    def _feasible(self, at: np.ndarray, margin: float) -> np.ndarray:
        from scipy.special import ndtr

        probability = np.ones(len(at))
        for model, view, low, high in self._limits:
            mean, deviation = model(view(at))
            inside = min(margin * np.sqrt(model.noise), 0.25 * (high - low))  # of a narrow band
            probability *= np.maximum(
                ndtr((high - inside - mean) / deviation) - ndtr((low + inside - mean) / deviation),
                1e-12,
            )
        return probability
