"""Acquisition: the point to evaluate next, and the point to recommend, by the model.

The value of an evaluation is its knowledge gradient: the mean rise of the best mean of the model.
Expected improvement trusts the luckiest evaluation too much; it ended with twice the regret on
noisy test functions (benchmarks/optimizers.py).

Source: P. Frazier, W. Powell and S. Dayanik, "The knowledge-gradient policy for correlated normal
beliefs", INFORMS J. Comput. 21 (2009) 599. Notation (shape, name in the code):

    x      point whose evaluation is considered      (k, d)  at
    q      points where the best mean may be         (m, d)  leaders
    m, c   mean and covariance of the model                  model(...), model.covariance
    u      standard deviation of a score at x        (k,)    scatter: sqrt(c(x, x) + noise)
    z      standard normal outcome of the evaluation (16,)   outcomes: its quantiles
    KG(x)  mean over z of max(m(q) + c(x, q) z / u, m(x) + c(x, x) z / u) - max m(q)
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from chamberopt.optimize.search.gaussian_process import GaussianProcess, one_thread
from chamberopt.optimize.search.nlopt_search import LOCAL, run_nlopt

OUTCOME_COUNT = 16
# Points where the model's best may be, and points where the knowledge gradient is computed before
# NLopt climbs from the best two.
LEADER_COUNT, CANDIDATE_COUNT = 100, 200
# A point nearer than this to one with a score, as a share of the bounds, would only meet the same
# noise again.
MIN_DISTANCE = 0.005
# Proposals are rounded, so that rounding errors of one processor or another make no difference.
DECIMALS = 4
# Recommendations subtract this many of the model's standard deviations from its mean: they stay
# near evaluated points, away from unexplored corners.
CAUTION = 0.5
STEP, TOLERANCE, MAX_CALLS = 0.05, 1e-3, 40

Function = Callable[[np.ndarray], np.ndarray]


def propose_point(model: GaussianProcess, rng: np.random.Generator) -> np.ndarray:
    """The new point (d,) of the unit cube whose evaluation has the largest knowledge gradient."""
    with one_thread():
        mean, _ = model(model.points)
        choices = _choices(model.points, mean, rng)
        at, deviation = model(choices)
        best_bounds = np.argsort(-(at + deviation), kind="stable")[:LEADER_COUNT]
        gradient = _knowledge_gradient(model, np.vstack([model.points, choices[best_bounds]]))
        # Expected improvement is quick to compute and selects where the gradient is worth it.
        improvement = _expected_improvement(at, deviation, float(mean.max()))
        choices = choices[np.argsort(-improvement, kind="stable")[:CANDIDATE_COUNT]]
        best_first = choices[np.argsort(-gradient(choices), kind="stable")]
        point = np.round(_climb(gradient, best_first[:2]), DECIMALS)
        if not _is_new(point, model.points):
            rounded = (np.round(other, DECIMALS) for other in best_first)
            new = (other for other in rounded if _is_new(other, model.points))
            point = next(new, np.round(rng.random(len(point)), 4))
    return point


def recommend_point(model: GaussianProcess, seed: int) -> np.ndarray:
    """The point (d,) with the largest mean minus CAUTION standard deviations."""

    def cautious_mean(at: np.ndarray) -> np.ndarray:
        mean, deviation = model(at)
        return mean - CAUTION * deviation

    with one_thread():
        mean, _ = model(model.points)
        choices = _choices(model.points, mean, np.random.default_rng(seed))
        choices = np.vstack([model.points, choices])
        best_first = choices[np.argsort(-cautious_mean(choices), kind="stable")]
        return np.round(_climb(cautious_mean, best_first[:2]), DECIMALS)


def _knowledge_gradient(model: GaussianProcess, leaders: np.ndarray) -> Function:
    """Logarithm of the knowledge gradient as a function of points (k, d).

    The logarithm, because NLopt works on the shape of a function better than on tiny values.
    """
    from scipy.special import ndtri

    before, _ = model(leaders)
    outcomes = ndtri((np.arange(OUTCOME_COUNT) + 0.5) / OUTCOME_COUNT)

    def log_gradient(at: np.ndarray) -> np.ndarray:
        mean, deviation = model(at)
        scatter = np.sqrt(deviation**2 + model.noise)
        moves, own = model.covariance(at, leaders) / scatter[:, None], deviation**2 / scatter
        best = [np.maximum((before + moves * z).max(axis=1), mean + own * z) for z in outcomes]
        return np.log(np.maximum(np.mean(best, axis=0) - before.max(), 1e-300))

    return log_gradient


def _expected_improvement(mean: np.ndarray, deviation: np.ndarray, best: float) -> np.ndarray:
    """Expected improvement over the model's best mean."""
    from scipy.special import ndtr

    z = (mean - best) / deviation
    density = deviation * np.exp(-0.5 * z * z) / np.sqrt(2.0 * np.pi)
    improvement: np.ndarray = (mean - best) * ndtr(z) + density
    return improvement


def _choices(points: np.ndarray, mean: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Points (k, d) to choose from: around the model's five best, and over the whole cube."""
    from scipy.stats.qmc import Sobol

    leaders = points[np.argsort(-mean, kind="stable")[:5]]
    nearby = np.repeat(leaders, 100, axis=0)
    distance = rng.choice([0.03, 0.1], (len(nearby), 1))
    nearby = np.clip(nearby + distance * rng.normal(size=nearby.shape), 0.0, 1.0)
    return np.vstack([nearby, Sobol(points.shape[1], seed=rng).random_base2(10)])


def _climb(function: Function, starts: np.ndarray) -> np.ndarray:
    """The best point (d,) that NLopt finds from the starts (k, d)."""
    tried: list[tuple[float, np.ndarray]] = []

    def value(point: np.ndarray) -> float:
        tried.append((float(function(point[None])[0]), point))
        return tried[-1][0]

    for start in starts:
        algorithm = LOCAL if len(start) > 1 else "LN_SBPLX"  # BOBYQA needs two parameters
        run_nlopt(value, start, algorithm, STEP, TOLERANCE, MAX_CALLS)
    return max(tried, key=lambda one: one[0])[1]


def _is_new(point: np.ndarray, points: np.ndarray) -> bool:
    return bool(np.abs(points - point).max(axis=1).min() >= MIN_DISTANCE)
