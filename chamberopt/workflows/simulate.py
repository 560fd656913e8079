"""Simulate a design into a folder. Python users and the command line share this workflow.

The workflow reports its steps to an object, a Teller. One class of this module is silent, the other
shows progress. The command line has a subclass that prints.
"""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from chamberopt.chamber.analytic import analytic_cavity
from chamberopt.chamber.build import build_chamber
from chamberopt.common.progress import StoppedError, step, untold
from chamberopt.coverage.field.memory import PROCESS, evaluation_bytes, how_many_fit
from chamberopt.design.ranges import unknowns, variants
from chamberopt.peening.calibration_errors import evaluate_calibrated
from chamberopt.peening.range_result import Spreads
from chamberopt.peening.tolerances import simulate_tolerances, with_usual_tolerances
from chamberopt.simulation.effect_pilot import with_effects_resolved
from chamberopt.simulation.effort import Effort
from chamberopt.simulation.evaluate import ReplicaPlan, evaluate
from chamberopt.simulation.replicas import ReplicaSet
from chamberopt.workflows.compile import compile_for
from chamberopt.workflows.ranges import ENDS, EndError, simulate_ranges
from chamberopt.workflows.save_run import save_simulation

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from chamberopt.chamber.build import Chamber
    from chamberopt.common.progress import Progress
    from chamberopt.design.load import Design
    from chamberopt.results.records import CandidateRecord
    from chamberopt.simulation.advice import Advice
    from chamberopt.simulation.evaluation import Evaluation
    from sim_core import AnalyticCavity

LEAST = 3  # replicas that give an interval


class Teller:
    """The object to which a workflow reports its steps.

    This class reports nothing but the progress of counted steps, to the function that it was given.
    StepTeller shows all steps. The command line has a subclass of it that prints.
    """

    def __init__(self, progress: Progress | None = None) -> None:
        self._progress = progress

    def step(self, what: str, total: int | None = None) -> AbstractContextManager[Progress]:
        """Return a `with` context for a step of the workflow.

        The context yields the function to call with the step's progress.

        Args:
            what: name of the step.
            total: number of units that the step counts; None if it counts nothing.
        """
        if self._progress is None or total is None:
            return nullcontext(untold)
        return nullcontext(self._progress)

    def stoppable(self, progress: Progress) -> AbstractContextManager[Progress]:
        """Return a `with` context in which the user may stop, and keep what is simulated by then.

        The context yields what to call in the place of `progress`, which then raises StoppedError.
        With this class nobody stops.
        """
        return nullcontext(progress)

    def compile(self, design: Design, chamber: Chamber, cavity: AnalyticCavity | None) -> None:
        """Compile the simulator before the first replica.

        This class does nothing, so the first replica compiles it.
        """

    def check(self, design: Design, chamber: Chamber, which: str = "") -> list[str] | None:
        """Return warnings on the design. This class does not check it and returns None.

        Args:
            which: name of the design for the warnings if there are several designs, such as
                " of the best design".
        """
        return None

    def tell(self, text: str) -> None:
        """Tell the user a sentence. This class ignores it."""


class StepTeller(Teller):
    """Show the steps of a workflow in the terminal or notebook, each with its progress."""

    def step(self, what: str, total: int | None = None) -> AbstractContextManager[Progress]:
        return step(what, total)

    def compile(self, design: Design, chamber: Chamber, cavity: AnalyticCavity | None) -> None:
        compile_for(design, chamber, cavity, self.tell)


def teller_of(progress: Progress | bool) -> Teller:
    """Return the Teller for the argument `progress` of the functions that Python users call.

    Args:
        progress: True to show all steps, False for none, or the function to call with the progress
            of counted steps.
    """
    if progress is True:
        return StepTeller()
    return Teller(progress or None)


@dataclass(frozen=True)
class SimulationSettings:
    """How a design is simulated.

    analytic: use the exact cylinder, box or prism instead of its mesh, if the chamber is one.
    tolerances: also simulate the effect of the design's tolerances.
    ranges: also simulate the ranges of what is not calibrated.
    plan: the replicas to simulate, by default those of the design.
    step: name of the step in which replicas are simulated.
    """

    analytic: bool = False
    tolerances: bool = False
    ranges: bool = False
    plan: ReplicaPlan = field(default_factory=ReplicaPlan)
    step: str = "replicas"


@dataclass(frozen=True)
class Simulated:
    """A design that was simulated and saved.

    design: the design with its optional physical effects chosen.
    advice: reasons for these effects, if the design left their choice to the program.
    spreads: effect of the design's tolerances, and ranges of what is not calibrated.
    record: what its result.json says.
    remarks: remarks for the user, such as why a picture was skipped.
    """

    design: Design
    chamber: Chamber
    evaluation: Evaluation
    spreads: Spreads
    advice: list[Advice]
    record: CandidateRecord
    remarks: list[str]


def simulate_design(
    design: Design,
    folder: Path,
    executor: Executor,
    teller: Teller,
    settings: SimulationSettings,
    chamber: Chamber | None = None,
) -> Simulated:
    """Build, simulate and save a design in a new or empty folder.

    Args:
        chamber: chamber of the design that was built and checked before; None to do so here.

    Raises:
        InputError: the chamber cannot be built, has no room for the shot, is not analytic or needs
            too much memory.
    """
    warnings = None
    if settings.tolerances:
        design = with_usual_tolerances(design)
    if settings.analytic:
        design.require_one_step("an exact cavity in place of the mesh")
    is_checked = chamber is not None
    if chamber is None:
        with teller.step("building the chamber"):
            chamber = build_chamber(design)
            most = Effort.of(design.process.accuracy).most
            how_many_fit(1, evaluation_bytes(design, chamber, most), PROCESS)
    cavity = analytic_cavity(design, chamber) if settings.analytic else None
    if not is_checked:
        warnings = teller.check(design, chamber)
    design, advice = resolve_effects(design, chamber, executor, teller)
    if settings.ranges:
        variants(design)  # before the work begins
    teller.compile(design, chamber, cavity)
    found, ranges = None, None
    # What follows the replicas takes as long again, which a user who waits is to know.
    first, then, last = steps = settings.step, ENDS, "writing and drawing"
    if settings.ranges and unknowns(design):
        first, then, last = (f"step {k} of 3: {one}" for k, one in enumerate(steps, 1))
    with teller.step(first, Effort.of(design.process.accuracy).most) as progress:
        what = design, chamber, executor, progress
        if settings.tolerances:
            evaluation, found = simulate_tolerances(*what, settings.analytic)
        else:
            evaluation = evaluate_until_stopped(*what, settings.plan, cavity, teller)
    if settings.ranges and evaluation.stopped_by != "user":
        try:
            ranges = simulate_ranges(design, chamber, evaluation, executor, teller, then)
        except EndError as error:
            evaluation = replace(evaluation, notes=(str(error), *evaluation.notes))
    spreads = Spreads(found, ranges)
    with teller.step(last):
        saved = save_simulation(folder, design, chamber, evaluation, advice, warnings, spreads)
    return Simulated(design, chamber, evaluation, spreads, advice, *saved)


def evaluate_until_stopped(
    design: Design,
    chamber: Chamber,
    executor: Executor,
    progress: Progress,
    plan: ReplicaPlan,
    cavity: AnalyticCavity | None,
    teller: Teller,
) -> Evaluation:
    """Return the evaluation of a design by its replicas, or by those that end before a stop.

    With a calibration, intervals take all of its runs: nothing can be kept before.

    Raises KeyboardInterrupt if too few have ended before a stop.
    """
    what = design, chamber, executor
    if design.calibration is not None:
        return evaluate_calibrated(*what, progress, plan, cavity)
    known = ReplicaSet()
    try:
        with teller.stoppable(progress) as tell:
            return evaluate(*what, tell, plan, cavity, known)
    except StoppedError:
        done = len(known.replicas)
    if done < LEAST:
        error = KeyboardInterrupt()
        error.add_note(f"nothing is kept: {done} replicas had ended, and {LEAST} give an interval")
        raise error
    found = evaluate(*what, None, replace(plan, count=done), cavity, known)
    most = Effort.of(design.process.accuracy, plan.count).most
    note = (
        f"stopped by the user after {done} of {most} replicas: intervals are wider than those of "
        "all, and how far figures may be off before a calibration was not simulated"
    )
    return replace(found, stopped_by="user", notes=(note, *found.notes))


def resolve_effects(
    design: Design, chamber: Chamber, executor: Executor, teller: Teller
) -> tuple[Design, list[Advice]]:
    """Choose the optional physical effects that a design leaves open, by pilot simulations.

    Return the design with the chosen effects, and the reasons.
    """
    if not design.effects.auto:
        return design, []
    with teller.step("pilot runs") as progress:
        return with_effects_resolved(
            design, chamber, executor, progress, lambda one: teller.compile(one, chamber, None)
        )
