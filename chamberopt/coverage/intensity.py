"""How evenly hard the target is hit: the spread of the local mean normal speed, free of the impacts' own scatter.

Almen intensity grows nearly linearly with the speed of the shot, for balls of one size and kind (SAE J443 measures it;
M. Guagliano, "Relating Almen intensity to residual stresses induced by shot peening", J. Mater. Process. Technol.
110 (2001) 277): how much the mean normal speed varies from place to place is how much the intensity would.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.coverage.coverage_from_impacts import Tally
from chamberopt.coverage.statistics.confidence_interval import Estimate, estimate

if TYPE_CHECKING:
    from chamberopt.coverage.coverage_estimators import TargetPatches


def intensity_uniformity(replicas: Sequence[Tally], ground: TargetPatches) -> Estimate:
    """1 - standard deviation over mean of the local mean normal speed, over the target's area; 1 is even, 0 unhit.

    A place that is not hit, or outside the cavity, has speed 0. Local means of few impacts scatter: their variance,
    seen from replica to replica, is taken off. Delete-one jackknife.
    """
    on = ground.patch >= 0
    patch, patches = ground.patch[on], len(ground.area)
    speeds = np.array([np.bincount(patch, replica.speed_sum[on], patches) for replica in replicas])
    hits = np.array([np.bincount(patch, replica.impacts[on], patches) for replica in replicas])
    n = len(replicas)
    whole = _uniformity(speeds, hits, ground)
    if n == 1:
        return estimate([whole], highest=1.0)
    others = ~np.eye(n, dtype=bool)
    without = np.array([_uniformity(speeds[rest], hits[rest], ground) for rest in others])
    return estimate(n * whole - (n - 1) * without, highest=1.0)


def _uniformity(speeds: np.ndarray, hits: np.ndarray, ground: TargetPatches) -> float:
    """From sums of normal speeds and numbers of impacts, (n, p) each: a replica a row, a patch a column."""
    count, total = len(hits), hits.sum(axis=0)
    local = np.divide(speeds.sum(axis=0), total, out=np.zeros(len(total)), where=total > 0)
    weight = (1.0 - ground.hidden) * ground.area / ground.area.sum()
    mean = float(weight @ local)
    if mean == 0.0:
        return 0.0
    noise = np.zeros(len(total))
    if (
        count > 1
    ):  # of a ratio of sums, from how each replica's sum misses it (Cochran, "Sampling Techniques", 1977)
        misses = ((speeds - local * hits) ** 2).sum(axis=0) * count / (count - 1)
        np.divide(misses, total.astype(float) ** 2, out=noise, where=total > 0)
    variance = float(weight @ (local**2 - noise)) - mean**2
    return 1.0 - float(np.sqrt(max(0.0, variance))) / mean
