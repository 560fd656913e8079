"""Depth of the layer that peening puts under compression, estimated from the dents.

Notation
    window  disc of the surface round a point of the target, in which dents are counted
    d       diameter of a dent on the part [m]
    L(d)    rate of dents wider than d [1/s]: sum of their areas in a window over the window's area
            and the time
    z(t)    depth of compression after a time t [m]

    z(t) = 1.1 integral over d of 1 - exp(-L(d) t)

Three estimates of the depth under one impact agree with the dent's diameter to 10 %, for hard
metals at 4 to 8 m/s and balls of 1.5 to 3 mm. S. T. S. Al-Hassani, "Mechanical aspects of residual
stress development in shot peening", ICSP-1, 1981, uses the dent of the full energy. J. K. Li et
al., "Mechanical approach to the residual stress field induced by shot peening", Mater. Sci. Eng.
A147 (1991) 167, use the depth where the elastic stress of Hertz meets the yield stress. D. Kirk's
rule takes the depth from the dent's size. An error of 30 % is left, and the depth was not compared
with measured profiles.

The estimate of Li gives 1.6 to 1.7 d for a metal that hardens strongly, such as 316L, because its
first yielding says little about its flow stress. Such a metal gets no estimate.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.estimate import (
    CONFIDENCE,
    OF_METAL,
    Estimate,
    estimate,
    jackknife,
    normal_quantile,
)
from chamberopt.coverage.strength import dent_rates, strength_at
from chamberopt.coverage.strength_intervals import MIN_BATCHES, level_histograms

if TYPE_CHECKING:
    from chamberopt.coverage.field.target_field import TargetField
    from chamberopt.coverage.part_impacts import Hits
    from chamberopt.design.materials import PartMaterial

OF_DENT = 1.1  # depth over the integral of diameters
ERROR = 0.3  # relative error of the depth, equal wherever the same shot peens the same metal
PEAK_STRESS = 0.5, 0.7  # peak compressive stress over tensile strength, at almost any intensity


def compression_depth(histogram: np.ndarray, time_ratio: float, highest: float) -> np.ndarray:
    """Return the depth [m] of the layer under compression below each measuring window, (p,).

    Args:
        histogram: dented area over area of each window (a disc of the surface in which dents are
            counted), by level (step) of dent diameter, (p, LEVELS).
        time_ratio: peening time over the time in which the dents fell.
        highest: dent diameter at the upper end of the levels [m].
    """
    times = np.full(len(histogram), time_ratio)
    return np.asarray(OF_DENT * strength_at(dent_rates(histogram), times, highest))


def compression_estimate(
    field: TargetField, batches: Sequence[Sequence[Hits]], seconds: float, peening_time: float
) -> Estimate:
    """Return the mean depth [µm] of the layer under compression, over the target's reachable
    surface.

    Its interval includes the error of the formula for the depth, which is most of the width.

    Args:
        batches: impacts of each replica, in batches of replicas, turned into the sector of the
            chamber in which the windows lie.
        seconds: simulated time of each replica.
        peening_time: how long the part is peened [s].
    """
    found = level_histograms(field, batches, seconds, lambda hits: (hits.dent, hits.dent))
    count, total = len(batches), found.parts.sum(axis=0)
    if found.highest == 0.0:
        return Estimate(0.0, math.inf, (0.0,) * count)

    def mean(histogram: np.ndarray, time: float) -> float:
        return 1e6 * float(compression_depth(histogram, peening_time / time, found.highest).mean())

    value, all_seconds = mean(total, found.seconds.sum()), found.seconds.sum()
    if count < MIN_BATCHES:
        return Estimate(value, math.inf, (value,) * count)
    without = [
        mean(total - part, all_seconds - own)
        for part, own in zip(found.parts, found.seconds, strict=True)
    ]
    deviations = jackknife(np.array([value, *without])) - value
    # Windows with few dents lack the widest dents. Half of the dents make the lack twice as large.
    half = count // 2
    halves = [(found.parts[rows].sum(axis=0), found.seconds[rows].sum())
              for rows in (slice(half), slice(half, 2 * half))]  # fmt: skip
    step = value - float(np.mean([mean(*one) for one in halves]))
    depth = estimate(value + step + deviations, 0.0, bias=abs(step))
    return depth.with_shared(OF_METAL, [ERROR / normal_quantile(CONFIDENCE) * depth.value])


def stress_notes(metal: PartMaterial) -> tuple[str, ...]:
    """Return notes on the stress under the surface: its likely peak, and a warning if the depth of
    compression cannot be estimated for this metal.
    """
    notes = []
    if metal.tensile_MPa is not None:
        low, high = (share * metal.tensile_MPa for share in PEAK_STRESS)
        notes.append(
            f"the largest compressive stress is usually {PEAK_STRESS[0]:g} to {PEAK_STRESS[1]:g} "
            f"of the tensile strength, {low:.0f} to {high:.0f} MPa, almost whatever the intensity"
        )
    if metal.hardens_strongly:
        notes.append(
            "materials.part: tensile_MPa and yield_MPa are those of a metal that hardens strongly, "
            "whose depth of compression cannot be estimated from the size of its dents"
        )
    return tuple(notes)
