"""The command `sweep`: simulate a design over the range of a study's parameters and draw a map."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from chamberopt.cli import console
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
from chamberopt.cli.resume import resume_command, resume_note, unfinished


@app.command
def sweep(
    study: Path,
    /,
    *,
    grid: int | None = None,
    sobol: int | None = None,
    seed: int | None = None,
    accuracy: Accuracy = None,
    time: TreatmentTime = None,
    workers: Workers = None,
    cluster: Cluster = None,
    verbose: Verbose = False,
    json: Json = False,
    out: Resumable = None,
) -> None:
    """Simulate candidates on a grid or spread evenly over [vary], instead of searching.

    With --out of an interrupted sweep, the sweep is resumed.

    Parameters
    ----------
    study
        Study file (.toml).
    grid
        Values of each parameter, bounds included: N parameters give GRID^N candidates, fewer
        where a parameter can have fewer values.
    sobol
        Number of candidates, at Sobol points; powers of 2 are spread most evenly. Those alike
        are simulated once.
    seed
        Seed of the Sobol points, by default the study's optimizer.seed.
    """
    from chamberopt.cli.teller import TerminalTeller
    from chamberopt.documents.terminal_lines import sweep_end
    from chamberopt.results.write import best_row_note
    from chamberopt.search.run_sweep import plan_sweep
    from chamberopt.search.study import load_study
    from chamberopt.search.study_folder import open_study_folder
    from chamberopt.workflows.optimise import read_sweep, sweep_study

    values = given_values(accuracy, time)
    loaded = load_study(study, values)
    plan = plan_sweep(loaded, grid, sobol, seed)
    name = f"{study.stem}-sweep"
    if out is None:
        console.print_remarks(unfinished(study, name))
    claim = partial(open_study_folder, loaded, plan=plan.as_json())
    with console.claimed_folder(out, name, claim) as folder:
        if folder.finished:
            found = read_sweep(folder, plan)
            end = sweep_end(found, [best_row_note(found)], verbose)
            console.print_finished(folder.path, "sweep", end, json)
            return
        command = resume_command(study, folder.path, plan.as_json(), as_options(values))
        with resume_note(folder, command):
            done = sweep_study(folder, plan, TerminalTeller(), workers, cluster)
    console.print_remarks(done.remarks)
    notes = [best_row_note(done.result), *map(str, done.advice)]
    failed = [trial for trial in done.result.trials if trial.objective is None]
    if failed:
        notes.append(f"{len(failed)} candidates failed, the first because: {failed[0].reason}")
    console.print_result(sweep_end(done.result, notes, verbose), folder.path, json)
