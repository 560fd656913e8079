"""Where the next evaluation teaches most, and which point to recommend, by the model; NLopt climbs on both.

The worth of an evaluation is its knowledge gradient: by how much it raises, on average, the best mean of the model
(P. Frazier, W. Powell and S. Dayanik, "The knowledge-gradient policy for correlated normal beliefs", INFORMS J.
Comput. 21 (2009) 599). Expected improvement, which trusts the luckiest evaluation less than it seems, ended with twice
the regret on noisy toys.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from chamberopt.optimize.search.gaussian_process import GaussianProcess, one_thread
from chamberopt.optimize.search.nlopt_search import LOCAL, run_nlopt

# Quantiles of the evaluation's outcome that its worth is averaged over.
OUTCOMES = 16
# Points at which the model's best may be, and at which an evaluation's worth is looked at before NLopt climbs.
LEADERS, CONSIDERED = 100, 200
# Nearer to a point already seen than this share of the bounds an evaluation would meet the same noise again.
NEAREST = 0.005
# Decimals of a proposal: what rounding differs by from one processor to another stays below.
DECIMALS = 4
# How much the model's own doubt counts against a point: recommends where the search has been, not a far corner.
CAUTION = 0.5
STEP, TOLERANCE, CALLS = 0.05, 1e-3, 40

Function = Callable[[np.ndarray], np.ndarray]


def propose_point(model: GaussianProcess, rng: np.random.Generator) -> np.ndarray:
    """The point (d,) of the unit cube whose evaluation is worth most, none seen before."""
    with one_thread():
        mean, _ = model(model.points)
        choices = _choices(model.points, mean, rng)
        at, doubt = model(choices)
        leaders = np.vstack(
            [model.points, choices[np.argsort(-(at + doubt), kind="stable")[:LEADERS]]]
        )
        worth = _worth(model, leaders)
        hopeful = np.argsort(-_improvement(at, doubt, float(mean.max())), kind="stable")[
            :CONSIDERED
        ]
        choices = choices[hopeful]
        best_first = choices[np.argsort(-worth(choices), kind="stable")]
        point = np.round(_climbed(worth, best_first[:2]), DECIMALS)
        if not _is_new(point, model.points):
            new = (np.round(other, DECIMALS) for other in best_first)
            point = next(
                (other for other in new if _is_new(other, model.points)),
                np.round(rng.random(len(point)), 4),
            )
    return point


def recommend_point(model: GaussianProcess, seed: int) -> np.ndarray:
    """The point (d,) with the best modelled score, less some of the model's doubt."""

    def cautious(at: np.ndarray) -> np.ndarray:
        mean, deviation = model(at)
        return mean - CAUTION * deviation

    with one_thread():
        mean, _ = model(model.points)
        choices = np.vstack(
            [model.points, _choices(model.points, mean, np.random.default_rng(seed))]
        )
        best_first = choices[np.argsort(-cautious(choices), kind="stable")]
        return np.round(_climbed(cautious, best_first[:2]), DECIMALS)


def _worth(model: GaussianProcess, leaders: np.ndarray) -> Function:
    """The knowledge gradient as a function of points (k, d); log, for NLopt sees shapes better than sizes."""
    from scipy.special import ndtri

    before, _ = model(leaders)
    outcomes = ndtri((np.arange(OUTCOMES) + 0.5) / OUTCOMES)

    def worth(at: np.ndarray) -> np.ndarray:
        mean, deviation = model(at)
        seen = np.sqrt(deviation**2 + model.noise)
        moves, own = model.covariance(at, leaders) / seen[:, None], deviation**2 / seen
        best = [np.maximum((before + moves * z).max(axis=1), mean + own * z) for z in outcomes]
        return np.log(np.maximum(np.mean(best, axis=0) - before.max(), 1e-300))

    return worth


def _improvement(mean: np.ndarray, deviation: np.ndarray, best: float) -> np.ndarray:
    """Expected improvement on the model's best mean: quick, to choose where to look at the worth."""
    from scipy.special import ndtr

    z = (mean - best) / deviation
    hoped: np.ndarray = (mean - best) * ndtr(z) + deviation * np.exp(-0.5 * z * z) / np.sqrt(
        2.0 * np.pi
    )
    return hoped


def _choices(points: np.ndarray, mean: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Points to choose from, (k, d): about the five best by the model, and all over the cube."""
    from scipy.stats.qmc import Sobol

    leaders = points[np.argsort(-mean, kind="stable")[:5]]
    nearby = np.repeat(leaders, 100, axis=0)
    reach = rng.choice([0.03, 0.1], (len(nearby), 1))
    nearby = np.clip(nearby + reach * rng.normal(size=nearby.shape), 0.0, 1.0)
    return np.vstack([nearby, Sobol(points.shape[1], seed=rng).random_base2(10)])


def _climbed(function: Function, starts: np.ndarray) -> np.ndarray:
    """The best point that NLopt finds from these starts (k, d)."""
    seen: list[tuple[float, np.ndarray]] = []

    def value(point: np.ndarray) -> float:
        seen.append((float(function(point[None])[0]), point))
        return seen[-1][0]

    for start in starts:
        if len(start) > 1:
            run_nlopt(value, start, LOCAL, step=STEP, tolerance=TOLERANCE, most=CALLS)
        else:  # BOBYQA wants two parameters at least
            run_nlopt(value, start, "LN_SBPLX", step=STEP, tolerance=TOLERANCE, most=CALLS)
    return max(seen, key=lambda one: one[0])[1]


def _is_new(point: np.ndarray, points: np.ndarray) -> bool:
    return bool(np.abs(points - point).max(axis=1).min() >= NEAREST)
