"""Choose the point to evaluate next, and the points to recommend, by the model of a search.

The model is a Gaussian process that predicts the mean score at each point. The value of an
evaluation is its knowledge gradient: by how much it raises the model's best mean, on average.
Expected improvement, the usual value, trusts the luckiest evaluation too much; it ended with twice
the regret on noisy test functions (benchmarks/optimizers.py).

Source: P. Frazier, W. Powell and S. Dayanik, "The knowledge-gradient policy for correlated normal
beliefs", INFORMS J. Comput. 21 (2009) 599. Notation (shape, name in the code):

    x      point whose evaluation is considered      (k, d)  at
    q      points where the best mean may be         (m, d)  leaders
    m, c   mean and covariance of the model                  model(...), model.covariance
    u      standard deviation of a score at x        (k,)    scatter: sqrt(c(x, x) + noise)
    z      standard normal outcome of the evaluation (16,)   outcomes: its quantiles
    KG(x)  mean over z of max(m(q) + c(x, q) z / u, m(x) + c(x, x) z / u) - max m(q)

What may still be gained is at most max(m + 2 s) over all x less max(m - 2 s) over the points that
were evaluated, s the model's standard deviation (A. Makarova et al., "Automatic Termination for
Hyperparameter Optimization", Proc. 1st Int. Conf. on Automated Machine Learning, PMLR 188 (2022)).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from chamberopt.search.optimiser.domain import Domain
from chamberopt.search.optimiser.gaussian_process import one_thread
from chamberopt.search.optimiser.nlopt_search import LOCAL, run_nlopt
from chamberopt.search.optimiser.search_model import SearchModel

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
# They are within the limits by MARGIN standard errors of an evaluation, with probability SURE: the
# confirmation asks for its whole interval to be inside.
MARGIN, SURE = 1.0, 0.8
# How far the model may be wrong about what is left to gain, in its standard deviations; and the
# probability of being within all limits below which a point promises nothing, and from which on it
# counts as reached (benchmarks/stopping.py).
DOUBT, UNLIKELY, LIKELY = 2.0, 0.05, 0.5
SWAP = 0.3  # share of the levels beside a leader that are drawn anew
STEP, TOLERANCE, MAX_CALLS = 0.05, 1e-3, 40

Function = Callable[[np.ndarray], np.ndarray]


def propose_point(model: SearchModel, rng: np.random.Generator) -> np.ndarray:
    """Return the new point (d,) of the unit cube that is most worth an evaluation.

    Its evaluation raises the best mean of the model most, on average (its knowledge gradient).
    """
    with one_thread():
        choices = _choices(model, rng)
        (at, deviation), feasible = model.expected(choices), model.feasible(choices)
        best_bounds = np.argsort(-(at + deviation) * feasible, kind="stable")[:LEADER_COUNT]
        gradient = _knowledge_gradient(model, np.vstack([model.points, choices[best_bounds]]))
        # Expected improvement is quick to compute and selects where the gradient is worth it.
        improvement = _expected_improvement(at, deviation, _best(model)) * feasible
        choices = choices[np.argsort(-improvement, kind="stable")[:CANDIDATE_COUNT]]
        best_first = choices[np.argsort(-gradient(choices), kind="stable")]
        climbed = _climb(gradient, best_first[:2], model.domain)
        last = rng.random(len(climbed))
        rounded = (_rounded(one, model.domain) for one in (climbed, *best_first, last))
        return next((one for one in rounded if _is_new(one, model)), _rounded(last, model.domain))


def recommend_points(model: SearchModel, seed: int) -> list[np.ndarray]:
    """Return two points (d,) with the best cautious estimate of the score by the model.

    The first is the best of the points that were evaluated, the second is the best of all points.
    They may be the same. The estimate is the model's mean less CAUTION standard deviations, and
    limits must be met.
    """

    def cautious_value(at: np.ndarray) -> np.ndarray:
        mean, deviation = model.expected(at)
        value = mean - CAUTION * deviation - model.lowest
        return value * np.minimum(1.0, model.feasible(at, MARGIN) / SURE)

    with one_thread():
        seen = model.points[int(np.argmax(cautious_value(model.points)))]
        choices = np.vstack([seen, _choices(model, np.random.default_rng(seed))])
        best_first = choices[np.argsort(-cautious_value(choices), kind="stable")]
        point = _rounded(_climb(cautious_value, best_first[:2], model.domain), model.domain)
    return [seen, point]


def possible_gain(model: SearchModel, seed: int) -> float:
    """Return by how much the best score may exceed the best of the evaluated points, at most.

    The model is taken at its word up to DOUBT standard deviations. The gain is infinite if no
    evaluated point is likely to be within all limits.
    """
    with one_thread():
        reached = model.points[model.feasible(model.points) >= LIKELY]
        if not len(reached):
            return float("inf")
        choices = _choices(model, np.random.default_rng(seed))
        possible = np.vstack([reached, choices[model.feasible(choices) > UNLIKELY]])
        (low, scatter), (high, doubt) = model.expected(reached), model.expected(possible)
    return float((high + DOUBT * doubt).max() - (low - DOUBT * scatter).max())


def _best(model: SearchModel) -> float:
    """Return the best mean score by the model among points whose evaluation has begun.

    The difference of each mean from the lowest score is multiplied by the probability that the
    point meets all limits.
    """
    mean, _ = model.expected(model.points)
    return model.lowest + float(((mean - model.lowest) * model.feasible(model.points)).max())


def _knowledge_gradient(model: SearchModel, leaders: np.ndarray) -> Function:
    """Return a function that computes how much the evaluation of each point (k, d) is worth, (k,).

    The function computes the logarithm of the knowledge gradient, because NLopt climbs badly where
    all values are tiny.

    Args:
        leaders: points (m, d) where the model's best mean may be.
    """
    from scipy.special import ndtri

    score, share = model.score, model.feasible(leaders)
    before = share * (model.expected(leaders)[0] - model.lowest)
    outcomes = ndtri((np.arange(OUTCOME_COUNT) + 0.5) / OUTCOME_COUNT)

    def log_gradient(at: np.ndarray) -> np.ndarray:
        scatter = np.sqrt(score(at)[1] ** 2 + score.noise)
        moves = share * model.covariance(at, leaders) / scatter[:, None]
        above = model.expected(at)[0] - model.lowest
        own = np.diag(model.covariance(at, at)) / scatter
        best = [np.maximum((before + moves * z).max(axis=1), above + own * z) for z in outcomes]
        rise = np.mean(best, axis=0) - before.max()
        return np.asarray(np.log(np.maximum(model.feasible(at) * rise, 1e-300)))

    return log_gradient


def _expected_improvement(mean: np.ndarray, deviation: np.ndarray, best: float) -> np.ndarray:
    """Return the expected improvement of points over the model's best mean score, (k,).

    Args:
        mean, deviation: mean and standard deviation of the score at the points, (k,).
    """
    from scipy.special import ndtr

    z = (mean - best) / deviation
    density = deviation * np.exp(-0.5 * z * z) / np.sqrt(2.0 * np.pi)
    improvement: np.ndarray = (mean - best) * ndtr(z) + density
    return improvement


def _choices(model: SearchModel, rng: np.random.Generator) -> np.ndarray:
    """Draw points (k, d) to choose the next from: near the model's five best, and anywhere."""
    from scipy.stats.qmc import Sobol

    points, domain = model.points, model.domain
    value = (model.expected(points)[0] - model.lowest) * model.feasible(points)
    leaders = points[np.argsort(-value, kind="stable")[:5]]
    nearby = np.repeat(leaders, 100, axis=0)
    distance = rng.choice([0.03, 0.1], (len(nearby), 1))
    nearby = np.clip(nearby + distance * rng.normal(size=nearby.shape), 0.0, 1.0)
    spread = Sobol(points.shape[1], seed=rng).random_base2(10)
    if not domain.free.all():  # other levels beside a leader's numbers
        other = domain.snap(rng.random(nearby.shape))
        swap = ~domain.free & (rng.random(nearby.shape) < SWAP)
        nearby = np.where(swap, other, nearby)
    return domain.snap(np.vstack([nearby, spread]))


def _climb(function: Function, starts: np.ndarray, domain: Domain) -> np.ndarray:
    """Return the point (d,) at which NLopt finds the largest value of a function.

    Args:
        starts: points from which NLopt climbs, (k, d). Parameters that are steps or choices keep
            their values of the start.
    """
    tried: list[tuple[float, np.ndarray]] = []
    free, count = domain.free, int(domain.free.sum())
    for start in starts:

        def value(numbers: np.ndarray, start: np.ndarray = start) -> float:
            point = start.copy()
            point[free] = numbers
            tried.append((float(function(point[None])[0]), point))
            return tried[-1][0]

        value(start[free])
        if count:
            algorithm = LOCAL if count > 1 else "LN_SBPLX"  # BOBYQA needs two parameters
            run_nlopt(value, start[free], algorithm, STEP, TOLERANCE, MAX_CALLS)
    return max(tried, key=lambda one: one[0])[1]


def _rounded(point: np.ndarray, domain: Domain) -> np.ndarray:
    rounded: np.ndarray = domain.snap(np.round(point, DECIMALS)[None])[0]
    return rounded


def _is_new(point: np.ndarray, model: SearchModel) -> bool:
    points, features = model.points, model.domain.features
    distance = np.abs(features(points) - features(point[None])).max(axis=1)
    return bool(distance.min() >= MIN_DISTANCE)
