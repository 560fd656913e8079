"""Run or resume a study in its folder. Python users and the command line share this workflow."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from chamberopt.chamber.build import build_chamber
from chamberopt.coverage.field.memory import PROCESS, evaluation_bytes, how_many_fit
from chamberopt.search.run_study import run_study
from chamberopt.simulation.replicas import most_replicas
from chamberopt.workflows.save_run import save_study
from chamberopt.workflows.simulate import Teller, resolve_effects

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from chamberopt.chamber.build import Chamber
    from chamberopt.search.run_study import StudyResult
    from chamberopt.search.study import Study
    from chamberopt.search.study_folder import StudyFolder
    from chamberopt.simulation.advice import Advice


@dataclass(frozen=True)
class Optimised:
    """A study that has ended and was saved.

    chamber: chamber of the study's design.
    advice: reasons for the optional effects, if the design left their choice to the program.
    remarks: remarks for the user, such as why a picture was skipped.
    """

    result: StudyResult
    chamber: Chamber
    advice: list[Advice]
    remarks: list[str]


def optimise_study(
    folder: StudyFolder, executor: Executor, teller: Teller, stop: Callable[[], bool] | None = None
) -> Optimised:
    """Run or resume the study of a folder, and save its result there.

    Args:
        stop: called before each evaluation. If it returns True, KeyboardInterrupt is raised.

    Raises:
        InputError: the start cannot be simulated, no candidate meets the constraints, or one needs
            more memory than there is.
    """
    with teller.step("building the chamber"):
        chamber = build_chamber(folder.study.design)
    study, advice = folder.with_effects_resolved(
        lambda design: resolve_effects(design, chamber, executor, teller)
    )
    at_once = _candidates_at_once(study, chamber, teller)
    teller.compile(study.design, chamber, None)
    if done := len(folder.recorded.trials):
        teller.tell(f"{folder.path}: resuming after {done} evaluations")
    with teller.step("evaluations", study.optimizer.evaluations) as progress:
        result = run_study(study, folder, executor, progress, stop=stop, at_once=at_once)
    with teller.step("writing and drawing"):
        best = result.best.design
        found = build_chamber(best, result.target)
        warnings = teller.check(best, found, " of the best design")
        remarks = save_study(folder.path, result, advice, warnings)
    return Optimised(result, chamber, advice, remarks)


def _candidates_at_once(study: Study, chamber: Chamber, teller: Teller) -> int:
    """Return how many candidates of a batch fit into memory at once.

    Raises InputError if not even one fits.
    """
    settings = study.optimizer
    replicas = settings.confirm_replicas * 2 ** (settings.confirm_rounds - 1)
    replicas = max(replicas, most_replicas(study.design))
    each = evaluation_bytes(study.design, chamber, replicas)
    count = how_many_fit(settings.batch, each, PROCESS)
    if count < settings.batch:
        text = f"there is memory for {count} of the {settings.batch} candidates of optimizer.batch"
        teller.tell(f"{text} at a time; the others wait, and figures stay the same")
    return count
