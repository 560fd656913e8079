"""The distribution of dent rates over a surface, from counts: what its poorest twentieth gets.

A patch hit n times may have a low rate or bad luck. The nonparametric maximum-likelihood mixture of Poisson
distributions (J. Kiefer and J. Wolfowitz, Ann. Math. Stat. 27 (1956) 887; found by EM, N. Laird, JASA 73 (1978) 805)
tells the two apart as far as counts can; what they cannot tell it leaves to where EM starts, a gamma distribution
with the mean and the variance that the counts do tell, and to how few steps it makes. Left running it gathers the rates
in clumps, which on a real part is as wrong as none at all: the figure between the two is the answer, and their distance
says how far it can be trusted.
"""

from __future__ import annotations

import numpy as np

STEPS, MANY_STEPS = 10, 100
NODES = 48  # of the rates
FINE = 6.0  # nodes of the counts: (j / FINE)², which adds 2 % to a count's own scatter
CLASS = 0.1  # exposures within 10 % of one another count as one


class Mixture:
    """Patches seen for a while: their exposures fixed, their counts given one set after another.

    exposure (p,): dents to expect on a patch for each unit of x (x: expected dented area over area) · weight (p,):
    area · most (p,): counts that no later set exceeds.
    """

    def __init__(self, exposure: np.ndarray, weight: np.ndarray, most: np.ndarray) -> None:
        self._exposure, self._weight = exposure, weight / weight.sum()
        kind = np.rint(np.log(exposure) / CLASS).astype(int)
        names, self._kind = np.unique(kind, return_inverse=True)
        middle = np.exp(CLASS * names)
        self._scale = middle[self._kind] / exposure
        self._columns = int(FINE * np.sqrt((most * self._scale).max(initial=0.0))) + 2
        mean, variance = self.moments(most)
        reach = 6.0 * np.sqrt(variance)
        self._rates = (
            np.linspace(np.sqrt(max(0.0, mean - reach)), np.sqrt(mean + reach), NODES) ** 2
        )
        counts = (np.arange(self._columns) / FINE) ** 2
        expected = np.maximum(np.outer(middle, self._rates), 1e-9)  # (kinds, rates)
        logs = counts[None, :, None] * np.log(expected)[:, None] - expected[:, None]
        logs -= logs.max(axis=2, keepdims=True)
        self._likelihood = np.exp(logs).reshape(-1, NODES)

    def moments(self, counts: np.ndarray) -> tuple[float, float]:
        """Mean and variance of x over the surface, the counts' own scatter taken off; the variance kept above 0."""
        x = counts / self._exposure
        mean = float(self._weight @ x)
        variance = float(
            self._weight @ (x - mean) ** 2 - self._weight @ (counts / self._exposure**2)
        )
        return mean, max(variance, 1e-4 * mean**2)

    def _start(self, mean: float, variance: float) -> np.ndarray:
        from scipy.special import gammainc

        shape = mean**2 / variance
        edges = np.append(0.5 * (self._rates[1:] + self._rates[:-1]), np.inf)
        gamma = np.diff(gammainc(shape, shape * edges / mean), prepend=0.0)
        return (
            0.98 * gamma / gamma.sum() + 0.02 / NODES
        )  # a little everywhere: EM cannot fill what is empty

    def poorest(self, counts: np.ndarray, share: float, steps: int = STEPS) -> float:
        """The x that all but the `share` of the area exceed."""
        mean, variance = self.moments(counts)
        if mean == 0.0:
            return 0.0
        place = counts * self._scale
        column = np.minimum((FINE * np.sqrt(place)).astype(int), self._columns - 2)
        below, above = (column / FINE) ** 2, ((column + 1) / FINE) ** 2
        part = (place - below) / (above - below)
        cell, cells = self._kind * self._columns + column, len(self._likelihood)
        found = np.bincount(cell, self._weight * (1.0 - part), cells)
        found += np.bincount(cell + 1, self._weight * part, cells)
        seen = found > 0.0
        likelihood, found = self._likelihood[seen], found[seen]
        weights = self._start(mean, variance)
        for _ in range(steps):
            weights = weights * (likelihood.T @ (found / (likelihood @ weights)))
        return quantile(self._rates, weights, share)

    def poorest_drawn_in(self, counts: np.ndarray, share: float) -> float:
        """The same from the counts themselves, drawn towards their mean until their scatter is that of the rates.

        T. A. Louis, JASA 79 (1984) 393: no shape is assumed, but that of the counting noise stays in it.
        """
        mean, variance = self.moments(counts)
        x = counts / self._exposure
        seen = float(self._weight @ (x - mean) ** 2)
        drawn = np.sqrt(min(1.0, variance / seen)) if seen > 0.0 else 1.0
        order = np.argsort(x, kind="stable")
        return max(0.0, mean + drawn * (quantile(x[order], self._weight[order], share) - mean))


def quantile(values: np.ndarray, weights: np.ndarray, share: float) -> float:
    """The value that `share` of the weight lies below; values (n,) rising, each at the middle of its own weight."""
    before = np.cumsum(weights) - 0.5 * weights
    return float(np.interp(share * weights.sum(), before, values))
