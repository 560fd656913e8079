"""An absent effect is in none of the arrays and in none of the machine code of a scene."""

import json
import subprocess
import sys
from collections.abc import Iterator
from operator import attrgetter
from pathlib import Path

import numpy as np
import pytest
from numba.core.caching import NullCache

from sim_core import (
    BallCollisions,
    Balls,
    Drag,
    Flexure,
    Friction,
    Gravity,
    PartRotation,
    Physics,
    RandomPhase,
    Rest,
    Restitution,
    Roughness,
    Scene,
    Vibration,
)
from sim_core.effects.surface.surface_effects import MAKERS, SurfaceEffects, surface_effects
from sim_core.loop import events
from sim_core.loop.simulate import Simulation
from sim_core.numerics.jit import Step, _compiled
from tests.helpers.scenes.cavities import box

# what the loop keeps of an effect, by the name of the field and the kind of thing it is when the
# effect is there
KEPT = {
    "gravity": ("gravity", "Gravity"),
    "restitution": ("restitution", "RestitutionState"),
    "vibration": ("wave", "Wave"),
    "rest": ("contact", "ContactState"),
    "part_rotation": ("rotation", "RotationState"),
    "friction": ("friction_state", "FrictionState"),
    "random_phase": ("random_phase", "RandomPhaseState"),
    "drag": ("drag", "DragState"),
    "roughness": ("roughness", "RoughnessState"),
    "flexure": ("flexure", "FlexureState"),
    "ball_collisions": ("neighbours", "NeighbourFilter"),
}
STEEL = (0.9, 1.0)
PRESENT = {
    "gravity": Gravity(),
    "restitution": Restitution((STEEL,) * 3, STEEL),
    "vibration": Vibration(0, 25e-6, 20e3),
    "rest": Rest(),
    "part_rotation": PartRotation(0, rpm=10.0),
    "friction": Friction(((0.3, 0.2),) * 3, (0.3, 0.2)),
    "random_phase": RandomPhase(1),
    "drag": Drag(),
    "roughness": Roughness((0.1,) * 3),
    "flexure": Flexure(np.zeros(12), 1e11),
    "ball_collisions": BallCollisions(),
}
NEEDS = {"rest": "gravity", "flexure": "restitution", "random_phase": "vibration"}
BARE = Physics(ball_collisions=None)


def bare_scene(physics: Physics = BARE) -> Scene:
    places = np.array([[0.005, 0.005, 0.005], [0.012, 0.01, 0.01]])
    return Scene(
        box((0.02, 0.02, 0.02)),
        Balls(places, np.array([[1.0, 0.5, 0.2], [-1.0, 0.3, 0.4]]), 3e-3),
        physics,
        0.05,
    )


def steps() -> Iterator[tuple[str, Step]]:
    """Every function of the simulator in this process, with its name."""
    for name, module in list(sys.modules.items()):
        if name.startswith("sim_core."):
            for function in vars(module).values():
                if isinstance(function, Step) and function.py_func.__module__ == name:
                    yield f"{name}.{function.py_func.__name__}", function


def forget_the_loop() -> None:
    """Compile the event loop from nothing; what sets up a scene may be loaded from the cache."""
    for _, step in steps():
        step._cache = NullCache()
    events.advance.entry = _compiled(events.advance.py_func, inline=False, from_python=True)
    events.advance.entry._cache = NullCache()


def compiled_functions() -> dict[str, list[str]]:
    """Every function of the simulator that was compiled or loaded in this process, with the types
    that it was compiled for.
    """
    found = {}
    for name, function in steps():
        kinds = [*function.signatures, *getattr(function, "entry", function).signatures]
        if kinds:
            found[name] = [*map(str, kinds)]
    return found


def test_every_effect_is_in_the_table() -> None:
    assert set(KEPT) == set(PRESENT) == set(Physics._fields) - {"surface"}


@pytest.mark.long
def test_a_rigid_face_has_no_profile(bare: dict[str, list[str]]) -> None:
    """A profile is part of a vibration, so the loop keeps it under its own name."""
    assert (
        Simulation(bare_scene(BARE._replace(vibration=Vibration(0, 1e-6, 2e4)))).state.profiles
        is None
    )
    assert not any("FaceProfiles(" in types for kinds in bare.values() for types in kinds)


def test_further_effects_of_surfaces_are_absent_unless_given() -> None:
    """Each is a field of one record, so the loop keeps it under its own name."""
    assert set(SurfaceEffects._fields) == set(MAKERS)
    assert all(effect is None for effect in Physics().surface)
    assert surface_effects() == SurfaceEffects()


@pytest.fixture(scope="module")
def bare() -> dict[str, list[str]]:
    """What a scene without any effect compiles."""
    code = (
        "import json; from sim_core import simulate; from "
        "tests.sim_core.effects.test_absent_effects import *; forget_the_loop();"
        "simulate(bare_scene()); print(json.dumps(compiled_functions()))"
    )
    answer = subprocess.run(
        [sys.executable, "-c", code],
        cwd=Path(__file__).parents[3],
        check=True,
        capture_output=True,
        text=True,
    )
    found: dict[str, list[str]] = json.loads(answer.stdout)
    return found


@pytest.mark.long
def test_the_machine_code_of_a_bare_scene_knows_no_effect(bare: dict[str, list[str]]) -> None:
    assert "sim_core.loop.events.advance" in bare
    wrong = {
        f"{function}{types}"
        for function, signatures in bare.items()
        for types in signatures
        for _, kind in KEPT.values()
        if f"{kind}(" in types
    }
    assert not wrong
    # what only an effect calls was never compiled, so it cannot be in what was
    for function in (
        "numerics.roots.first_wave_approach",
        "contact.landing_and_lift_off.touch_down",
        "contact.ball_on_ball.meet",
        "detect.ball_bent_face.first_bent_approach",
        "effects.amplitude_profile.share_and_slope",
        "effects.part_rotation.relative_flight",
        "effects.restitution.restitution_law",
        "effects.roughness._facet",
        "effects.flexure._zener",
        "impulses.friction._tangential_change",
        "loop.neighbours.next_meeting",
    ):
        module, _, name = f"sim_core.{function}".rpartition(".")
        assert hasattr(sys.modules.get(module) or __import__(module, fromlist=[name]), name), (
            f"{function} is no more"
        )
        assert f"sim_core.{function}" not in bare


@pytest.mark.parametrize("effect", sorted(KEPT))
def test_the_arrays_of_an_absent_effect_do_not_exist(effect: str) -> None:
    field, _ = KEPT[effect]
    assert attrgetter(field)(Simulation(bare_scene()).state) is None


@pytest.mark.parametrize("effect", sorted(set(KEPT) - {"part_rotation"}))
def test_the_table_names_what_a_present_effect_keeps(effect: str) -> None:
    field, kind = KEPT[effect]
    needed = {name: PRESENT[name] for name in (effect, NEEDS.get(effect)) if name}
    run = Simulation(bare_scene(BARE._replace(**needed)))  # type: ignore[arg-type]
    assert type(attrgetter(field)(run.state)).__name__ == kind
