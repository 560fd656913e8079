"""Replicas -> mean, spread and poorest twentieth of the coverage over the target, each with its interval.

The expectation of mean and spread does not depend on how long was simulated (uncovered.py); that of the poorest
twentieth does as little as can be (mixture.py). Both want a few dents on a triangle for each unit of dented area over
area at the treatment time. Where there are fewer, neighbours are taken together, and what differs
within such a patch is known only by its variance: figures are then put between "nothing" and "all of it lies in
the patches", and the interval reaches both.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.coverage.coverage_from_impacts import Tally
from chamberopt.coverage.metrics import NEVER, exposed_target, require_target, seconds_to_98
from chamberopt.coverage.statistics.confidence_interval import Estimate, estimate
from chamberopt.coverage.statistics.poisson_survival import Bare, Dents
from chamberopt.coverage.statistics.rate_mixture import MANY_STEPS, Mixture
from chamberopt.coverage.statistics.triangle_patches import patches
from chamberopt.geometry.triangles import unit_normals

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design

# Dents on a patch for each unit of x, dented area over area at the treatment time. The product over dents scatters no
# more than what it estimates from 1 on, its interval from 2 on; 3 for places where dents are larger than elsewhere
# (400 triangles, a quarter in shadow: intervals of the spread held the truth in 88 % at 2, in 96 % at 3).
LEAST_EXPOSURE = 3.0
POOREST = 0.05
NORMAL = 1.645  # standard deviations: how far below the mean of a normal distribution its poorest twentieth ends


@dataclass(frozen=True)
class TargetPatches:
    """The exposed target as the estimators see it.

    patch (m,): of each part triangle, -1 off the target · area (p,) m² of the patches · hidden: share of the target's
    area outside the cavity, never covered · stretch: treatment time over one replica's simulated time · dent: area
    [m²] of dents that, all alike, would scatter as these do · triangles: how many of them are in the patches.
    """

    patch: np.ndarray
    area: np.ndarray
    hidden: float
    stretch: float
    dent: float
    triangles: int

    @property
    def are_merged(self) -> bool:
        """Whether neighbours had to be taken together."""
        return len(self.area) < self.triangles


def target_patches(replicas: Sequence[Tally], chamber: Chamber, design: Design) -> TargetPatches:
    """The target of a chamber, in patches that the dents of these replicas suffice for. InputError if there is none."""
    require_target(chamber)
    exposed = exposed_target(chamber)
    target = np.flatnonzero(exposed)
    area = chamber.exposed_area[target]
    stretch = design.process.treatment_time / replicas[0].simulated_time
    sizes = np.concatenate(
        [replica.dent_area[exposed[replica.dent_triangle]] for replica in replicas]
    )
    dent = float((sizes**2).sum() / sizes.sum()) if len(sizes) else 0.0
    exposure = area * len(replicas) / stretch / dent if dent else np.full(len(area), LEAST_EXPOSURE)
    patch = np.full(len(chamber.part.triangles), -1)
    patch[target] = patches(_places(chamber, target, exposure), exposure, LEAST_EXPOSURE)
    sizes_of = np.bincount(patch[target], area)
    all_area = chamber.part.area[chamber.part.target].sum()
    return TargetPatches(
        patch, sizes_of, max(0.0, 1.0 - float(area.sum() / all_area)), stretch, dent, len(target)
    )


def _places(chamber: Chamber, target: np.ndarray, exposure: np.ndarray) -> np.ndarray:
    """Where triangles are, (m, 6): middle points, and normals as long as two patches: an edge parts neighbours."""
    corners = chamber.part.vertices[chamber.part.triangles[target]]
    normal = unit_normals(corners)
    wide = math.sqrt(
        chamber.exposed_area[target].sum() * LEAST_EXPOSURE / max(exposure.sum(), LEAST_EXPOSURE)
    )
    return np.concatenate([corners.mean(axis=1), 2.0 * wide * normal], axis=1)


def coverage_estimates(
    replicas: Sequence[Tally], chamber: Chamber, ground: TargetPatches
) -> dict[str, Estimate]:
    """mean_coverage, std_coverage and p05_coverage at the treatment time, dents falling as Avrami has it."""
    dents, parts, totals = [], [], np.zeros(len(ground.area))
    for replica in replicas:
        patch = ground.patch[replica.dent_triangle]
        there = patch >= 0
        dents.append(Dents(patch[there], replica.dent_area[there]))
        parts.append(np.bincount(dents[-1].patch, dents[-1].area, len(ground.area)))
        totals += parts[-1]
    lost = _variance_within(replicas, ground, chamber) if ground.are_merged else 0.0
    mean, std = _mean_and_std(dents, ground, lost)
    return {
        "mean_coverage": mean,
        "std_coverage": std,
        "p05_coverage": _poorest(parts, totals, ground, lost, mean, std),
    }


def _mean_and_std(
    dents: Sequence[Dents], ground: TargetPatches, lost: float
) -> tuple[Estimate, Estimate]:
    """From the means of exp(-x) and exp(-2 x); lost: variance of x within patches."""
    bare = Bare(dents, ground.area, ground.stretch, ground.dent)
    seen = 1.0 - ground.hidden
    mean = seen * (1.0 - bare.once)
    variance = seen * (1.0 - 2.0 * bare.once + bare.twice) - mean**2
    off, more = _at_most(lost, bare.once)
    shift = (
        seen * min(lost * max(bare.once, 0.0) / 2.0, off) / 2.0
    )  # half of what it takes off the mean
    wider = (
        seen * min(lost * max(bare.twice, 0.0), more) / 2.0
    )  # ... and of what it adds to the variance
    spread = estimate(
        variance + wider + bare.swing(2.0 * seen * (mean - 1.0), seen), 0.0, 0.25, wider
    )
    # sqrt is steep at 0: the chord over the interval of the variance instead of the tangent; where that interval
    # reaches 0, so does the one of the spread, with the upper end's own length to each side.
    value, reach, slope = math.sqrt(spread.value), spread.half_width, 0.0
    if 0.0 < reach < math.inf:
        low, high = math.sqrt(max(0.0, spread.value - reach)), math.sqrt(spread.value + reach)
        slope = (high - low) / (2.0 * reach) if low > 0.0 else high / reach
    moved = value + slope * (np.array(spread.pseudovalues) - spread.value)
    return estimate(mean - shift + bare.swing(-seen, 0.0), 0.0, 1.0, shift), estimate(
        moved, 0.0, 0.5, slope * wider
    )


def _at_most(lost: float, bare: float) -> tuple[float, float]:
    """How much an x of this variance at most takes off the mean coverage, and adds to its variance; ``bare``: of the
    mean x. Second order alone goes beyond all bounds where the variance is large: x is not below 0.

    Of all x >= 0 with one mean and variance, exp(-x) has the largest mean when x is 0 or one other value (the lower
    principal representation: S. Karlin and W. J. Studden, "Tchebycheff Systems", Wiley 1966, chapter 3).
    """
    if not (lost > 0.0 and 0.0 < bare < 1.0):
        return 0.0, 0.0
    mean = -math.log(bare)
    hit, dented = mean**2 / (mean**2 + lost), -math.expm1(-(mean + lost / mean))
    return 1.0 - bare - hit * dented, hit * (1.0 - hit) * dented**2


def time_to_98_estimate(poorest: Estimate, seconds: float) -> Estimate:
    """Time [s] to full coverage from p05_coverage after `seconds`; never: objective.LONGEST, and an interval as wide.

    The chord over the interval instead of the tangent, as for the spread: the time is steep where little is covered.
    """
    value, slope = seconds_to_98(poorest.value, seconds), 0.0
    reach = min(poorest.half_width, 1.0)
    if reach > 0.0 and value < NEVER:
        slow, fast = (seconds_to_98(poorest.value + side * reach, seconds) for side in (-1.0, 1.0))
        slope = (fast - slow) / (2.0 * reach)
    moved = value + slope * (np.array(poorest.pseudovalues) - poorest.value)
    made = estimate(moved, 0.0, NEVER, abs(slope) * poorest.bias)
    return Estimate(made.value, NEVER, made.pseudovalues, made.bias) if value == NEVER else made


def _pseudovalues(values: np.ndarray) -> np.ndarray:
    """Of a figure without bias, (n + 1,) of all replicas and of all but each: the jackknife's, about the figure."""
    n = len(values) - 1
    if n == 0:
        return values
    raw = n * values[0] - (n - 1) * values[1:]
    return raw + (values[0] - raw.mean())


def _poorest(
    parts: Sequence[np.ndarray],
    totals: np.ndarray,
    ground: TargetPatches,
    lost: float,
    mean: Estimate,
    std: Estimate,
) -> Estimate:
    """The coverage that 95 % of the target's area exceeds; hidden area comes first, at 0."""
    n = len(parts)
    share = (POOREST - ground.hidden) / (1.0 - ground.hidden)
    if share <= 0.0 or ground.dent == 0.0:
        return Estimate(0.0, 0.0 if n > 1 else math.inf, (0.0,) * n)
    exposure = ground.area * n / (ground.stretch * ground.dent)
    counts = totals / ground.dent
    mixture = Mixture(exposure, ground.area, counts)
    without = (
        [n / (n - 1) * mixture.poorest(counts - part / ground.dent, share) for part in parts]
        if n > 1
        else []
    )
    x = np.array([mixture.poorest(counts, share), *without])
    middle, variance = mixture.moments(counts)
    # ... and had the patches all of the variance, this one as far below the mean as before in standard deviations.
    wider = math.sqrt(1.0 + lost / variance) if lost > 0.0 else 1.0
    joined = max(0.0, middle - (middle - x[0]) * wider)
    shaped = np.array(
        [mixture.poorest(counts, share, MANY_STEPS), mixture.poorest_drawn_in(counts, share)]
    )
    value = -math.expm1(-x[0])
    bias = float(np.abs(value + np.expm1(-shaped)).max()) + abs(value + math.expm1(-joined))
    # How far it lies below the mean goes with the spread, and is no better known; where that may be nothing at all, a
    # normal distribution says how far at most.
    below = abs(mean.value - value)
    if std.value > std.half_width:
        bias += std.half_width / std.value * below
    else:
        bias += max(below, NORMAL * (std.value + std.half_width) - below)
    return estimate(_pseudovalues(-np.expm1(-x)), 0.0, 1.0, bias)


def _variance_within(replicas: Sequence[Tally], ground: TargetPatches, chamber: Chamber) -> float:
    """Variance of x over the triangles less that over the patches, both free of the dents' own scatter.

    Squares are made of pairs of dents from different replicas: within one a ball that bounces on its spot puts all of
    its dents on one triangle, which says nothing of where dents fall in the next. Of a single replica, of all pairs.
    """
    on, n = ground.patch >= 0, len(replicas)
    exposed, patch, count = chamber.exposed_area[on], ground.patch[on], len(ground.area)
    each = np.array(
        [np.bincount(replica.dent_triangle, replica.dent_area, len(on))[on] for replica in replicas]
    )
    dented = np.array([np.bincount(patch, one, count) for one in each])
    if n > 1:
        own, own_together, pairs = (each**2).sum(axis=0), (dented**2).sum(axis=0), n / (n - 1)
    else:
        own = np.bincount(replicas[0].dent_triangle, replicas[0].dent_area ** 2, len(on))[on]
        own_together, pairs = np.bincount(patch, own, count), 1.0
    triangles = ((each.sum(axis=0) ** 2 - own) / exposed).sum()
    together = ((dented.sum(axis=0) ** 2 - own_together) / ground.area).sum()
    return max(
        0.0, float((ground.stretch / n) ** 2 * pairs * (triangles - together) / ground.area.sum())
    )


def few_dents_note(replicas: Sequence[Tally], ground: TargetPatches) -> tuple[str, ...]:
    """What to know where neighbours had to be taken together."""
    hits = sum(int(replica.dents[ground.patch >= 0].sum()) for replica in replicas)
    if not ground.are_merged and hits:
        return ()
    return (
        f"only {hits / ground.triangles:.1f} dents per target triangle were simulated: neighbouring triangles are "
        f"taken together in {len(ground.area)} patches, and the intervals are wider for it; raise "
        "process.accuracy.simulated_time_s or replicas, or mesh the part more coarsely",
    )
