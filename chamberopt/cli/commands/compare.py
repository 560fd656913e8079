"""The command `compare`: compare designs and results with the first of them."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from chamberopt.cli.console import print_remarks, print_result, results_folder
from chamberopt.cli.options import Cluster, Json, Out, Verbose, Workers, app


@app.command
def compare(
    *candidates: Path,
    treatment_time_s: float | None = None,
    workers: Workers = None,
    cluster: Cluster = None,
    json: Json = False,
    out: Out = None,
    verbose: Verbose = False,
) -> None:
    """Compare candidates for the same part: what differs, its effect on coverage, and whether that
    effect is larger than the noise.

    Parameters
    ----------
    candidates
        Two or more design files (.toml) or results folders; the others are compared with the first.
        Designs are simulated with the seeds of the first.
    treatment_time_s
        Compare after this time; results of another treatment time are simulated again.
    """
    from chamberopt.cli.teller import TerminalTeller
    from chamberopt.common.executor import open_executor
    from chamberopt.documents.comparison import comparison_end
    from chamberopt.workflows.comparison_folder import COMPARE, compare_candidates

    workers_of = partial(open_executor, workers, cluster)
    with results_folder(out, "compare") as folder:
        comparison, remarks = compare_candidates(
            candidates, folder, workers_of, TerminalTeller(), treatment_time_s
        )
        print_remarks(remarks)
    print_result(comparison_end(comparison, verbose), folder, json, COMPARE)
