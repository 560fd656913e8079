"""The fraction of a surface that stays uncovered for longer than was simulated, without bias.

Notation
    T      treatment time [s]
    t      simulated time of all replicas together [s]
    s_j    areas of the dents on a patch within t [m²]           (dents.area)
    A      area of the patch [m²]                                (area, (p,))
    k      T / (t A) [1/m²]                                      (per_area, (p,))
    x      expected area of the dents on the patch within T, over A
    exp(-x)  uncovered fraction of the patch at T, by Avrami's equation

The dented area k sum(s_j) in the place of x makes the uncovered fraction too large, because exp is
not linear, and the fewer dents, the worse. But the product over the dents

    product of (1 - k s_j)

has exactly exp(-x) for its mean, for dents of any sizes and however short t is: it is the
generating functional of a Poisson process (J. F. C. Kingman, "Poisson Processes", Oxford 1993,
chapter 3.2). For dents of one size it is the estimator of I. J. Good and G. H. Toulmin, Biometrika
43 (1956) 45. With 2 k its mean is exp(-2 x), and both together give the variance of coverage over a
surface free of counting noise.

The price is scatter: the mean square of a patch is exp(x (k s - 2)). Of its orders in k s the
replicas show the first (more dents or fewer, with everything that shifts a whole replica). How much
larger the sum of all orders is, is a mean of such products again. The delete-one jackknife would
count order m of it m times over (B. Efron and C. Stein, Ann. Stat. 9 (1981) 586).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np


class PatchDents(NamedTuple):
    """Single dents of one replica: patch (k,) int and area [m²] (k,)."""

    patch: np.ndarray
    area: np.ndarray


class UncoveredFraction:
    """Means over a surface of exp(-x) and exp(-2 x), and their deviations from replica to replica.

    Args:
        area: areas of the patches [m²], which are also their weights, (p,).
        time_ratio: treatment time over the simulated time of one replica.
        dent_area: area of dents that, all alike, would scatter as these do [m²].
    """

    def __init__(
        self, replicas: Sequence[PatchDents], area: np.ndarray, time_ratio: float, dent_area: float
    ) -> None:
        n = len(replicas)
        per_area, weight = time_ratio / n / area, area / area.sum()
        dents = PatchDents(
            np.concatenate([one.patch for one in replicas]),
            np.concatenate([one.area for one in replicas]),
        )
        products = [_survival_product(dents, power * per_area) for power in (1, 2, 3, 4)]
        self.mean = float(weight @ products[0])
        self.mean_square = float(weight @ products[1])

        dented = np.array([np.bincount(one.patch, one.area, len(area)) for one in replicas])
        x = _shrunken_x(per_area * dented.sum(axis=0), per_area * dent_area, weight)
        slopes = [-power * weight * np.exp(-power * x) for power in (1, 2)]
        share = np.array([n * (dented @ (slope * per_area)) for slope in slopes])
        first_order = _weighted_products(
            slopes, per_area**2 * np.bincount(dents.patch, dents.area**2, len(area))
        )
        weighted = [weight * product for product in products[:2]]
        # Mean of the square less the square of the mean, each without bias as the products are.
        all_orders = _weighted_products(weighted, np.ones(len(area)))
        all_orders -= [[weight**2 @ products[a + b + 1] for a in (0, 1)] for b in (0, 1)]
        self._deviations = _rescaled(
            share - share.mean(axis=1, keepdims=True), first_order, all_orders
        )

    def replica_deviations(self, of_mean: float, of_mean_square: float) -> np.ndarray:
        """Deviations from 0 of a weighted sum of `mean` and `mean_square`, one a replica, (n,).

        Their standard deviation over sqrt(n) is the standard error of the sum.
        """
        return np.array([of_mean, of_mean_square]) @ self._deviations


def _shrunken_x(observed: np.ndarray, noise: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """x of each patch, drawn to the mean until it scatters as the true one, or half as much.

    This is used for the intervals alone, where an error of it cancels.

    Args:
        observed: dented area over area of each patch, (p,).
        noise: variance of the observed value over x, (p,).
    """
    mean = float(weight @ observed)
    variance = max(0.0, float(weight @ (observed - mean) ** 2 - weight @ (noise * observed)))
    trust = np.divide(
        variance, variance + noise * mean, out=np.zeros_like(observed), where=noise * mean > 0.0
    )
    return np.maximum(0.0, mean + np.sqrt(np.maximum(trust, 0.25)) * (observed - mean))


def _weighted_products(two: Sequence[np.ndarray], weight: np.ndarray) -> np.ndarray:
    """Weighted sums of all products of two columns, (2, 2)."""
    columns = np.array(two)
    return np.asarray(columns * weight @ columns.T)


def _rescaled(
    deviations: np.ndarray, first_order: np.ndarray, all_orders: np.ndarray
) -> np.ndarray:
    """First-order deviations, enlarged to what all orders together make: L K^-1 deviations.

    K and L are the Cholesky factors of the covariances `first_order` and `all_orders` of the
    Poisson process, (2, 2). The second is kept from being smaller than the first.

    Args:
        deviations: (2, n).
    """
    if first_order[0, 0] <= 0.0:
        return deviations
    top = max(all_orders[0, 0], first_order[0, 0])
    # Rounding makes this negative if all dents lie on one patch.
    rest = max(0.0, first_order[1, 1] - first_order[0, 1] ** 2 / first_order[0, 0])
    top_rest = max(all_orders[1, 1] - all_orders[0, 1] ** 2 / top, rest)
    along = deviations[0] / np.sqrt(first_order[0, 0])
    across = 0.0 * along
    if rest > 0.0:
        slope = first_order[0, 1] / first_order[0, 0]
        across = (deviations[1] - slope * deviations[0]) / np.sqrt(rest)
    return np.array(
        [np.sqrt(top) * along, all_orders[0, 1] / np.sqrt(top) * along + np.sqrt(top_rest) * across]
    )


def _survival_product(dents: PatchDents, per_area: np.ndarray) -> np.ndarray:
    """Product of 1 - k s over the dents of each patch, (p,), cut off at exp(50) as noise."""
    factor = 1.0 - per_area[dents.patch] * dents.area
    logs = np.log(np.maximum(np.abs(factor), 1e-12))  # exactly 0 has no logarithm
    negative = np.bincount(dents.patch, factor < 0.0, len(per_area)).astype(int) % 2 == 1
    size = np.exp(np.minimum(np.bincount(dents.patch, logs, len(per_area)), 50.0))
    return np.where(negative, -size, size)
