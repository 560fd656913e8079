"""Which effects a design needs: an estimate from dimensionless groups, and a short paired pilot run with each switched.

The pilot simulates the design, and the design with one effect switched, from the same starts, and compares what a short
run knows without bias: the mean normal speed of impacts on the target, and the dented area a second on the half of
it nearer to the sonotrode and on the other, told as the coverage that comes of it if it is spread evenly there. It
advises; it never switches. A design that says ``effects = "auto"`` asks for the switching too: see settled.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from chamberopt.chamber import dimensionless
from chamberopt.chamber.scene import balls_can_rest, chamber_mesh
from chamberopt.coverage.metrics import exposed_target
from chamberopt.coverage.statistics.confidence_interval import Estimate, estimate
from chamberopt.simulation.evaluate import evaluate

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.common.progress import Progress
    from chamberopt.coverage.coverage_from_impacts import Tally
    from chamberopt.design.load import Design

Prepare = Callable[["Design"], None]
FIGURES = SPEED, NEARER, FARTHER = (
    "mean impact speed",
    "coverage of the target's half nearer to the sonotrode",
    "coverage of its farther half",
)
REPLICAS = 8
IMPACTS = 300_000  # on the target, all replicas together: speed and dents to about half a per cent
FIRST_LOOK = 0.05  # s of each replica, to learn how often the target is hit
LONGEST = 20.0  # s of each replica
# What switching friction on takes for it, assumed: dry metal (mu), and beta0 between those that S. Foerster, M. Louge,
# H. Chang and K. Allia, Phys. Fluids 6 (1994) 1108, measured (0.43, 0.44) and none.
FRICTION = {"mu": 0.3, "beta0": 0.2}
ACCURACY = 0.01  # [-]: changes below are taken to be of no matter


@dataclass(frozen=True)
class Switch:
    """An effect that can be on or off in a design: ``reason``: what the groups say of it, one sentence."""

    effect: str
    on: Callable[[Design, Chamber], bool]
    values: tuple[Any, Any]  # on and off
    reason: Callable[[Design, Chamber], str]


@dataclass(frozen=True)
class Advice:
    """What switching one effect on changes, with 95 % intervals: the mean impact speed by a share of it, coverages by
    so much.

    ``verdict``: "matters", "makes no difference" (both at ``accuracy``) or "undecided".
    """

    effect: str
    on: bool
    reason: str
    changes: dict[str, Estimate]
    accuracy: float

    @property
    def verdict(self) -> str:
        """From the largest change and its interval."""
        if all(abs(e.value) + e.half_width <= self.accuracy for e in self.changes.values()):
            return "makes no difference"
        if any(abs(e.value) - e.half_width > self.accuracy for e in self.changes.values()):
            return "matters"
        return "undecided"

    def as_json(self) -> dict[str, Any]:
        """Plain JSON values."""
        changes = {
            name: {"value": e.value, "half_width": e.half_width} for name, e in self.changes.items()
        }
        return {
            "effect": self.effect,
            "on": self.on,
            "verdict": self.verdict,
            "said": str(self),
            "changes": changes,
        }

    def __str__(self) -> str:
        """One sentence for a person."""
        name, most = max(self.changes.items(), key=lambda item: abs(item[1].value))
        seen = f"{name} changes by {100 * most.value:+.2g} ± {100 * most.half_width:.1g} % with it"
        at = f"at {100 * self.accuracy:g} %"
        advice = {
            ("matters", True): "needed",
            ("matters", False): "switch it on",
            ("makes no difference", True): f"off is safe {at}",
            ("makes no difference", False): f"off is safe {at}",
            ("undecided", True): f"not decided {at}: keep it",
            ("undecided", False): f"not decided {at}: on is the safe side",
        }[self.verdict, self.on]
        return f"{self.effect} is {'on' if self.on else 'off'}: {advice} ({self.reason}; pilot: {seen})"


SWITCHES = (
    Switch(
        "gravity",
        lambda design, chamber: design.effects.gravity,
        (True, False),
        lambda design, chamber: (
            f"g H / V² = {dimensionless.gravity_speed_change(design, chamber):.2g}"
        ),
    ),
    Switch(
        "ball_collisions",
        lambda design, chamber: design.effects.ball_collisions,
        (True, False),
        lambda design, chamber: (
            f"mean free path {dimensionless.free_path(design, chamber):.2g} chamber heights"
        ),
    ),
    Switch(
        "friction",
        lambda design, chamber: design.effects.friction is not None,
        (FRICTION, None),
        lambda design, chamber: (
            f"a hit that sticks takes {dimensionless.MAX_SPIN_SHARE:.0%} of the sideways speed into spin"
        ),
    ),
    Switch(
        "drag",
        lambda design, chamber: design.effects.drag,
        (True, False),
        lambda design, chamber: (
            f"{dimensionless.drag_loss(design, chamber):.2g} of the speed is lost on the way up"
        ),
    ),
    Switch(
        "rest",
        lambda design, chamber: balls_can_rest(design, chamber_mesh(chamber)),
        (True, False),
        lambda design, chamber: "something still faces up, where balls can lie",
    ),
)


def advise(
    design: Design,
    chamber: Chamber,
    executor: Executor,
    progress: Progress | None = None,
    prepare: Prepare | None = None,
) -> list[Advice]:
    """Advice on every effect that can be switched in this design, the most important first.

    prepare(variant) is called before each variant runs: every set of effects is compiled once. Raises InputError and
    sim_core.SimulationError as evaluate does.
    """
    pilot = _Pilot(design, chamber, executor, prepare)
    switches = [switch for switch in SWITCHES if _applies(switch, design, chamber)]
    said = []
    for done, switch in enumerate(switches):
        if progress:
            progress(done, len(switches), None)
        on = switch.on(design, chamber)
        other = pilot.figures({switch: not on})
        without, with_it = (other, pilot.base) if on else (pilot.base, other)
        changes = {name: _change(name, with_it[name], without[name]) for name in FIGURES}
        said.append(Advice(switch.effect, on, switch.reason(design, chamber), changes, ACCURACY))
    return sorted(said, key=lambda one: -_size(one))


def with_effects_resolved(
    design: Design,
    chamber: Chamber,
    executor: Executor,
    progress: Progress | None = None,
    prepare: Prepare | None = None,
) -> tuple[Design, list[Advice]]:
    """The design as it is, without advice; or, if it leaves its effects to us (effects.auto), with those switched off
    that a pilot shows to make no difference, and the advice.

    All are on at first; each is switched off alone, and then all that this shows to be safe, together: as long as that
    does make a difference, the most important of them stays on.
    """
    if not design.effects.auto:
        return design, []
    whole = _with(
        design, {switch: True for switch in SWITCHES if _applies(switch, design, chamber)}
    )
    advice = advise(whole, chamber, executor, progress, prepare)
    off = [one.effect for one in advice if one.verdict == "makes no difference"]
    pilot = _Pilot(whole, chamber, executor, prepare) if len(off) > 1 else None
    while pilot is not None and len(off) > 1:
        without = pilot.figures({switch: False for switch in SWITCHES if switch.effect in off})
        changes = {name: _change(name, pilot.base[name], without[name]) for name in FIGURES}
        if Advice("", True, "", changes, ACCURACY).verdict != "matters":
            break
        off = off[1:]
    return _with(whole, {switch: False for switch in SWITCHES if switch.effect in off}), advice


class _Pilot:
    """Short runs of a design with some effects switched; ``base``: the figures of none switched."""

    def __init__(
        self, design: Design, chamber: Chamber, executor: Executor, prepare: Prepare | None
    ) -> None:
        self._design, self._chamber, self._executor, self._prepare = (
            design,
            chamber,
            executor,
            prepare,
        )
        look = evaluate(self._switched({}, FIRST_LOOK), chamber, executor)
        hits = look.total.impacts[exposed_target(chamber)].sum()
        self._seconds = float(np.clip(FIRST_LOOK * IMPACTS / max(hits, 1), FIRST_LOOK, LONGEST))
        self.base = self.figures({})

    def figures(self, wanted: dict[Switch, bool]) -> dict[str, np.ndarray]:
        """Each of FIGURES in every replica, (REPLICAS,)."""
        return _figures(self._switched(wanted, self._seconds), self._chamber, self._executor)

    def _switched(self, wanted: dict[Switch, bool], seconds: float) -> Design:
        variant = _with(self._design, wanted).changed(
            {
                "process.accuracy.replicas": REPLICAS,
                "process.accuracy.simulated_time_s": seconds,
                "process.accuracy.objective_half_width": None,
                "process.accuracy.coverage_model": "avrami",
            }
        )
        if self._prepare is not None:
            self._prepare(variant)
        return variant


def _applies(switch: Switch, design: Design, chamber: Chamber) -> bool:
    """Whether an effect can be switched in this design at all."""
    if switch.effect == "rest":
        return balls_can_rest(design.changed({"effects.rest": None}), chamber_mesh(chamber))
    if design.shot.mix is not None and switch.effect == "friction":
        return False  # not supported together
    return switch.effect != "ball_collisions" or design.shot.count > 1


def _with(design: Design, wanted: dict[Switch, bool]) -> Design:
    values: dict[str, Any] = {"effects.auto": False}
    for switch, on in wanted.items():
        present, (value_on, value_off) = getattr(design.effects, switch.effect), switch.values
        values[f"effects.{switch.effect}"] = (present or value_on) if on else value_off
    if not values.get("effects.gravity", design.effects.gravity):
        values["effects.rest"] = None  # nothing lies still without gravity
    return design.changed(values)


def _size(one: Advice) -> float:
    return max(abs(change.value) for change in one.changes.values())


def _figures(design: Design, chamber: Chamber, executor: Executor) -> dict[str, np.ndarray]:
    """The three figures of every replica."""
    replicas = evaluate(design, chamber, executor).replicas
    target = exposed_target(chamber)
    away = np.linalg.norm(
        chamber.part.vertices[chamber.part.triangles].mean(axis=1), axis=1
    )  # of the sonotrode's middle
    near = target & (away <= _middle(away[target], chamber.exposed_area[target]))

    def of_each(figure: Callable[[Tally], float]) -> np.ndarray:
        return np.array([figure(replica) for replica in replicas])

    def coverage(half: np.ndarray) -> np.ndarray:
        if not half.any():  # a target of a triangle or two may be all on one side
            return np.zeros(len(replicas))
        times = design.process.treatment_time / chamber.exposed_area[half].sum()
        return -np.expm1(-of_each(lambda t: t.dented_area[half].sum() / t.simulated_time) * times)

    return {
        SPEED: of_each(lambda t: t.speed_sum[target].sum() / max(1, t.impacts[target].sum())),
        NEARER: coverage(near),
        FARTHER: coverage(target & ~near),
    }


def _middle(distances: np.ndarray, areas: np.ndarray) -> float:
    """The distance within which half the area lies."""
    order = np.argsort(distances, kind="stable")
    return float(distances[order][np.searchsorted(np.cumsum(areas[order]), 0.5 * areas.sum())])


def _change(name: str, with_it: np.ndarray, without: np.ndarray) -> Estimate:
    """Mean change, from replicas paired by their seeds; infinitely uncertain where nothing was hit."""
    scale = float(without.mean()) if name == SPEED else 1.0
    return estimate((with_it - without) / scale) if scale > 0.0 else Estimate(0.0, math.inf)
