"""Evaluate a candidate: simulate independent replicas and estimate its metrics with intervals."""

from __future__ import annotations

import time
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chamberopt.chamber.analytic import cavity_note
from chamberopt.chamber.checks.check import amplitude_notes, friction_notes
from chamberopt.chamber.checks.fillets import facet_warnings
from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.errors import InputError
from chamberopt.common.executor import share
from chamberopt.common.progress import Progress, tell_program
from chamberopt.coverage.dents import dent_diameter
from chamberopt.coverage.field.surface_points import StepRoom
from chamberopt.coverage.field.target_field import (
    TargetField,
    WindowSetting,
    find_target_field,
    require_narrow_gauge,
    require_touchable_zones,
    require_wide_gauge,
)
from chamberopt.coverage.metrics import (
    STEPS,
    find_metric,
    require_metrics,
    require_target,
    unit_of_objective,
)
from chamberopt.coverage.stress_knowledge import edge_notes, stress_notes
from chamberopt.simulation.effort import Effort
from chamberopt.simulation.estimates import (
    SeenDents,
    estimate_metrics,
    estimate_zones,
    growth_for_dents,
    objective_estimate,
    reach_notes,
    resolution_notes,
    strength_notes,
    told_of_each_step,
)
from chamberopt.simulation.evaluation import Evaluation
from chamberopt.simulation.replicas import ReplicaSet, ReplicaSetting, Underway, run_in_order
from chamberopt.simulation.resting_balls import resting_notes
from chamberopt.simulation.settling import first_half_excess, settling_notes
from chamberopt.simulation.trapped_balls import TrappedBalls, mean_trapped, trapped_notes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from chamberopt.chamber.build import Chamber
    from chamberopt.common.estimate import Estimate
    from chamberopt.coverage.field.surface_points import Rooms
    from chamberopt.coverage.part_impacts import Hits
    from chamberopt.design.load import Design
    from sim_core import AnalyticCavity, TriangleMesh

# The fastest impact for which windows are prepared, as a multiple of the sonotrode's peak speed.
# Only balls that drive one another are faster, and on creases their dents count as wide as the
# dent at this speed.
MAX_SPEED = 4.0
SPEEDS = 1001  # impact speeds from 0 on that are tried for the widest dent


@dataclass(frozen=True)
class ReplicaPlan:
    """The replicas to simulate: their number and seeds, and the objective to estimate."""

    # Number of replicas; None for as many as the design's [process.accuracy] asks for.
    count: int | None = None
    stream: str = "search"  # stream of seeds, "search" or "confirm"
    # The objective, whose interval decides when a wanted accuracy is reached.
    objective_name: str = "uniform_coverage"
    # Whether coverage is also measured in windows of twice the radius. No search takes these.
    wide_windows: bool = True
    # Whether the target has figures of each step alone too. No pilot takes these.
    single_steps: bool = True


def evaluate(
    design: Design,
    chamber: Chamber,
    executor: Executor,
    progress: Progress | None = None,
    plan: ReplicaPlan | None = None,
    cavity: AnalyticCavity | None = None,
    known: ReplicaSet | None = None,
) -> Evaluation:
    """Simulate a candidate design in independent replicas and estimate its objective and metrics.

    The result does not depend on the number of workers: replicas are added in order, and their
    results, never a clock, decide how many there are.

    Args:
        cavity: simulate in this exact cavity instead of the chamber's mesh.
        known: replicas of this very candidate, to which the missing replicas are added.

    Raises:
        InputError: the shot does not fit into the chamber, or the objective takes a metric that
            the design lacks.
        sim_core.SimulationError: a replica cannot be simulated.
    """
    plan = plan or ReplicaPlan()
    run = _Run(design, chamber, executor, plan, cavity, known or ReplicaSet())
    while True:
        found = run.look_after_more(progress)
        if run.step.stopped_by:
            if progress and found.replicas < run.effort.most:
                progress(found.replicas, found.replicas, None)  # no more are needed
            return found


class SeenSurfaces(NamedTuple):
    """The dents of all replicas: on the target, on each zone, and on the target in each step."""

    target: SeenDents
    zones: dict[str, SeenDents]
    steps: list[SeenDents]


@dataclass
class _Run:
    """The simulation of one candidate design, to which replicas can be added."""

    design: Design
    chamber: Chamber
    executor: Executor
    plan: ReplicaPlan
    cavity: AnalyticCavity | None
    known: ReplicaSet

    def __post_init__(self) -> None:
        design, chamber, mesh = self.design, self.chamber, chamber_mesh(self.chamber)
        require_metrics(design, self.plan.objective_name)
        setting = ReplicaSetting(design, chamber, self.cavity or mesh)
        self.setting = share(self.executor, setting)
        self.before, self.underway = len(self.known.replicas), Underway(setting, self.setting)
        self.effort = Effort.of(design.process.accuracy, self.plan.count)
        self.step = self.effort.begin  # how many replicas the next look takes
        self.timings = {"simulate": 0.0, "coverage": 0.0}
        require_figures(design, chamber, mesh)
        own = design.in_steps.items() if self.plan.single_steps else ()
        self.steps = [(*one, room) for one, room in zip(own, chamber.steps, strict=False)]

        def see() -> SeenSurfaces:
            target = self.known.target or prepare_target(design, chamber, mesh)
            self.known.target = target  # for more replicas of the candidate
            zones = zone_fields(design, chamber, mesh)
            steps = [prepare_target(one, room, room.mesh) for _, one, room in self.steps]
            return SeenSurfaces(
                SeenDents.none(target, self.plan.wide_windows),
                {name: SeenDents.none(one, has_wide=False) for name, one in zones.items()},
                [SeenDents.none(one, has_wide=False) for one in steps],
            )

        # The dents of a replica are looked at while others are simulated, so that no worker waits.
        beside = ThreadPoolExecutor(1)
        self.seen = beside.submit(see)
        beside.shutdown(wait=False)

    def look(self) -> tuple[list[Hits], SeenSurfaces]:
        """Locate the dents of new replicas in the windows in which dents are counted.

        Returns:
            The impacts of each replica, and the dents of all replicas.
        """
        hits = [replica.hits for replica in self.known.replicas]
        seen = self.seen.result()
        for one in (seen.target, *seen.zones.values()):
            one.add(hits)
        for k, one in enumerate(seen.steps):
            one.add(self.hits_in_step(k))
        return hits, seen

    def hits_in_step(self, step: int) -> list[Hits]:
        """Return the impacts of each replica in one of the steps, in the pose of this step."""
        return [replica.steps[step].hits for replica in self.known.replicas]

    def estimate_steps(self, seen: Sequence[SeenDents]) -> dict[str, Estimate]:
        """Return the metrics of the target in each step alone, by names as steps.NAME.strength_um.

        Args:
            seen: the dents on the target in each step.
        """
        metrics: dict[str, Estimate] = {}
        for k, (name, design, chamber) in enumerate(self.steps):
            found = estimate_metrics(seen[k], self.hits_in_step(k), chamber, design).metrics
            of_step = {f"{STEPS}.{name}.{figure}": one for figure, one in found.items()}
            metrics |= {figure: one for figure, one in of_step.items() if find_metric(figure)}
        return metrics

    def ball_notes(self) -> tuple[TrappedBalls | None, tuple[str, ...]]:
        """Return what trapped balls did, and notes on balls that are trapped or at rest.

        With steps, it is what they did in the step in which most balls are held in gaps.
        """
        replicas, found, notes = self.known.replicas, [], []
        for k, (name, design) in enumerate(self.design.in_steps.items()):
            own = [one.steps[k] if one.steps else one for one in replicas]
            found.append(mean_trapped([one.trapped for one in own]))
            said = (
                *trapped_notes([one.trapped for one in own], design),
                *resting_notes([one.resting for one in own if one.resting], len(own)),
            )
            notes += [f"step {name.replace('_', ' ')}: {note}" if name else note for note in said]
        return max(found, key=lambda one: one.rattling_impacts if one else 0.0), tuple(notes)

    def look_after_more(self, progress: Progress | None) -> Evaluation:
        """Add the replicas of the next step, and return the evaluation of all replicas.

        `step` then is the step that follows from it.
        """
        design, plan, replicas = self.design, self.plan, self.known.replicas
        count = self.step.replicas
        how = design.process.seed, self.executor, plan.stream, range(len(replicas), count), count
        began = time.perf_counter()

        def tell() -> None:
            if progress:
                done = max(len(replicas), self.before + self.underway.done)
                progress(done, max(count, self.effort.most), None)
                tell_program("held", self.underway.held)

        for replica in run_in_order(self.underway.task, self.setting, *how, tell):
            replicas.append(replica)
            tell()
            self.look()
        simulated = time.perf_counter()
        hits, seen = self.look()
        target = seen.target
        found = estimate_metrics(target, hits, self.chamber, design)
        of_zones, zone_notes = estimate_zones(seen.zones, hits, self.chamber, design)
        metrics = found.metrics | of_zones
        if not design.has_like_steps:
            metrics = told_of_each_step(metrics)
        metrics |= self.estimate_steps(seen.steps)
        trapped, ball_notes = self.ball_notes()
        objective = objective_estimate(plan.objective_name, metrics, design)
        self.timings["simulate"] += simulated - began
        self.timings["coverage"] += time.perf_counter() - simulated
        field, done = target.field, len(replicas)
        facets = facet_warnings(self.chamber.part, min(design.shot.diameters), field.reach.share)
        growth = growth_for_dents(plan.objective_name, found.resolution)
        unit = unit_of_objective(plan.objective_name, metrics, objective)
        self.step = self.effort.after(done, objective, growth, self.step, unit)
        excess = first_half_excess([one.halves for one in replicas if one.halves])
        return Evaluation(
            objective_name=plan.objective_name,
            objective=objective,
            metrics=metrics,
            metrics_of_wide=found.metrics_of_wide,
            gauge_mm2=design.process.accuracy.gauge_mm2,
            resolution=found.resolution,
            reachable=field.reachable,
            crease_share=target.crease_share,
            alike=field.alike,
            replicas=done,
            simulated_time=done * design.process.recorded_time,
            hits=tuple(hits),
            timings=self.timings,
            collisions={
                kind: sum(replica.collisions[kind] for replica in replicas)
                for kind in replicas[0].collisions
            },
            notes=(  # the most important first
                *settling_notes(excess, design),
                *ball_notes,
                *((self.step.note,) if self.step.note else ()),
                *resolution_notes(found.resolution),
                *strength_notes(found.metrics, found.resolution),
                *zone_notes,
                *reach_notes(field.reach),
                *(one.text for one in facets),
                *friction_notes(design),
                *amplitude_notes(design),
                *edge_notes(design, self.chamber.part, metrics),
                *stress_notes(design, metrics),
                *((cavity_note(self.cavity),) if self.cavity else ()),
                *_symmetry_note(field.alike),
            ),
            zones={name: one.field.reachable for name, one in seen.zones.items()},
            steps={
                name: one.field.reachable
                for (name, _, _), one in zip(self.steps, seen.steps, strict=True)
            },
            stream=plan.stream,
            stopped_by=self.step.stopped_by or "replicas",
            analytic=self.cavity is not None,
            trapped=trapped,
            first_half_excess=None if excess is None else excess.value,
        )


def require_figures(design: Design, chamber: Chamber, mesh: TriangleMesh) -> None:
    """Raise InputError if a chamber can give no figures of the target and its zones.

    The causes are: no triangle of the target bounds the cavity; the windows, discs in which dents
    are counted, are too small or too wide for the target; or no ball touches a zone.
    """
    window = window_setting(design, chamber)
    require_narrow_gauge(chamber, window)
    require_touchable_zones(chamber, rooms_of(design, chamber, mesh), 0.5 * window.ball)


def prepare_target(
    design: Design, chamber: Chamber, mesh: TriangleMesh, name: str = "part.target"
) -> TargetField:
    """Return the target of a chamber with windows, discs in which its coverage is measured.

    Args:
        name: what messages call the target.
    Raises:
        InputError: no triangle of the target bounds the cavity, no ball touches any of it, or
            windows are too small.
    """
    window = window_setting(design, chamber)
    found = find_target_field(chamber, rooms_of(design, chamber, mesh), window)
    if not found.reachable > 0.0:
        raise InputError(
            f"{name}: a ball of {1e3 * window.ball:g} mm touches nothing of it in this "
            "chamber, so it has no figures; let more of the part stand in the chamber, or use "
            "smaller balls"
        )
    return found


def rooms_of(design: Design, chamber: Chamber, mesh: TriangleMesh) -> Rooms:
    """Return the surface of a chamber; for a design with steps, the rooms of the balls in all."""
    if not chamber.steps:
        return mesh
    rooms, first = [], chamber.part.file
    for one, own in zip(design.in_steps.values(), chamber.steps, strict=True):
        pose = own.part.file
        assert first is not None
        assert pose is not None
        turn = pose.rotation @ first.rotation.T
        shift = pose.shift - turn @ first.shift
        rooms.append(StepRoom(own.mesh, 0.5 * min(one.shot.diameters), turn, shift))
    return tuple(rooms)


def zone_fields(design: Design, chamber: Chamber, mesh: TriangleMesh) -> dict[str, TargetField]:
    """Return each zone of a chamber's part with windows in which its coverage is measured, by name.

    Raises InputError if no triangle of a zone bounds the cavity, or the windows are too small.
    """
    surfaces = {name: chamber.on_zone(name) for name in chamber.part.zones}
    return {
        name: prepare_target(design, one, mesh, f"zones: {name}") for name, one in surfaces.items()
    }


def window_setting(design: Design, chamber: Chamber) -> WindowSetting:
    """Return the numbers from which windows, discs in which dents are counted, are prepared.

    They are the size of the windows, the number of their middles, the smallest ball, the largest
    dent, and whether the target may be symmetric.

    Raises:
        InputError: no triangle of the target bounds the cavity, or the windows are too small.
    """
    require_target(chamber)
    steps = [one.simulated for one in design.in_steps.values()]
    accuracy = design.process.accuracy
    setting = WindowSetting(
        gauge=accuracy.gauge,
        points=accuracy.points,
        ball=min(min(one.shot.diameters) for one in steps),
        largest_dent=max(map(_largest_dent, steps)),
        symmetric=design.effects.part_turn is None
        and not design.steps
        and not design.sonotrodes
        and design.sonotrode.is_centred,
    )
    require_wide_gauge(chamber, setting)
    return setting


def _largest_dent(design: Design) -> float:
    """Return the diameter of the largest dent [m] for which windows are prepared."""
    material, shot = design.materials.part, design.shot
    faces = (design.sonotrode, *design.sonotrodes)
    fastest = max(one.peak_speed * one.largest_share for one in faces) * MAX_SPEED
    fastest = max(fastest, 2.0 * material.yield_speed)
    # With a table of restitution a slower impact may leave a wider dent than the fastest.
    speeds = np.linspace(0.0, fastest, SPEEDS)
    return float(dent_diameter(speeds, max(shot.diameters), shot.density, material).max())


def _symmetry_note(alike: int) -> tuple[str, ...]:
    if alike == 1:
        return ()
    angle = f"{360.0 / alike:.4g}°"
    return (
        f"part and chamber look the same after a turn by {angle}: figures and maps of coverage and "
        f"intensity are means over {alike} places that are alike",
    )
