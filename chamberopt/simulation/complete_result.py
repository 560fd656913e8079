"""All that is computed of a candidate before its result is written, from its evaluation."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.simulation.evaluation import require_triangles
from chamberopt.simulation.field_values import PartField
from chamberopt.simulation.time_curve import coverage_against_time

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.coverage.field.display_mesh import DisplayField
    from chamberopt.design.load import Design
    from chamberopt.simulation.evaluation import Evaluation


@dataclass(frozen=True)
class CandidateResult:
    """A simulated candidate with the fields and curves of its result folder."""

    design: Design
    chamber: Chamber
    evaluation: Evaluation
    element_values: dict[str, np.ndarray]  # of each triangle of the part, by name, (m,) each
    display: DisplayField  # fields at the vertices of a mesh to draw
    time_curve: list[dict[str, float]]  # coverage against peening time, a row a time


def complete_result(design: Design, chamber: Chamber, evaluation: Evaluation) -> CandidateResult:
    """Compute what only a final result needs; a search does without it.

    InputError if the evaluation, which a resumed study has read from a file, is of another part.
    """
    require_triangles(evaluation, len(chamber.part.triangles))
    seen = PartField(design, chamber, evaluation)
    with ThreadPoolExecutor(2) as threads:  # compiled code, most of it, works beside other threads
        element_values = threads.submit(seen.element_values)
        display = threads.submit(seen.display)
        time_curve = coverage_against_time(design, seen.target, evaluation)
        return CandidateResult(
            design=design,
            chamber=chamber,
            evaluation=evaluation,
            element_values=element_values.result(),
            display=display.result(),
            time_curve=time_curve,
        )
