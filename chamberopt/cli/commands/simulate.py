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
    tolerances: bool = False,
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
    tolerances
        Also simulate what the design's [tolerances] do: a further run for each, and one for the
        worst corner.
    """
    from chamberopt.chamber.analytic import analytic_cavity
    from chamberopt.chamber.build import build_chamber
    from chamberopt.common.executor import open_executor
    from chamberopt.common.progress import step
    from chamberopt.coverage.field.memory import PROCESS, evaluation_bytes, how_many_fit
    from chamberopt.design.load import load_design
    from chamberopt.peening.calibration_errors import evaluate_calibrated
    from chamberopt.peening.tolerances import plan_tolerances, simulate_tolerances
    from chamberopt.simulation.replicas import most_replicas
    from chamberopt.workflows.save_run import save_simulation

    candidate = load_design(design)
    if tolerances:
        plan_tolerances(candidate)  # before any work: they may be wrong
    elif candidate.tolerances:
        console.print_remarks(["the design has [tolerances]; --tolerances simulates them too"])
    with (
        console.results_folder(out, design.stem) as folder,
        open_executor(workers, cluster) as executor,
    ):
        with step("building the chamber"):
            chamber = build_chamber(candidate)
            cavity = analytic_cavity(candidate, chamber) if analytic else None
            how_many_fit(1, evaluation_bytes(candidate, chamber, most_replicas(candidate)), PROCESS)
            warnings = console.print_warnings(candidate, chamber)
        candidate, advice = resolve_effects(candidate, chamber, executor)
        compile_with_message(candidate, chamber, cavity)
        with step("replicas", candidate.process.accuracy.replicas) as progress:
            if tolerances:
                evaluation, found = simulate_tolerances(
                    candidate, chamber, executor, progress, analytic
                )
            else:
                evaluation = evaluate_calibrated(
                    candidate, chamber, executor, progress, cavity=cavity
                )
                found = None
        with step("writing and drawing"):
            remarks = save_simulation(
                folder, candidate, chamber, evaluation, advice, warnings, found
            )
    console.print_remarks(remarks)
    notes = console.note_lines([*map(str, advice), *chamber.notes, *evaluation.notes])
    limits = console.zone_lines(candidate, evaluation)
    lines = [*console.evaluation_lines(evaluation), *limits, *notes]
    if found:
        lines += ["", *console.tolerance_lines(found)]
    console.print_result(lines, folder, json)
