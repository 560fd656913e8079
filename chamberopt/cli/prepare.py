"""What precedes a simulation: compilation with a message, pilot runs, and the replica to repeat."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from chamberopt.cli.console import print_remarks

if TYPE_CHECKING:
    from concurrent.futures import Executor
    from pathlib import Path

    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from chamberopt.output.resimulate.rebuild import RebuiltReplica
    from chamberopt.output.results.load import Result
    from chamberopt.simulation.effect_pilot import Advice
    from sim_core import AnalyticCavity


def compile_with_message(
    design: Design, chamber: Chamber, cavity: AnalyticCavity | None = None
) -> None:
    """Compile with a message, not behind a progress bar, where a minute would look like a hang."""
    import sim_core
    from chamberopt.chamber.part import turning_axis
    from chamberopt.chamber.scene import (
        chamber_mesh,
        require_ball_count,
        require_turnable,
        scene_physics,
    )

    require_ball_count(design)
    shot, mesh = design.shot, chamber_mesh(chamber)
    axis = turning_axis(design, chamber.part)
    require_turnable(design, mesh, axis)
    physics = scene_physics(design, cavity or mesh, axis=axis)
    is_cylinder = cavity is not None and cavity.radius is not None
    variant = physics, shot.count, shot.mix is None, is_cylinder
    if sim_core.is_compiled(*variant):
        return
    print_remarks(["compiling the simulator (once per set of effects) ..."])
    seconds = sim_core.compile_simulator(*variant)
    print_remarks([f"compiled in {seconds:.0f} s"])
    if not sim_core.is_compiled(*variant):
        print_remarks(["compiled code cannot be kept: set NUMBA_CACHE_DIR to a folder of your own"])


def resolve_effects(
    design: Design, chamber: Chamber, executor: Executor
) -> tuple[Design, list[Advice]]:
    """Replace each effect that is "auto" by what pilot runs advise, with the advice."""
    from chamberopt.common.progress import progress_bar
    from chamberopt.simulation.effect_pilot import with_effects_resolved

    with progress_bar("pilot runs") as progress:
        return with_effects_resolved(
            design, chamber, executor, progress, lambda one: compile_with_message(one, chamber)
        )


def advise_effects(design: Design, chamber: Chamber) -> list[dict[str, Any]]:
    """Find by pilot runs which effects a design needs; the advice as plain JSON values."""
    from chamberopt.common.parallel.executor import local_executor
    from chamberopt.common.progress import progress_bar
    from chamberopt.simulation.effect_pilot import advise, with_effects_resolved

    def prepare(variant: Design) -> None:
        compile_with_message(variant, chamber)

    print_remarks(["pilot runs with each effect switched on and off ..."])
    with local_executor() as executor, progress_bar("pilot runs") as progress:
        advice = with_effects_resolved(design, chamber, executor, progress, prepare)[1]
        advice = advice or advise(design, chamber, executor, progress, prepare)
    return [one.as_json() for one in advice]


def load_replica(folder: Path, number: int) -> tuple[Result, RebuiltReplica]:
    """A result and one of its replicas, compiled to be simulated again."""
    from chamberopt.output.resimulate.rebuild import rebuild_replica
    from chamberopt.output.results.load import load_result
    from chamberopt.output.vtp_files import CHAMBER, COVERAGE, PART

    loaded = load_result(folder)
    for name in (PART, COVERAGE, CHAMBER):  # the drawing process reads them
        loaded.path(name)
    replica = rebuild_replica(loaded, number)
    compile_with_message(replica.design, replica.chamber, replica.cavity)
    return loaded, replica
