"""The command `accuracy`: a convergence study of the numerical parameters of one design."""

from __future__ import annotations

from pathlib import Path

from chamberopt.cli.console import print_remarks, print_result, results_folder
from chamberopt.cli.options import Json, Out, app
from chamberopt.cli.prepare import compile_with_message


@app.command
def accuracy(
    design: Path, /, *, budget_s: float = 300.0, json: Json = False, out: Out = None
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
    from chamberopt.common.executor import local_executor
    from chamberopt.common.progress import step
    from chamberopt.design.load import load_design
    from chamberopt.documents.accuracy import accuracy_lines
    from chamberopt.simulation.convergence import (
        describe_cost,
        require_budget,
        run_convergence_study,
    )
    from chamberopt.workflows.save_accuracy import save_accuracy

    require_budget(budget_s)
    one = load_design(design)
    with results_folder(out, f"{design.stem}-accuracy") as folder:
        print_remarks([describe_cost(one, budget_s)])
        with local_executor() as executor:
            study = run_convergence_study(one, budget_s, executor, compile_with_message)
        with step("writing and drawing"):
            save_accuracy(folder, study)
    print_result(accuracy_lines(study), folder, json, "accuracy.json")
