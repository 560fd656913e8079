"""Whether the windows have the dents that figures take, and how much simulation would give them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from chamberopt.coverage.coverage_from_impacts import Batch
from chamberopt.coverage.field.target_field import Gauge
from chamberopt.coverage.percentile import DentSums

# Dents in a window for each unit of x that the mean and the standard deviation take, in all windows
# but LEAST_RESOLVED of them, and dents in the median window for the figures of single places.
DENTS_FOR_MEAN, DENTS_FOR_PLACES = 3.0, 25.0
LEAST_RESOLVED = 0.05
ENOUGH = 1.2  # times what the dents so far foretell, which scatter themselves
NOT_RESOLVED = "not resolved"


@dataclass(frozen=True)
class Resolution:
    """How many dents the windows of a simulation have, and how many its figures take."""

    dents: float  # in the median window
    needed_for_mean: float  # dents in the median window for mean and standard deviation
    needed_for_places: float  # for 5th percentile, times and intensity
    simulated_time: float  # of all replicas [s]

    @property
    def has_mean(self) -> bool:
        return self.dents >= self.needed_for_mean

    @property
    def has_places(self) -> bool:
        return self.dents >= self.needed_for_places

    def time_for(self, needed: float) -> float:
        """Simulated time [s] in which the median window gets so many dents.

        With a margin where it has fewer now.
        """
        if not self.dents:
            return math.inf
        margin = 1.0 if self.dents >= needed else ENOUGH
        return margin * self.simulated_time * needed / self.dents


def find_resolution(
    batches: Sequence[Batch], sums: DentSums, gauge: Gauge, time_ratio: float, time: float
) -> Resolution:
    """Compare the dents in the windows with what the figures take.

    Args:
        sums: of the batches, over each window.
        time_ratio: treatment time over the simulated time of one replica.
        time: simulated by each replica [s].
    """
    replicas = sum(one.replicas for one in batches)
    prints, dents = [one.footprints for one in batches], float(np.median(sums.number))
    if not dents:
        return Resolution(0.0, DENTS_FOR_MEAN, DENTS_FOR_PLACES, replicas * time)
    # Area of dents that, all alike, would scatter as these do.
    area = sum(one.squares for one in prints) / sum(one.area for one in prints)
    # Dents for each unit of x; beside a crease those on the crease decide.
    per_unit = gauge.area / area
    if gauge.band is not None:
        chord = 0.5 * math.sqrt(math.pi * area)  # mean width of a dent across its diameter
        np.minimum.at(per_unit, gauge.band.point, gauge.band.length / chord)
    poorest = float(np.quantile(per_unit, LEAST_RESOLVED)) * replicas / time_ratio
    needed = dents * DENTS_FOR_MEAN / poorest
    return Resolution(dents, needed, DENTS_FOR_PLACES, replicas * time)
