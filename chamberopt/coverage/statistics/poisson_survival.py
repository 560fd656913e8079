"""The share of a surface that no dent has reached at a time longer than simulated, without bias.

Dents fall on a patch independently of one another, by Avrami's equation exp(-x) of it is bare at the time T, x the
dented area to expect by then over the patch's. Putting the dented area simulated in the place of x is too dark:
exp is not linear, and the fewer dents, the worse. But over the dents s_1, s_2 ... [m²] of a simulated time t

    product of (1 - k s_j),   k = T / (t · area of the patch),

has exactly exp(-x) for its mean, whatever the sizes of the dents and however short t: the generating functional of a
Poisson process (J. F. C. Kingman, "Poisson Processes", Oxford 1993, chapter 3.2); for dents of one size it is the
estimator of I. J. Good and G. H. Toulmin, Biometrika 43 (1956) 45. With 2 k it is exp(-2 x), and both together give
variances over a surface free of counting noise. What is paid is scatter, mean square exp(x (k s - 2)) a patch: of
its orders the replicas show the first, more dents or fewer, with whatever else moves a whole replica; how much larger
all orders are is a mean of such products again. (The delete-one jackknife would count order m of it m times over:
B. Efron and C. Stein, Ann. Stat. 9 (1981) 586.)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np


class Dents(NamedTuple):
    """Single dents of one replica: patch (k,) int, area (k,) m²."""

    patch: np.ndarray
    area: np.ndarray


class Bare:
    """Means over a surface of exp(-x) and exp(-2 x), and how they move from replica to replica.

    area (p,) m² of the patches, also their weights; stretch: wanted time over the simulated time of one replica;
    dent: area [m²] of dents that, all alike, would scatter as these do.
    """

    def __init__(
        self, replicas: Sequence[Dents], area: np.ndarray, stretch: float, dent: float
    ) -> None:
        n = len(replicas)
        per_area, weight = stretch / n / area, area / area.sum()
        every = Dents(
            np.concatenate([d.patch for d in replicas]), np.concatenate([d.area for d in replicas])
        )
        products = [_products(every, power * per_area) for power in (1, 2, 3, 4)]
        self.once, self.twice = float(weight @ products[0]), float(weight @ products[1])

        dented = np.array([np.bincount(d.patch, d.area, len(area)) for d in replicas])
        x = _likely(per_area * dented.sum(axis=0), per_area * dent, weight)
        slopes = [-power * weight * np.exp(-power * x) for power in (1, 2)]
        share = np.array([n * (dented @ (slope * per_area)) for slope in slopes])
        first = _products_of(
            slopes, per_area**2 * np.bincount(every.patch, every.area**2, len(area))
        )
        weighted = [weight * product for product in products[:2]]
        # Without bias, as the products are: the mean of the square less the square of the mean.
        whole = _products_of(weighted, np.ones(len(area)))
        whole -= [[weight**2 @ products[a + b + 1] for a in (0, 1)] for b in (0, 1)]
        self._moves = _stretched(share - share.mean(axis=1, keepdims=True), first, whole)

    def swing(self, once: float, twice: float) -> np.ndarray:
        """That of `once` times the first mean plus `twice` the second, (n,), mean 0: s/√n is the standard error."""
        return np.array([once, twice]) @ self._moves


def _likely(seen: np.ndarray, noise: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """x of each patch (p,), drawn to their mean until they scatter as the true ones do, or half as much.

    noise (p,): variance of what is seen over x. Only for the intervals, where an error of it cancels.
    """
    mean = float(weight @ seen)
    variance = max(0.0, float(weight @ (seen - mean) ** 2 - weight @ (noise * seen)))
    trust = np.divide(
        variance, variance + noise * mean, out=np.zeros_like(seen), where=noise * mean > 0.0
    )
    return np.maximum(0.0, mean + np.sqrt(np.maximum(trust, 0.25)) * (seen - mean))


def _products_of(two: Sequence[np.ndarray], weight: np.ndarray) -> np.ndarray:
    """All weighted sums of products of two columns, (2, 2)."""
    columns = np.array(two)
    return np.asarray(columns * weight @ columns.T)


def _stretched(moves: np.ndarray, first: np.ndarray, whole: np.ndarray) -> np.ndarray:
    """Moves (2, n) of the first order, stretched to what all orders together make: L K^-1 moves.

    K and L are the Cholesky factors of the two (2, 2) covariances from the Poisson process; `whole` is never less.
    """
    if first[0, 0] <= 0.0:
        return moves
    whole_top = max(whole[0, 0], first[0, 0])
    rest = max(
        0.0, first[1, 1] - first[0, 1] ** 2 / first[0, 0]
    )  # rounding leaves less than 0 where dents lie on one patch
    whole_rest = max(whole[1, 1] - whole[0, 1] ** 2 / whole_top, rest)
    along = moves[0] / np.sqrt(first[0, 0])
    across = (
        (moves[1] - first[0, 1] / first[0, 0] * moves[0]) / np.sqrt(rest)
        if rest > 0.0
        else 0.0 * along
    )
    return np.array(
        [
            np.sqrt(whole_top) * along,
            whole[0, 1] / np.sqrt(whole_top) * along + np.sqrt(whole_rest) * across,
        ]
    )


def _products(dents: Dents, per_area: np.ndarray) -> np.ndarray:
    """Product of 1 - k s over the dents of each patch; beyond exp(50) it is noise, and is cut off."""
    factor = 1.0 - per_area[dents.patch] * dents.area
    logs = np.log(np.maximum(np.abs(factor), 1e-12))  # exactly 0 has no logarithm
    negative = np.bincount(dents.patch, factor < 0.0, len(per_area)).astype(int) % 2 == 1
    size = np.exp(np.minimum(np.bincount(dents.patch, logs, len(per_area)), 50.0))
    return np.where(negative, -size, size)
