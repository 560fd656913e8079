"""Prepare a simulation: compile the simulator, make pilot simulations, load a replica."""

from __future__ import annotations

from typing import TYPE_CHECKING

from chamberopt.cli.console import print_remarks

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from chamberopt.chamber.build import Chamber
    from chamberopt.chamber.propose.proposal import Proposal, Wanted
    from chamberopt.chamber.propose.proposed_budget import Measured
    from chamberopt.chamber.propose.proposed_intensity import IntensityPilot
    from chamberopt.common.progress import Progress
    from chamberopt.design.intensity import WantedIntensity
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


def with_intensity(
    made: Proposal, wanted: Wanted, intensity: WantedIntensity, again: Callable[[Wanted], Proposal]
) -> Proposal:
    """Return a proposal with balls and an amplitude for a wanted Almen intensity, by pilot runs.

    Args:
        again: proposes the design for other wishes.
    Raises:
        InputError: no pilot tells the intensity.
    """
    from chamberopt.chamber.propose.proposed_intensity import propose_intensity
    from chamberopt.common.executor import local_executor
    from chamberopt.common.progress import step
    from chamberopt.peening.intensity_pilot import predict_intensity

    compile_with_message(made.design, made.chamber)
    with local_executor() as executor:

        def simulate(one: Proposal) -> IntensityPilot | None:
            with step("pilot run of the intensity") as progress:
                return predict_intensity(one.design, one.chamber, executor, progress)

        return propose_intensity(made, wanted, intensity, again, simulate)


def measured(made: Proposal, is_told: bool = True) -> Measured | None:
    """Simulate a proposal briefly, and return what its budget follows from.

    It is None where that cannot be done. A warning then gives the reason, unless is_told is false.
    """
    from chamberopt.common.errors import InputError
    from chamberopt.common.executor import local_executor
    from chamberopt.common.progress import step
    from chamberopt.simulation.budget_pilot import measure_budget
    from sim_core import SimulationError

    try:
        compile_with_message(made.design, made.chamber)
        with local_executor() as executor, step("pilot run (--no-pilot leaves it out)") as progress:
            return measure_budget(made.design, made.chamber, executor, progress)
    except (InputError, SimulationError) as error:
        text = f"warning: no pilot, treatment and simulated time are starts: {error}"
        print_remarks([text] if is_told else [])
        return None


def with_measured_budget(made: Proposal, found: Measured | None) -> Proposal:
    """Return a proposal whose treatment time and budget follow from a pilot, if one could run."""
    from chamberopt.chamber.propose.proposed_budget import Asked, propose_budget, with_budget

    if found is None:
        return made
    is_limited = not made.design.why_no_intensity
    asked = Asked(made.design.process.coverage_percent, made.strength_dents, is_limited)
    return with_budget(made, propose_budget(found, asked))


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
