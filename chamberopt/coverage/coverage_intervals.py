"""Mean, standard deviation and 5th percentile of the target's coverage, with confidence intervals.

Notation
    x       expected dented area over area of a place at the treatment time
    C       its coverage, 1 - exp(-x)
    h       share of the target's area outside the cavity, where C = 0      (hidden_fraction)
    v       variance of x within patches                                    (variance_within)
    m1, m2  means of exp(-x) and exp(-2 x) over the exposed target

    mean C   = (1 - h) (1 - m1)
    mean C²  = (1 - h) (1 - 2 m1 + m2)

The expectations of mean and standard deviation do not depend on how long was simulated
(poisson_survival.py), that of the 5th percentile as little as possible (rate_mixture.py). Both want
a few dents on a triangle for each unit of x. Where there are fewer, neighbouring triangles are
merged into patches. Differences within a patch are known by their variance v alone: the values are
then put midway between "x is equal within patches" and "all of v lies there", and the interval
includes both.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.estimate import Estimate, estimate
from chamberopt.coverage.coverage_from_impacts import Tally
from chamberopt.coverage.metrics import NEVER, P05, exposed_target, require_target, seconds_to_98
from chamberopt.coverage.statistics.poisson_survival import PatchDents, UncoveredFraction
from chamberopt.coverage.statistics.rate_mixture import MANY_STEPS, RateMixture
from chamberopt.coverage.statistics.triangle_patches import patches
from chamberopt.geometry.triangles import unit_normals

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber

# Dents on a patch for each unit of x. From 1 on the product over dents scatters no more than what
# it estimates, from 2 on its interval does. 3 is for places where dents are larger than elsewhere:
# on 400 triangles, a quarter in shadow, intervals of the standard deviation held the truth in 88 %
# at 2 and in 96 % at 3.
MIN_EXPOSURE = 3.0
P05_OF_NORMAL = 1.645  # standard deviations by which a normal 5th percentile lies below the mean


@dataclass(frozen=True)
class TargetPatches:
    """The exposed target, divided into patches with enough dents."""

    patch: np.ndarray  # patch of each part triangle, -1 off the target, (m,)
    area: np.ndarray  # exposed areas of the patches [m²], (p,)
    hidden_fraction: float  # share of the target's area outside the cavity
    time_ratio: float  # treatment time over the simulated time of one replica
    dent_area: float  # area of dents that, all alike, would scatter as these do [m²]
    triangles: int  # number of triangles in the patches

    @property
    def are_merged(self) -> bool:
        """Whether some patches are of several triangles."""
        return len(self.area) < self.triangles


def target_patches(
    replicas: Sequence[Tally], chamber: Chamber, treatment_time: float
) -> TargetPatches:
    """Divide the exposed target into patches that have enough dents in these replicas.

    Args:
        treatment_time: time at which the coverage is wanted [s].

    Raises:
        InputError: no triangle of the target bounds the cavity.
    """
    require_target(chamber)
    exposed = exposed_target(chamber)
    target = np.flatnonzero(exposed)
    area = chamber.exposed_area[target]
    time_ratio = treatment_time / replicas[0].simulated_time
    dents = np.concatenate(
        [replica.dent_area[exposed[replica.dent_triangle]] for replica in replicas]
    )
    dent_area = float((dents**2).sum() / dents.sum()) if len(dents) else 0.0
    exposure = (
        area * len(replicas) / time_ratio / dent_area
        if dent_area
        else np.full(len(area), MIN_EXPOSURE)
    )
    patch = np.full(len(chamber.part.triangles), -1)
    patch[target] = patches(_merging_coordinates(chamber, target, exposure), exposure, MIN_EXPOSURE)
    all_area = chamber.part.area[chamber.part.target].sum()
    return TargetPatches(
        patch=patch,
        area=np.bincount(patch[target], area),
        hidden_fraction=max(0.0, 1.0 - float(area.sum() / all_area)),
        time_ratio=time_ratio,
        dent_area=dent_area,
        triangles=len(target),
    )


def _merging_coordinates(chamber: Chamber, target: np.ndarray, exposure: np.ndarray) -> np.ndarray:
    """Coordinates in which triangles that may be merged are near each other, (m, 6).

    They are the centres and the normals, these as long as two patches, so that a sharp edge
    separates the triangles on its sides.
    """
    corners = chamber.part.vertices[chamber.part.triangles[target]]
    patch_size = math.sqrt(
        chamber.exposed_area[target].sum() * MIN_EXPOSURE / max(exposure.sum(), MIN_EXPOSURE)
    )
    return np.concatenate([corners.mean(axis=1), 2.0 * patch_size * unit_normals(corners)], axis=1)


def coverage_estimates(
    replicas: Sequence[Tally], chamber: Chamber, target: TargetPatches
) -> dict[str, Estimate]:
    """Estimate mean_coverage, std_coverage and p05_coverage by Avrami's equation."""
    dents, parts, totals = [], [], np.zeros(len(target.area))
    for replica in replicas:
        patch = target.patch[replica.dent_triangle]
        on_target = patch >= 0
        dents.append(PatchDents(patch[on_target], replica.dent_area[on_target]))
        parts.append(np.bincount(dents[-1].patch, dents[-1].area, len(target.area)))
        totals += parts[-1]
    within = _variance_within(replicas, target, chamber) if target.are_merged else 0.0
    mean, std = _mean_and_std(dents, target, within)
    return {
        "mean_coverage": mean,
        "std_coverage": std,
        "p05_coverage": _p05(parts, totals, target, within, mean, std),
    }


def _mean_and_std(
    dents: Sequence[PatchDents], target: TargetPatches, variance_within: float
) -> tuple[Estimate, Estimate]:
    """Mean and standard deviation of the coverage from the means of exp(-x) and exp(-2 x)."""
    uncovered = UncoveredFraction(dents, target.area, target.time_ratio, target.dent_area)
    m1, m2 = uncovered.mean, uncovered.mean_square
    exposed = 1.0 - target.hidden_fraction
    mean = exposed * (1.0 - m1)
    variance = exposed * (1.0 - 2.0 * m1 + m2) - mean**2
    max_shift, max_added = _max_effect_of_variance(variance_within, m1)
    # Half of what v takes off the mean, and of what it adds to the variance.
    shift = exposed * min(variance_within * max(m1, 0.0) / 2.0, max_shift) / 2.0
    added = exposed * min(variance_within * max(m2, 0.0), max_added) / 2.0
    of_variance = estimate(
        variance + added + uncovered.replica_deviations(2.0 * exposed * (mean - 1.0), exposed),
        0.0,
        0.25,
        added,
    )
    # The square root is steep at 0: the chord over the interval of the variance takes the place of
    # the tangent. If that interval reaches 0, so does the one of the standard deviation, and the
    # length of its upper side serves for both sides.
    value, reach, slope = math.sqrt(of_variance.value), of_variance.half_width, 0.0
    if 0.0 < reach < math.inf:
        low = math.sqrt(max(0.0, of_variance.value - reach))
        high = math.sqrt(of_variance.value + reach)
        slope = (high - low) / (2.0 * reach) if low > 0.0 else high / reach
    of_std = value + slope * (np.array(of_variance.pseudovalues) - of_variance.value)
    of_mean = mean - shift + uncovered.replica_deviations(-exposed, 0.0)
    return estimate(of_mean, 0.0, 1.0, shift), estimate(of_std, 0.0, 0.5, slope * added)


def _max_effect_of_variance(variance: float, uncovered: float) -> tuple[float, float]:
    """Largest effect on coverage that x can have by varying within patches.

    The second order of a Taylor series exceeds all bounds where the variance is large, but x is not
    below 0. Of all x >= 0 with one mean and variance, exp(-x) has the largest mean if x is 0 or one
    other value (the lower principal representation: S. Karlin and W. J. Studden, "Tchebycheff
    Systems", Wiley 1966, chapter 3).

    Args:
        variance: variance of x.
        uncovered: exp(-x) of the mean x.

    Returns:
        What it takes off the mean coverage at most, and adds to the variance of coverage.
    """
    if not (variance > 0.0 and 0.0 < uncovered < 1.0):
        return 0.0, 0.0
    mean = -math.log(uncovered)
    share, covered = mean**2 / (mean**2 + variance), -math.expm1(-(mean + variance / mean))
    return 1.0 - uncovered - share * covered, share * (1.0 - share) * covered**2


def time_to_98_estimate(p05: Estimate, seconds: float) -> Estimate:
    """Time [s] to full coverage from p05_coverage after `seconds`.

    Where it is never reached, the value is NEVER and the interval as wide. The chord over the
    interval takes the place of the tangent, because the time is steep where little is covered.
    """
    value, slope = seconds_to_98(p05.value, seconds), 0.0
    reach = min(p05.half_width, 1.0)
    if reach > 0.0 and value < NEVER:
        slow, fast = (seconds_to_98(p05.value + side * reach, seconds) for side in (-1.0, 1.0))
        slope = (fast - slow) / (2.0 * reach)
    pseudovalues = value + slope * (np.array(p05.pseudovalues) - p05.value)
    found = estimate(pseudovalues, 0.0, NEVER, abs(slope) * p05.bias)
    if value == NEVER:
        return Estimate(found.value, NEVER, found.pseudovalues, found.bias)
    return found


def _jackknife_pseudovalues(values: np.ndarray) -> np.ndarray:
    """Pseudo-values about a value that needs no correction of its bias.

    Args:
        values: of all replicas, and of all but each, (n + 1,).
    """
    n = len(values) - 1
    if n == 0:
        return values
    raw = n * values[0] - (n - 1) * values[1:]
    return raw + (values[0] - raw.mean())


def _p05(
    parts: Sequence[np.ndarray],
    totals: np.ndarray,
    target: TargetPatches,
    variance_within: float,
    mean: Estimate,
    std: Estimate,
) -> Estimate:
    """The 5th percentile of coverage over the target's area, with the hidden area at 0.

    Args:
        parts: dented area of each patch in each replica [m²], (p,) each.
        totals: their sum, (p,).
    """
    n = len(parts)
    share = (P05 - target.hidden_fraction) / (1.0 - target.hidden_fraction)
    if share <= 0.0 or target.dent_area == 0.0:
        return Estimate(0.0, 0.0 if n > 1 else math.inf, (0.0,) * n)
    exposure = target.area * n / (target.time_ratio * target.dent_area)
    counts = totals / target.dent_area
    mixture = RateMixture(exposure, target.area, counts)
    without_each = (
        [mixture.low_quantile(counts - part / target.dent_area, share) for part in parts]
        if n > 1
        else []
    )
    x = np.array(
        [mixture.low_quantile(counts, share), *(n / (n - 1) * one for one in without_each)]
    )
    # If all of the variance within patches were there, x would lie as far below the mean as before
    # in standard deviations.
    mean_x, variance = mixture.moments(counts)
    widening = math.sqrt(1.0 + variance_within / variance) if variance_within > 0.0 else 1.0
    widened = max(0.0, mean_x - (mean_x - x[0]) * widening)
    # Other assumptions on the distribution of x.
    alternatives = np.array(
        [
            mixture.low_quantile(counts, share, MANY_STEPS),
            mixture.shrunken_low_quantile(counts, share),
        ]
    )
    value = -math.expm1(-x[0])
    bias = float(np.abs(value + np.expm1(-alternatives)).max()) + abs(value + math.expm1(-widened))
    # How far p05 lies below the mean goes with the standard deviation and is known no better. Where
    # that may be 0, a normal distribution tells how far at most.
    below = abs(mean.value - value)
    if std.value > std.half_width:
        bias += std.half_width / std.value * below
    else:
        bias += max(below, P05_OF_NORMAL * (std.value + std.half_width) - below)
    return estimate(_jackknife_pseudovalues(-np.expm1(-x)), 0.0, 1.0, bias)


def _variance_within(replicas: Sequence[Tally], target: TargetPatches, chamber: Chamber) -> float:
    """Variance of x over the triangles less that over the patches, both free of counting noise.

    Squares are made of pairs of dents from different replicas. Within one replica a ball that
    bounces on its spot puts all of its dents on one triangle, which tells nothing of where dents
    fall in the next. A single replica offers only the pairs of its own dents.
    """
    on, n = target.patch >= 0, len(replicas)
    exposed, patch, count = chamber.exposed_area[on], target.patch[on], len(target.area)
    dented = np.array(
        [np.bincount(replica.dent_triangle, replica.dent_area, len(on))[on] for replica in replicas]
    )
    dented_patch = np.array([np.bincount(patch, one, count) for one in dented])
    if n > 1:
        own, own_patch, pairs = (
            (dented**2).sum(axis=0),
            (dented_patch**2).sum(axis=0),
            n / (n - 1),
        )
    else:
        own = np.bincount(replicas[0].dent_triangle, replicas[0].dent_area ** 2, len(on))[on]
        own_patch, pairs = np.bincount(patch, own, count), 1.0
    triangles = ((dented.sum(axis=0) ** 2 - own) / exposed).sum()
    merged = ((dented_patch.sum(axis=0) ** 2 - own_patch) / target.area).sum()
    return max(
        0.0, float((target.time_ratio / n) ** 2 * pairs * (triangles - merged) / target.area.sum())
    )


def few_dents_note(replicas: Sequence[Tally], target: TargetPatches) -> tuple[str, ...]:
    """A note if triangles had to be merged, or if nothing was hit."""
    dents = sum(int(replica.dents[target.patch >= 0].sum()) for replica in replicas)
    if not target.are_merged and dents:
        return ()
    return (
        f"only {dents / target.triangles:.1f} dents per target triangle were simulated: "
        f"neighbouring triangles are merged into {len(target.area)} patches, which makes the "
        "intervals wider; raise process.accuracy.simulated_time_s or replicas, or mesh the part "
        "more coarsely",
    )
