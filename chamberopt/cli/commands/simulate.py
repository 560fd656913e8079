"""The command `simulate`: the coverage of one design."""

from __future__ import annotations

from pathlib import Path

from chamberopt.cli import console
from chamberopt.cli.options import Cluster, Json, Out, Workers, app
from chamberopt.cli.prepare import compile_with_message, resolve_effects


@app.command
def simulate(
    design: Path,
    /,
    *,
    analytic: bool = False,
    workers: Workers = None,
    cluster: Cluster = None,
    json: Json = False,
    out: Out = None,
) -> None:
    """Simulate one design and predict its coverage, with confidence intervals and pictures.

    Parameters
    ----------
    design
        Design file (.toml).
    analytic
        Use the exact cylinder, box or prism instead of its triangles, if the chamber is one.
    """
    from chamberopt.chamber.analytic import analytic_cavity
    from chamberopt.chamber.build import build_chamber
    from chamberopt.common.parallel.executor import open_executor
    from chamberopt.common.progress import progress_bar
    from chamberopt.design.load import load_design
    from chamberopt.output.save_run import save_simulation
    from chamberopt.simulation.evaluate import evaluate

    candidate = load_design(design)
    with (
        console.results_folder(out, design.stem) as folder,
        open_executor(workers, cluster) as executor,
    ):
        chamber = build_chamber(candidate)
        cavity = analytic_cavity(candidate, chamber) if analytic else None
        warnings = console.print_warnings(candidate, chamber)
        candidate, advice = resolve_effects(candidate, chamber, executor)
        compile_with_message(candidate, chamber, cavity)
        with progress_bar("replicas") as progress:
            evaluation = evaluate(candidate, chamber, executor, progress, cavity=cavity)
        remarks = save_simulation(folder, candidate, chamber, evaluation, advice, warnings)
    console.print_remarks(remarks)
    notes = console.note_lines([*map(str, advice), *chamber.notes, *evaluation.notes])
    console.print_result([*console.evaluation_lines(evaluation), *notes], folder, json)
