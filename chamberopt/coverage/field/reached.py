"""How much of a target a ball can touch, and how well some points tell."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from chamberopt.common.estimate import CONFIDENCE, normal_quantile
from chamberopt.coverage.field.surface_points import sampling_errors, sparse_points

RULE_OF_THREE = 3.0  # events that may be expected where none was seen, with a probability of 5 %
CERTAIN = 3.0  # standard errors of the reach by which it is surely more or less than a share


class Reach(NamedTuple):
    """What of the target a ball can touch.

    Attributes:
        share: of its area.
        error: standard error of it, by the choice of points.
    """

    share: float
    error: float = 0.0

    @property
    def largest(self) -> float:
        """The largest share that it may be."""
        return min(1.0, self.share + CERTAIN * self.error)

    def beyond(self, share: float) -> float:
        """By how many standard errors it is more than a share; below 0 if less, or as much."""
        more = self.share - share
        return more / self.error if self.error else math.copysign(math.inf, more or -1.0)


def reach_from(fits: np.ndarray) -> Reach:
    """The reach by whether a ball fits at each of some points (p,).

    Even if it fits at all of them, a share of 3 / p may be out of reach with a probability of 5 %:
    the rule of three (J. A. Hanley and A. Lippman-Hand, J. Am. Med. Assoc. 249 (1983) 1743).
    """
    scatter = sampling_errors(np.array([some.mean() for some in sparse_points(fits)]))
    least = RULE_OF_THREE / len(fits) / normal_quantile(CONFIDENCE)
    return Reach(float(fits.mean()), max(math.hypot(*scatter), least))
