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
    ReplicaSet,
    ReplicaSetting,
    next_replica_count,
)
from chamberopt.simulation.resting_balls import bouncing_notes, resting_notes

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.coverage.part_impacts import Hits
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
    known: ReplicaSet | None = None,
) -> Evaluation:
    """Simulate a candidate in independent replicas and estimate its objective and metrics.

    The result does not depend on the number of workers: replicas are added in order, and their
    results, never a clock, decide how many there are.

    Args:
        cavity: simulate in this exact cavity instead of the chamber's mesh.
        known: replicas of this very candidate, to which the missing ones are added.

    Raises:
        InputError: the shot does not fit into the chamber, or the objective takes a metric that
            the design lacks.
        sim_core.SimulationError: a replica cannot be simulated.
    """
    plan = plan or ReplicaPlan()
    run = _Run(design, chamber, executor, plan, cavity, known or ReplicaSet())
    accuracy = design.process.accuracy
    wanted = accuracy.objective_half_width if plan.count is None else None
    count = plan.count or accuracy.replicas
    if wanted is not None:
        count = min(max(count, MIN_REPLICAS_TO_STOP), accuracy.max_replicas)
    while True:
        run.simulate(count, progress)
        if wanted is None:
            return run.evaluation("replicas")
        done, half_width = run.count, run.objective.half_width
        count = next_replica_count(done, half_width, wanted, accuracy.max_replicas)
        if count == done:
            stopped_by = "accuracy" if half_width <= wanted else "max_replicas"
            note = _accuracy_note(stopped_by, done, run.objective, wanted)
            return run.evaluation(stopped_by, (note,))


class _Run:
    """The simulation of one candidate, with the estimates from its replicas so far."""

    objective: Estimate

    def __init__(
        self,
        design: Design,
        chamber: Chamber,
        executor: Executor,
        plan: ReplicaPlan,
        cavity: AnalyticCavity | None,
        known: ReplicaSet,
    ) -> None:
        require_metrics(design, plan.objective_name)
        self._design, self._chamber, self._plan, self._cavity = design, chamber, plan, cavity
        self._executor, self._known, mesh = executor, known, chamber_mesh(chamber)
        self._setting = share(executor, ReplicaSetting(design, chamber, cavity or mesh))
        self._timings = {"simulate": 0.0, "coverage": 0.0}
        window = require_figures(design, chamber, mesh)

        def see() -> tuple[SeenDents, dict[str, SeenDents]]:
            field = known.target or find_target_field(chamber, mesh, window)
            return SeenDents.none(field), see_zones(design, chamber, mesh)

        # The dents of a replica are looked at while others are simulated, so that no worker waits.
        beside = ThreadPoolExecutor(1)
        self._seen = beside.submit(see)
        beside.shutdown(wait=False)

    @property
    def count(self) -> int:
        """Number of replicas so far."""
        return len(self._known.replicas)

    def simulate(self, count: int, progress: Progress | None) -> None:
        """Add replicas until there are so many, and estimate the objective from all."""
        began, seed = time.perf_counter(), self._design.process.seed
        how = self._setting, seed, self._executor, progress, self._plan.stream
        for _ in self._known.add_up_to(count, *how):
            self._look()
        simulated = time.perf_counter()
        hits, target, zones = self._look()
        self._found = estimate_metrics(target, hits, self._chamber, self._design)
        of_zones, self._zone_notes = estimate_zones(zones, hits, self._chamber, self._design)
        self._metrics = self._found.metrics | of_zones
        self.objective = weighted_sum(parse_objective(self._plan.objective_name), self._metrics)
        self._timings["simulate"] += simulated - began
        self._timings["coverage"] += time.perf_counter() - simulated

    def _look(self) -> tuple[list[Hits], SeenDents, dict[str, SeenDents]]:
        """The impacts of all replicas, and their dents on the target and on each zone."""
        hits = [replica.hits for replica in self._known.replicas]
        target, zones = self._seen.result()
        for one in (target, *zones.values()):
            one.add(hits)
        return hits, target, zones

    def evaluation(self, stopped_by: str, accuracy_note: tuple[str, ...] = ()) -> Evaluation:
        """The evaluation from all replicas; `stopped_by` as Evaluation has it."""
        hits, target, zones = self._look()
        design, found, field = self._design, self._found, target.field
        replicas, count = self._known.replicas, self.count
        return Evaluation(
            objective_name=self._plan.objective_name,
            objective=self.objective,
            metrics=self._metrics,
            metrics_of_wide=found.metrics_of_wide,
            gauge_mm2=design.process.accuracy.gauge_mm2,
            resolution=found.resolution,
            reachable=field.reachable,
            crease_share=target.crease_share,
            alike=field.alike,
            replicas=count,
            simulated_time=count * design.process.recorded_time,
            hits=tuple(hits),
            timings=self._timings,
            collisions={
                kind: sum(replica.collisions[kind] for replica in replicas)
                for kind in replicas[0].collisions
            },
            notes=(
                *((cavity_note(self._cavity),) if self._cavity else ()),
                *friction_notes(design),
                *reach_notes(field.reach),
                *facet_warnings(self._chamber.part, min(design.shot.diameters), field.reach.share),
                *_symmetry_note(field.alike),
                *accuracy_note,
                *resolution_notes(found.resolution),
                *strength_notes(found.metrics, found.resolution),
                *self._zone_notes,
                *stress_notes(design.materials.part),
                *resting_notes([one.resting for one in replicas if one.resting], count),
                *bouncing_notes([one.bouncing_share for one in replicas]),
            ),
            zones={name: one.field.reachable for name, one in zones.items()},
            stream=self._plan.stream,
            stopped_by=stopped_by,
            analytic=self._cavity is not None,
        )


def require_figures(design: Design, chamber: Chamber, mesh: TriangleMesh) -> WindowSetting:
    """The windows for the target of a chamber.

    Raises:
        InputError: as `window_setting`, or the windows are too wide for the target, or no ball
            touches a zone.
    """
    window = window_setting(design, chamber)
    require_narrow_gauge(chamber, window)
    require_touchable_zones(chamber, mesh, 0.5 * window.ball)
    return window


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


def _accuracy_note(stopped_by: str, replicas: int, objective: Estimate, wanted: float) -> str:
    """A note on whether the wanted accuracy was reached."""
    if stopped_by == "accuracy":
        return f"the wanted accuracy of ± {wanted:g} was reached after {replicas} replicas"
    needed = (
        f"about {math.ceil(replicas * (objective.half_width / wanted) ** 2)}"
        if math.isfinite(objective.half_width)
        else "many more"
    )
    return (
        f"the wanted accuracy of ± {wanted:g} was not reached: the simulation stopped at "
        f"process.accuracy.max_replicas = {replicas} with ± {objective.half_width:.2g}, and "
        f"{needed} replicas would be needed; raise process.accuracy.max_replicas or "
        "simulated_time_s"
    )
