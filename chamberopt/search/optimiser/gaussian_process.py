"""A Gaussian process as a smooth model of noisy scores.

Source: C. E. Rasmussen and C. K. I. Williams, "Gaussian Processes for Machine Learning", MIT Press
2006. scikit-learn fits the hyperparameters. Notation (shape, name in the code):

    X      points of the unit cube with scores           (n, d)  points
    y      scores, less their mean, scaled               (n,)    values
    x      points where the model is evaluated           (k, d)  at
    s2     noise of each score, from its replicas        (n,)    variances
    a      signal variance                               scalar  _signal
    l      length scale of each parameter                (d,)    _lengths
    w      noise beyond s2, fitted                       scalar  noise_level

    kernel (Matérn 5/2)   k(p, q) = a (1 + r + r²/3) exp(-r),  r = sqrt(5) |(p - q) / l|
    variance of the mean  b, so large that the scores alone say where it is      TREND
    covariance of y       K = b + k(X, X) + diag(s2) + w I = L Lᵀ                _inverse: L⁻¹
    mean at x             m(x) = (b + k(x, X)) K⁻¹ y                             _weights: K⁻¹ y
    covariance at x, x'   c(x, x') = b + k(x, x') - (b + k(x, X)) K⁻¹ (b + k(X, x'))

Far from all points the model's mean is not the plain mean of the scores, because the points gather
where scores are good. It is the generalised least squares mean of the scores, in which many near
points count little more than one point (section 2.7 of the source).

While a point's evaluation still runs, the model takes its own mean at the point for the score, with
the usual noise. Its mean then stays the same everywhere, but it is surer near the point, so that
the next proposal goes elsewhere (the "kriging believer": D. Ginsbourger, R. Le Riche and L.
Carraro, "Kriging is well-suited to parallelize optimization", in "Computational Intelligence in
Expensive Optimization Problems", Springer 2010).

The hyperparameters are those of the largest posterior probability, not of the largest likelihood:
log a, log l and log w have a normal prior. It keeps the model from reading too much into 20 points
(mean regret 0.027 with the prior, 0.032 without, on noisy test functions with 40 evaluations;
benchmarks/optimizers.py).
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.search.optimiser.domain import Axis, Domain

if TYPE_CHECKING:
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import Kernel
    from threadpoolctl import ThreadpoolController

# The cost of a fit grows with the cube of the number of points: 0.05 s at 80, 1 s at 300.
MAX_POINTS = 300
TREND = 100.0  # in squared standard deviations of the scores
# Prior of each hyperparameter: median, and standard deviation of the logarithm; then its bounds.
# Length scales are shares of the bounds.
SIGNAL, LENGTH, NOISE = (1.0, 1.5), (0.8, 1.0), (0.01, 1.5)
SIGNAL_BOUNDS, LENGTH_BOUNDS, NOISE_BOUNDS = (0.02, 50.0), (0.05, 5.0), (1e-6, 7.0)

MAX_PRIOR = 1e3  # half the degrees of freedom of a variance that is common to all
MIN_NOISE = 1e-8  # variance that keeps the covariance matrix invertible

Misfit = Callable[[np.ndarray], tuple[float, np.ndarray]]  # and its gradient


class GaussianProcess:
    """A smooth model of scores over points of the unit cube, fitted when it is made.

    Its attribute `noise` is the variance of one evaluation's score, and `signal` the variance of
    the noiseless score from place to place.

    Args:
        points: points with scores, shape (n, d); only the best MAX_POINTS are used.
        scores: score of each point, (n,).
        variances: squared standard errors of the scores, (n,); 0 where unknown.
        domain: which values each parameter can have; by default any value.
        length_factor: multiplies the fitted length scales. Below 1 the model is less certain away
            from its points.
        running: points whose evaluation still runs, shape (m, d); they become the last of `points`.
    """

    def __init__(
        self,
        points: np.ndarray,
        scores: np.ndarray,
        variances: np.ndarray | None = None,
        length_factor: float = 1.0,
        running: np.ndarray | None = None,
        domain: Domain | None = None,
    ) -> None:
        self._domain = domain or Domain([Axis()] * points.shape[1])
        keep = np.sort(np.argsort(-scores, kind="stable")[:MAX_POINTS])
        known = np.zeros(len(scores)) if variances is None else variances
        self.points, scores, known = points[keep], scores[keep], known[keep]
        self._centre, self._spread = float(scores.mean()), float(scores.std()) or 1.0
        values = (scores - self._centre) / self._spread
        with one_thread():
            noise = known / self._spread**2
            self._features = self._domain.features(self.points)
            process = _fit(self._features, values, noise, length_factor)
            if running is not None and len(running):
                features = self._domain.features(running)
                values = np.append(values, process.predict(features))
                noise = np.append(noise, np.full(len(running), noise.mean()))
                self.points = np.vstack([self.points, running])
                self._features = np.vstack([self._features, features])
                process = _fit_with(process.kernel_, self._features, values, noise)
            self._inverse = np.linalg.inv(process.L_)
        varying = process.kernel_.k1.k2
        self._signal, self._lengths = varying.k1.constant_value, varying.k2.length_scale
        self.signal = float(self._signal) * self._spread**2
        self._weights, self._values = process.alpha_, values
        self.noise = float(known.mean() + process.kernel_.k2.noise_level * self._spread**2)

    def __call__(self, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return mean (k,) and standard deviation (k,) of the noiseless score at points (k, d)."""
        kernel = self._kernel(self._domain.features(at), self._features)
        explained = ((kernel @ self._inverse.T) ** 2).sum(axis=1)
        variance = np.maximum(TREND + self._signal - explained, 1e-12)
        mean = self._centre + self._spread * (kernel @ self._weights)
        return mean, self._spread * np.sqrt(variance)

    def left_out(self) -> tuple[np.ndarray, np.ndarray]:
        """Return mean and standard deviation of the score at each of `points` by the other points.

        The hyperparameters are those of all points, and the noise of the score itself is in the
        deviation. Both have the shape (n,).

        Source: section 5.4.2 of the source above, equation 5.12.
        """
        own = (self._inverse**2).sum(axis=0)  # the diagonal of K⁻¹ = L⁻ᵀ L⁻¹
        mean = self._centre + self._spread * (self._values - self._weights / own)
        return mean, self._spread / np.sqrt(own)

    def covariance(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Return the covariance (k, m) of the noiseless scores at points a (k, d) and b (m, d)."""
        a, b = self._domain.features(a), self._domain.features(b)
        from_a, from_b = (self._kernel(x, self._features) @ self._inverse.T for x in (a, b))
        explained = from_a @ from_b.T
        covariance: np.ndarray = self._spread**2 * (self._kernel(a, b) - explained)
        return covariance

    def _kernel(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        from scipy.spatial.distance import cdist

        distance = np.sqrt(5.0) * cdist(a / self._lengths, b / self._lengths)
        matern: np.ndarray = self._signal * (1.0 + distance + distance**2 / 3.0) * np.exp(-distance)
        return TREND + matern


def moderate_variances(spreads: np.ndarray, replicas: np.ndarray) -> np.ndarray:
    """Return the squared standard error of each candidate's mean over its replicas, shape (n,).

    A few replicas estimate a candidate's own variance badly, so each estimate is drawn towards the
    estimates of all candidates. The true variances differ from each other if the estimates scatter
    more than chance lets them. The less they differ, the more the estimates are drawn together.

    Source: G. K. Smyth, "Linear models and empirical Bayes methods", Stat. Appl. Genet. Mol. Biol.
    3 (2004) 3, section 6.2.

    Args:
        spreads: variance of one replica of each candidate, shape (n,); NaN where unknown.
        replicas: number of replicas of each candidate, shape (n,).
    """
    from scipy.optimize import brentq
    from scipy.special import digamma, polygamma

    known = np.isfinite(spreads) & (spreads > 0.0) & (replicas > 1)
    if not known.any():
        return np.zeros(len(spreads))
    own = 0.5 * (replicas[known] - 1.0)  # half the degrees of freedom
    logs = np.log(spreads[known]) - digamma(own) + np.log(own)
    beyond_chance = (logs.var(ddof=1) if len(logs) > 1 else 0.0) - polygamma(1, own).mean()
    if beyond_chance <= float(polygamma(1, MAX_PRIOR)):
        prior, common = MAX_PRIOR, float(spreads[known].mean())
    else:
        prior = brentq(lambda x: float(polygamma(1, x)) - beyond_chance, 1e-3, MAX_PRIOR)
        common = float(np.exp(logs.mean() + digamma(prior) - np.log(prior)))
    moderated = np.full(len(spreads), common)
    moderated[known] = (prior * common + own * spreads[known]) / (prior + own)
    return np.asarray(moderated / replicas)


def _fit(
    points: np.ndarray, values: np.ndarray, noise: np.ndarray, length_factor: float
) -> GaussianProcessRegressor:
    """Fit scikit-learn's Gaussian process to scores, and return it.

    Args:
        points: points in the form that the model learns from, (n, f).
        values: scores, moved and scaled to mean 0 and standard deviation 1, (n,).
        noise: variance of each scaled score, (n,).
        length_factor: multiplies the fitted length scales.
    """
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

    dimensions = points.shape[1]
    priors = [SIGNAL, *[LENGTH] * dimensions, NOISE]
    middle = np.array([np.log(median) for median, _ in priors])
    width = np.array([deviation for _, deviation in priors])

    def most_probable(
        misfit: Misfit, begin: np.ndarray, bounds: np.ndarray
    ) -> tuple[np.ndarray, float]:
        from scipy.optimize import minimize

        def with_prior(logs: np.ndarray) -> tuple[float, np.ndarray]:
            value, gradient = misfit(logs)
            away = (logs - middle) / width
            return value + 0.5 * float(away @ away), gradient + away / width

        result = minimize(with_prior, begin, jac=True, method="L-BFGS-B", bounds=bounds)
        return result.x, float(result.fun)

    lengths = Matern(np.full(dimensions, LENGTH[0]), LENGTH_BOUNDS, nu=2.5)
    kernel = ConstantKernel(SIGNAL[0], SIGNAL_BOUNDS) * lengths
    kernel = ConstantKernel(TREND, "fixed") + kernel + WhiteKernel(NOISE[0], NOISE_BOUNDS)
    alpha = np.maximum(noise, MIN_NOISE)
    process = GaussianProcessRegressor(kernel, alpha=alpha, optimizer=most_probable)
    with warnings.catch_warnings():
        # A length scale at its bound belongs to a parameter without effect.
        warnings.simplefilter("ignore", ConvergenceWarning)
        process.fit(points, values)
    if length_factor == 1.0:
        return process
    logs = process.kernel_.theta + np.log([1.0, *[length_factor] * dimensions, 1.0])
    return _fit_with(kernel.clone_with_theta(logs), points, values, noise)


def _fit_with(
    kernel: Kernel, points: np.ndarray, values: np.ndarray, noise: np.ndarray
) -> GaussianProcessRegressor:
    """Return scikit-learn's Gaussian process for scores, with hyperparameters that are known.

    Args:
        kernel: the covariance function with these hyperparameters.
    """
    from sklearn.gaussian_process import GaussianProcessRegressor

    alpha = np.maximum(noise, MIN_NOISE)
    return GaussianProcessRegressor(kernel, alpha=alpha, optimizer=None).fit(points, values)


def one_thread() -> AbstractContextManager[object]:
    """Return a context manager within which linear algebra runs on one thread.

    The results are then the same on any number of cores, and for such small arrays it is faster.
    """
    limited: AbstractContextManager[object] = _threads().limit(limits=1)
    return limited


@cache
def _threads() -> ThreadpoolController:
    import scipy.linalg  # noqa: F401  its libraries can only be limited once they are loaded
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
