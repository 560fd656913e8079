"""The distribution of dent rates over a surface, estimated from counts, and its low quantiles.

Notation
    x          expected dented area over area of a patch at the treatment time: its dent rate
    exposure   dents to expect on a patch for each unit of x, (p,)
    count      dents on a patch, expressed in dents of one size, (p,)
    weight     area of a patch over the area of all, (p,)

A patch with few dents has a low rate or bad luck. The nonparametric maximum-likelihood mixture of
Poisson distributions tells the two apart as far as counts can (J. Kiefer and J. Wolfowitz, Ann.
Math. Stat. 27 (1956) 887; found by expectation maximisation, EM: N. Laird, JASA 73 (1978) 805).
What counts cannot tell is left to the start of EM, a gamma distribution with the mean and variance
that the counts do tell, and to a small number of steps. With many steps EM gathers the rates in
clumps, which on a real part is as wrong as no steps at all. The value between the two is the
answer, and their distance tells how far it can be trusted.
"""

from __future__ import annotations

import numpy as np

STEPS, MANY_STEPS = 10, 100
RATES = 48  # nodes of the rates
# Nodes of the counts are (j / COUNT_NODES)², which adds 2 % to a count's own scatter.
COUNT_NODES = 6.0
EXPOSURE_CLASS = 0.1  # exposures within 10 % of one another count as one


class RateMixture:
    """Distribution of x over patches with fixed exposures, for one set of counts after another.

    Args:
        exposure: dents to expect for each unit of x, (p,).
        area: areas of the patches, (p,).
        max_counts: counts that no later set exceeds, (p,).
    """

    def __init__(self, exposure: np.ndarray, area: np.ndarray, max_counts: np.ndarray) -> None:
        self._exposure, self._weight = exposure, area / area.sum()
        names, self._kind = np.unique(
            np.rint(np.log(exposure) / EXPOSURE_CLASS).astype(int), return_inverse=True
        )
        middle = np.exp(EXPOSURE_CLASS * names)
        self._scale = middle[self._kind] / exposure
        largest = (max_counts * self._scale).max(initial=0.0)
        self._columns = int(COUNT_NODES * np.sqrt(largest)) + 2
        mean, variance = self.moments(max_counts)
        reach = 6.0 * np.sqrt(variance)
        self._rates = (
            np.linspace(np.sqrt(max(0.0, mean - reach)), np.sqrt(mean + reach), RATES) ** 2
        )
        counts = (np.arange(self._columns) / COUNT_NODES) ** 2
        expected = np.maximum(np.outer(middle, self._rates), 1e-9)  # (kinds, rates)
        logs = counts[None, :, None] * np.log(expected)[:, None] - expected[:, None]
        logs -= logs.max(axis=2, keepdims=True)
        self._likelihood = np.exp(logs).reshape(-1, RATES)

    def moments(self, counts: np.ndarray) -> tuple[float, float]:
        """Mean and variance of x over the surface, without the counts' own scatter.

        The variance is kept above 0.
        """
        x = counts / self._exposure
        mean = float(self._weight @ x)
        variance = float(
            self._weight @ (x - mean) ** 2 - self._weight @ (counts / self._exposure**2)
        )
        return mean, max(variance, 1e-4 * mean**2)

    def _gamma_weights(self, mean: float, variance: float) -> np.ndarray:
        """Weights of the rates from which EM starts."""
        from scipy.special import gammainc

        shape = mean**2 / variance
        edges = np.append(0.5 * (self._rates[1:] + self._rates[:-1]), np.inf)
        gamma = np.diff(gammainc(shape, shape * edges / mean), prepend=0.0)
        # A little weight everywhere, because EM cannot fill what is empty.
        return 0.98 * gamma / gamma.sum() + 0.02 / RATES

    def low_quantile(self, counts: np.ndarray, share: float, steps: int = STEPS) -> float:
        """The x that all but `share` of the area exceed, by the mixture after some steps of EM."""
        mean, variance = self.moments(counts)
        if mean == 0.0:
            return 0.0
        # Each count is shared between the two nodes next to it.
        place = counts * self._scale
        column = np.minimum((COUNT_NODES * np.sqrt(place)).astype(int), self._columns - 2)
        below, above = (column / COUNT_NODES) ** 2, ((column + 1) / COUNT_NODES) ** 2
        part = (place - below) / (above - below)
        cell, cells = self._kind * self._columns + column, len(self._likelihood)
        found = np.bincount(cell, self._weight * (1.0 - part), cells)
        found += np.bincount(cell + 1, self._weight * part, cells)
        occupied = found > 0.0
        likelihood, found = self._likelihood[occupied], found[occupied]
        weights = self._gamma_weights(mean, variance)
        for _ in range(steps):
            weights = weights * (likelihood.T @ (found / (likelihood @ weights)))
        return _quantile(self._rates, weights, share)

    def shrunken_low_quantile(self, counts: np.ndarray, share: float) -> float:
        """The x that all but `share` of the area exceed, from counts drawn towards their mean.

        They are drawn until their scatter is that of the rates. This assumes no shape of the
        distribution, but the shape of the counting noise stays in it.

        Source: T. A. Louis, JASA 79 (1984) 393.
        """
        mean, variance = self.moments(counts)
        x = counts / self._exposure
        scatter = float(self._weight @ (x - mean) ** 2)
        shrink = np.sqrt(min(1.0, variance / scatter)) if scatter > 0.0 else 1.0
        order = np.argsort(x, kind="stable")
        return max(0.0, mean + shrink * (_quantile(x[order], self._weight[order], share) - mean))


def _quantile(values: np.ndarray, weights: np.ndarray, share: float) -> float:
    """The value below which `share` of the weight lies.

    Args:
        values: rising, (n,); each stands at the middle of its own weight.
    """
    before = np.cumsum(weights) - 0.5 * weights
    return float(np.interp(share * weights.sum(), before, values))
