"""Where one candidate covers more than another, and where the difference is not noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from chamberopt.output.compare.target_surface import TargetSurface


@dataclass(frozen=True)
class LocalDifference:
    """Coverage of a later candidate minus that of the first, at places of the target.

    Args:
        value: the difference, -1 to 1, at the vertices of the first candidate's field, shape (v,).
        real: whether it exceeds its 95 % interval, shape (v,) bool. The intervals hold for each
            place alone, so one place in twenty exceeds its own by chance.
        more: share of the target's area where the later candidate really covers more.
        less: share of the target's area where it really covers less.
    """

    value: np.ndarray
    real: np.ndarray
    more: float
    less: float

    def as_json(self) -> dict[str, float]:
        """Return the figures of the whole target as plain JSON values."""
        return {"share_more": self.more, "share_less": self.less}


def local_difference(first: TargetSurface, other: TargetSurface) -> LocalDifference:
    """Compute other - first for two results of one part and target.

    The interval of the difference follows from those of the two coverages, which assume independent
    dents. Where either has too few dents, no difference is real.

    Source: G. Y. Zou and A. Donner, "Construction of confidence limits about effect measures",
    Statistics in Medicine 27 (2008) 1693.
    """
    coverage, interval, resolved = other.at(first)
    value = coverage - first.coverage
    real = np.abs(value) > 0.5 * np.hypot(interval, first.interval)
    real &= resolved & first.resolved
    more, less = (float(first.area[real & sign].sum()) for sign in (value > 0.0, value < 0.0))
    return LocalDifference(value, real, more, less)
