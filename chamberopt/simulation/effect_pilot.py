"""Advise which physical effects a design needs, by dimensionless groups and short pilot runs.

The pilot simulates the design, and the design with each effect switched, from the same starts. It
compares figures that a short run measures without bias: the mean normal speed of the impacts on the
target, and the dented area per second on the nearer and on the farther half of the target, seen
from the sonotrode. A dented area is shown as the coverage that it would give if spread evenly.

An effect that an estimate shows to be far too small to matter has no runs: air drag on balls of
some millimetres.

The pilot advises and changes nothing. Only a design with effects = "auto" leaves the choice to it
(with_effects_resolved).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.chamber import dimensionless
from chamberopt.chamber.flexure import flexure_of_surfaces, mean_softness
from chamberopt.chamber.scene import balls_can_rest, chamber_mesh
from chamberopt.common.estimate import Estimate, estimate
from chamberopt.common.number_text import percent, plain
from chamberopt.coverage.coverage_from_impacts import coverage_from_dent_density
from chamberopt.coverage.metrics import exposed_target
from chamberopt.design.materials import CATALOGUE, USUAL, treatment
from chamberopt.simulation.advice import FARTHER, MEASURED, NEARER, SPEED, Advice, verdict_on
from chamberopt.simulation.evaluate import require_figures
from chamberopt.simulation.replicas import ReplicaSetting, simulate_replicas
from chamberopt.simulation.variations import RunsProgress

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.common.progress import Progress
    from chamberopt.coverage.part_impacts import Hits
    from chamberopt.design.load import Design

Prepare = Callable[["Design"], None]

REPLICAS = 8
# Impacts on the target in all replicas together, for an error of about 0.5 % of speed and dents.
IMPACTS = 300_000
FIRST_TIME = 0.05  # s of each replica, to find how often the target is hit
MAX_TIME = 20.0  # s of each replica
ACCURACY = 0.01  # smaller changes do not matter


# Values of each effect's key when it is switched on and off.
SWITCHED = {
    "gravity": (True, False),
    "ball_collisions": (True, False),
    "friction": (CATALOGUE, None),
    "roughness": (USUAL, None),
    "drag": (True, False),
    "rest": (True, False),
    "flexure": (True, False),
}


def advise(
    design: Design,
    chamber: Chamber,
    executor: Executor,
    progress: Progress | None = None,
    prepare: Prepare | None = None,
) -> list[Advice]:
    """Return advice on each physical effect that the design can switch, the most important first.

    Args:
        prepare: called with each variant of the design before its simulation, for example to
            compile the simulator for its effects.

    Raises:
        InputError: no triangle of the target bounds the cavity, the windows in which dents are
            counted are too small or too wide for it, or no ball touches a zone.
        sim_core.SimulationError: a replica cannot be simulated.
    """
    return _Pilot(design, chamber, executor, progress, prepare).advise()


def with_effects_resolved(
    design: Design,
    chamber: Chamber,
    executor: Executor,
    progress: Progress | None = None,
    prepare: Prepare | None = None,
) -> tuple[Design, list[Advice]]:
    """Choose the effects of a design that has effects = "auto"; other designs stay as they are.

    All effects are on at first, and each is switched off alone. Effects that make no difference
    alone are then switched off together. While this makes a difference, the most important of these
    effects is switched on again.

    Args:
        prepare: called with each variant of the design before its simulation.

    Returns:
        The design with its effects chosen, and the advice behind the choice. The advice is empty
        if the design does not have effects = "auto".
    """
    if not design.effects.auto:
        return design, []
    complete = _switched(design, dict.fromkeys(_switchable(design, chamber), True))
    pilot = _Pilot(complete, chamber, executor, progress, prepare)
    advice = pilot.advise()
    off = [one.effect for one in advice if one.verdict == "makes no difference"]
    while len(off) > 1:
        without = pilot.measure(dict.fromkeys(off, False))
        if verdict_on(_changes(pilot.unchanged, without), ACCURACY) != "matters":
            break
        off = off[1:]
    return _switched(complete, dict.fromkeys(off, False)), advice


@dataclass
class _Pilot:
    """Short runs of a design as it is, and with some of its effects switched on or off."""

    design: Design
    chamber: Chamber
    executor: Executor
    progress: Progress | None
    prepare: Prepare | None

    def __post_init__(self) -> None:
        design, chamber, self.mesh = self.design, self.chamber, chamber_mesh(self.chamber)
        require_figures(design, chamber, self.mesh)
        self.effects = _switchable(design, chamber)
        self.time = FIRST_TIME
        bounds = {effect: _bound(effect, design, chamber) for effect in self.effects}
        self.bounds = {effect: one for effect, one in bounds.items() if one <= ACCURACY}
        # A short run for the time, a run without a change, and a run for each effect.
        self.runs = RunsProgress(self.progress, 2 + len(self.effects) - len(self.bounds))
        target = exposed_target(chamber)
        hits = sum(int(target[one.triangle].sum()) for one in self._simulate({})[1])
        self.time = float(np.clip(FIRST_TIME * IMPACTS / max(hits, 1), FIRST_TIME, MAX_TIME))
        self.unchanged = self.measure({})

    def advise(self) -> list[Advice]:
        """Return advice on each physical effect that can be switched, the most important first."""
        advice = []
        for effect in self.effects:
            is_on = _is_on(effect, self.design, self.chamber)
            reason = _reason(effect, self.design, self.chamber)
            if effect in self.bounds:
                changes = dict.fromkeys(MEASURED, Estimate(0.0, self.bounds[effect]))
                advice.append(Advice(effect, is_on, reason, changes, ACCURACY, estimated=True))
                continue
            other = self.measure({effect: not is_on})
            with_it, without = (self.unchanged, other) if is_on else (other, self.unchanged)
            advice.append(Advice(effect, is_on, reason, _changes(with_it, without), ACCURACY))
        return sorted(advice, key=lambda one: -one.largest_change)

    def measure(self, effects: Mapping[str, bool]) -> dict[str, np.ndarray]:
        """Simulate the design with some effects switched, and return what the pilot compares.

        Returns:
            Arrays (REPLICAS,) by the names in MEASURED: for each replica the mean normal speed of
            impacts [m/s], the coverage of the half of the target nearer to the sonotrode, and the
            coverage of the farther half.
        """
        self.runs.ended += 1
        variant, replicas = self._simulate(effects)
        return _measure(variant, self.chamber, replicas)

    def _simulate(self, effects: Mapping[str, bool]) -> tuple[Design, list[Hits]]:
        """Simulate the design with some effects switched.

        Returns:
            The design with these effects, and the impacts of each replica.
        """
        accuracy = {
            "replicas": REPLICAS,
            "simulated_time_s": self.time,
            "objective_half_width": None,
        }
        values = {f"process.accuracy.{name}": value for name, value in accuracy.items()}
        variant = _switched(self.design, effects).changed(values)
        if self.prepare is not None:
            self.prepare(variant)
        setting = ReplicaSetting(variant, self.chamber, self.mesh)
        replicas = simulate_replicas(setting, self.executor, self.runs)
        return variant, [one.hits for one in replicas]


def _bound(effect: str, design: Design, chamber: Chamber) -> float:
    """Return the largest change that an effect can make, by an estimate; infinite without one."""
    return dimensionless.drag_change(design, chamber) if effect == "drag" else math.inf


def _is_on(effect: str, design: Design, chamber: Chamber) -> bool:
    if effect == "rest":
        return balls_can_rest(design, chamber_mesh(chamber))
    if effect == "flexure":
        return flexure_of_surfaces(design, chamber, chamber_mesh(chamber)) is not None
    return bool(getattr(design.effects, effect))


def groups(design: Design, chamber: Chamber) -> list[dict[str, object]]:
    """Return a table of the effects that can be switched, with the importance of each effect.

    A row has the keys effect (name), on, and said (a sentence). The sentences come from
    dimensionless groups, without a simulation.
    """
    found = []
    for effect in _switchable(design, chamber):
        on = _is_on(effect, design, chamber)
        state = "chosen by pilot runs" if design.effects.auto else "on" if on else "off"
        reason = _reason(effect, design, chamber)
        found.append({"effect": effect, "on": on, "said": f"{effect} is {state}: {reason}"})
    return found


def _reason(effect: str, design: Design, chamber: Chamber) -> str:
    """Return in words how important an effect is, by a dimensionless group such as g H / V²."""
    loss = dimensionless.drag_loss(design, chamber)
    return {
        "gravity": f"g H / V² = {plain(dimensionless.gravity_speed_change(design, chamber), 2)}",
        "ball_collisions": (
            f"mean free path {plain(dimensionless.free_path(design, chamber), 2)} chamber heights"
        ),
        "friction": (
            f"{_of_catalogue(design)}an impact without slip turns "
            f"{dimensionless.MAX_SPIN_SHARE:.0%} of the sideways speed into spin"
        ),
        "roughness": (
            f"facets turn a ball aside by {_turned_aside(design):.2g}°, twice their rms slope"
        ),
        "drag": f"{percent(loss)} of the speed is lost on the way up",
        "rest": "a surface that does not move faces up, so balls can lie on it",
        "flexure": f"thin parts: {mean_softness(design, chamber):.2f} of the restitution, mean",
    }[effect]


def _of_catalogue(design: Design) -> str:
    """Return the materials for which the catalogue gave friction; "" if it did not."""
    friction = design.effects.friction
    return f"by the catalogue for {friction.pairs}; " if friction and friction.pairs else ""


def _turned_aside(design: Design) -> float:
    """Return the angle [degrees] by which facets of the usual or the given slope turn a ball."""
    rough = design.effects.roughness
    return 2.0 * (treatment(USUAL).slope_deg if rough is None else rough.slope_deg)


def _switchable(design: Design, chamber: Chamber) -> list[str]:
    """Return the names of the effects that can be switched in this design."""

    def can_be_switched(effect: str) -> bool:
        if effect == "rest":
            return balls_can_rest(design.changed({"effects.rest": None}), chamber_mesh(chamber))
        if effect == "flexure":
            return chamber.part.thickness is not None
        return effect != "ball_collisions" or design.shot.count > 1

    return [effect for effect in SWITCHED if can_be_switched(effect)]


def _switched(design: Design, effects: Mapping[str, bool]) -> Design:
    values: dict[str, Any] = {"effects.auto": False}
    for effect, on in effects.items():
        value_on, value_off = SWITCHED[effect]
        given = getattr(design.effects, effect)
        if effect == "flexure" and given is not None:
            given = given.model_copy(update={"on": on})
            value_off = given
        values[f"effects.{effect}"] = (given or value_on) if on else value_off
    if not values.get("effects.gravity", design.effects.gravity):
        values["effects.rest"] = None  # without gravity nothing lies still
    return design.changed(values)


def _measure(design: Design, chamber: Chamber, replicas: Sequence[Hits]) -> dict[str, np.ndarray]:
    """Return three figures of every replica of a design, by name, (replicas,) each.

    These are the mean normal speed of impacts, the coverage of the half of the target nearer to the
    sonotrode, and the coverage of the farther half.
    """
    target = exposed_target(chamber)
    centres = chamber.part.vertices[chamber.part.triangles].mean(axis=1)
    distance = np.linalg.norm(centres, axis=1)  # from the middle of the sonotrode
    near = target & (distance <= _median(distance[target], chamber.exposed_area[target]))

    def coverage(half: np.ndarray) -> np.ndarray:
        if not half.any():  # a target of a triangle or two may be all on one side
            return np.zeros(len(replicas))
        dents = [one.dent[half[one.triangle]].astype(float) for one in replicas]
        rate = np.pi / 4.0 * np.array([(dent**2).sum() for dent in dents])
        time_ratio = design.process.treatment_time / design.process.recorded_time
        return coverage_from_dent_density(rate * time_ratio / chamber.exposed_area[half].sum())

    speeds = [one.speed[target[one.triangle]].astype(float) for one in replicas]
    return {
        SPEED: np.array([one.mean() if len(one) else 0.0 for one in speeds]),
        NEARER: coverage(near),
        FARTHER: coverage(target & ~near),
    }


def _median(distances: np.ndarray, areas: np.ndarray) -> float:
    """Return the distance within which half of the triangles' area lies."""
    order = np.argsort(distances, kind="stable")
    return float(distances[order][np.searchsorted(np.cumsum(areas[order]), 0.5 * areas.sum())])


def _changes(
    with_it: Mapping[str, np.ndarray], without: Mapping[str, np.ndarray]
) -> dict[str, Estimate]:
    """Return the mean change of each figure by an effect, from replicas with and without it.

    Replicas with and without the effect have the same seeds. The change of the speed is infinitely
    uncertain if nothing was hit without the effect.
    """
    changes = {}
    for name in MEASURED:
        scale = float(without[name].mean()) if name == SPEED else 1.0
        changes[name] = (
            estimate((with_it[name] - without[name]) / scale)
            if scale > 0.0
            else Estimate(0.0, math.inf)
        )
    return changes
