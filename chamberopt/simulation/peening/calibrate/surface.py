"""Simulated figures as a smooth function of the parameters that a simulation takes.

Notation
    x     logarithms of those parameters, less those of the centre, (k,)
    X     of all runs, (r, k)
    f     figures of a run, logarithms too, (n,); Y of all runs, (r, n)
    p(x)  1, x_i, x_i x_j: the terms of a quadratic polynomial, (q,)
    s     standard deviation of a figure by the noise of one run
    f(x) = p(x) M Y,  with error covariance c(x) times that of one run

Coefficients have priors, wide but for the curvatures, so that few runs do. A run far from the
centre counts less, by what cubic terms may be: every run that was made serves, near ones most.
"""

from __future__ import annotations

from itertools import combinations_with_replacement
from typing import NamedTuple

import numpy as np

CONSTANT, SLOPE, CURVATURE = 10.0, 3.0, 0.3  # prior standard deviations of coefficients
CUBIC = 0.1  # of a cubic term


class Surface(NamedTuple):
    """Weights of the runs at any place near the centre.

    Attributes:
        centre: logarithms of the parameters, (k,).
        matrix: M, (q, r).
        spread: covariance of the coefficients over that of a run's figure, (q, q).
    """

    centre: np.ndarray
    matrix: np.ndarray
    spread: np.ndarray

    def weights(self, place: np.ndarray) -> np.ndarray:
        """How much each run counts at a place (k,), (r,)."""
        return np.asarray(_terms(place - self.centre)[0] @ self.matrix)

    def noise(self, place: np.ndarray) -> float:
        """c(x) at a place (k,)."""
        terms = _terms(place - self.centre)[0]
        return float(terms @ self.spread @ terms)


def fit_surface(places: np.ndarray, centre: np.ndarray, noise: float) -> Surface:
    """The surface of figures of runs.

    Args:
        places: logarithms of the parameters of each run, (r, k).
        noise: s.
    """
    x = places - centre
    terms = _terms(x)
    distance = np.linalg.norm(x, axis=1)
    weight = noise**2 / (noise**2 + (CUBIC * distance**3) ** 2)
    count = x.shape[1]
    prior = np.array([CONSTANT] + [SLOPE] * count + [CURVATURE] * (terms.shape[1] - count - 1))
    spread = np.linalg.inv((terms.T * weight) @ terms + np.diag((noise / prior) ** 2))
    return Surface(centre, spread @ (terms.T * weight), spread)


def _terms(x: np.ndarray) -> np.ndarray:
    """p of each row, (r, q)."""
    x = np.atleast_2d(x)
    pairs = combinations_with_replacement(range(x.shape[1]), 2)
    return np.column_stack([np.ones(len(x)), x, *(x[:, i] * x[:, j] for i, j in pairs)])
