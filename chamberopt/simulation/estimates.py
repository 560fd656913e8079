"""Estimate the metrics of a candidate from the impacts of its replicas, with intervals.

Notation
    g     number of batches of replicas; a batch is one replica unless there are many
    S     a metric as a function of the impacts of some batches
    y_j   pseudo-value of batch j: g S(all) - (g - 1) S(all but j)

Coverage, the time to full coverage and figures of strength have estimators of their own
(coverage_intervals.py, percentile.py, strength_intervals.py and stress_profile.py in coverage). The
other metrics are ratios of sums: the delete-one jackknife over batches corrects their bias of order
1/g and gives the standard error (B. Efron and R. J. Tibshirani, "An Introduction to the Bootstrap",
Chapman & Hall 1993, chapter 11).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.chamber.build import TARGET
from chamberopt.chamber.checks.gaps import MIN_MISSED_SHARE
from chamberopt.common.estimate import (
    NOT_RESOLVED,
    Estimate,
    estimate,
    shared_half_width,
    sum_of_shared,
)
from chamberopt.common.number_text import plain, share_in_words
from chamberopt.coverage.coverage_from_impacts import (
    Prints,
    batches_of,
    in_batches,
    kept_footprints,
    locate_dents,
)
from chamberopt.coverage.coverage_intervals import Resolution, coverage_estimates, find_resolution
from chamberopt.coverage.field.surface_points import CERTAIN, RULE_OF_THREE, Reach
from chamberopt.coverage.field.target_field import Gauge, TargetField
from chamberopt.coverage.metrics import (
    METRICS,
    OF_STRIP,
    P05,
    ObjectiveFunction,
    exposed_target,
    find_metric,
    highest_uniform_coverage,
    parse_objective,
)
from chamberopt.coverage.part_impacts import Hits, TargetImpacts
from chamberopt.coverage.percentile import sum_dents, time_to_98
from chamberopt.coverage.strength_intervals import strength_estimates
from chamberopt.coverage.stress_profile import stress_estimates
from chamberopt.design.calibration import calibrated_strip

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.calibration import Calibration
    from chamberopt.design.load import Design


OF_EACH_STEP = "of each step"
SHARES = frozenset({"mean_coverage", "std_coverage", "p05_coverage", "p95_coverage"})


@dataclass
class SeenDents:
    """The dents of all replicas so far, counted in windows (discs of the surface) of two sizes.

    The smaller size is the gauge, which the design sets, and the larger has twice its radius. A
    surface that is alike in several sectors has windows in one sector, into which all impacts are
    turned.
    """

    field: TargetField
    gauge: list[Prints]
    wide: list[Prints]
    in_sector: list[Hits]
    has_wide: bool = True  # whether dents are counted in the larger windows at all

    @classmethod
    def none(cls, field: TargetField, has_wide: bool = True) -> SeenDents:
        """Return the dents of a surface before the first replica: none."""
        return cls(field, [], [], [], has_wide)

    def add(self, hits: Sequence[Hits]) -> None:
        """Add the dents of new replicas.

        Args:
            hits: impacts of all replicas, of which the first were added before.
        """
        for one in hits[len(self.gauge) :]:
            in_sector = self.field.in_sector(one)
            dents = locate_dents(self.field, in_sector)
            self.in_sector.append(in_sector)
            self.gauge.append(kept_footprints(self.field, self.field.gauge, dents))
            if self.has_wide:
                self.wide.append(kept_footprints(self.field, self.field.wide, dents))

    @property
    def crease_share(self) -> float:
        """Share of the dented area that is on creases, the sharp edges of the surface."""
        area = sum(one.area for one in self.gauge)
        return sum(one.area_on_creases for one in self.gauge) / area if area else 0.0


class Estimates(NamedTuple):
    """The metrics of some replicas in windows of two sizes, and if dents suffice for them."""

    metrics: dict[str, Estimate]
    metrics_of_wide: dict[str, Estimate]
    resolution: Resolution


def estimate_metrics(
    seen: SeenDents, hits: Sequence[Hits], chamber: Chamber, design: Design
) -> Estimates:
    """Estimate all metrics from the impacts of replicas.

    The half-widths of the intervals are infinite if there is a single replica.
    """
    found, resolution = raw_estimates(seen, design)
    found |= _ratios(in_batches(hits), chamber, design)
    metrics = _all_resolved({name: found[name] for name in METRICS if name in found}, resolution)
    if not seen.has_wide:
        return Estimates(metrics, {}, resolution)
    of_wide = window_estimates(seen.field, seen.field.wide, seen.wide, design)
    return Estimates(metrics, _all_resolved(*of_wide), resolution)


def estimate_zones(
    zones: Mapping[str, SeenDents], hits: Sequence[Hits], chamber: Chamber, design: Design
) -> tuple[dict[str, Estimate], tuple[str, ...]]:
    """Return the metrics of zones, by names such as root.mean_coverage, and notes for the user.

    Args:
        zones: the dents on each zone, by its name.
    """
    metrics: dict[str, Estimate] = {}
    notes: list[str] = []
    for zone, seen in zones.items():
        found = estimate_metrics(seen, hits, chamber.on_zone(zone), design)
        of_zone = {f"{zone}.{name}": one for name, one in found.metrics.items()}
        metrics |= {name: one for name, one in of_zone.items() if find_metric(name)}
        surface = f"zone {zone}"
        notes += reach_notes(seen.field.reach, surface)
        notes += resolution_notes(found.resolution, surface)
        notes += strength_notes(found.metrics, found.resolution, surface)
        if seen.field.is_one_window:
            notes.append(
                f"zone {zone}: smaller than two windows, so intensity_uniformity is not resolved: "
                "lower process.accuracy.gauge_mm2, and simulate longer, to see differences in it"
            )
    return metrics, tuple(notes)


def told_of_each_step(metrics: Mapping[str, Estimate]) -> dict[str, Estimate]:
    """Return metrics without those of intensity, for steps whose balls or amplitudes differ.

    A strip is peened in one step, so that no strip has the intensity of such steps together.
    """
    return {
        name: one.not_known(OF_EACH_STEP) if name.rpartition(".")[2] in OF_STRIP else one
        for name, one in metrics.items()
    }


def raw_estimates(seen: SeenDents, design: Design) -> tuple[dict[str, Estimate], Resolution]:
    """Return the metrics of coverage and intensity, and the dents that they have and need.

    They are measured in windows, discs of the area that the design sets (the gauge). The metrics
    have intervals even where there are too few dents.
    """
    found, resolution = window_estimates(seen.field, seen.field.gauge, seen.gauge, design)
    process, batches = design.process, in_batches(seen.in_sector)
    shot = design.shot.density, calibrated_strip(design.shot, design.calibration)
    found |= strength_estimates(seen.field, batches, process.recorded_time, *shot)
    found |= _calibrated(found, design.calibration)
    found |= stress_estimates(seen.field, batches, design, found)
    return found, resolution


def _calibrated(
    found: Mapping[str, Estimate], calibration: Calibration | None
) -> dict[str, Estimate]:
    """Return the Almen intensities and the saturation time of a real strip, by name.

    The result is empty unless the calibration measured strips.
    """
    if calibration is None or not calibration.has_strips:
        return {}
    figures = {
        f"almen_intensity{which}": found[f"strength{which}_um"].times(
            calibration.intensity_mmA(1.0)
        )
        for which in ("", "_p05", "_p95")
    }
    time = found["saturation_time_s"].times(1.0 / calibration.factor("beta"))
    return {**figures, "saturation_time_s": time}


def window_estimates(
    field: TargetField, gauge: Gauge, prints: Sequence[Prints], design: Design
) -> tuple[dict[str, Estimate], Resolution]:
    """Return the metrics of coverage in windows of one size, and the dents that they have and need.

    A window is a disc of the surface in which dents are counted.
    """
    process = design.process
    time_ratio = process.treatment_time / process.recorded_time
    batches = batches_of(prints)
    sums = replace(sum_dents(batches, len(gauge.area)), has_levels=bool(design.steps))
    found = coverage_estimates(batches, sums, field.reach, time_ratio)
    found["time_to_98_s"] = time_to_98(
        found["p05_coverage"], sums, field.reach, time_ratio, process.treatment_time
    )
    known_to = least_half_width(field.reach, prints)
    for name in SHARES & found.keys():
        found[name] = found[name].at_least_as_wide(known_to)
    return found, find_resolution(batches, sums, gauge, time_ratio, process.recorded_time)


def least_half_width(reach: Reach, prints: Sequence[Prints]) -> float:
    """Return the least half-width that the interval of a share of the target may have.

    The share in reach of the balls is measured at random points, and has an error by their choice.
    By the rule of three, a share 3 / n of the target may lack dents by chance, if there are n
    dents. The least half-width is the larger of this error and this share.
    """
    area, squares = sum(one.area for one in prints), sum(one.squares for one in prints)
    dents = area**2 / squares if squares else 0.0  # as many, all alike, would scatter as these do
    return max(shared_half_width([reach.error]), RULE_OF_THREE / max(dents, RULE_OF_THREE))


def _all_resolved(found: Mapping[str, Estimate], resolution: Resolution) -> dict[str, Estimate]:
    """Return all estimates, without intervals where there are too few dents for them.

    The mean coverage needs many dents where nearly all is covered. If there are too few, the 5th
    percentile of the coverage gives it a lower bound.
    """
    shown = {name: as_resolved(name, one, resolution) for name, one in found.items()}
    for name in SHARES & shown.keys():
        one = shown[name]
        shown[name] = replace(one, in_words=one.in_words or share_in_words(one))
    mean, p05 = shown["mean_coverage"], shown["p05_coverage"]
    if mean.in_words == NOT_RESOLVED and 0.0 < p05.low < math.inf:
        least = 100.0 * (1.0 - P05) * p05.low
        shown["mean_coverage"] = mean.not_known(f"more than {math.floor(least)} %")
    return shown


def as_resolved(name: str, value: Estimate, resolution: Resolution) -> Estimate:
    """Return the estimate of a metric, without its interval if there are too few dents for it."""
    metric = METRICS[name]
    enough = resolution.has_places if metric.of_places else resolution.has_mean
    # A percentile of exactly 0 follows from places out of reach, not from dents.
    is_exact = metric.of_places and value.value == value.half_width == 0.0
    has_interval = math.isfinite(value.half_width) or value.in_words != ""
    if metric.of_impacts is not None or is_exact or value.in_words == "never":
        return value
    if enough and has_interval:
        return value
    return value.not_known(NOT_RESOLVED)


def growth_for_dents(objective_name: str, resolution: Resolution) -> float:
    """Return the factor on the simulated time that gives an objective the dents that it needs.

    It is 1 or less if they are there, and infinite if the median window has none.
    """
    metrics = map(find_metric, parse_objective(objective_name).terms)
    of_places = any(metric is not None and metric.of_places for metric in metrics)
    needed = resolution.needed_for_places if of_places else resolution.needed_for_mean
    return needed / resolution.dents if resolution.dents else math.inf


def _ratios(
    batches: Sequence[Sequence[Hits]], chamber: Chamber, design: Design
) -> dict[str, Estimate]:
    """Return estimates of the metrics that are ratios of sums over impacts, such as mean speeds."""
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


LEAST = METRICS["p05_coverage"].summary


def reach_notes(reach: Reach, surface: str = TARGET) -> tuple[str, ...]:
    """Return a note on the highest coverage of a surface that balls do not reach everywhere.

    There is no note if balls reach all of the surface.
    """
    reachable, beyond = reach.share, reach.beyond(1.0 - P05)
    if reachable > 1.0 - MIN_MISSED_SHARE:
        return ()
    highest = highest_uniform_coverage(reachable)
    uniform = f" or a uniform coverage above {highest:.2f}" if surface == TARGET else ""
    bare = f", and the {LEAST} is 0" if beyond <= -CERTAIN else ""
    if abs(beyond) < CERTAIN:
        bare = (
            f"; whether the {LEAST} is 0 is not resolved, as the share in reach is known to "
            f"± {shared_half_width([reach.error]):.1%} only: raise process.accuracy.points"
        )
    return (
        f"{1.0 - reachable:.1%} of {surface} is out of reach of the balls and counts as bare: no "
        f"chamber with so much of it has a mean coverage above {reachable:.2f}{uniform}{bare}",
    )


def resolution_notes(found: Resolution, surface: str = TARGET) -> tuple[str, ...]:
    """Return a note on the figures of a surface that have too few dents, and on the time they need.

    There is no note if all figures have enough dents.
    """
    if found.has_mean and found.has_places:
        return ()
    if not found.dents:
        return (
            f"fewer than half of the windows of {surface} were hit: no figure of it is resolved; "
            "raise process.accuracy.simulated_time_s or replicas, or process.accuracy.gauge_mm2",
        )
    needs = [
        f"{what} {plain(needed, 3)} (about {plain(found.time_for(needed), 2)} s of all replicas)"
        for what, needed, there in (
            ("mean and standard deviation take", found.needed_for_mean, found.has_mean),
            ("5th percentile, times and intensity take", found.needed_for_places, found.has_places),
        )
        if not there
    ]
    return (
        f"the median window of {surface} has {found.dents:.1f} dents after "
        f"{plain(found.simulated_time, 3)} s: {', '.join(needs)}; raise "
        "process.accuracy.simulated_time_s or replicas, or process.accuracy.gauge_mm2",
    )


def strength_notes(
    metrics: Mapping[str, Estimate], resolution: Resolution, surface: str = TARGET
) -> tuple[str, ...]:
    """Return a note if dents are too few for strength and saturation time only."""
    saturation = metrics["saturation_time_s"]
    if saturation.in_words != NOT_RESOLVED or not resolution.has_places or not saturation.value:
        return ()
    seconds = plain(resolution.simulated_time, 3)
    return (
        f"on {surface} a strip would saturate after {plain(saturation.value, 2)} s or more, by "
        f"dents of which the {seconds} s of all replicas hold too few: strength and "
        "saturation take twice that time or more; raise process.accuracy.simulated_time_s or "
        "replicas",
    )


def objective_estimate(name: str, metrics: Mapping[str, Estimate], design: Design) -> Estimate:
    """Return the estimate of an objective of a design. Its numbers are exact in all replicas."""
    objective, known = parse_objective(name), dict(metrics)
    count = max(len(one.pseudovalues) for one in metrics.values())
    for term in objective.terms.keys() - known.keys():
        value = design.value(term)
        known[term] = Estimate(value, 0.0, (value,) * count)
    return weighted_sum(objective, known)


def weighted_sum(objective: ObjectiveFunction, metrics: dict[str, Estimate]) -> Estimate:
    """Return the estimate of an objective, the weighted sum of metrics.

    The interval accounts for errors that the metrics have in common.
    """
    terms = [(weight, metrics[name]) for name, weight in objective.terms.items()]
    value = sum(weight * metric.value for weight, metric in terms)
    columns = [weight * np.array(metric.pseudovalues) for weight, metric in terms]
    spread = estimate(np.sum(columns, axis=0), shared=sum_of_shared(terms))
    # The words of a metric hold for an objective of this metric alone.
    words = next((metric.in_words for _, metric in terms if metric.in_words), "")
    if len(terms) > 1:
        words = "" if all(metric.has_number for _, metric in terms) else NOT_RESOLVED
    bias = sum(abs(weight) * metric.bias for weight, metric in terms)
    # Biases, and the extra width of steep intervals, may all go one way, so they are added.
    more = sum(abs(weight) * metric.beyond_scatter for weight, metric in terms)
    is_open = words == NOT_RESOLVED or any(math.isinf(metric.half_width) for _, metric in terms)
    half_width = math.inf if is_open else spread.half_width + more
    return replace(spread, value=value, half_width=half_width, bias=bias, in_words=words)
