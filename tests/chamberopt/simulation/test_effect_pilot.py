"""Dimensionless groups, advice from pilot runs, and the choice of effects = "auto"."""

import math
import re
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh

from chamberopt.chamber import dimensionless
from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.scene import chamber_mesh, scene_physics
from chamberopt.common.errors import InputError
from chamberopt.common.estimate import Estimate
from chamberopt.common.executor import SerialExecutor, local_executor
from chamberopt.coverage.metrics import exposed_target
from chamberopt.design.design import validate
from chamberopt.design.load import Design, load_design
from chamberopt.results.write import advice_record
from chamberopt.simulation import effect_pilot
from chamberopt.simulation.advice import Advice
from chamberopt.simulation.effect_pilot import MEASURED, advise, with_effects_resolved
from chamberopt.simulation.replicas import ReplicaSetting
from tests.helpers.synthetic import DESIGNS, dents_at, plate_design

PLATE = plate_design()
CHAMBER = build_chamber(PLATE)
DENTS = 10  # on each triangle of the target, in made-up runs


def with_effects(effects: Any) -> Design:
    return validate(Design, {**PLATE.model_dump(), "effects": effects})


def test_groups_are_what_their_formulas_say() -> None:
    speed = PLATE.sonotrode.peak_speed
    assert dimensionless.gravity_speed_change(PLATE, CHAMBER) == pytest.approx(
        9.80665 * CHAMBER.height / speed**2
    )
    # A dilute gas: the packing does not matter, and twice the balls halve the path.
    each = 1e3 * PLATE.shot.ball_mass  # g
    thin, thinner = (plate_design(shot__mass_g=balls * each) for balls in (8, 4))
    assert thin.shot.count == 2 * thinner.shot.count
    assert dimensionless.free_path(thinner, CHAMBER) == pytest.approx(
        2 * dimensionless.free_path(thin, CHAMBER), rel=0.01
    )
    assert math.isinf(dimensionless.free_path(plate_design(shot__mass_g=each), CHAMBER))
    big = plate_design(shot__diameter_mm=8)  # Re above 1000: C_d is 0.44
    expected = 0.75 * 0.44 * 1.204 / 7800 * CHAMBER.height / 8e-3
    assert dimensionless.drag_loss(big, CHAMBER) == pytest.approx(expected, rel=1e-6)


def test_flexure_is_switched_only_where_a_part_is_thin() -> None:
    """The numbers that a design gives for it stay when it is switched off and on."""
    named = {row["effect"] for row in effect_pilot.groups(PLATE, CHAMBER)}
    assert "flexure" not in named
    metals = {
        "part_E_GPa": 210.0,
        "part_poisson": 0.3,
        "part_density_kg_m3": 7800.0,
        "shot_E_GPa": 210.0,
        "shot_poisson": 0.3,
    }
    thickness = np.full(len(CHAMBER.part.triangles), 2e-3, dtype=np.float32)
    thin = replace(CHAMBER, part=replace(CHAMBER.part, thickness=thickness))
    design = PLATE.changed({"effects.flexure": metals})
    (row,) = (row for row in effect_pilot.groups(design, thin) if row["effect"] == "flexure")
    assert row["on"] is True
    assert re.fullmatch(r"flexure is on: thin parts: 0\.8\d of the restitution, mean", row["said"])
    for on in (False, True):
        switched = effect_pilot._switched(design, {"flexure": on})
        assert switched.effects.flexure is not None
        assert switched.effects.flexure.model_dump() == metals | {"on": on}
        row = next(r for r in effect_pilot.groups(switched, thin) if r["effect"] == "flexure")
        assert row["on"] is on
    named_metals = load_design(DESIGNS / "blade.toml")
    off = effect_pilot._switched(named_metals, {"flexure": False}).effects.flexure
    assert off is not None
    assert not off.on


@pytest.mark.parametrize(
    ("value", "half_width", "on", "said"),
    [
        (0.002, 0.003, True, "off is safe at 1 %"),
        (-0.002, 0.003, False, "off is safe at 1 %"),
        (0.3, 0.01, True, "needed"),
        (-0.3, 0.01, False, "switch it on"),
        (0.008, 0.01, True, "keep it"),
        (0.008, 0.01, False, "on is the safe side"),
        (0.0, math.inf, True, "keep it"),
    ],
)
def test_a_verdict_follows_from_the_largest_change_and_its_interval(
    value: float, half_width: float, on: bool, said: str
) -> None:
    changes = {MEASURED[0]: Estimate(value, half_width), MEASURED[1]: Estimate(0.0, 0.001)}
    one = Advice("drag", on, "because", changes, 0.01)
    assert said in str(one)
    assert "because" in str(one)
    assert advice_record(one).verdict == one.verdict


def pretend(strength: dict[str, float], monkeypatch: pytest.MonkeyPatch) -> list[Design]:
    """Replace the simulation: each effect that is on multiplies speeds and dents."""
    asked: list[Design] = []

    def simulate(setting: ReplicaSetting, executor: Executor, progress: Any) -> Any:
        design, chamber, _ = setting
        asked.append(design)
        on = {
            "gravity": design.effects.gravity,
            "ball_collisions": design.effects.ball_collisions,
            "friction": design.effects.friction is not None,
            "drag": design.effects.drag,
        }
        factor = math.prod(1.0 + strength.get(name, 0.0) * there for name, there in on.items())
        triangle = np.repeat(np.flatnonzero(exposed_target(chamber)), DENTS)
        # A hundredth of each triangle is dented in a second.
        area = 0.01 * factor * design.process.recorded_time * chamber.exposed_area[triangle] / DENTS
        place = chamber.part.vertices[chamber.part.triangles[triangle, 0]]
        hits = dents_at(design, triangle, place, np.sqrt(4.0 / np.pi * area))
        speeds = [3.0 * factor * (1.0 + 1e-4 * k) for k in range(effect_pilot.REPLICAS)]
        return [
            SimpleNamespace(hits=replace(hits, speed=np.full(len(hits), speed))) for speed in speeds
        ]

    monkeypatch.setattr(effect_pilot, "simulate_replicas", simulate)
    return asked


def test_each_effect_is_switched_alone_and_the_most_important_comes_first(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked = pretend(
        {"gravity": 0.05, "ball_collisions": -0.5, "friction": -0.3, "drag": -0.001}, monkeypatch
    )
    smooth = PLATE.changed({"effects.friction": "none"})
    order = advise(smooth, CHAMBER, SerialExecutor())
    said = {one.effect: one for one in order}
    names = [one.effect for one in order]
    assert names == ["ball_collisions", "friction", "gravity", "roughness", "drag"]
    assert [one.on for one in order] == [True, False, True, True, False]
    assert [one.verdict for one in order] == ["matters"] * 3 + ["makes no difference"] * 2
    assert said["friction"].changes["mean normal speed"].value == pytest.approx(-0.3)
    assert said["gravity"].changes["mean normal speed"].value == pytest.approx(0.05)
    changed = [design.effects for design in asked if design.effects != smooth.effects]
    assert len(changed) == 4  # drag is decided by its estimate
    assert said["drag"].estimated
    assert "no pilot run was made" in str(said["drag"])
    assert all(abs(one.value) + one.half_width < 0.01 for one in said["drag"].changes.values())
    assert all(design.process.accuracy.objective_half_width is None for design in asked)


def test_drag_is_measured_where_the_estimate_leaves_it_open(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Small balls lose more of their speed in the air than the accuracy of the advice."""
    small = PLATE.changed({"shot.diameter_mm": 0.3, "shot.mass_g": 0.01})
    assert dimensionless.drag_change(PLATE, CHAMBER) < 0.002
    assert dimensionless.drag_change(small, CHAMBER) > effect_pilot.ACCURACY
    pretend({"drag": -0.05}, monkeypatch)
    said = {one.effect: one for one in advise(small, CHAMBER, SerialExecutor())}
    assert not said["drag"].estimated
    assert said["drag"].verdict == "matters"


def test_a_change_names_its_unit() -> None:
    """A speed changes by a share of itself, a coverage by a difference."""
    for name, unit in zip(MEASURED, ("% of itself", *["percentage points"] * 2), strict=True):
        one = Advice("friction", True, "because", {name: Estimate(0.075, 0.009)}, 0.01)
        assert f"it changes the {name} by +7.5 ± 0.9 {unit})" in str(one)


def test_a_target_of_two_triangles_has_figures_too(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Both are as far from the sonotrode: there is no farther half, and no 0 / 0."""
    trimesh.creation.box((60, 60, 10)).export(tmp_path / "lid.stl")
    data = PLATE.model_dump()
    data["part"] = {
        "mesh": str(tmp_path / "lid.stl"),
        "unit": "mm",
        "target": {"direction": (0.0, 0.0, -1.0)},
    }
    data["part"]["target"]["angle_deg"] = (0.0, 10.0)
    lid = validate(Design, data)
    pretend({"gravity": 0.05}, monkeypatch)

    for one in advise(lid, build_chamber(lid), SerialExecutor()):
        assert all(math.isfinite(change.value) for change in one.changes.values())


def test_auto_keeps_what_matters_and_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    pretend(
        {"gravity": 0.002, "ball_collisions": -0.5, "friction": -0.3, "drag": -0.001}, monkeypatch
    )
    design = with_effects("auto")
    assert design.effects.auto
    chosen, why = with_effects_resolved(design, CHAMBER, SerialExecutor())
    effects = chosen.effects
    assert (effects.auto, effects.gravity, effects.ball_collisions, effects.drag) == (
        False,
        False,
        True,
        False,
    )
    assert effects.friction is not None
    assert len(why) == 5
    assert with_effects_resolved(PLATE, CHAMBER, SerialExecutor()) == (PLATE, [])


def test_effects_that_are_small_alone_but_not_together_are_not_all_left_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pretend(
        {"gravity": 0.009, "drag": 0.0085, "friction": -0.3, "ball_collisions": 0.5}, monkeypatch
    )
    effects = with_effects_resolved(with_effects("auto"), CHAMBER, SerialExecutor())[0].effects
    assert (effects.gravity, effects.drag) == (True, False)


def test_figures_given_beside_auto_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    pretend({"friction": -0.3}, monkeypatch)
    design = with_effects({"auto": True, "friction": {"mu": 0.7, "beta0": -0.1}})
    friction = with_effects_resolved(design, CHAMBER, SerialExecutor())[0].effects.friction
    assert friction is not None
    assert (friction.mu, friction.beta0) == (0.7, -0.1)


def test_a_design_that_is_not_settled_is_not_simulated() -> None:
    with pytest.raises(InputError, match="effects: still"):
        scene_physics(with_effects("auto"), chamber_mesh(CHAMBER))
    with pytest.raises(InputError, match="effects"):
        with_effects("all")


@pytest.mark.long
def test_the_pilot_sees_what_a_long_run_sees() -> None:
    """The air takes next to nothing on the plate. Friction takes more than half of the tangential
    speed, so that the balls fly steeper and hit the plate harder.
    """
    with local_executor() as executor:
        said = {one.effect: one for one in advise(PLATE, CHAMBER, executor)}
    assert said["friction"].verdict == "matters"
    assert said["friction"].changes["mean normal speed"].low > 0.0
    assert abs(said["drag"].changes["mean normal speed"].value) < 0.02
    assert all(np.isfinite(e.half_width) for one in said.values() for e in one.changes.values())
