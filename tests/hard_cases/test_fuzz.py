"""Random scenes keep all invariants or stop with a message, and so do past failures."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings

from sim_core import (
    Drag,
    Friction,
    Gravity,
    Physics,
    RandomPhase,
    Rest,
    Restitution,
    Scene,
    Vibration,
)
from tests.hard_cases.fuzz import Plan, plans, play_and_check, require_invariants
from tests.hard_cases.fuzzed_effects import FEW, MANY
from tests.hard_cases.saved_scene import FOLDER, load_scene, save_scene
from tests.helpers.scenes.cavities import CEILING, FLOOR
from tests.helpers.scenes.fuzzed_chambers import Chamber, random_chamber

SAVED = sorted(FOLDER.glob("*.npz"))
SLOW = [HealthCheck.too_slow, HealthCheck.data_too_large]


@pytest.mark.long
@settings(
    max_examples=40, derandomize=True, deadline=None, database=None, suppress_health_check=SLOW
)
@given(plans(FEW))
def test_any_scene_runs_or_says_why_not(plan: Plan) -> None:
    play_and_check(plan)


@pytest.mark.long
@pytest.mark.parametrize("effects", MANY)
def test_many_scenes_with_these_effects_run_or_say_why_not(effects: str) -> None:
    @settings(
        max_examples=250,
        deadline=None,
        suppress_health_check=SLOW,
        phases=set(Phase) - {Phase.explain},
    )
    @given(plans((effects,)))
    def play(plan: Plan) -> None:
        play_and_check(plan)

    play()


@pytest.mark.parametrize("path", SAVED, ids=[path.stem for path in SAVED])
def test_a_saved_scene_runs(path: Path) -> None:
    """All of them do; one that is rightly refused belongs into a test that names its message."""
    scene = load_scene(path)
    require_invariants(Chamber(scene.mesh, scene.balls, scene.physics), scene.duration)


def test_there_are_saved_scenes() -> None:
    assert len(SAVED) >= 4


LAW = (0.9, 1.0)
LAWS = Physics(Gravity(), Restitution((LAW, LAW), LAW), Vibration(FLOOR, 25e-6, 20e3, 0.3))


@pytest.mark.parametrize(
    ("physics", "alike"),
    [
        (LAWS._replace(friction=Friction((LAW, LAW), LAW), rest=Rest()), True),
        (LAWS._replace(random_phase=RandomPhase(7), drag=Drag(), ball_collisions=None), False),
        (
            LAWS._replace(
                vibration=(Vibration(FLOOR, 0.0, 20e3), Vibration(CEILING, 0.0, 19e3)), drag=Drag()
            ),
            False,
        ),
    ],
)
def test_a_scene_comes_back_from_its_file_as_it_was(
    tmp_path: Path, physics: Physics, alike: bool
) -> None:
    chamber = random_chamber("geared", 3)
    balls = dataclasses.replace(chamber.balls, spins=chamber.balls.velocities if alike else None)
    if not alike:
        shares = np.where(np.arange(len(balls)) % 3, 1.0, 0.7)
        balls = dataclasses.replace(
            balls, diameter=shares * balls.diameter, density=7800.0 * shares
        )
    scene = Scene(chamber.mesh, balls, physics, 0.5)
    save_scene(tmp_path / "scene.npz", scene)
    again = load_scene(tmp_path / "scene.npz")
    assert again.physics == physics
    assert again.duration == scene.duration
    for name in ("positions", "velocities", "spins", "diameter", "density"):
        np.testing.assert_array_equal(getattr(again.balls, name), getattr(scene.balls, name))
    for name in ("vertices", "triangles", "tags"):
        assert (getattr(again.mesh, name) == getattr(scene.mesh, name)).all()
