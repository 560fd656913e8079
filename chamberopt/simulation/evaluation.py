"""The evaluation of a candidate, and its file.

A study keeps its confirmed candidates in such files, exactly, so that it can be resumed without
simulating them again.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from chamberopt.common.estimate import Estimate
from chamberopt.common.npz_files import load_record, save_record
from chamberopt.coverage.coverage_intervals import Resolution
from chamberopt.coverage.part_impacts import Hits


@dataclass(frozen=True)
class Evaluation:
    """One candidate, simulated in independent replicas."""

    objective_name: str
    objective: Estimate  # the weighted sum of metrics that a study maximises
    metrics: dict[str, Estimate]  # estimate of each metric at the gauge, by its name
    metrics_of_wide: dict[str, Estimate]  # those of coverage in windows of twice the radius
    gauge_mm2: float  # area of the windows in which coverage is measured
    resolution: Resolution
    reachable: float  # share of the target that a ball can touch
    crease_share: float  # share of the dented area that is on creases
    replicas: int
    simulated_time: float  # recorded time of all replicas together [s]
    hits: tuple[Hits, ...]  # single impacts of each replica on the part
    timings: dict[str, float]  # wall-clock time of each step [s]
    collisions: dict[str, int]  # number of simulated collisions of each kind, warm-up included
    notes: tuple[str, ...] = ()  # what to know before trusting the result
    stream: str = "search"  # stream of seeds, "search" or "confirm"
    # What ended it: "replicas" (their number was given), "accuracy" or "max_replicas".
    stopped_by: str = "replicas"
    analytic: bool = False  # whether it ran in an exact cavity instead of the chamber's mesh


def save_evaluation(path: Path, evaluation: Evaluation) -> None:
    """Write an evaluation to its file. Raises OSError if it cannot be written."""
    save_record(path, evaluation)


def load_evaluation(path: Path) -> Evaluation:
    """Read an evaluation, equal to the one that was saved; InputError if missing or damaged."""
    remedy = "restore the file or run the study in a new folder"
    return load_record(path, Evaluation, (Estimate, Hits, Resolution), remedy)
