"""run, sweep: many designs."""

from __future__ import annotations

import shlex
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from chamberopt.cli.console import (
    accuracy_said,
    estimates,
    notes_said,
    remark,
    results_folder,
    row,
    say,
    warn,
)
from chamberopt.cli.options import Cluster, Json, Resumable, Workers, app
from chamberopt.cli.prepare import compiled, settled_effects
from chamberopt.common.errors import InputError

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from chamberopt.chamber.build import Chamber
    from chamberopt.cli.interrupt import Interrupt
    from chamberopt.optimize.storage.study_folder import StudyFolder
    from chamberopt.optimize.study import Study


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
    """Run a study: search for a better design, confirm it on fresh seeds, write it as best.toml. With the --out of a
    run that was stopped it goes on from there. Ctrl-C: once to stop after this evaluation, twice to stop now.

    Parameters
    ----------
    study
        Study file (.toml).
    """
    from chamberopt.cli.interrupt import Interrupt

    with Interrupt() as interrupt:
        from chamberopt.chamber.build import build_chamber
        from chamberopt.common.parallel.executor import open_executor
        from chamberopt.optimize.load_study import load_study
        from chamberopt.optimize.storage.study_folder import open_study_folder

        question = load_study(study)
        start = build_chamber(question.design)
        if out is None:
            remark(_unfinished(study))
        place = results_folder(None, study.stem) if out is None else nullcontext(out)
        with place as folder, open_study_folder(question, folder) as record:
            if record.finished:
                _finished(record.folder, json)
                return
            command = f"to go on: {_command('run', study, '--out', record.folder)}"
            try:
                with open_executor(workers, cluster) as executor:
                    _run(question, start, record, executor, interrupt, command, json)
            except InputError:
                raise
            except BaseException as error:
                if record.begun:
                    error.add_note(command)
                raise


def _run(
    question: Study, start: Chamber, record: StudyFolder, executor: Executor, interrupt: Interrupt, how_to_go_on: str,
    json: bool,
) -> None:  # fmt: skip
    """A study from where its record stands to what is said of its result. start: the chamber of its design."""
    from chamberopt.chamber.build import build_chamber
    from chamberopt.common.progress import progress_bar
    from chamberopt.optimize.run_study import search_and_confirm
    from chamberopt.output.save_run import save_study

    question, advice = record.with_effects_resolved(
        lambda design: settled_effects(design, start, executor)
    )
    design = question.design
    compiled(design, start)
    if record.trials:
        remark(
            [f"{record.folder}: {len(record.trials)} evaluations are there; going on from the next"]
        )
    with progress_bar("evaluations") as progress:
        interrupt.be_patient(how_to_go_on)
        result = search_and_confirm(
            question, record, executor, progress, stop=lambda: interrupt.asked
        )
    warned = warn(
        result.best.design, build_chamber(result.best.design, result.target), " of the best design"
    )
    remark(save_study(record.folder, result, advice, warned))
    lines = [f"{'parameter':34}{'start':>12}{'best':>12}"]
    lines += [
        f"{name:34}{question.design.value(name):12.5g}{result.best.design.value(name):12.5g}"
        for name in question.vary
    ]
    lines += [
        "",
        "start",
        *estimates(result.start.evaluation),
        "",
        "best",
        *estimates(result.best.evaluation),
    ]
    verdict = "better than the start" if result.improved else "within the noise of the start"
    lines += ["", f"{row('gain', result.gain)}: {verdict}"]
    if result.sensitivity:
        lines += ["", *result.sensitivity.sentences(), ""]
    if question.objective.pareto:
        lines += [
            f"the front of {' and '.join(question.objective.pareto)}: pareto.csv, pareto.png",
            "",
        ]
    fine = result.best.evaluation
    lines += [
        f"± 95 % intervals; start and best from {len(fine.replicas)} replicas of {design.process.recorded_time:g} s on "
        f"seeds of their own, the search's figures in history.csv from {accuracy_said(question.at_search_accuracy(design))}"
    ]
    notes = (
        *map(str, advice),
        *result.warnings,
        *result.at_bounds,
        *start.notes,
        *result.best.evaluation.notes,
    )
    say([*lines, *notes_said(notes)], record.folder, json)
    if not json:
        print(
            f"to see it: {_command('report', record.folder)}; the design: {record.folder / 'best.toml'}"
        )


def _finished(folder: Path, json: bool) -> None:
    """What `run` says of a study that needs nothing more."""
    from chamberopt.output.results.load import load_result, summary

    remark(
        [
            f"{folder}: this study is finished, nothing was run; to run it anew give another folder (--out)"
        ]
    )
    say([f"best design: {summary(load_result(folder))}"], folder, json)


def _unfinished(study: Path) -> list[str]:
    """Earlier runs of a study that were stopped, by their folders' names: what is run now begins anew."""
    from chamberopt.optimize.storage.study_folder import is_finished, is_study_folder

    names = [
        study.stem,
        *(path.name for path in sorted(Path("results").glob(f"{study.stem}-[0-9]*"))),
    ]
    stopped = [
        folder
        for name in names
        if is_study_folder(folder := Path("results", name)) and not is_finished(folder)
    ]
    return [
        f"{folder}: not finished; to go on there: {_command('run', study, '--out', folder)}"
        for folder in stopped
    ]


def _command(*words: object) -> str:
    """A command of ours as a shell takes it."""
    return shlex.join(["chamberopt", *map(str, words)])


@app.command
def sweep(
    study: Path, /, *, grid: int | None = None, sobol: int | None = None, seed: int | None = None,
    workers: Workers = None, cluster: Cluster = None, json: Json = False, out: Resumable = None,
) -> None:  # fmt: skip
    """Map a study: simulate candidates all over [vary], on a grid or evenly spread, instead of searching. With the
    --out of a sweep that was stopped it goes on from there.

    Parameters
    ----------
    study
        Study file (.toml).
    grid
        Values of every parameter, bounds included: N parameters make GRID^N candidates.
    sobol
        Candidates in all, as Sobol points; powers of 2 spread best.
    seed
        Of the Sobol points; the study's optimizer.seed if left out.
    """
    from chamberopt.chamber.build import build_chamber
    from chamberopt.common.parallel.executor import open_executor
    from chamberopt.common.progress import progress_bar
    from chamberopt.optimize.load_study import load_study
    from chamberopt.optimize.run_sweep import plan_sweep, run_sweep
    from chamberopt.output.results import sweep_results

    question = load_study(study)
    plan = plan_sweep(question, grid, sobol, seed)
    start = build_chamber(question.design)
    place = results_folder(None, f"{study.stem}-sweep") if out is None else nullcontext(out)
    with place as folder, open_executor(workers, cluster, "processes") as executor:
        design, advice = settled_effects(question.design, start, executor)
        question = question.model_copy(update={"design": design})
        compiled(design, start)
        with progress_bar("candidates") as progress:
            found = run_sweep(question, plan, folder, executor, progress)
        remark(sweep_results.write_sweep(folder, found))
    lines = [
        f"{len(found.trials)} candidates in {found.seconds:.0f} s, {accuracy_said(question.at_search_accuracy(design))} each"
    ]
    best = found.best
    if best is not None and best.objective is not None:
        lines += [
            "",
            f"best, number {best.number}",
            *(f"{name:34}{x:12.5g}" for name, x in best.parameters.items()),
        ]
        goal = {question.objective.goals[0]: best.objective, **best.metrics}
        lines += [row(name, estimate) for name, estimate in goal.items()]
    failed = [trial for trial in found.trials if trial.objective is None]
    reasons = (
        [f"{len(failed)} candidates could not be simulated, the first for: {failed[0].reason}"]
        if failed
        else []
    )
    say(
        [*lines, *notes_said([*map(str, advice), *reasons, sweep_results.caution(found)])],
        folder,
        json,
    )
