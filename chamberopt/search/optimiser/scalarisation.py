"""Join two objectives to one score, with random weights for each step of the search (ParEGO).

Source: J. Knowles, "ParEGO", IEEE Trans. Evol. Comput. 10 (2006) 50.
"""

from __future__ import annotations

import numpy as np

# Weight of the plain sum beside the worse of the two objectives. Without it, a point that is worse
# in one objective and equal in the other could have the same score.
SUM_WEIGHT = 0.05


def draw_weights(seed: int, step: int) -> np.ndarray:
    """Draw random weights (2,) of two objectives for one step of a search; they add up to 1."""
    first = float(np.random.default_rng([seed, step]).random())
    return np.array([first, 1.0 - first])


def scalarise(
    values: np.ndarray, variances: np.ndarray, weight: np.ndarray, among: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Join several objectives of each candidate to one score, to be maximised.

    The score is minus the augmented Tchebycheff distance from the best value of each objective.
    Each point of the Pareto front has the best score for some weights.

    Args:
        values: objectives of the candidates, shape (n, k).
        variances: squared standard errors of the values, shape (n, k).
        weight: weights of the objectives, shape (k,).
        among: candidates that define the range of each objective, shape (n,) bool; default all.
    Returns:
        Scores (n,) and their variances (n,).
    """
    known = values if among is None else values[among]
    size = np.ptp(known, axis=0)
    size = np.where(size > 0.0, size, 1.0)
    missing = weight * (known.max(axis=0) - values) / size
    scores = -(missing.max(axis=1) + SUM_WEIGHT * missing.sum(axis=1))
    return scores, variances @ (weight / size) ** 2
