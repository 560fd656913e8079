"""Run or resume a study or a sweep in its folder, for Python users and the command line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, TypeVar

from chamberopt.chamber.build import build_chamber
from chamberopt.common.executor import core_count, open_executor
from chamberopt.coverage.field.memory import PROCESS, evaluation_bytes, how_many_fit
from chamberopt.results.load import load_trials
from chamberopt.search.ask_and_tell import most_evaluations
from chamberopt.search.run_study import StudyProgress, StudyResult, run_study
from chamberopt.search.run_sweep import SweepPlan, SweepResult, run_sweep
from chamberopt.simulation.effort import Effort
from chamberopt.workflows.ranges import EndError, study_ranges
from chamberopt.workflows.save_run import save_study, save_sweep
from chamberopt.workflows.simulate import Teller, resolve_effects

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from chamberopt.chamber.build import Chamber
    from chamberopt.peening.range_result import StudyRanges
    from chamberopt.search.study import Study
    from chamberopt.search.study_folder import StudyFolder
    from chamberopt.simulation.advice import Advice


CANDIDATES = "candidates and confirmations"  # the step that ends with the last of them
Found = TypeVar("Found", StudyResult, SweepResult)


@dataclass(frozen=True)
class Ended(Generic[Found]):
    """A study or a sweep that has ended, with its result, which was saved.

    chamber: chamber of the study's design.
    advice: reasons for the optional physical effects, if the design left them to the program.
    remarks: remarks for the user, such as why a picture was skipped.
    ranges: ranges of what is not calibrated, of a study; None if they were not simulated.
    """

    result: Found
    chamber: Chamber
    advice: list[Advice]
    remarks: list[str]
    ranges: StudyRanges | None = None


def optimise_study(
    folder: StudyFolder,
    executor: Executor,
    teller: Teller,
    stop: Callable[[], bool] | None = None,
    with_ranges: bool = False,
) -> Ended[StudyResult]:
    """Run or resume the study of a folder, and save its result there.

    Args:
        stop: called before each evaluation. If it returns True, KeyboardInterrupt is raised.
        with_ranges: True to simulate start, best and runner-up at the ends of what is not
            calibrated.

    Raises:
        InputError: the start cannot be simulated, no candidate meets the constraints, or the memory
            is too small for a candidate.
    """
    with teller.step("building the chamber"):
        chamber = build_chamber(folder.study.design)
    at_once = _candidates_at_once(folder.study, chamber, teller)
    study, advice = _prepare(folder, chamber, executor, teller)
    whole = teller.step(CANDIDATES, most_evaluations(study))
    with whole as evaluations, teller.step("replicas of the candidates at work") as replicas:
        progress = StudyProgress(evaluations, replicas)
        result = run_study(study, folder, executor, progress, stop=stop, at_once=at_once)
    ranges, failed = None, []
    if with_ranges:
        try:
            ranges = study_ranges(result, executor, teller)
        except EndError as error:
            failed = [str(error)]
    with teller.step("writing and drawing"):
        found = result.chamber_of(result.best)
        warnings = teller.check(result.best.design, found, " of the best design")
        remarks = failed + save_study(folder.path, result, advice, warnings, ranges)
    return Ended(result, chamber, advice, remarks, ranges)


def sweep_study(
    folder: StudyFolder,
    plan: SweepPlan,
    teller: Teller,
    workers: int | None = None,
    cluster: str | None = None,
) -> Ended[SweepResult]:
    """Run or resume the sweep of a folder, and save its result there.

    Args:
        workers: number of worker processes, by default one per core. Fewer are started if not all
            fit into memory.
        cluster: value of the option --cluster, to use workers of a cluster instead.

    Raises:
        InputError: no candidate can be simulated, or a candidate needs more memory than there is.
    """
    with teller.step("building the chamber"):
        chamber = build_chamber(folder.study.design)
    if cluster is None:
        workers = _workers_that_fit(folder.study, chamber, workers, teller)
    with open_executor(workers, cluster, "processes") as executor:
        study, advice = _prepare(folder, chamber, executor, teller)
        with teller.step("candidates", len(plan.points)) as progress:
            result = run_sweep(study, plan, folder, executor, progress)
    with teller.step("writing and drawing"):
        remarks = save_sweep(folder.path, result)
    return Ended(result, chamber, advice, remarks)


def read_sweep(folder: StudyFolder, plan: SweepPlan) -> SweepResult:
    """Return the result of a finished sweep from its folder.

    Raises InputError if a file of the sweep was changed.
    """
    trials = tuple(load_trials(folder.path))
    return SweepResult(folder.study, plan, folder.path, trials, folder.seconds)


def _prepare(
    folder: StudyFolder, chamber: Chamber, executor: Executor, teller: Teller
) -> tuple[Study, list[Advice]]:
    """Choose the physical effects that the study's design leaves open, and compile the simulator.

    Return the study with these effects, and the reasons for them.
    """
    study, advice = folder.with_effects_resolved(
        lambda design: resolve_effects(design, chamber, executor, teller)
    )
    teller.compile(study.design, chamber, None)
    if done := len(folder.recorded.trials):
        teller.tell(f"{folder.path}: resuming after {done} evaluation{'s' * (done != 1)}")
    return study, advice


def _candidates_at_once(study: Study, chamber: Chamber, teller: Teller) -> int:
    """Return how many candidates of a batch fit into memory at once.

    Raises InputError if not even one candidate fits.
    """
    settings = study.optimizer
    replicas = settings.confirm_replicas * 2 ** (settings.confirm_rounds - 1)
    replicas = max(replicas, Effort.of(study.design.process.accuracy).most)
    each = evaluation_bytes(study.design, chamber, replicas)
    count = how_many_fit(settings.batch, each, PROCESS)
    if count < settings.batch:
        text = f"there is memory for {count} of the {settings.batch} candidates of optimizer.batch"
        teller.tell(f"{text} at a time; the others wait, and figures stay the same")
    return count


def _workers_that_fit(
    study: Study, chamber: Chamber, wanted: int | None, teller: Teller
) -> int | None:
    """Return how many of the `wanted` worker processes fit into memory. None means one per core.

    Raises InputError if not even one process fits.
    """
    design = study.at_search_accuracy(study.design)
    each = PROCESS + evaluation_bytes(design, chamber, Effort.of(design.process.accuracy).most)
    asked = core_count() if wanted is None else wanted
    count = how_many_fit(asked, each, PROCESS)
    if count >= asked:
        return wanted
    text = f"there is memory for {count} of {asked} worker processes; figures stay the same"
    teller.tell(text)
    return count
