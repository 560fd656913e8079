"""The command `run`: search for a better design."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from chamberopt.cli import console
from chamberopt.cli.interrupt import Interrupt
from chamberopt.cli.options import (
    Accuracy,
    Cluster,
    Json,
    Resumable,
    TreatmentTime,
    Verbose,
    Workers,
    app,
    as_options,
    given_values,
)
from chamberopt.cli.resume import quoted, resume_command, resume_note, unfinished


@app.command
def run(
    study: Path,
    /,
    *,
    evaluations: int | None = None,
    accuracy: Accuracy = None,
    time: TreatmentTime = None,
    ranges: bool = True,
    workers: Workers = None,
    cluster: Cluster = None,
    verbose: Verbose = False,
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
    evaluations
        What the search may simulate, in candidates, in the place of the file's
        optimizer.evaluations.
    ranges
        At the end also simulate start, best and runner-up at the ends of what is not calibrated
        (friction, v0, slopes of faces), and say whether the best stays best.
    """
    with Interrupt() as interrupt:
        from chamberopt.cli.teller import SearchTeller
        from chamberopt.common.executor import open_executor
        from chamberopt.documents.terminal_lines import result_end
        from chamberopt.search.study import load_study
        from chamberopt.search.study_folder import open_study_folder
        from chamberopt.workflows.optimise import optimise_study

        values = given_values(accuracy, time, evaluations)
        loaded = load_study(study, values)
        if out is None:
            console.print_remarks(unfinished(study, study.stem))
        claim = partial(open_study_folder, loaded)
        with console.claimed_folder(out, study.stem, claim) as folder:
            if folder.finished:
                console.print_finished(folder.path, "study", result_end(folder.path, verbose), json)
                return
            command = resume_command(study, folder.path, options=as_options(values))
            with resume_note(folder, command), open_executor(workers, cluster) as executor:
                teller = SearchTeller(interrupt, f"to resume: {command}")
                done = optimise_study(folder, executor, teller, lambda: interrupt.requested, ranges)
            console.print_remarks(done.remarks)
            console.print_result(result_end(folder.path, verbose), folder.path, json)
            if not json:
                show, best = quoted("report", folder.path), folder.path / "best.toml"
                console.show([f"to see it: {show}; the design: {best}"])
