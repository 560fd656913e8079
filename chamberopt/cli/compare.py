"""compare: designs and results, against the first of them."""

from __future__ import annotations

import json as json_format
from pathlib import Path
from typing import TYPE_CHECKING

from chamberopt.cli.console import remark, results_folder, warn
from chamberopt.cli.options import Cluster, Json, Out, Workers, app
from chamberopt.cli.prepare import compiled, settled_effects

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design
    from chamberopt.output.compare.candidates import Candidate
    from chamberopt.output.results.load import Result
    from chamberopt.simulation.effect_pilot import Advice
    from sim_core import AnalyticCavity


@app.command
def compare(
    *candidates: Path, treatment_time_s: float | None = None, workers: Workers = None, cluster: Cluster = None,
    json: Json = False, out: Out = None,
) -> None:  # fmt: skip
    """Compare candidates for the same part: what differs, what that did to the coverage, and whether it is real.

    Parameters
    ----------
    candidates
        Two or more design files (.toml) or results folders; the first is what the others are measured against. Designs
        are simulated, on the seeds of the first.
    treatment_time_s
        Compare after so long; results of another treatment time are simulated again.
    """
    from chamberopt.output.compare.candidates import gathered
    from chamberopt.output.compare.comparison import comparison_of
    from chamberopt.output.compare.files import COMPARE, write_comparison
    from chamberopt.output.compare.table import as_text

    found = gathered(candidates, treatment_time_s)
    with results_folder(out, "compare") as folder:
        comparison = comparison_of(
            _results(found, folder, workers, cluster), [one.label for one in found]
        )
        remark(write_comparison(folder, comparison))
    if json:
        about = json_format.loads((folder / COMPARE).read_text(encoding="utf-8"))
        print(json_format.dumps({**about, "folder": str(folder)}, indent=2))
    else:
        print(f"{as_text(comparison)}\nresults in {folder}")


def _results(
    candidates: list[Candidate], folder: Path, workers: int | None, cluster: str | None
) -> list[Result]:
    """The results of all; those that are missing are simulated."""
    from chamberopt.common.parallel.executor import open_executor
    from chamberopt.output.compare.candidates import simulated

    if not any(one.missing for one in candidates):
        return [one.result for one in candidates if one.result is not None]
    with open_executor(workers, cluster) as executor:

        def prepare(
            design: Design, chamber: Chamber, cavity: AnalyticCavity | None
        ) -> tuple[Design, list[Advice]]:
            warn(design, chamber)
            settled, advice = settled_effects(design, chamber, executor)
            compiled(settled, chamber, cavity)
            return settled, advice

        results, remarks = simulated(candidates, folder, executor, prepare)
    remark(remarks)
    return results
