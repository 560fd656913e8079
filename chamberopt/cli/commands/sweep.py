"""The command `sweep`: simulate a design over the range of a study's parameters and draw a map."""

from __future__ import annotations

from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from chamberopt.cli import console
from chamberopt.cli.options import Cluster, Json, Resumable, Workers, app
from chamberopt.cli.prepare import compile_with_message
from chamberopt.cli.resume import resume_command, resume_note, unfinished

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.search.study import Study


@app.command
def sweep(
    study: Path,
    /,
    *,
    grid: int | None = None,
    sobol: int | None = None,
    seed: int | None = None,
    workers: Workers = None,
    cluster: Cluster = None,
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
    from chamberopt.chamber.build import build_chamber
    from chamberopt.cli.teller import TerminalTeller
    from chamberopt.common.executor import open_executor
    from chamberopt.common.progress import step
    from chamberopt.documents.terminal_lines import note_lines, sweep_lines
    from chamberopt.results.write import best_row_note
    from chamberopt.search.run_sweep import plan_sweep, run_sweep
    from chamberopt.search.study import load_study
    from chamberopt.search.study_folder import open_study_folder
    from chamberopt.workflows.save_run import save_sweep
    from chamberopt.workflows.simulate import resolve_effects

    loaded = load_study(study)
    plan = plan_sweep(loaded, grid, sobol, seed)
    name = f"{study.stem}-sweep"
    if out is None:
        console.print_remarks(unfinished(study, name))
    claim = partial(open_study_folder, loaded, plan=plan.as_json())
    with console.claimed_folder(out, name, claim) as folder, ExitStack() as workers_end:
        if folder.finished:
            console.print_finished(folder.path, "sweep", [], json)
            return
        with step("building the chamber"):
            chamber = build_chamber(loaded.design)
        command = resume_command(study, folder.path, plan.as_json())
        workers_end.enter_context(resume_note(folder, command))
        if cluster is None:
            workers = _workers_that_fit(loaded, chamber, workers)
        executor = workers_end.enter_context(open_executor(workers, cluster, "processes"))
        loaded, advice = folder.with_effects_resolved(
            lambda design: resolve_effects(design, chamber, executor, TerminalTeller())
        )
        compile_with_message(loaded.design, chamber)
        with step("candidates", len(plan.points)) as progress:
            result = run_sweep(loaded, plan, folder, executor, progress)
        with step("writing and drawing"):
            console.print_remarks(save_sweep(folder.path, result))
    notes = [*map(str, advice)]
    failed = [trial for trial in result.trials if trial.objective is None]
    if failed:
        notes.append(f"{len(failed)} candidates failed, the first because: {failed[0].reason}")
    notes.append(best_row_note(result))
    console.print_result([*sweep_lines(result), *note_lines(notes)], folder.path, json)


def _workers_that_fit(study: Study, chamber: Chamber, wanted: int | None) -> int | None:
    """Return the number of worker processes to start: as many as wanted and fit into memory.

    Raises InputError if not even one fits.
    """
    from chamberopt.common.executor import core_count
    from chamberopt.coverage.field.memory import PROCESS, evaluation_bytes, how_many_fit
    from chamberopt.simulation.replicas import most_replicas

    design = study.at_search_accuracy(study.design)
    each = PROCESS + evaluation_bytes(design, chamber, most_replicas(design))
    asked = core_count() if wanted is None else wanted
    count = how_many_fit(asked, each, PROCESS)
    if count < asked:
        text = f"there is memory for {count} of {asked} worker processes; figures stay the same"
        console.print_remarks([text])
    return count if count < asked else wanted
