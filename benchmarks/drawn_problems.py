"""Problems drawn by a seed, on ground that is not that of our search.

The score is the largest of some Gaussian hills, each with its own height, widths and rotation:

    score(x) = max_i w_i exp(-(x - c_i)^T S_i^-1 (x - c_i) / (2 d)),

the landscapes of M. Gallagher and B. Yuan, "A general-purpose tunable landscape generator", IEEE
Transactions on Evolutionary Computation 10 (2006) 590, which has creases where two hills meet. A
problem has two to five parameters, some of them with few levels, some choices without order; in
some problems half of the score is lost beyond a cliff, some have a limit, some have noise that
differs from place to place. All of it is drawn; nothing is chosen by what a search makes of it.

Problems with an even seed may be used to develop the search, those with an odd seed are never
looked at while it is developed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from benchmarks.noisy_problems import NUMBER, Problem, highest
from chamberopt.search.optimiser.domain import Axis

TOP = 0.8  # of the highest hill: scores are of the size of uniform_coverage
SPREAD = 2_000  # points that tell what share of the cube is within a limit
Score = Callable[[np.ndarray], float]


def drawn_problem(seed: int) -> Problem:
    """The problem of a seed; its search begins at a point within the limit."""
    rng = np.random.default_rng([11, seed])
    dimensions = int(rng.integers(2, 6))
    axes = tuple(_axis(rng) for _ in range(dimensions))
    score = _placed(_hills(rng, dimensions), axes, rng)
    if rng.random() < 0.4:
        score = _with_cliff(score, rng, dimensions)
    least_noise = float(np.exp(rng.uniform(np.log(0.01), np.log(0.1))))
    is_uneven = rng.random() < 0.3

    def noise(x: np.ndarray) -> float:
        return least_noise * (1.0 + is_uneven * 2.0 * (1.0 - score(x) / TOP))

    figure = _limit(rng, dimensions) if rng.random() < 0.4 else None
    problem = Problem(f"drawn {seed}", score, 0.0, noise, axes, figure=figure)
    spread = problem.domain.snap(rng.random((SPREAD, dimensions)))
    start = tuple(next(x for x in spread if problem.is_feasible(x)))
    return replace(problem, start=start, best=highest(problem))


def _axis(rng: np.random.Generator) -> Axis:
    kind = rng.random()
    if kind < 0.65:
        return NUMBER
    return Axis(int(rng.integers(4, 10))) if kind < 0.85 else Axis(3, ordered=False)


def _hills(rng: np.random.Generator, dimensions: int) -> Score:
    count = int(rng.integers(3, 11))
    heights = np.concatenate([[TOP], rng.uniform(0.25 * TOP, 0.95 * TOP, count - 1)])
    centres = rng.random((count, dimensions))
    widths = np.exp(rng.uniform(np.log(0.1), np.log(0.6), (count, dimensions)))
    turns = [np.linalg.qr(rng.normal(size=(dimensions, dimensions)))[0] for _ in range(count)]
    across = np.stack(turns) / widths[:, :, None]  # rows: a hill's axes over its widths

    def score(x: np.ndarray) -> float:
        away = np.einsum("kij,kj->ki", across, x - centres)
        return float((heights * np.exp(-(away**2).sum(axis=1) / (2 * dimensions))).max())

    return score


def _placed(score: Score, axes: tuple[Axis, ...], rng: np.random.Generator) -> Score:
    """The score where the levels of a choice stand in an order that nobody knows."""
    orders = [None if axis.ordered else rng.permutation(axis.levels) for axis in axes]

    def placed(x: np.ndarray) -> float:
        at = np.array(x, dtype=float)
        for k, order in enumerate(orders):
            if order is not None:
                last = len(order) - 1
                at[k] = order[round(last * at[k])] / last
        return score(at)

    return placed


def _with_cliff(score: Score, rng: np.random.Generator, dimensions: int) -> Score:
    """The score of which half is lost beyond a plane through the middle half of the cube."""
    across = rng.normal(size=dimensions)
    edge = float(across @ rng.uniform(0.25, 0.75, dimensions))

    def score_with_cliff(x: np.ndarray) -> float:
        return score(x) if across @ x <= edge else 0.5 * score(x)

    return score_with_cliff


def _limit(rng: np.random.Generator, dimensions: int) -> Score:
    """A figure that is at most 0 on 20 to 80 % of the cube: a plane, and a bend."""
    across = rng.normal(size=dimensions)
    across /= np.linalg.norm(across)
    bend, middle = rng.uniform(-1.0, 1.0), rng.random(dimensions)

    def figure(x: np.ndarray) -> float:
        return float(across @ x + bend * ((x - middle) ** 2).sum())

    values = [figure(x) for x in rng.random((SPREAD, dimensions))]
    edge = float(np.quantile(values, rng.uniform(0.2, 0.8)))
    return lambda x: figure(x) - edge
