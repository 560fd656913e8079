"""The error against the number of replicas: errors of batches, and a power law fitted to them.

Notation
    R       number of replicas of the reference
    k       replicas of a batch; m = R / k batches, none sharing a replica
    e_rms   root mean square error of the batches against infinitely many replicas (`rms_error`)
    e       half-width of the 95 % interval of a batch, 1.96 e_rms (`BatchSize.error`)
    c       CPU seconds of a batch
    e = scale · c^(-power)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from chamberopt.common.estimate import CONFIDENCE

KNOWN_TO = 0.5  # largest half-width of the power, as a share of it, of a law that is told
NORMAL = 1.96  # half-width of a 95 % interval, in standard errors


@dataclass(frozen=True)
class BatchSize:
    """The errors of the objective from batches with the same number of replicas each."""

    replicas: int  # number of replicas in a batch
    batches: int
    rms: float  # root mean square error of the objective
    half_width: float  # mean half-width of the intervals that the batches themselves estimate
    cpu_s: float  # of a batch, simulation and estimate
    is_resolved: bool = True  # whether all batches had enough dents for their figures

    @property
    def error(self) -> float:
        """Half-width of a 95 % interval of the objective, if errors are normal with this RMS."""
        return NORMAL * self.rms

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the root mean square error."""
        return rms_interval(self.rms, self.batches)


@dataclass(frozen=True)
class ErrorLaw:
    """The error of the objective against the cost in CPU seconds: error = scale · cost^(-power)."""

    scale: float
    power: float
    half_width: float = math.inf  # of the 95 % interval of the power

    @property
    def halving(self) -> tuple[float, float, float] | None:
        """Factor of the cost that halves the error, and its 95 % interval; 4 for a power of 1/2.

        It is None if the power is not known to a half, so that the interval has no end or hardly.
        """
        if not self.half_width < KNOWN_TO * self.power:
            return None
        powers = self.power, self.power + self.half_width, self.power - self.half_width
        middle, low, high = (2.0 ** (1.0 / p) for p in powers)
        return middle, low, high


def rms_error(values: np.ndarray, whole: float, share: float) -> float:
    """Return the root mean square error of batches of replicas against infinitely many replicas.

    The batches are parts of all R replicas, with whose estimate they are compared. For independent
    replicas of variance s² the mean square difference is s²/k - s²/R = s²/k (1 - k/R). Division by
    1 - k/R gives the square of the error, s²/k.

    Args:
        values: estimates of the objective from each batch, (m,).
        whole: estimate of the objective from all replicas.
        share: number of replicas of a batch over the number of all replicas, k/R.
    """
    return math.sqrt(float(np.mean((np.asarray(values) - whole) ** 2)) / (1.0 - share))


def rms_interval(rms: float, batches: int) -> tuple[float, float]:
    """Return the 95 % interval of a root mean square error that was measured on m batches.

    It comes from chi-square with m - 1 degrees of freedom.
    """
    from scipy.special import chdtri  # inverse of the upper tail of chi-square

    freedom, tail = batches - 1, 0.5 - CONFIDENCE / 2.0
    low, high = (math.sqrt(freedom / chdtri(freedom, p)) for p in (tail, 1.0 - tail))
    return rms * low, rms * high


def fit_error_law(sizes: Sequence[BatchSize]) -> ErrorLaw:
    """Fit the law of the error against the cost, by weighted least squares in logarithms.

    Sizes at which batches have too few dents are left out if two other sizes remain. The logarithm
    of an RMS error of m batches has the standard deviation 1 / sqrt(2 (m - 1)).
    """
    resolved = [size for size in sizes if size.is_resolved]
    sizes = resolved if len(resolved) > 1 else sizes
    cost, error = np.log([(size.cpu_s, size.error) for size in sizes]).T
    weights = [math.sqrt(2.0 * (size.batches - 1)) for size in sizes]
    (slope, intercept), covariance = np.polyfit(cost, error, 1, w=weights, cov="unscaled")
    half_width = NORMAL * math.sqrt(covariance[0, 0])
    return ErrorLaw(float(np.exp(intercept)), float(-slope), half_width)
