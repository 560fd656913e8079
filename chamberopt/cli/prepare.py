"""What comes before a simulation: compiling, aloud, and pilot runs that choose effects."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from chamberopt.simulation.effect_pilot import Advice
    from sim_core import AnalyticCavity


def compiled(design: Design, chamber: Chamber, cavity: AnalyticCavity | None = None) -> None:
    """Compiles, aloud, before the bar starts: else its first minute would look like a hang."""
    from chamberopt.chamber.scene import chamber_mesh, require_ball_count, scene_physics
    from chamberopt.common.progress import compile_with_message

    require_ball_count(design)
    shot = design.shot
    physics = scene_physics(design, cavity or chamber_mesh(chamber))
    compile_with_message(
        physics, shot.count, shot.mix is None, cavity is not None and cavity.radius is not None
    )


def settled_effects(
    design: Design, chamber: Chamber, executor: Executor
) -> tuple[Design, list[Advice]]:
    """The design with its effects chosen, and why, where it leaves them to us."""
    from chamberopt.common.progress import progress_bar
    from chamberopt.simulation.effect_pilot import with_effects_resolved

    with progress_bar("pilot runs") as progress:
        return with_effects_resolved(
            design, chamber, executor, progress, lambda variant: compiled(variant, chamber)
        )


def effects_advised(design: Design, chamber: Chamber) -> list[dict[str, Any]]:
    """Which effects a design needs, by pilot runs."""
    from chamberopt.common.parallel.executor import local_executor
    from chamberopt.common.progress import progress_bar
    from chamberopt.simulation.effect_pilot import advise, with_effects_resolved

    def prepare(variant: Design) -> None:
        compiled(variant, chamber)

    print(
        "pilot runs, with each effect switched (--no-pilot skips them) ...",
        file=sys.stderr,
        flush=True,
    )
    with local_executor() as executor, progress_bar("pilot runs") as progress:
        advice = with_effects_resolved(design, chamber, executor, progress, prepare)[1]
        advice = advice or advise(design, chamber, executor, progress, prepare)
    return [one.as_json() for one in advice]
