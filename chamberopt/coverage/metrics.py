"""Coverage -> numbers: the metrics of a candidate, and the objectives a study can maximise.

Each is a function of a summed Tally, so that accuracy.py can take replicas out of the sum and see how far the
number moves. All are over the exposed target; averages over it are weighted with exposed area.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common.errors import InputError
from chamberopt.coverage.coverage_from_impacts import Tally, coverage_at

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design

FULL_COVERAGE = 0.98  # SAE J2277: coverage that counts as complete
NEVER = 1e6  # s; eleven days of peening stand for never

Statistic = Callable[[Tally, "Chamber", "Design"], float]
OverSurface = Callable[[np.ndarray, np.ndarray], float]


@dataclass(frozen=True)
class Metric:
    """A named number about a candidate: how it is computed, its unit and the range it can have.

    from_coverage: the same of any coverage (m,) of target triangles and their shares (m,) of its area, where it is one.
    """

    name: str
    unit: str
    summary: str
    function: Statistic
    lowest: float = -math.inf
    highest: float = math.inf
    from_coverage: OverSurface | None = None


@dataclass(frozen=True)
class ObjectiveFunction:
    """What a study maximises: a weighted sum of metrics, so that it always agrees with the metrics shown beside it."""

    name: str
    summary: str
    terms: dict[str, float]


def exposed_target(chamber: Chamber) -> np.ndarray:
    """Part triangles that are wanted covered and that the shot can reach, shape (m,) bool."""
    return chamber.part.target & (chamber.exposed_area > 0.0)


def require_target(chamber: Chamber) -> None:
    """InputError when nothing of the target bounds the cavity."""
    if not exposed_target(chamber).any():
        raise InputError(
            "part.target: no triangle of the target bounds the cavity, so its coverage is not defined; "
            "widen [part.target] or move the part into the chamber"
        )


def target_coverage(coverage: np.ndarray, chamber: Chamber) -> tuple[np.ndarray, np.ndarray]:
    """Coverage of every target triangle, from that of the part's exposed triangles (m,), and its share of the area.

    What lies outside the cavity is not covered. Left out of the count, it would teach the optimiser to hide
    whatever is hard to reach behind a lower ceiling.
    """
    target = chamber.part.target
    require_target(chamber)
    area = chamber.part.area[target]
    exposed = np.minimum(chamber.exposed_area[target] / area, 1.0)
    return np.where(exposed > 0.0, coverage[target], 0.0) * exposed, area / area.sum()


def mean_coverage(coverage: np.ndarray, weight: np.ndarray) -> float:
    """Area-weighted mean of the coverage at the treatment time, 0..1."""
    return float(weight @ coverage)


def std_coverage(coverage: np.ndarray, weight: np.ndarray) -> float:
    """Area-weighted standard deviation of the coverage from triangle to triangle, 0..0.5."""
    return float(np.sqrt(weight @ (coverage - weight @ coverage) ** 2))


def p05_coverage(coverage: np.ndarray, weight: np.ndarray) -> float:
    """The coverage that 95 % of the target's area exceeds, 0..1."""
    order = np.argsort(coverage, kind="stable")
    # Mid-point rule: each triangle stands at the middle of its share of the area.
    share = np.cumsum(weight[order]) - 0.5 * weight[order]
    return float(np.interp(0.05, share, coverage[order]))


def mean_normal_speed(total: Tally, chamber: Chamber, design: Design) -> float:
    """Mean normal speed of all impacts on the target [m/s]; 0 when nothing hit it."""
    target = exposed_target(chamber)
    impacts = total.impacts[target].sum()
    return float(total.speed_sum[target].sum() / impacts) if impacts else 0.0


def impacts_per_mm2_s(total: Tally, chamber: Chamber, design: Design) -> float:
    """Impacts on the target per mm² of its exposed area and second."""
    target = exposed_target(chamber)
    area_mm2 = chamber.exposed_area[target].sum() * 1e6
    return float(total.impacts[target].sum() / (area_mm2 * total.simulated_time))


def time_to_98(total: Tally, chamber: Chamber, design: Design) -> float:
    """Treatment time [s] after which 95 % of the target's area is covered to 98 %; see seconds_to_98."""
    seconds = design.process.treatment_time
    return seconds_to_98(
        p05_coverage(*target_coverage(coverage_at(total, chamber, seconds), chamber)), seconds
    )


def seconds_to_98(poorest: float, seconds: float) -> float:
    """The same from what the poorest twentieth has after `seconds`: dents fall as Avrami has it, 1 - exp(-rate · time).

    98 % counts as full coverage (SAE J2277), and all but the twentieth as everywhere. At most LONGEST, which stands for
    never.
    """
    rate = -math.log(min(max(1.0 - poorest, 1e-12), 1.0)) / seconds
    return min(NEVER, -math.log(1.0 - FULL_COVERAGE) / rate) if rate > 0.0 else NEVER


def intensity_uniformity(total: Tally, chamber: Chamber, design: Design) -> float:
    """1 - standard deviation over mean of the local mean normal speed; 0 when nothing hit. See intensity.py."""
    target = chamber.part.target
    hits, area = total.impacts[target], chamber.part.area[target]
    local = np.divide(total.speed_sum[target], hits, out=np.zeros(len(hits)), where=hits > 0)
    mean = mean_coverage(local, area / area.sum())
    return 1.0 - std_coverage(local, area / area.sum()) / mean if mean > 0.0 else 0.0


def shot_count(total: Tally, chamber: Chamber, design: Design) -> float:
    """Number of balls."""
    return float(design.shot.count)


def _coverage_metric(name: str, summary: str, from_coverage: OverSurface, highest: float) -> Metric:
    """Its plain function takes the dents of a tally for all there are: figures.py corrects for a short simulation."""

    def plain(total: Tally, chamber: Chamber, design: Design) -> float:
        return from_coverage(
            *target_coverage(coverage_at(total, chamber, design.process.treatment_time), chamber)
        )

    return Metric(name, "", summary, plain, 0.0, highest, from_coverage)


METRICS = {
    metric.name: metric
    for metric in (
        _coverage_metric("mean_coverage", "mean coverage of the target", mean_coverage, 1.0),
        _coverage_metric(
            "std_coverage", "standard deviation of coverage over the target", std_coverage, 0.5
        ),
        _coverage_metric(
            "p05_coverage", "coverage that 95 % of the target's area exceeds", p05_coverage, 1.0
        ),
        Metric(
            "time_to_98_s",
            "s",
            "time until 95 % of the target's area is 98 % covered",
            time_to_98,
            0.0,
            NEVER,
        ),
        Metric(
            "intensity_uniformity",
            "",
            "1 - relative spread of the local impact speed",
            intensity_uniformity,
        ),
        Metric(
            "mean_normal_speed_m_s",
            "m/s",
            "mean normal speed of the impacts",
            mean_normal_speed,
            0.0,
        ),
        Metric(
            "impacts_per_mm2_s", "1/(mm² s)", "impacts per area and second", impacts_per_mm2_s, 0.0
        ),
        Metric("shot_count", "balls", "number of balls", shot_count, 0.0),
    )
}

OBJECTIVES = {
    one.name: one
    for one in (
        # 1 only when all is covered, and covered evenly.
        ObjectiveFunction(
            "uniform_coverage",
            "mean minus standard deviation of coverage",
            {"mean_coverage": 1.0, "std_coverage": -1.0},
        ),
        ObjectiveFunction(
            "coverage_p05", "coverage of the least covered 5 % of the area", {"p05_coverage": 1.0}
        ),
        ObjectiveFunction(
            "time_to_98", "time to full coverage, the shorter the better", {"time_to_98_s": -1.0}
        ),
        ObjectiveFunction(
            "intensity_uniformity",
            "how evenly hard the target is hit",
            {"intensity_uniformity": 1.0},
        ),
    )
}


def parse_objective(name: str) -> ObjectiveFunction:
    """The objective of that name, or a sum such as "1 uniform_coverage + -0.001 time_to_98_s"; else InputError."""
    if name in OBJECTIVES:
        return OBJECTIVES[name]
    terms: dict[str, float] = {}
    for term in name.split(" + "):
        weight, _, part = term.partition(" ")
        try:
            factor, parts = float(weight), _terms(part)
        except (ValueError, KeyError):
            raise InputError(
                f"objective.name: {name!r} is not an objective; allowed: {', '.join(OBJECTIVES)}"
            ) from None
        for metric, share in parts.items():
            terms[metric] = terms.get(metric, 0.0) + factor * share
    return ObjectiveFunction(name, "weighted sum", terms)


def _terms(name: str) -> dict[str, float]:
    """Metrics and weights of an objective or a metric. KeyError when it is neither."""
    return (
        {METRICS[name].name: 1.0}
        if name in METRICS and name not in OBJECTIVES
        else OBJECTIVES[name].terms
    )
