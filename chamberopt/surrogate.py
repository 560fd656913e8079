"""A smooth model of noisy scores: which point the whole search recommends, not just its luckiest evaluation.

A Gaussian process (C. E. Rasmussen and C. K. I. Williams, "Gaussian Processes for Machine Learning", MIT
Press 2006, algorithm 2.1) with a Matérn-5/2 kernel and one length scale per parameter. Measured on three
noisy toys with 40 evaluations, confirming its recommendation beside the best seen about halves the regret.
"""

from collections.abc import Callable

import numpy as np

# Fewer points than this per parameter do not fix a length scale.
POINTS_PER_PARAMETER = 4
# How much the model's own doubt counts against a point: recommends where the search has been, not a far
# corner.
CAUTION = 0.5


def recommend(points: np.ndarray, scores: np.ndarray, seed: int) -> np.ndarray | None:
    """The point of the unit cube with the best modelled score, or None when there are too few points.

    points (n, d) in [0, 1], scores (n,) to be maximised.
    """
    count, dimension = points.shape
    if count < POINTS_PER_PARAMETER * dimension:
        return None
    model = _fit(points, scores)
    if model is None:
        return None
    rng = np.random.default_rng(seed)
    leaders = points[np.argsort(-scores)[:5]]
    nearby = np.repeat(leaders, 200, axis=0)
    nearby = np.clip(nearby + rng.normal(0.0, 0.07, nearby.shape), 0.0, 1.0)
    choices = np.vstack([points, nearby, rng.random((2000, dimension))])
    mean, deviation = model(choices)
    best: np.ndarray = choices[np.argmax(mean - CAUTION * deviation)]
    return best


def _matern(a: np.ndarray, b: np.ndarray, scale: np.ndarray) -> np.ndarray:
    distance = np.sqrt(5.0 * (((a[:, None] - b[None]) / scale) ** 2).sum(axis=-1))
    matern: np.ndarray = (1.0 + distance + distance**2 / 3.0) * np.exp(-distance)
    return matern


def _fit(points: np.ndarray, scores: np.ndarray) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]] | None:
    """Mean and standard deviation as functions of points; None when all scores are equal."""
    from scipy.linalg import LinAlgError, cho_factor, cho_solve
    from scipy.optimize import minimize

    count, dimension = points.shape
    centre, spread = float(np.median(scores)), float(scores.std())
    if spread == 0.0:
        return None
    values = (scores - centre) / spread
    # Log of: length scales, signal variance, noise variance. The priors keep 20 points from being over-read.
    prior_mean = np.log([*[0.5] * dimension, 1.0, 0.05])
    prior_width = np.array([*[0.8] * dimension, 1.5, 1.5])
    bounds = [(np.log(0.05), np.log(5.0))] * dimension + [(-4.0, 4.0), (-9.0, 2.0)]

    def covariance(p: np.ndarray) -> np.ndarray:
        kernel = np.exp(p[-2]) * _matern(points, points, np.exp(p[:dimension]))
        total: np.ndarray = kernel + np.exp(p[-1]) * np.eye(count)
        return total

    def misfit(p: np.ndarray) -> float:
        try:
            factor = cho_factor(covariance(p), lower=True)
        except LinAlgError:
            return 1e6
        likelihood = 0.5 * values @ cho_solve(factor, values) + np.log(np.diag(factor[0])).sum()
        return float(likelihood + 0.5 * (((p - prior_mean) / prior_width) ** 2).sum())

    best = minimize(misfit, prior_mean, method="L-BFGS-B", bounds=bounds).x
    factor = cho_factor(covariance(best), lower=True)
    weights = cho_solve(factor, values)

    def predict(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        kernel = np.exp(best[-2]) * _matern(at, points, np.exp(best[:dimension]))
        variance = np.exp(best[-2]) - np.einsum("ij,ji->i", kernel, cho_solve(factor, kernel.T))
        return centre + spread * (kernel @ weights), spread * np.sqrt(np.maximum(variance, 0.0))

    return predict
