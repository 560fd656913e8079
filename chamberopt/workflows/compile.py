"""Compile the simulator for a design before its first replica, as named steps with progress."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import sim_core
from chamberopt.chamber.flexure import flexure_of_surfaces
from chamberopt.chamber.part import turning_axis
from chamberopt.chamber.replica_seed import replica_seed
from chamberopt.chamber.scene import build_scene, chamber_mesh
from chamberopt.common.progress import step

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from sim_core import AnalyticCavity


def compile_for(
    design: Design, chamber: Chamber, cavity: AnalyticCavity | None, tell: Callable[[str], None]
) -> None:
    """Compile the simulator for a design, and tell of it because the first time takes a minute.

    It is compiled for each step of a design with several.

    Args:
        tell: called with a sentence for the user.
    Raises:
        InputError: the shot does not fit, or the part cannot turn. It is raised early.
    """
    if chamber.steps:
        for one, its_room in zip(design.in_steps.values(), chamber.steps, strict=True):
            compile_for(one, its_room, None, tell)
        return
    room, seed = cavity or chamber_mesh(chamber), replica_seed(design.process.seed, 0)
    with step("placing the shot"):
        flexure = flexure_of_surfaces(design, chamber, room)
        scene = build_scene(design, room, seed, turning_axis(design, chamber.part), flexure)
    is_cylinder = cavity is not None and cavity.radius is not None
    variant = scene.physics, design.shot.count, design.shot.mix is None, is_cylinder
    if sim_core.is_compiled(*variant):
        return
    tell("compiling the simulator (once per set of effects) ...")
    with step("compiling the simulator (once), functions") as progress:
        sim_core.compile_simulator(*variant, lambda done: progress(done, 0, None))
    if not sim_core.is_compiled(*variant):
        tell("compiled code cannot be kept: set NUMBA_CACHE_DIR to a folder of your own")
