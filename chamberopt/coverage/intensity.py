"""Intensity uniformity: how evenly hard the target is hit.

Notation
    v    local mean normal speed of the impacts on a patch [m/s]     (local, (p,))
    w    area of a patch over the area of the target                 (weight, (p,))
    uniformity = 1 - (standard deviation of v) / (mean of v), both weighted with w

Almen intensity grows nearly linearly with the speed of the shot for balls of one size and kind (SAE
J443 measures it; M. Guagliano, "Relating Almen intensity to residual stresses induced by shot
peening", J. Mater. Process. Technol. 110 (2001) 277). So the mean normal speed varies over the part
as the intensity would.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.estimate import Estimate, estimate
from chamberopt.coverage.coverage_from_impacts import Tally

if TYPE_CHECKING:
    from chamberopt.coverage.coverage_intervals import TargetPatches


def intensity_uniformity(replicas: Sequence[Tally], target: TargetPatches) -> Estimate:
    """Estimate the intensity uniformity by the delete-one jackknife: 1 is even, 0 not hit at all.

    A place that is not hit or lies outside the cavity has speed 0. Local means of few impacts
    scatter; their variance, which shows from replica to replica, is subtracted.
    """
    on = target.patch >= 0
    patch, patches = target.patch[on], len(target.area)
    speeds = np.array([np.bincount(patch, replica.speed_sum[on], patches) for replica in replicas])
    hits = np.array([np.bincount(patch, replica.impacts[on], patches) for replica in replicas])
    n = len(replicas)
    whole = _uniformity(speeds, hits, target)
    if n == 1:
        return estimate([whole], highest=1.0)
    others = ~np.eye(n, dtype=bool)
    without = np.array([_uniformity(speeds[rest], hits[rest], target) for rest in others])
    return estimate(n * whole - (n - 1) * without, highest=1.0)


def _uniformity(speeds: np.ndarray, hits: np.ndarray, target: TargetPatches) -> float:
    """Uniformity from sums of normal speeds and numbers of impacts, (n, p): replicas by patches."""
    count, total = len(hits), hits.sum(axis=0)
    local = np.divide(speeds.sum(axis=0), total, out=np.zeros(len(total)), where=total > 0)
    weight = (1.0 - target.hidden_fraction) * target.area / target.area.sum()
    mean = float(weight @ local)
    if mean == 0.0:
        return 0.0
    noise = np.zeros(len(total))
    if count > 1:
        # Variance of a ratio of sums, from the residual of each replica's sum (W. G. Cochran,
        # "Sampling Techniques", Wiley 1977).
        residuals = ((speeds - local * hits) ** 2).sum(axis=0) * count / (count - 1)
        np.divide(residuals, total.astype(float) ** 2, out=noise, where=total > 0)
    variance = float(weight @ (local**2 - noise)) - mean**2
    return 1.0 - float(np.sqrt(max(0.0, variance))) / mean
