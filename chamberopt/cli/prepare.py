"""Prepare a simulation: compile the simulator, make pilot simulations, load a replica."""

from __future__ import annotations

from typing import TYPE_CHECKING

from chamberopt.cli.console import print_remarks

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from chamberopt.chamber.build import Chamber
    from chamberopt.common.progress import Progress
    from chamberopt.design.load import Design
    from chamberopt.results.load import Result
    from chamberopt.results.rebuild import RebuiltReplica
    from sim_core import AnalyticCavity


def compile_with_message(
    design: Design, chamber: Chamber, cavity: AnalyticCavity | None = None
) -> None:
    """Compile the simulator for a design, with a message because the first time takes a minute.

    Raises:
        InputError: the shot does not fit, or the part cannot turn. It is raised early.
    """
    from chamberopt.workflows.compile import compile_for

    compile_for(design, chamber, cavity, lambda text: print_remarks([text]))


def advise_effects(design: Design, chamber: Chamber) -> list[dict[str, object]]:
    """Find by pilot simulations which optional physical effects matter for a design.

    Return the advice on each effect as JSON values.
    """
    from chamberopt.common.executor import local_executor
    from chamberopt.common.progress import step
    from chamberopt.results.write import advice_record
    from chamberopt.simulation.effect_pilot import (
        IMPACTS,
        MAX_TIME,
        REPLICAS,
        advise,
        groups,
        with_effects_resolved,
    )

    def prepare(variant: Design) -> None:
        compile_with_message(variant, chamber)

    effects = len(groups(design, chamber))
    print_remarks(
        [
            f"pilot runs: of the design, and with each of {effects} effects switched, until the "
            f"target has about {IMPACTS:,} impacts (at most {REPLICAS} x {MAX_TIME:g} simulated s)"
        ]
    )
    with local_executor() as executor, step("pilot runs") as progress:
        advice = with_effects_resolved(design, chamber, executor, progress, prepare)[1]
        advice = advice or advise(design, chamber, executor, progress, prepare)
    return [advice_record(one).as_json() for one in advice]


def seconds_of(progress: Progress, whole: float) -> Callable[[float], None]:
    """Return a function for sim_core.simulate to call, which reports simulated time to `progress`.


    Args:
        whole: simulated time of the whole step [s].
    """
    return lambda seconds: progress(round(seconds), max(1, round(whole)), None)


def load_replica(folder: Path, number: int) -> tuple[Result, RebuiltReplica]:
    """Load a result and one of its replicas, ready to be compiled and simulated again."""
    from chamberopt.coverage.part_impacts import HITS_FILE
    from chamberopt.results.load import load_result
    from chamberopt.results.rebuild import rebuild_replica

    loaded = load_result(folder)
    loaded.path(HITS_FILE)  # a missing file is told at once
    return loaded, rebuild_replica(loaded, number)
