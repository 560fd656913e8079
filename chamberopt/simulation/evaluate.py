"""Evaluate a candidate: simulate independent replicas and estimate its metrics with intervals."""

from __future__ import annotations

import math
import time
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.chamber.analytic import cavity_note
from chamberopt.chamber.checks.check import friction_notes
from chamberopt.chamber.checks.fillets import facet_warnings
from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.estimate import Estimate
from chamberopt.common.executor import share
from chamberopt.common.progress import Progress
from chamberopt.coverage.compression import stress_notes
from chamberopt.coverage.dents import dent_diameter
from chamberopt.coverage.field.target_field import (
    TargetField,
    WindowSetting,
    find_target_field,
    require_narrow_gauge,
    require_touchable_zones,
    require_wide_gauge,
)
from chamberopt.coverage.metrics import parse_objective, require_metrics, require_target
from chamberopt.simulation.estimates import (
    SeenDents,
    estimate_metrics,
    estimate_zones,
    reach_notes,
    resolution_notes,
    strength_notes,
    weighted_sum,
)
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
SPEEDS = 1001  # up to there, of which one leaves the widest dent


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
    target: TargetField | None = None,
) -> Evaluation:
    """Simulate a candidate in independent replicas and estimate its objective and metrics.

    The result does not depend on the number of workers: replicas are added in order, and their
    results, never a clock, decide how many there are.

    Args:
        cavity: simulate in this exact cavity instead of the chamber's mesh.
        done: first replicas of this very candidate, already simulated; the new ones are appended.
        target: of `prepare_target`, if that was called already.

    Raises:
        InputError: the shot does not fit into the chamber, or the objective takes a metric that
            the design lacks.
        sim_core.SimulationError: a replica cannot be simulated.
    """
    plan = plan or ReplicaPlan()
    require_metrics(design, plan.objective_name)
    accuracy = design.process.accuracy
    wanted = accuracy.objective_half_width if plan.count is None else None
    count = plan.count or accuracy.replicas
    if wanted is not None:
        count = min(max(count, MIN_REPLICAS_TO_STOP), accuracy.max_replicas)
    mesh = chamber_mesh(chamber)
    setting = share(executor, ReplicaSetting(design, chamber, cavity or mesh))
    timings = {"simulate": 0.0, "coverage": 0.0}
    window = window_setting(design, chamber)
    require_narrow_gauge(chamber, window)
    require_touchable_zones(chamber, mesh, 0.5 * window.ball)
    # The dents of a replica are looked at while others are simulated, so that no worker waits.
    beside = ThreadPoolExecutor(1)
    field = beside.submit(lambda: target or find_target_field(chamber, mesh, window))
    zones = beside.submit(see_zones, design, chamber, mesh)
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
            seen = seen or SeenDents.none(field.result())
            for one in (seen, *zones.result().values()):
                one.add([replica.hits for replica in done])
        simulated = time.perf_counter()
        hits = [replica.hits for replica in done]
        seen = seen or SeenDents.none(field.result())
        for one in (seen, *zones.result().values()):
            one.add(hits)
        found = estimate_metrics(seen, hits, chamber, design)
        of_zones, zone_notes = estimate_zones(zones.result(), hits, chamber, design)
        metrics = found.metrics | of_zones
        value = weighted_sum(parse_objective(plan.objective_name), metrics)
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
        metrics=metrics,
        metrics_of_wide=found.metrics_of_wide,
        gauge_mm2=accuracy.gauge_mm2,
        resolution=found.resolution,
        reachable=seen.field.reachable,
        crease_share=seen.crease_share,
        alike=seen.field.alike,
        replicas=len(done),
        simulated_time=len(done) * design.process.recorded_time,
        hits=tuple(hits),
        timings=timings,
        collisions={
            kind: sum(replica.collisions[kind] for replica in done) for kind in done[0].collisions
        },
        notes=(
            *((cavity_note(cavity),) if cavity else ()),
            *friction_notes(design),
            *reach_notes(seen.field.reach),
            *facet_warnings(chamber.part, min(design.shot.diameters), seen.field.reach.share),
            *_symmetry_note(seen.field.alike),
            *_accuracy_note(stopped_by, len(done), value, wanted),
            *resolution_notes(found.resolution),
            *strength_notes(found.metrics, found.resolution),
            *zone_notes,
            *stress_notes(design.materials.part),
            *resting_notes([replica.resting for replica in done if replica.resting], len(done)),
            *bouncing_notes([replica.bouncing_share for replica in done]),
        ),
        zones={name: one.field.reachable for name, one in zones.result().items()},
        stream=plan.stream,
        stopped_by=stopped_by,
        analytic=cavity is not None,
    )


def prepare_target(design: Design, chamber: Chamber, mesh: TriangleMesh) -> TargetField:
    """The target of a chamber, ready to be looked at through windows; InputError as below."""
    return find_target_field(chamber, mesh, window_setting(design, chamber))


def see_zones(design: Design, chamber: Chamber, mesh: TriangleMesh) -> dict[str, SeenDents]:
    """The zones of a chamber's part by their names, ready for dents; InputError as below."""
    surfaces = {name: chamber.on_zone(name) for name in chamber.part.zones}
    return {
        name: SeenDents.none(prepare_target(design, one, mesh)) for name, one in surfaces.items()
    }


def window_setting(design: Design, chamber: Chamber) -> WindowSetting:
    """The windows for the target of a chamber.

    Raises:
        InputError: no triangle of the target bounds the cavity, or the gauge is too small for it.
    """
    require_target(chamber)
    design = design.simulated
    material, shot = design.materials.part, design.shot
    fastest = max(one.peak_speed for one in (design.sonotrode, *design.sonotrodes)) * MAX_SPEED
    fastest = max(fastest, 2.0 * material.yield_speed)
    # With a table of restitution a slower impact may leave a wider dent than the fastest.
    speeds = np.linspace(0.0, fastest, SPEEDS)
    dents = dent_diameter(speeds, max(shot.diameters), shot.density, material)
    accuracy = design.process.accuracy
    setting = WindowSetting(
        gauge=accuracy.gauge,
        points=accuracy.points,
        ball=min(shot.diameters),
        largest_dent=float(dents.max()),
        symmetric=design.effects.part_turn is None and not design.sonotrodes,
    )
    require_wide_gauge(chamber, setting)
    return setting


def _symmetry_note(alike: int) -> tuple[str, ...]:
    if alike == 1:
        return ()
    angle = f"{360.0 / alike:.4g}°"
    return (
        f"part and chamber look the same after a turn by {angle}: figures and maps of coverage and "
        f"intensity are means over {alike} places that are alike",
    )


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
