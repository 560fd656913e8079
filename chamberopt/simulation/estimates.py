"""Estimate the metrics of a candidate from the impacts of its replicas, with intervals.

Notation
    g     number of batches of replicas; a batch is one replica unless there are many
    S     a metric as a function of the impacts of some batches
    y_j   pseudo-value of batch j: g S(all) - (g - 1) S(all but j)

Coverage, the time to full coverage and the intensity uniformity have estimators of their own
(coverage/coverage_intervals.py, coverage/strength.py). The other metrics are ratios of sums: the
delete-one jackknife over batches corrects their bias of order 1/g and gives the standard error (B.
Efron and R. J. Tibshirani, "An Introduction to the Bootstrap", Chapman & Hall 1993, chapter 11).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.common.estimate import Estimate, estimate, sum_of_shared
from chamberopt.coverage.coverage_from_impacts import (
    Footprints,
    batches_of,
    find_footprints,
    in_batches,
    locate_dents,
)
from chamberopt.coverage.coverage_intervals import coverage_estimates
from chamberopt.coverage.field.target_field import Gauge, TargetField
from chamberopt.coverage.metrics import METRICS, P05, ObjectiveFunction, exposed_target
from chamberopt.coverage.part_impacts import Hits, TargetImpacts
from chamberopt.coverage.percentile import time_to_98
from chamberopt.coverage.resolution import NOT_RESOLVED, Resolution, find_resolution
from chamberopt.coverage.strength import intensity_uniformity

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design


@dataclass
class SeenDents:
    """The dents of the replicas so far, in windows of both sizes."""

    field: TargetField
    gauge: list[Footprints]
    wide: list[Footprints]

    def add(self, hits: Sequence[Hits]) -> None:
        """Look at the replicas that are new."""
        for one in hits[len(self.gauge) :]:
            dents = locate_dents(self.field, one)
            self.gauge.append(find_footprints(self.field, self.field.gauge, dents))
            self.wide.append(find_footprints(self.field, self.field.wide, dents))

    @property
    def crease_share(self) -> float:
        """Share of the dented area of the target that is on creases."""
        area = sum(one.area for one in self.gauge)
        return sum(one.area_on_creases for one in self.gauge) / area if area else 0.0


class Estimates(NamedTuple):
    """The metrics of some replicas, and how well they are resolved."""

    metrics: dict[str, Estimate]
    metrics_of_wide: dict[str, Estimate]
    resolution: Resolution


def estimate_metrics(
    seen: SeenDents, hits: Sequence[Hits], chamber: Chamber, design: Design
) -> Estimates:
    """Estimate all metrics from replicas; with a single one the half-widths are infinite."""
    found, resolution = raw_estimates(seen, hits, design)
    found |= _ratios(in_batches(hits), chamber, design)
    of_wide, resolution_of_wide = window_estimates(seen.field, seen.field.wide, seen.wide, design)
    return Estimates(
        _all_resolved({name: found[name] for name in METRICS}, resolution),
        _all_resolved(of_wide, resolution_of_wide),
        resolution,
    )


def raw_estimates(
    seen: SeenDents, hits: Sequence[Hits], design: Design
) -> tuple[dict[str, Estimate], Resolution]:
    """Metrics of coverage and intensity at the gauge, with intervals even where not resolved."""
    found, resolution = window_estimates(seen.field, seen.field.gauge, seen.gauge, design)
    uniformity = intensity_uniformity(seen.field, in_batches(hits), design.shot.density)
    return found | {"intensity_uniformity": uniformity}, resolution


def window_estimates(
    field: TargetField, gauge: Gauge, prints: list[Footprints], design: Design
) -> tuple[dict[str, Estimate], Resolution]:
    """Metrics of coverage in windows of one size."""
    process = design.process
    time_ratio = process.treatment_time / process.recorded_time
    batches = batches_of(prints)
    found = coverage_estimates(
        batches, len(gauge.area), field.reachable, time_ratio, field.reachable_error
    )
    found["time_to_98_s"] = time_to_98(
        found["p05_coverage"], batches, len(gauge.area), field.reachable, time_ratio,
        process.treatment_time,
    )  # fmt: skip
    return found, find_resolution(batches, gauge, time_ratio, process.recorded_time)


def _all_resolved(found: Mapping[str, Estimate], resolution: Resolution) -> dict[str, Estimate]:
    """All estimates as far as they are resolved; the mean at least by a bound, where there is one.

    The mean takes many dents where nearly all is covered, and then the 5th percentile is known.
    """
    shown = {name: as_resolved(name, one, resolution) for name, one in found.items()}
    mean, p05 = shown["mean_coverage"], shown["p05_coverage"]
    if mean.in_words == NOT_RESOLVED and 0.0 < p05.low < math.inf:
        least = 100.0 * (1.0 - P05) * p05.low
        shown["mean_coverage"] = mean.not_known(f"more than {math.floor(least)} %")
    return shown


def as_resolved(name: str, value: Estimate, resolution: Resolution) -> Estimate:
    """The estimate of a metric, without an interval if there are too few dents for one."""
    metric = METRICS[name]
    enough = resolution.has_places if metric.of_places else resolution.has_mean
    # 0 follows from places out of reach.
    is_exact = metric.of_places and value.value == value.half_width == 0.0
    has_interval = math.isfinite(value.half_width) or value.in_words != ""
    if metric.of_impacts is not None or is_exact or value.in_words == "never":
        return value
    if enough and has_interval:
        return value
    return value.not_known(NOT_RESOLVED)


def _ratios(
    batches: Sequence[Sequence[Hits]], chamber: Chamber, design: Design
) -> dict[str, Estimate]:
    """Estimates of the metrics that are ratios of sums over impacts."""
    exposed, count = exposed_target(chamber), len(batches)
    area, time = float(chamber.exposed_area[exposed].sum()), design.process.recorded_time
    on_target = [tuple(hits.on(exposed) for hits in batch) for batch in batches]

    def impacts(some: Sequence[tuple[Hits, ...]]) -> TargetImpacts:
        hits = tuple(one for batch in some for one in batch)
        return TargetImpacts(hits, time * len(hits), area)

    whole = impacts(on_target)
    rests = [impacts(on_target[:j] + on_target[j + 1 :]) for j in range(count)] if count > 1 else []
    estimates = {}
    for name, metric in METRICS.items():
        if metric.of_impacts is None:
            continue
        plain = metric.of_impacts(whole, design)
        without = np.array([metric.of_impacts(rest, design) for rest in rests])
        pseudovalues = count * plain - (count - 1) * without if rests else np.array([plain])
        estimates[name] = estimate(pseudovalues, metric.lowest, metric.highest)
    return estimates


def resolution_notes(found: Resolution) -> tuple[str, ...]:
    """What is not resolved, and the simulated time that would do."""
    if found.has_mean and found.has_places:
        return ()
    if not found.dents:
        return (
            "fewer than half of the target's windows were hit: no figure of it is resolved; raise "
            "process.accuracy.simulated_time_s or replicas, or process.accuracy.gauge_mm2",
        )
    needs = [
        f"{what} {needed:.3g} (about {found.time_for(needed):.2g} s of all replicas)"
        for what, needed, there in (
            ("mean and standard deviation take", found.needed_for_mean, found.has_mean),
            ("5th percentile, times and intensity take", found.needed_for_places, found.has_places),
        )
        if not there
    ]
    return (
        f"the median window has {found.dents:.1f} dents after {found.simulated_time:.3g} s: "
        f"{', '.join(needs)}; raise process.accuracy.simulated_time_s or replicas, or "
        "process.accuracy.gauge_mm2",
    )


def weighted_sum(objective: ObjectiveFunction, metrics: dict[str, Estimate]) -> Estimate:
    """The objective from the metrics, with an interval that knows how they move together."""
    terms = [(weight, metrics[name]) for name, weight in objective.terms.items()]
    value = sum(weight * metric.value for weight, metric in terms)
    columns = [weight * np.array(metric.pseudovalues) for weight, metric in terms]
    spread = estimate(np.sum(columns, axis=0), shared=sum_of_shared(terms))
    # Words of a single metric are true of it alone.
    words = next((metric.in_words for _, metric in terms if metric.in_words), "")
    words = NOT_RESOLVED if words and len(terms) > 1 else words
    bias = sum(abs(weight) * metric.bias for weight, metric in terms)
    # Biases, and by how much a steep interval is wider, may all go one way.
    more = sum(abs(weight) * metric.beyond_scatter for weight, metric in terms)
    is_open = words == NOT_RESOLVED or any(math.isinf(metric.half_width) for _, metric in terms)
    half_width = math.inf if is_open else spread.half_width + more
    return replace(spread, value=value, half_width=half_width, bias=bias, in_words=words)
