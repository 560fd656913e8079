"""Two objectives at once: which candidates no other beats in both, and how a search is spread along that front."""

from __future__ import annotations

import numpy as np

# Weight of the plain sum beside the worse of the two: without it a point beaten in one objective could score alike.
SUM = 0.05


def draw_weights(seed: int, step: int) -> np.ndarray:
    """How much each of two objectives counts at this step of a search: drawn anew each time."""
    first = float(np.random.default_rng([seed, step]).random())
    return np.array([first, 1.0 - first])


def scalarise(
    values: np.ndarray, variances: np.ndarray, weight: np.ndarray, among: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """One score for several objectives (n, k), to be maximised, and its variance: two arrays (n,).

    The augmented Tchebycheff distance from the best of each, in units of the range of those `among` (J. Knowles,
    "ParEGO", IEEE Trans. Evol. Comput. 10 (2006) 50): for every point of the front there are weights it is best for.
    """
    known = values if among is None else values[among]
    size = np.ptp(known, axis=0)
    size = np.where(size > 0.0, size, 1.0)
    missing = weight * (known.max(axis=0) - values) / size
    return -(missing.max(axis=1) + SUM * missing.sum(axis=1)), variances @ (weight / size) ** 2
