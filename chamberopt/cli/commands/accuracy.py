"""The command `accuracy`: how the error of a design's figures depends on numerical settings."""

from __future__ import annotations

from pathlib import Path

from chamberopt.cli.console import print_result, results_folder
from chamberopt.cli.options import Json, Out, Verbose, app


@app.command
def accuracy(
    design: Path,
    /,
    *,
    budget_s: float = 300.0,
    json: Json = False,
    out: Out = None,
    verbose: Verbose = False,
) -> None:
    """Measure error against computing time, and recommend settings for 5, 1 and 0.1 % error.

    Each numerical parameter is compared with a reference simulation.

    Parameters
    ----------
    design
        Design file (.toml).
    budget_s
        CPU seconds to spend on simulations; with more, smaller errors become visible.
    """
    from chamberopt.cli.teller import TerminalTeller
    from chamberopt.common.executor import local_executor
    from chamberopt.design.load import load_design
    from chamberopt.documents.accuracy import accuracy_end
    from chamberopt.simulation.convergence import require_budget
    from chamberopt.workflows.accuracy import measure_accuracy

    require_budget(budget_s)
    loaded = load_design(design)
    with results_folder(out, f"{design.stem}-accuracy") as folder, local_executor() as executor:
        study = measure_accuracy(loaded, budget_s, folder, executor, TerminalTeller())
    print_result(accuracy_end(study, verbose), folder, json, "accuracy.json")
