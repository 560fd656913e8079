"""The command `simulate`: simulate the coverage of one design."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from chamberopt.cli import console
from chamberopt.cli.options import (
    Accuracy,
    Cluster,
    Json,
    Out,
    TreatmentTime,
    Verbose,
    Workers,
    app,
    given_values,
)


@app.command
def simulate(
    design: Path,
    /,
    *,
    accuracy: Accuracy = None,
    time: TreatmentTime = None,
    effort: Literal["quick", "thorough"] | None = None,
    analytic: bool = False,
    tolerances: bool = False,
    ranges: bool = True,
    workers: Workers = None,
    cluster: Cluster = None,
    verbose: Verbose = False,
    json: Json = False,
    out: Out = None,
) -> None:
    """Simulate one design and predict its coverage, with confidence intervals and pictures.

    Ctrl-C ends it with a result of the replicas that have ended by then; a second Ctrl-C stops at
    once. Of a design with a calibration nothing is kept before all replicas have ended.

    Parameters
    ----------
    design
        Design file (.toml).
    effort
        Simulate a quarter of the file's process.accuracy.simulated_time_s in no more replicas than
        it begins with, which tells little of single places; or four times as long.
    analytic
        Use the exact cylinder, box or prism instead of its triangles, if the chamber is one.
    tolerances
        Also simulate what the design's [tolerances] do: a further run for each, and one for the
        worst corner. Without the table the amplitude has the usual tolerance, 4 µm peak to valley.
    ranges
        Also simulate the ends of what is not calibrated (friction, v0, slopes of faces), in as many
        replicas again, and say how far the figures may be off by it.
    """
    from chamberopt.cli.interrupt import is_requested
    from chamberopt.cli.teller import SimulationTeller
    from chamberopt.common.executor import open_executor
    from chamberopt.design.load import load_design
    from chamberopt.design.tolerances import USUAL_IN_WORDS
    from chamberopt.documents.terminal_lines import result_end
    from chamberopt.peening.tolerances import plan_tolerances
    from chamberopt.simulation.effort import scaled
    from chamberopt.workflows.simulate import SimulationSettings, simulate_design

    candidate = load_design(design)
    if values := given_values(accuracy, time):
        candidate = candidate.changed(values)
    candidate = scaled(candidate, effort)
    if tolerances:
        plan_tolerances(candidate)  # reports wrong tolerances before the work begins
        if candidate.tolerances is None:
            taken = f"the usual tolerance of the amplitude is taken: {USUAL_IN_WORDS}"
            console.print_remarks([f"the design has no [tolerances]; {taken}"])
    elif candidate.tolerances:
        console.print_remarks(["the design has [tolerances]; --tolerances simulates them too"])
    with (
        console.results_folder(out, design.stem) as folder,
        open_executor(workers, cluster) as executor,
    ):
        settings = SimulationSettings(analytic, tolerances, ranges)
        done = simulate_design(candidate, folder, executor, SimulationTeller(), settings)
        console.print_remarks(done.remarks)
        console.print_result(result_end(folder, verbose), folder, json)
        if is_requested():
            raise KeyboardInterrupt  # what still runs is not waited for
