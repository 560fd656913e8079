"""Evaluate a candidate: simulate independent replicas and estimate its metrics with intervals.

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
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.chamber.analytic import cavity_note
from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.estimate import Estimate, estimate, sum_of_shared
from chamberopt.common.parallel.executor import share
from chamberopt.common.progress import Progress
from chamberopt.coverage.coverage_from_impacts import (
    Footprints,
    batches_of,
    find_footprints,
    in_batches,
    locate_dents,
)
from chamberopt.coverage.coverage_intervals import coverage_estimates
from chamberopt.coverage.dents import dent_diameter
from chamberopt.coverage.field.target_field import (
    Gauge,
    TargetField,
    WindowSetting,
    find_target_field,
    require_wide_gauge,
)
from chamberopt.coverage.metrics import (
    METRICS,
    P05,
    ObjectiveFunction,
    exposed_target,
    parse_objective,
    require_target,
)
from chamberopt.coverage.part_impacts import Hits, TargetImpacts
from chamberopt.coverage.percentile import time_to_98
from chamberopt.coverage.resolution import NOT_RESOLVED, Resolution, find_resolution
from chamberopt.coverage.strength import intensity_uniformity
from chamberopt.simulation.evaluation import Evaluation
from chamberopt.simulation.replicas import (
    MIN_REPLICAS_TO_STOP,
    Replica,
    ReplicaSetting,
    next_replica_count,
    simulate_replicas,
)
from chamberopt.simulation.resting_balls import bouncing_notes, resting_notes

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from sim_core import AnalyticCavity, TriangleMesh

# Of the sonotrode's peak speed: faster impacts, which balls would have to drive one another to,
# leave dents as wide as this one on creases.
MAX_SPEED = 4.0


@dataclass(frozen=True)
class ReplicaPlan:
    """Which replicas to simulate."""

    # Number of replicas; None for as many as the design's [process.accuracy] asks for.
    count: int | None = None
    stream: str = "search"  # stream of seeds, "search" or "confirm"
    # The objective, whose interval decides when a wanted accuracy is reached.
    objective_name: str = "uniform_coverage"


def evaluate(
    design: Design,
    chamber: Chamber,
    executor: Executor,
    progress: Progress | None = None,
    plan: ReplicaPlan | None = None,
    cavity: AnalyticCavity | None = None,
    done: list[Replica] | None = None,
) -> Evaluation:
    """Simulate a candidate in independent replicas and estimate its objective and metrics.

    The result does not depend on the number of workers: replicas are added in order, and their
    results, never a clock, decide how many there are.

    Args:
        cavity: simulate in this exact cavity instead of the chamber's mesh.
        done: first replicas of this very candidate, already simulated; the new ones are appended.

    Raises:
        InputError: the shot does not fit into the chamber.
        sim_core.SimulationError: a replica cannot be simulated.
    """
    plan = plan or ReplicaPlan()
    accuracy = design.process.accuracy
    wanted = accuracy.objective_half_width if plan.count is None else None
    count = plan.count or accuracy.replicas
    if wanted is not None:
        count = min(max(count, MIN_REPLICAS_TO_STOP), accuracy.max_replicas)
    mesh = chamber_mesh(chamber)
    setting = share(executor, ReplicaSetting(design, chamber, cavity or mesh))
    timings = {"simulate": 0.0, "coverage": 0.0}
    window = window_setting(design, chamber)
    # The dents of a replica are looked at while others are simulated, so that no worker waits.
    beside = ThreadPoolExecutor(1)
    field = beside.submit(find_target_field, chamber, mesh, window)
    beside.shutdown(wait=False)
    done = [] if done is None else done
    seen: SeenDents | None = None
    while True:
        started = time.perf_counter()
        for replica in simulate_replicas(
            setting, design.process.seed, executor, plan.stream, range(len(done), count)
        ):
            done.append(replica)
            if progress:
                progress(len(done), count, None)
            seen = seen or SeenDents(field.result(), [], [])
            seen.add([one.hits for one in done])
        simulated = time.perf_counter()
        hits = [replica.hits for replica in done]
        seen = seen or SeenDents(field.result(), [], [])
        seen.add(hits)
        found = estimate_metrics(seen, hits, chamber, design)
        value = weighted_sum(parse_objective(plan.objective_name), found.metrics)
        timings["simulate"] += simulated - started
        timings["coverage"] += time.perf_counter() - simulated
        if wanted is None:
            stopped_by = "replicas"
            break
        count = next_replica_count(len(done), value.half_width, wanted, accuracy.max_replicas)
        if count == len(done):
            stopped_by = "accuracy" if value.half_width <= wanted else "max_replicas"
            break
    return Evaluation(
        objective_name=plan.objective_name,
        objective=value,
        metrics=found.metrics,
        metrics_of_wide=found.metrics_of_wide,
        gauge_mm2=accuracy.gauge_mm2,
        resolution=found.resolution,
        reachable=seen.field.reachable,
        crease_share=seen.crease_share,
        replicas=len(done),
        simulated_time=len(done) * design.process.recorded_time,
        hits=tuple(hits),
        timings=timings,
        collisions={
            kind: sum(replica.collisions[kind] for replica in done) for kind in done[0].collisions
        },
        notes=(
            *((cavity_note(cavity),) if cavity else ()),
            *_accuracy_note(stopped_by, len(done), value, wanted),
            *resolution_notes(found.resolution),
            *resting_notes([replica.resting for replica in done if replica.resting], len(done)),
            *bouncing_notes([replica.bouncing_share for replica in done]),
        ),
        stream=plan.stream,
        stopped_by=stopped_by,
        analytic=cavity is not None,
    )


def prepare_target(design: Design, chamber: Chamber, mesh: TriangleMesh) -> TargetField:
    """The target of a chamber, ready to be looked at through windows; InputError as below."""
    return find_target_field(chamber, mesh, window_setting(design, chamber))


def window_setting(design: Design, chamber: Chamber) -> WindowSetting:
    """The windows for the target of a chamber.

    Raises:
        InputError: no triangle of the target bounds the cavity, or the gauge is too small for it.
    """
    require_target(chamber)
    material, shot = design.materials.part, design.shot
    fastest = max(one.peak_speed for one in (design.sonotrode, *design.sonotrodes)) * MAX_SPEED
    largest_dent = dent_diameter(
        np.array([max(fastest, 2.0 * material.yield_speed)]),
        max(shot.diameters),
        shot.density,
        material.hardness,
        material.restitution,
        material.yield_speed,
    )
    accuracy = design.process.accuracy
    setting = WindowSetting(
        accuracy.gauge, accuracy.points, min(shot.diameters), float(largest_dent[0])
    )
    require_wide_gauge(chamber, setting)
    return setting


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


def _accuracy_note(
    stopped_by: str, replicas: int, objective: Estimate, wanted: float | None
) -> tuple[str, ...]:
    """A note on whether the wanted accuracy was reached."""
    if wanted is None:
        return ()
    if stopped_by == "accuracy":
        return (f"the wanted accuracy of ± {wanted:g} was reached after {replicas} replicas",)
    needed = (
        f"about {math.ceil(replicas * (objective.half_width / wanted) ** 2)}"
        if math.isfinite(objective.half_width)
        else "many more"
    )
    return (
        f"the wanted accuracy of ± {wanted:g} was not reached: the simulation stopped at "
        f"process.accuracy.max_replicas = {replicas} with ± {objective.half_width:.2g}, and "
        f"{needed} replicas would be needed; raise process.accuracy.max_replicas or "
        "simulated_time_s",
    )
