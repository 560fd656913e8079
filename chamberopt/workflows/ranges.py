"""Simulate the ranges of what is not calibrated, of a design and of a study's best designs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from chamberopt.common.errors import InputError
from chamberopt.common.progress import StoppedError
from chamberopt.design.ranges import unknowns
from chamberopt.documents.ranges import cost_text
from chamberopt.peening.range_result import RangeResult, StudyRanges
from chamberopt.peening.ranges import (
    EndRuns,
    best_at_ends,
    find_ranges,
    replicas_at_ends,
    simulate_ends,
)
from chamberopt.search.study.constraints import INFEASIBLE

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from chamberopt.chamber.build import Chamber
    from chamberopt.common.progress import Progress
    from chamberopt.design.load import Design
    from chamberopt.search.candidate import ConfirmedCandidate
    from chamberopt.search.run_study import StudyResult
    from chamberopt.simulation.evaluation import Evaluation
    from chamberopt.workflows.simulate import Teller

STOPPED = "stopped by the user: how far figures may be off before a calibration is not simulated"
ENDS = "replicas at the ends of what is not calibrated"


class EndError(Exception):
    """Raised if a design cannot be simulated at an end of what is not calibrated."""


def simulate_ranges(
    design: Design,
    chamber: Chamber,
    found: Evaluation,
    executor: Executor,
    teller: Teller,
    step: str = ENDS,
) -> RangeResult | None:
    """Return the ranges of a design's figures; None if all of its numbers are known or calibrated.

    Raises EndError if an end cannot be simulated, or the user stops before all are.

    Args:
        found: evaluation of the design.
        step: what the step is called.
    """
    groups = unknowns(design)
    if not groups:
        return None
    count = replicas_at_ends(found.replicas, len(groups))
    teller.tell(cost_text([one.name for one in groups], count, found.replicas))
    total = 2 * len(groups) * count
    with teller.step(step, total) as progress, teller.stoppable(progress) as tell:
        try:
            return find_ranges(_simulated(design, chamber, found, executor, tell, count))
        except StoppedError:
            raise EndError(STOPPED) from None


def study_ranges(result: StudyResult, executor: Executor, teller: Teller) -> StudyRanges | None:
    """Return the ranges of a study's best and start designs, and which is better at their ends.

    The best design is compared with the start and with the runner-up, the next best of the
    confirmed candidates. Return None if all numbers of the best or the start are known.

    Raises EndError if an end cannot be simulated.
    """
    best, start, runner_up = result.best, result.start, _runner_up(result)
    compared = [best, *(one for one in (start, runner_up) if one is not None and one is not best)]
    groups = [unknowns(one.design) for one in compared]
    if not all(groups):
        return None
    least = min(one.evaluation.replicas for one in compared)
    count = replicas_at_ends(least, max(map(len, groups)))
    teller.tell(cost_text([one.name for one in groups[0]], count, least, len(compared)))
    ends: list[EndRuns] = []
    total, ended = 2 * count * sum(map(len, groups)), 0
    with teller.step(ENDS, total) as progress:
        for one, unknown in zip(compared, groups, strict=True):
            chamber = result.chamber_of(one)

            def tell(done: float, _: int, best: float | None, before: int = ended) -> None:
                progress(before + done, total, best)

            ends.append(_simulated(one.design, chamber, one.evaluation, executor, tell, count))
            ended += 2 * count * len(unknown)
    ours, *others = ends
    names: list[Literal["start", "runner-up"]] = [
        "start" if one is start else "runner-up" for one in compared[1:]
    ]
    of_start = find_ranges(ours if start is best else others[0])
    rivals = [best_at_ends(ours, other, name) for other, name in zip(others, names, strict=True)]
    return StudyRanges(find_ranges(ours), of_start, rivals)


def _runner_up(result: StudyResult) -> ConfirmedCandidate | None:
    """Return the next best of a study's confirmed candidates; None if there is none."""
    others = [
        one
        for one in result.confirmed
        if one is not result.best and one is not result.start and one.feasibility != INFEASIBLE
    ]
    return max(others, key=lambda one: one.goals[0].value - one.lost_to_tolerances, default=None)


def _simulated(
    design: Design,
    chamber: Chamber,
    found: Evaluation,
    executor: Executor,
    progress: Progress,
    count: int,
) -> EndRuns:
    from sim_core import SceneError, SimulationError

    try:
        runs = simulate_ends(design, chamber, found, executor, progress, count)
    except (InputError, SceneError, SimulationError) as error:
        notes = "".join(f" ({one})" for one in getattr(error, "__notes__", ()))
        raise EndError(
            f"what is not calibrated was not simulated, because an end of it cannot be: "
            f"{error}{notes}; narrow [ranges], or leave them out with --no-ranges"
        ) from None
    assert runs is not None
    return runs
