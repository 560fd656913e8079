"""The dent densities of all windows of the target, without the scatter of counting.

Notation
    window  disc of the surface round a point of the target, in which dents are counted
    y       square root of the dent density that is counted in a window, per replica
    z       square root of its true dent density, that of infinitely many replicas
    v(z)    variance of y in windows with the true root z, by counting
    g_k     share of the target whose true root is z_k                         (weight, (k,))
    h_i     share of the target whose counted root lies in bin i               (counted, (b,))
    K_ik    probability that a window with true root z_k is counted in bin i   (kernel, (b, k))

Counting widens the distribution of the dent density over the target. By the root its variance is
the same at any density if dents fall independently (M. S. Bartlett, J. Roy. Stat. Soc. Suppl. 3
(1936) 68), but balls that hop on one spot make it larger where they do, so v is taken from windows
of like density. Each step

    g_k <- g_k sum over i of K_ik h_i / (sum over l of K_il g_l)

raises the likelihood of the counted roots (W. H. Richardson, J. Opt. Soc. Am. 62 (1972) 55; L. B.
Lucy, Astron. J. 79 (1974) 745; N. Laird, J. Am. Stat. Assoc. 73 (1978) 805). The first g has the
roots moved towards their mean until they vary as the true roots do, which is exact on an even
surface and for a normal distribution. Many steps would fit the scatter, so that few are made.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

# With 6 steps the bias of a percentile is up to 1.6 times as large, with 100 its scatter is up to
# 1.4 times as large.
STEPS = 20
BINS = 200  # of counted roots, with the same share of the windows in each
GROUPS = 20  # of windows of like density, of which the variance by counting is taken
LEAST_VARIANCE = 0.1  # of a group, over that of all windows: few dents show no variance
OF_COUNTED = 0.01  # share of the first g at the counted roots themselves, so that none is left out


class CountedRoots(NamedTuple):
    """Square roots of the dent densities that are counted in windows, and their variance.

    Attributes:
        root: square root of the dents' shares of each window per replica, shape (p,).
        variance: variance of each root by counting, from the differences between batches of
            replicas, shape (p,); None from a single batch, which does not show it.
    """

    root: np.ndarray
    variance: np.ndarray | None

    @property
    def counting(self) -> float:
        """Mean variance by counting; 0 if it is not known."""
        return 0.0 if self.variance is None else float(self.variance.mean())

    @property
    def true_variance(self) -> float:
        """Variance over the target without that of counting; it may be below 0 by chance."""
        return float(self.root.var()) - self.counting

    def level(self, share: float, deviations: float) -> float:
        """Return the density that lies so many standard deviations of counting from a percentile.

        Windows of one level of density scatter round it by counting alone. So 1.645 deviations
        bring the 5th or 95th percentile of such windows back to their level.

        Args:
            share: share of the windows that do not exceed the percentile.
        """
        moved = float(np.quantile(self.root, share)) + deviations * math.sqrt(self.counting)
        return max(0.0, moved) ** 2


class TrueDensities(NamedTuple):
    """Distribution of the true dent density over the reachable target.

    Attributes:
        root: true square roots of the dent density per replica, rising, shape (k,).
        upto: share of the target up to each of them, with half of its own, shape (k,).
    """

    root: np.ndarray
    upto: np.ndarray

    def at(self, share: float) -> float:
        """Return the dent density per replica that this share of the target does not exceed."""
        return float(np.interp(share, self.upto, self.root)) ** 2


def count_roots(shares: np.ndarray, replicas: np.ndarray) -> CountedRoots:
    """Return the square roots of dent densities in windows, and their variance by counting.

    Args:
        shares: sums of the dents' shares of each window, by batch, shape (g, p).
        replicas: number of replicas in each batch, shape (g,).
    """
    batches, total = len(shares), shares.sum(axis=0)
    root = np.sqrt(total / replicas.sum())
    if batches == 1:
        return CountedRoots(root, None)
    rest = (replicas.sum() - replicas)[:, None]
    without_each = np.sqrt(np.maximum(total - shares, 0.0) / rest)
    return CountedRoots(root, (batches - 1) * without_each.var(axis=0))  # jackknife in each window


def true_densities(counted: CountedRoots, more: float = 0.0) -> TrueDensities:
    """Return the distribution of the true dent density over the target.

    Args:
        more: variance to add to the variance over the target with which the search begins.
    """
    order = np.argsort(counted.root, kind="stable")
    root = counted.root[order]
    middles = (np.arange(BINS) + 0.5) / BINS
    if counted.variance is None or not counted.variance.any() or root[0] == root[-1]:
        return TrueDensities(np.quantile(root, middles), middles)
    left = max(0.0, counted.true_variance) + more
    shrink, mean = math.sqrt(left / float(root.var())), float(root.mean())
    of_bins = np.quantile(root, middles)
    drawn = np.maximum(mean + shrink * (of_bins - mean), 0.0)
    true = np.concatenate([drawn, of_bins])
    weight = np.repeat([1.0 - OF_COUNTED, OF_COUNTED], BINS) / BINS
    scatter = np.sqrt(_variance_at(true, root, counted.variance[order]))
    edges = np.unique(np.quantile(root, np.arange(1, BINS) / BINS))
    bins = np.searchsorted(edges, root, side="right")
    shares = np.bincount(bins, minlength=len(edges) + 1) / len(root)
    weight = _likelier(weight, _kernel(edges, true, scatter), shares)
    rising = np.argsort(true, kind="stable")
    true, weight = true[rising], weight[rising] / weight.sum()
    return TrueDensities(true, np.cumsum(weight) - 0.5 * weight)


def _variance_at(true: np.ndarray, root: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """Return the variance by counting at roots (k,), from windows in the order of their roots."""
    groups = np.linspace(0, len(root), min(GROUPS, len(root)) + 1).astype(int)
    size = np.diff(groups)
    at, there = (np.add.reduceat(one, groups[:-1]) / size for one in (root, variance))
    least = LEAST_VARIANCE * float(variance.mean())
    return np.asarray(np.interp(true, at, np.maximum(there, least)))


def _kernel(edges: np.ndarray, true: np.ndarray, scatter: np.ndarray) -> np.ndarray:
    """Return the probability of each bin of counted roots for each true root, (b, k).

    Args:
        edges: rising edges between the bins; the outer bins have no end, (b - 1,).
        scatter: standard deviation of the counted root at each true root, (k,).
    """
    from scipy.special import ndtr

    below = ndtr((edges[:, None] - true) / scatter)
    ends = np.zeros((1, len(true)))
    return np.asarray(np.diff(np.concatenate([ends, below, ends + 1.0]), axis=0))


def _likelier(weight: np.ndarray, kernel: np.ndarray, counted: np.ndarray) -> np.ndarray:
    """Return the weights of the true roots after STEPS steps, (k,).

    The sums are not matrix products, whose last bits depend on the number of threads.
    """
    for _ in range(STEPS):
        expected = np.einsum("bk,k->b", kernel, weight)
        ratio = np.divide(counted, expected, out=np.zeros_like(counted), where=expected > 0.0)
        weight = weight * np.einsum("bk,b->k", kernel, ratio)
    return weight
