"""The command `compare`: designs and results, compared with the first candidate."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from chamberopt.cli.console import print_remarks, print_result, print_warnings, results_folder
from chamberopt.cli.options import Cluster, Json, Out, Workers, app
from chamberopt.cli.prepare import compile_with_message

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from chamberopt.results.load import Result
    from chamberopt.simulation.effect_pilot import Advice
    from chamberopt.workflows.compared_candidates import Candidate
    from sim_core import AnalyticCavity


@app.command
def compare(
    *candidates: Path,
    treatment_time_s: float | None = None,
    workers: Workers = None,
    cluster: Cluster = None,
    json: Json = False,
    out: Out = None,
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
    from chamberopt.common.progress import step
    from chamberopt.documents.comparison import comparison_text
    from chamberopt.results.compare.comparison import comparison_of
    from chamberopt.workflows.compared_candidates import read_candidates
    from chamberopt.workflows.comparison_folder import COMPARE, write_comparison

    with results_folder(out, "compare") as folder:
        with step("reading and building"):
            gathered_candidates = read_candidates(candidates, treatment_time_s)
        results = _results(gathered_candidates, folder, workers, cluster)
        with step("comparing and drawing"):
            comparison = comparison_of(results, [one.label for one in gathered_candidates])
            print_remarks(write_comparison(folder, comparison))
    print_result([comparison_text(comparison)], folder, json, COMPARE)


def _results(
    candidates: list[Candidate], folder: Path, workers: int | None, cluster: str | None
) -> list[Result]:
    """The results of all candidates. Missing results are simulated."""
    from chamberopt.cli.teller import TerminalTeller
    from chamberopt.common.executor import open_executor
    from chamberopt.workflows.compared_candidates import simulate_missing
    from chamberopt.workflows.simulate import resolve_effects

    if not any(one.missing for one in candidates):
        return [one.result for one in candidates if one.result is not None]
    with open_executor(workers, cluster) as executor:

        def prepare(
            design: Design, chamber: Chamber, cavity: AnalyticCavity | None
        ) -> tuple[Design, list[Advice]]:
            print_warnings(design, chamber)
            design, advice = resolve_effects(design, chamber, executor, TerminalTeller())
            compile_with_message(design, chamber, cavity)
            return design, advice

        results, remarks = simulate_missing(candidates, folder, executor, prepare)
    print_remarks(remarks)
    return results
