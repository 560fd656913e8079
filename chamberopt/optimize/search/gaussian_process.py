"""A smooth model of noisy scores: what the whole search says of a point, and how sure it is.

A Gaussian process (C. E. Rasmussen and C. K. I. Williams, "Gaussian Processes for Machine Learning", MIT Press 2006)
fitted by scikit-learn: Matérn-5/2, one length scale per parameter, the noise of the evaluations as their replicas
tell it plus some more to be fitted. The most probable hyperparameters, not the likeliest: a prior keeps 20 points from
being over-read (measured on noisy toys, 40 evaluations each: mean regret 0.027 with it, 0.032 without).
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

# A fit costs their number cubed: 0.05 s at 80, 1 s at 300.
MOST_POINTS = 300
# Scores further below the middle than this many times the best's distance above it say "bad", not how bad: the
# model would otherwise bend to penalties.
DEEPEST = 3.0
# Variances this many times the middle one are no chance: of four normal replicas one in ten thousand is.
OUTLIER = 9.0
# Prior of the logarithms of signal variance, length scales in shares of the bounds, and unexplained noise: middle and
# width; and the bounds of each.
SIGNAL, LENGTH, NOISE = (1.0, 1.5), (0.3, 0.6), (0.01, 1.5)
SIGNAL_BOUNDS, LENGTH_BOUNDS, NOISE_BOUNDS = (0.02, 50.0), (0.05, 5.0), (1e-6, 7.0)


class GaussianProcess:
    """Scores as a smooth function of points of the unit cube, fitted once.

    points (n, d) in [0, 1] · scores (n,) · variances (n,): squared standard errors of the scores, see pool_variances(); 0, or
    absent, where not known. Of more than MOST_POINTS only the best are used. rough: the fitted length scales times
    this; below 1 for a model that trusts less what it has not seen.
    """

    def __init__(
        self,
        points: np.ndarray,
        scores: np.ndarray,
        variances: np.ndarray | None = None,
        rough: float = 1.0,
    ) -> None:
        keep = np.sort(np.argsort(-scores, kind="stable")[:MOST_POINTS])
        known = np.zeros(len(scores)) if variances is None else variances
        self.points, scores, known = points[keep], scores[keep], known[keep]
        middle = float(np.median(scores))
        scores = np.maximum(scores, middle - DEEPEST * (float(scores.max()) - middle))
        self._centre, self._spread = float(np.median(scores)), float(scores.std()) or 1.0
        with one_thread():
            process = _fitted(
                self.points, (scores - self._centre) / self._spread, known / self._spread**2, rough
            )
            self._inverse = np.linalg.inv(process.L_)
        self._signal = process.kernel_.k1.k1.constant_value
        self._lengths = process.kernel_.k1.k2.length_scale
        self._weights = process.alpha_
        self.noise = float(known.mean() + process.kernel_.k2.noise_level * self._spread**2)
        """Variance of one evaluation's score."""

    def __call__(self, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and standard deviation of the true score at points (k, d): two arrays (k,)."""
        kernel = self._kernel(at, self.points)
        known = kernel @ self._inverse.T
        left = np.maximum(self._signal - (known**2).sum(axis=1), 1e-12)
        return self._centre + self._spread * (kernel @ self._weights), self._spread * np.sqrt(left)

    def covariance(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Of the true scores at points a (k, d) and b (m, d), after what was seen: (k, m)."""
        seen = (self._kernel(a, self.points) @ self._inverse.T) @ (
            self._kernel(b, self.points) @ self._inverse.T
        ).T
        both: np.ndarray = self._spread**2 * (self._kernel(a, b) - seen)
        return both

    def _kernel(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        from scipy.spatial.distance import cdist

        distance = np.sqrt(5.0) * cdist(a / self._lengths, b / self._lengths)
        matern: np.ndarray = self._signal * (1.0 + distance + distance**2 / 3.0) * np.exp(-distance)
        return matern


def pool_variances(spreads: np.ndarray, replicas: np.ndarray) -> np.ndarray:
    """Squared standard errors (n,) of means of so many replicas (n,), from the variances (n,) of one replica each.

    So few replicas tell a candidate's own variance badly: all are taken to scatter alike, as the mean of them. Only one
    that scatters far more than most, as a time to full coverage does where little is covered, has its own.
    """
    known = np.isfinite(spreads)
    if not known.any():
        return np.zeros(len(spreads))
    own = known & (spreads > OUTLIER * float(np.median(spreads[known])))
    return np.where(own, spreads, float(spreads[known & ~own].mean())) / replicas


def _fitted(points: np.ndarray, values: np.ndarray, noise: np.ndarray, rough: float) -> Any:
    """scikit-learn's process, given values of mean 0 and size 1 and the variances of their noise (n,)."""
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

    priors = [SIGNAL, *[LENGTH] * points.shape[1], NOISE]
    middle, width = (
        np.array([np.log(prior[0]) for prior in priors]),
        np.array([prior[1] for prior in priors]),
    )

    def most_probable(
        misfit: Callable[[np.ndarray], tuple[float, np.ndarray]],
        begin: np.ndarray,
        bounds: np.ndarray,
    ) -> tuple[np.ndarray, float]:
        from scipy.optimize import minimize

        def with_prior(logs: np.ndarray) -> tuple[float, np.ndarray]:
            value, gradient = misfit(logs)
            away = (logs - middle) / width
            return value + 0.5 * float(away @ away), gradient + away / width

        found = minimize(with_prior, begin, jac=True, method="L-BFGS-B", bounds=bounds)
        return found.x, float(found.fun)

    kernel = ConstantKernel(SIGNAL[0], SIGNAL_BOUNDS) * Matern(
        np.full(points.shape[1], LENGTH[0]), LENGTH_BOUNDS, nu=2.5
    ) + WhiteKernel(NOISE[0], NOISE_BOUNDS)
    process = GaussianProcessRegressor(
        kernel, alpha=np.maximum(noise, 1e-8), optimizer=most_probable
    )
    with warnings.catch_warnings():
        warnings.simplefilter(
            "ignore", ConvergenceWarning
        )  # a length at its bound: a parameter without effect
        process.fit(points, values)
        if rough == 1.0:
            return process
        logs = process.kernel_.theta + np.log([1.0, *[rough] * points.shape[1], 1.0])
        return GaussianProcessRegressor(
            kernel.clone_with_theta(logs), alpha=process.alpha, optimizer=None
        ).fit(points, values)


def one_thread() -> Any:
    """Within it linear algebra runs on one thread: the same bits whatever the number of cores, and faster so small."""
    return _threads().limit(limits=1)


@cache
def _threads() -> Any:
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
