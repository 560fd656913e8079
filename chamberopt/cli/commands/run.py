"""The command `run`: the search for a better design."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from chamberopt.cli import console
from chamberopt.cli.interrupt import Interrupt
from chamberopt.cli.options import Cluster, Json, Resumable, Workers, app
from chamberopt.cli.prepare import compile_with_message
from chamberopt.cli.resume import quoted, resume_command, resume_note, unfinished

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from chamberopt.chamber.build import Chamber
    from chamberopt.search.run_study import StudyResult
    from chamberopt.search.study import Study
    from chamberopt.search.study_folder import StudyFolder


@app.command
def run(
    study: Path,
    /,
    *,
    workers: Workers = None,
    cluster: Cluster = None,
    json: Json = False,
    out: Resumable = None,
) -> None:
    """Search for a better design, confirm it with new seeds, and write it as best.toml.

    With --out of an interrupted run, the run is resumed. Ctrl-C stops after the running
    evaluations; a second Ctrl-C stops at once.

    Parameters
    ----------
    study
        Study file (.toml).
    """
    with Interrupt() as interrupt:
        from chamberopt.chamber.build import build_chamber
        from chamberopt.common.executor import open_executor
        from chamberopt.common.progress import step
        from chamberopt.documents.terminal_lines import note_lines, study_lines
        from chamberopt.results.load import load_result, summary
        from chamberopt.search.study import load_study
        from chamberopt.search.study_folder import open_study_folder

        loaded = load_study(study)
        if out is None:
            console.print_remarks(unfinished(study, study.stem))
        claim = partial(open_study_folder, loaded)
        with console.claimed_folder(out, study.stem, claim) as folder:
            if folder.finished:
                line = f"best design: {summary(load_result(folder.path))}"
                console.print_finished(folder.path, "study", [line], json)
                return
            with step("building the chamber"):
                chamber = build_chamber(loaded.design)
            command = resume_command(study, folder.path)
            with resume_note(folder, command), open_executor(workers, cluster) as executor:
                how_to_resume = f"to resume: {command}"
                result, notes = _search(folder, chamber, executor, interrupt, how_to_resume)
            lines = [*study_lines(result), *note_lines(notes)]
            console.print_result(lines, folder.path, json)
            if not json:
                show, best = quoted("report", folder.path), folder.path / "best.toml"
                console.show([f"to see it: {show}; the design: {best}"])


def _search(
    folder: StudyFolder,
    chamber: Chamber,
    executor: Executor,
    interrupt: Interrupt,
    how_to_resume: str,
) -> tuple[StudyResult, list[str]]:
    """Run or resume the study of a folder and save its result; returns notes for the user too.

    Args:
        chamber: chamber of the study's design.
    """
    from chamberopt.chamber.build import build_chamber
    from chamberopt.cli.teller import TerminalTeller
    from chamberopt.common.progress import step
    from chamberopt.search.run_study import run_study
    from chamberopt.workflows.save_run import save_study
    from chamberopt.workflows.simulate import resolve_effects

    study, advice = folder.with_effects_resolved(
        lambda design: resolve_effects(design, chamber, executor, TerminalTeller())
    )
    at_once = _candidates_at_once(study, chamber)
    compile_with_message(study.design, chamber)
    if done := len(folder.recorded.trials):
        console.print_remarks([f"{folder.path}: resuming after {done} evaluations"])
    with step("evaluations", study.optimizer.evaluations) as progress:
        interrupt.wait_for_evaluation(how_to_resume)
        result = run_study(
            study, folder, executor, progress, stop=lambda: interrupt.requested, at_once=at_once
        )
    with step("writing and drawing"):
        best = result.best.design
        found = build_chamber(best, result.target)
        warnings = console.print_warnings(best, found, " of the best design")
        console.print_remarks(save_study(folder.path, result, advice, warnings))
    notes = [*map(str, advice), *result.warnings, *result.notes, *chamber.notes]
    return result, [*notes, *result.best.evaluation.notes]


def _candidates_at_once(study: Study, chamber: Chamber) -> int:
    """How many candidates of a batch fit into memory; InputError if one does not."""
    from chamberopt.coverage.field.memory import PROCESS, evaluation_bytes, how_many_fit
    from chamberopt.simulation.replicas import most_replicas

    settings = study.optimizer
    replicas = settings.confirm_replicas * 2 ** (settings.confirm_rounds - 1)
    replicas = max(replicas, most_replicas(study.design))
    each = evaluation_bytes(study.design, chamber, replicas)
    count = how_many_fit(settings.batch, each, PROCESS)
    if count < settings.batch:
        text = f"there is memory for {count} of the {settings.batch} candidates of optimizer.batch"
        console.print_remarks([f"{text} at a time; the others wait, and figures stay the same"])
    return count
