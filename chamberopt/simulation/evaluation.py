"""Hold the evaluation of a candidate, and write and read its file.

A study keeps its confirmed candidates in such files, bit for bit, so that it can be resumed without
another simulation of these candidates.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from chamberopt.common.errors import InputError
from chamberopt.common.estimate import Estimate
from chamberopt.common.limits import MAX_NUMBER
from chamberopt.common.npz_files import is_of_type, load_record, save_record
from chamberopt.coverage.coverage_intervals import Resolution
from chamberopt.coverage.field.symmetry import MAX_COPIES
from chamberopt.coverage.metrics import METRICS, find_metric
from chamberopt.coverage.part_impacts import Hits, require_impacts
from chamberopt.simulation.trapped_balls import SHARES, TrappedBalls

REMEDY = "restore the file or run the study in a new folder"


@dataclass(frozen=True)
class Evaluation:
    """The objective, metrics and impacts of one candidate design, from independent replicas."""

    objective_name: str
    objective: Estimate  # the weighted sum of metrics that a study maximises
    metrics: dict[str, Estimate]  # estimate of each metric at the gauge, by its name
    metrics_of_wide: dict[str, Estimate]  # metrics of coverage in windows of twice the radius
    gauge_mm2: float  # area of the windows in which coverage is measured
    resolution: Resolution
    reachable: float  # share of the target that a ball can touch
    crease_share: float  # share of the dented area that is on creases
    replicas: int
    simulated_time: float  # recorded time of all replicas together [s]
    hits: tuple[Hits, ...]  # single impacts of each replica on the part
    timings: dict[str, float]  # wall-clock time of each step [s]
    collisions: dict[str, int]  # number of simulated collisions of each kind, warm-up included
    notes: tuple[str, ...] = ()  # sentences to read before trusting the result
    stream: str = "search"  # stream of seeds, "search" or "confirm"
    stopped_by: str = "replicas"  # the reason to end, as in effort.py
    # Number of places of the target that are alike by symmetry; figures are means over these.
    alike: int = 1
    # Share of each zone that a ball can touch, by its name.
    zones: dict[str, float] = field(default_factory=dict)
    # Share of the target that a ball can touch in each step, by its name; of no steps without.
    steps: dict[str, float] = field(default_factory=dict)
    trapped: TrappedBalls | None = None  # what hopping and rattling balls did; None if not known
    # By what share the target was dented more in the first halves of the replicas than in the
    # second, where that is more than noise: the shot had not settled. None if it is not.
    first_half_excess: float | None = None
    analytic: bool = False  # whether it ran in an exact cavity instead of the chamber's mesh


def save_evaluation(path: Path, evaluation: Evaluation) -> None:
    """Write an evaluation to its file. Raises OSError if it cannot be written."""
    save_record(path, evaluation)


def load_evaluation(path: Path) -> Evaluation:
    """Read an evaluation, equal to the one that was saved.

    Raises InputError if the file is missing or damaged, or holds values that no evaluation has.
    """
    found = load_record(path, Evaluation, (Estimate, Hits, Resolution, TrappedBalls), REMEDY)
    try:
        _require_sound(found)
    except ValueError as error:
        raise InputError(f"{path}: damaged ({error}); {REMEDY}") from None
    return found


def require_triangles(evaluation: Evaluation, triangles: int) -> None:
    """Raise InputError if an impact is on a triangle that a part with so many triangles lacks."""
    for hits in evaluation.hits:
        if len(hits) and not 0 <= hits.triangle.min() <= hits.triangle.max() < triangles:
            text = "confirm: an impact is on a triangle that the part does not have"
            raise InputError(f"{text}; {REMEDY}")


def _require_sound(found: Evaluation) -> None:
    """Raise ValueError if a value has a type, length or range that no evaluation has."""
    if not is_of_type(found, Evaluation):
        raise ValueError("a value is of another type")
    names = {*found.metrics, *found.metrics_of_wide}
    required = {name for name, metric in METRICS.items() if metric.required}
    if required - found.metrics.keys() or not all(map(find_metric, names)):
        raise ValueError("its metrics are not those of this program")
    estimates = found.objective, *found.metrics.values(), *found.metrics_of_wide.values()
    needed = found.resolution
    known = [
        found.objective.value, found.reachable, found.crease_share, found.simulated_time,
        needed.dents, needed.needed_for_mean, needed.needed_for_places, needed.simulated_time,
        *found.timings.values(), *found.collisions.values(),
        found.first_half_excess or 0.0,
        *(one.bias for one in estimates),
        *(x for one in estimates for x in (*one.pseudovalues, *one.shared)),
    ]  # fmt: skip
    if not all(abs(number) <= MAX_NUMBER for number in known):
        raise ValueError("a number is not finite, or too large")
    if not (found.simulated_time > 0.0 and found.objective.pseudovalues and found.replicas > 0):
        raise ValueError("it has no simulated time, or no replicas")
    if not 1 <= found.alike <= MAX_COPIES:
        raise ValueError(f"{found.alike} places alike")
    if found.trapped and not all(0.0 <= getattr(found.trapped, one) <= 1.0 for one in SHARES):
        raise ValueError("a share of trapped balls is not from 0 to 1")
    if any(one.half_width < 0.0 for one in estimates):
        raise ValueError("an interval is negative")
    if len(found.hits) != found.replicas:
        raise ValueError(f"impacts of {len(found.hits)} replicas, expected {found.replicas}")
    for hits in found.hits:
        if hits.triangle.dtype.kind != "i" or hits.triangle.ndim != 1:
            raise ValueError("the triangles of impacts are no whole numbers")
        columns = {name: one for name, one in vars(hits).items() if name != "triangle"}
        require_impacts(columns, len(hits))
