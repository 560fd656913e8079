"""The registry of metrics of a candidate, and of objectives that a study can maximise.

A new metric is one entry of `METRICS`, a new objective one of `OBJECTIVES`. Study files, tables,
reports and result folders take names, units and ranges from here. All metrics are over the exposed
target.
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
NEVER = 1e6  # s: eleven days of peening stand for never
P05 = 0.05  # share of the target's area that may be covered less than p05_coverage


@dataclass(frozen=True)
class Metric:
    """A named number of a candidate, as a function of coverage or of impacts.

    A metric with neither function has an estimator of its own, see simulation/evaluate.py.
    """

    name: str
    unit: str
    summary: str
    lowest: float = -math.inf
    highest: float = math.inf
    # Function of the coverage of target triangles and their shares of its area, (m,) each.
    of_coverage: Callable[[np.ndarray, np.ndarray], float] | None = None
    # Function of the impacts of replicas.
    of_impacts: Callable[[Tally, Chamber, Design], float] | None = None
    required: bool = False  # whether a results folder without it is damaged

    def value(self, total: Tally, chamber: Chamber, design: Design) -> float:
        """The metric of these impacts, without correction for a short simulation."""
        if self.of_impacts is not None:
            return self.of_impacts(total, chamber, design)
        assert self.of_coverage is not None
        coverage = coverage_at(total, chamber, design.process.treatment_time)
        return self.of_coverage(*target_coverage(coverage, chamber))


@dataclass(frozen=True)
class ObjectiveFunction:
    """What a study maximises: a weighted sum of metrics."""

    name: str
    summary: str
    terms: dict[str, float]  # weight of each metric, by its name


def exposed_target(chamber: Chamber) -> np.ndarray:
    """Which part triangles belong to the target and can be reached by the shot, (m,) bool."""
    return chamber.part.target & (chamber.exposed_area > 0.0)


def require_target(chamber: Chamber) -> None:
    """Raise InputError if no triangle of the target bounds the cavity."""
    if not exposed_target(chamber).any():
        raise InputError(
            "part.target: no triangle of the target bounds the cavity, so its coverage is not "
            "defined; widen [part.target] or move the part into the chamber"
        )


def target_coverage(coverage: np.ndarray, chamber: Chamber) -> tuple[np.ndarray, np.ndarray]:
    """Coverage of every target triangle and its share of the target's area.

    Area outside the cavity counts as not covered. If it were left out, an optimiser would hide
    places that are hard to reach behind a lower ceiling.

    Args:
        coverage: coverage of the exposed area of each part triangle, (m,).
    """
    target = chamber.part.target
    require_target(chamber)
    area = chamber.part.area[target]
    exposed = np.minimum(chamber.exposed_area[target] / area, 1.0)
    return np.where(exposed > 0.0, coverage[target], 0.0) * exposed, area / area.sum()


def mean_coverage(coverage: np.ndarray, weight: np.ndarray) -> float:
    """Area-weighted mean of the coverage, 0..1."""
    return float(weight @ coverage)


def std_coverage(coverage: np.ndarray, weight: np.ndarray) -> float:
    """Area-weighted standard deviation of the coverage over the triangles, 0..0.5."""
    return float(np.sqrt(weight @ (coverage - weight @ coverage) ** 2))


def p05_coverage(coverage: np.ndarray, weight: np.ndarray) -> float:
    """5th percentile of the coverage: 95 % of the target's area has more, 0..1."""
    order = np.argsort(coverage, kind="stable")
    # Mid-point rule: each triangle stands at the middle of its share of the area.
    share = np.cumsum(weight[order]) - 0.5 * weight[order]
    return float(np.interp(P05, share, coverage[order]))


def seconds_to_98(p05: float, seconds: float) -> float:
    """Peening time until the 5th percentile of the coverage is FULL_COVERAGE, by Avrami's equation.

    Args:
        p05: 5th percentile of the coverage after `seconds` of peening.

    Returns:
        Time [s], at most NEVER.
    """
    rate = -math.log(min(max(1.0 - p05, 1e-12), 1.0)) / seconds
    return min(NEVER, -math.log(1.0 - FULL_COVERAGE) / rate) if rate > 0.0 else NEVER


def _mean_normal_speed(total: Tally, chamber: Chamber, design: Design) -> float:
    target = exposed_target(chamber)
    impacts = total.impacts[target].sum()
    return float(total.speed_sum[target].sum() / impacts) if impacts else 0.0


def _impacts_per_mm2_s(total: Tally, chamber: Chamber, design: Design) -> float:
    target = exposed_target(chamber)
    area_mm2 = chamber.exposed_area[target].sum() * 1e6
    return float(total.impacts[target].sum() / (area_mm2 * total.simulated_time))


def _shot_count(total: Tally, chamber: Chamber, design: Design) -> float:
    return float(design.shot.count)


METRICS = {
    metric.name: metric
    for metric in (
        Metric(
            "mean_coverage",
            "",
            "mean coverage of the target",
            0.0,
            1.0,
            mean_coverage,
            required=True,
        ),
        Metric(
            "std_coverage",
            "",
            "standard deviation of coverage over the target",
            0.0,
            0.5,
            std_coverage,
            required=True,
        ),
        Metric(
            "p05_coverage",
            "",
            "coverage that 95 % of the target's area exceeds",
            0.0,
            1.0,
            p05_coverage,
            required=True,
        ),
        Metric(
            "time_to_98_s", "s", "time until 95 % of the target's area is 98 % covered", 0.0, NEVER
        ),
        Metric("intensity_uniformity", "", "1 - relative spread of the local impact speed"),
        Metric(
            "mean_normal_speed_m_s",
            "m/s",
            "mean normal speed of the impacts",
            0.0,
            of_impacts=_mean_normal_speed,
            required=True,
        ),
        Metric(
            "impacts_per_mm2_s",
            "1/(mm² s)",
            "impacts per area and second",
            0.0,
            of_impacts=_impacts_per_mm2_s,
            required=True,
        ),
        Metric(
            "shot_count", "balls", "number of balls", 0.0, of_impacts=_shot_count, required=True
        ),
    )
}

OBJECTIVES = {
    one.name: one
    for one in (
        ObjectiveFunction(
            "uniform_coverage",  # 1 only if everything is covered, and covered evenly
            "mean minus standard deviation of coverage",
            {"mean_coverage": 1.0, "std_coverage": -1.0},
        ),
        ObjectiveFunction(
            "p05_coverage", "coverage of the least covered 5 % of the area", {"p05_coverage": 1.0}
        ),
        ObjectiveFunction(
            "minus_time_to_98_s",
            "time to full coverage, the shorter the better",
            {"time_to_98_s": -1.0},
        ),
        ObjectiveFunction(
            "intensity_uniformity",
            "how evenly hard the target is hit",
            {"intensity_uniformity": 1.0},
        ),
    )
}
RENAMED_OBJECTIVES = {"coverage_p05": "p05_coverage", "time_to_98": "minus_time_to_98_s"}


def renamed_objective(old: str) -> str:
    """Message for a name that objectives had in version 0.1.0."""
    return f"{old!r} is now called {RENAMED_OBJECTIVES[old]!r}; change the name"


def parse_objective(name: str) -> ObjectiveFunction:
    """The objective of that name, or a sum such as "1 uniform_coverage + -0.001 time_to_98_s".

    Raises:
        InputError: it is neither.
    """
    if name in OBJECTIVES:
        return OBJECTIVES[name]
    if name in RENAMED_OBJECTIVES:
        raise InputError(f"objective.name: {renamed_objective(name)}")
    terms: dict[str, float] = {}
    for term in name.split(" + "):
        weight, _, part = term.partition(" ")
        try:
            factor = float(weight)
            of_part = {part: 1.0} if part in METRICS else OBJECTIVES[part].terms
        except (ValueError, KeyError):
            raise InputError(
                f"objective.name: {name!r} is not an objective; allowed: {', '.join(OBJECTIVES)}"
            ) from None
        for metric, share in of_part.items():
            terms[metric] = terms.get(metric, 0.0) + factor * share
    return ObjectiveFunction(name, "weighted sum", terms)
