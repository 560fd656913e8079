"""The registry of metrics, numbers that describe a simulated design, and of objectives of studies.

A new metric is an entry of `METRICS`, and a new objective is an entry of `OBJECTIVES`. Study files,
tables, reports and result folders take names, units and ranges from `find_metric`. The metrics of
`METRICS` are over the target, "ZONE.mean_coverage" is the same metric over a zone of the design,
and "steps.STEP.mean_coverage" is the same metric after one of its steps alone. A design may lack
some metrics: `metric_problem` gives the reason.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from chamberopt.common import toml_errors
from chamberopt.common.errors import InputError
from chamberopt.common.estimate import NOT_RESOLVED
from chamberopt.common.key_words import inner_first
from chamberopt.design.flexure import NO_STRESS

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.common.estimate import Estimate
    from chamberopt.coverage.part_impacts import TargetImpacts
    from chamberopt.design.load import Design

FULL_COVERAGE = 0.98  # SAE J2277: coverage that counts as complete
NEVER = 1e6  # s: eleven days of peening stand for never
P05 = 0.05  # share of the target's area that may be covered less than p05_coverage
STEPS = "steps"
P95 = 0.95  # share of the target's area that may be covered less than p95_coverage


@dataclass(frozen=True)
class Metric:
    """A named number that describes a simulated design, such as its mean coverage.

    Metrics of coverage and intensity have their own estimators, see simulation/estimates.py.
    """

    name: str
    unit: str
    summary: str
    lowest: float = -math.inf
    highest: float = math.inf
    # Function of the impacts on the target and the design; None for a metric with an estimator.
    of_impacts: Callable[[TargetImpacts, Design], float] | None = None
    required: bool = False  # true if a results folder without the metric is damaged
    of_places: bool = False  # true for a metric of single places, which takes more dents
    of_zones: bool = True  # true if a zone of the target has the metric too
    # Function that gives the reason why a design lacks the metric, or "". None: no design lacks it.
    lacking: Callable[[Design], str] | None = None


@dataclass(frozen=True)
class ObjectiveFunction:
    """A weighted sum of metrics, and of numbers of the design, that a study maximises."""

    name: str
    summary: str
    terms: dict[str, float]  # weight of each metric or number, by its name

    @property
    def is_exact(self) -> bool:
        """Whether it is of numbers of the design alone, which no simulation has to find."""
        return not any(find_metric(name) for name in self.terms)


def exposed_target(chamber: Chamber) -> np.ndarray:
    """Return marks (m,) of the part triangles of the target that bound the room of the balls."""
    return chamber.part.target & (chamber.exposed_area > 0.0)


def require_target(chamber: Chamber) -> None:
    """Raise InputError if no triangle of the target bounds the cavity, the room of the balls."""
    if not exposed_target(chamber).any():
        raise InputError(
            "part.target: no triangle of the target bounds the cavity, so its coverage is not "
            "defined; widen [part.target] or move the part into the chamber"
        )


def _mean_normal_speed(impacts: TargetImpacts, design: Design) -> float:
    return impacts.total("speed") / impacts.count if impacts.count else 0.0


def _impacts_per_mm2_s(impacts: TargetImpacts, design: Design) -> float:
    return impacts.count / (1e6 * impacts.area * impacts.time)


def _why_no_intensity(design: Design) -> str:
    return design.why_no_intensity


def _why_no_stress(design: Design) -> str:
    return "" if design.stress else NO_STRESS


def _shot_count(impacts: TargetImpacts, design: Design) -> float:
    return float(design.shot.count)


METRICS = {
    metric.name: metric
    for metric in (
        Metric("mean_coverage", "", "mean coverage of the target", 0.0, 1.0, required=True),
        Metric(
            "std_coverage",
            "",
            "standard deviation of coverage over the target",
            0.0,
            0.5,
            required=True,
        ),
        Metric(
            "p05_coverage",
            "",
            "coverage that 95 % of the area exceeds",
            0.0,
            1.0,
            required=True,
            of_places=True,
        ),
        Metric(
            "p95_coverage", "", "coverage that 5 % of the area exceeds", 0.0, 1.0, of_places=True
        ),
        Metric("exposure", "", "mean exposure, in times to 98 % coverage", 0.0, of_places=True),
        Metric("p95_exposure", "", "exposure that 5 % of the area exceeds", 0.0, of_places=True),
        Metric(
            "time_to_98_s",
            "s",
            "time until 95 % of the area is 98 % covered",
            0.0,
            NEVER,
            of_places=True,
        ),
        Metric(
            "intensity_uniformity",
            "",
            "1 - relative spread of the local peening strength",
            of_places=True,
        ),
        Metric("strength_um", "µm", "mean peening strength", 0.0, of_places=True),
        Metric(
            "strength_p05_um",
            "µm",
            "peening strength that 95 % of the area exceeds",
            0.0,
            of_places=True,
        ),
        Metric(
            "strength_p95_um",
            "µm",
            "peening strength that 5 % of the area exceeds",
            0.0,
            of_places=True,
        ),
        Metric(
            "almen_intensity",
            "mmA",
            "mean Almen intensity",
            0.0,
            of_places=True,
            lacking=_why_no_intensity,
        ),
        Metric(
            "almen_intensity_p05",
            "mmA",
            "Almen intensity that 95 % of the area exceeds",
            0.0,
            of_places=True,
            lacking=_why_no_intensity,
        ),
        Metric(
            "almen_intensity_p95",
            "mmA",
            "Almen intensity that 5 % of the area exceeds",
            0.0,
            of_places=True,
            lacking=_why_no_intensity,
        ),
        Metric("saturation_time_s", "s", "saturation time of a strip", 0.0, of_places=True),
        Metric(
            "compression_depth_um",
            "µm",
            "estimated depth of compression in a thick part",
            0.0,
            of_places=True,
        ),
        Metric(
            "surface_stress_MPa",
            "MPa",
            "estimated residual stress at the surface",
            of_places=True,
            lacking=_why_no_stress,
        ),
        Metric(
            "peak_stress_MPa",
            "MPa",
            "estimated largest compressive residual stress",
            of_places=True,
            lacking=_why_no_stress,
        ),
        Metric(
            "peak_stress_depth_um",
            "µm",
            "estimated depth of the largest compressive stress",
            0.0,
            of_places=True,
            lacking=_why_no_stress,
        ),
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
            "shot_count",
            "balls",
            "number of balls",
            0.0,
            of_impacts=_shot_count,
            required=True,
            of_zones=False,
        ),
    )
}


# What a strip tells, which is peened in one step.
OF_STRIP = frozenset(
    name
    for name in METRICS
    if name.startswith(("strength_", "almen_", "intensity_", "saturation_"))
)


def find_metric(name: str) -> Metric | None:
    """Return the metric with a name such as "mean_coverage", "ZONE.mean_coverage" or
    "steps.STEP.mean_coverage", or None.
    """
    surface, _, of_target = name.rpartition(".")
    metric = METRICS.get(of_target)
    if metric is None or not surface:
        return METRICS.get(name)
    step = surface.removeprefix(f"{STEPS}.")
    if not (step.isidentifier() and metric.of_zones):
        return None
    of_target = metric.summary
    if step != surface:
        summary = f"{of_target}, step {step.replace('_', ' ')} alone"
    else:
        of_zone = of_target.replace("the target", f"zone {surface}")
        summary = of_zone if of_zone != of_target else f"{of_target}, zone {surface}"
    return replace(metric, name=name, summary=summary, required=False)


def tells_coverage(metrics: Mapping[str, Estimate]) -> bool:
    """Return whether enough dents were simulated to tell the coverage after the treatment time."""
    mean = metrics.get("mean_coverage")
    return mean is None or mean.in_words != NOT_RESOLVED


def named(name: str) -> str:
    """Return the name of a metric, or of a number of a design, in words."""
    metric = find_metric(name)
    return metric.summary if metric else inner_first(name)


def is_number(name: str) -> bool:
    """Return whether a name may be that of a number of a design, such as shot.mass_g."""
    return "." in name and find_metric(name) is None


def metric_problem(design: Design, name: str) -> str:
    """Return the reason why a design lacks the named metric or number, or "" if it has it."""
    metric = find_metric(name)
    if metric is None:
        if is_number(name):
            try:
                design.value(name)
            except InputError as error:
                return str(error).removeprefix(f"{name}: ")
            return ""
        return f"not a metric; {toml_errors.did_you_mean(name, METRICS)}"
    zone, zones = name.rpartition(".")[0], [one.name for one in design.zones]
    if zone.startswith(f"{STEPS}."):
        steps = [one.name for one in design.steps or ()]
        if (step := zone.removeprefix(f"{STEPS}.")) not in steps:
            hint = toml_errors.did_you_mean(step, steps) if steps else "add it as [[steps]]"
            return f"the design has no step {step!r}; {hint}"
        return metric.lacking(design) if metric.lacking else ""
    if zone and zone not in zones:
        hint = toml_errors.did_you_mean(zone, zones) if zones else "add it as [[zones]]"
        return f"the design has no zone {zone!r}; {hint}"
    return metric.lacking(design) if metric.lacking else ""


def metric_names(design: Design) -> tuple[str, ...]:
    """Return the names of all metrics of a design. The metrics of its zones come last."""
    of_target = tuple(name for name in METRICS if not metric_problem(design, name))
    surfaces = (
        *(zone.name for zone in design.zones),
        *(f"{STEPS}.{step.name}" for step in design.steps or ()),
    )
    of_zones = (f"{one}.{name}" for one in surfaces for name in of_target)
    return (*of_target, *(name for name in of_zones if find_metric(name)))


OBJECTIVES = {
    one.name: one
    for one in (
        ObjectiveFunction(
            "uniform_coverage",  # 1 only if the whole target is covered evenly
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
            "minus_treatment_time_s",
            "treatment time that meets all limits, the shorter the better",
            {"process.treatment_time_s": -1.0},
        ),
        ObjectiveFunction(
            "intensity_uniformity",
            "how even the peening strength is over the target",
            {"intensity_uniformity": 1.0},
        ),
    )
}
RENAMED_OBJECTIVES = {"coverage_p05": "p05_coverage", "time_to_98": "minus_time_to_98_s"}


def renamed_objective(old: str) -> str:
    """Return a message with the new name of an objective that had another name in version 0.1.0."""
    return f"{old!r} is now called {RENAMED_OBJECTIVES[old]!r}; change the name"


def parse_objective(name: str) -> ObjectiveFunction:
    """Return the objective of this name, or the objective that a weighted sum of objectives,
    metrics and numbers of a design describes.

    >>> parse_objective("1 uniform_coverage + -0.001 time_to_98_s").terms
    {'mean_coverage': 1.0, 'std_coverage': -1.0, 'time_to_98_s': -0.001}

    Raises:
        InputError: the text is neither a name nor a sum.
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
            is_term = find_metric(part) or is_number(part)
            of_part = {part: 1.0} if is_term else OBJECTIVES[part].terms
        except (ValueError, KeyError):
            raise InputError(
                f"objective.name: {name!r} is not an objective; allowed: {', '.join(OBJECTIVES)}"
            ) from None
        for metric, share in of_part.items():
            terms[metric] = terms.get(metric, 0.0) + factor * share
    return ObjectiveFunction(name, "weighted sum", terms)


def unit_of_objective(name: str, metrics: Mapping[str, Estimate], value: Estimate) -> float:
    """Return the size of the largest term of an objective, in which gains and accuracy count.

    The size of a term is its weight if its metric is between 0 and 1. Else it is the weight times
    the size of the metric, or of the objective if the metric was not measured.

    Args:
        metrics: estimates of the metrics by name.
        value: the objective itself.
    """
    sizes = []
    for term, weight in parse_objective(name).terms.items():
        metric, figure = find_metric(term), metrics.get(term, value)
        is_share = metric is not None and metric.highest <= 1.0
        sizes.append(abs(weight) * (1.0 if is_share else abs(figure.value)))
    return max(sizes) or 1.0


def highest_uniform_coverage(reachable: float) -> float:
    """Return the largest uniform_coverage (mean minus standard deviation of coverage) that is
    possible if balls reach only a share r of the target.

    The rest of the target has no coverage. If the share r has the same coverage c everywhere, the
    mean is r c and the standard deviation is c sqrt(r (1 - r)).
    """
    return max(0.0, reachable - math.sqrt(max(0.0, reachable * (1.0 - reachable))))


def highest_objective(name: str, reachable: float) -> float:
    """Return the largest possible value of an objective if balls reach only a share of the target.

    The value is infinite if no bound is known.
    """
    terms = parse_objective(name).terms
    if terms == OBJECTIVES["uniform_coverage"].terms:
        return highest_uniform_coverage(reachable)
    known = {"mean_coverage": reachable, "p05_coverage": float(reachable >= 1.0 - P05)}
    highest = 0.0
    for metric, weight in terms.items():
        limits = find_metric(metric)
        if limits is None:
            return math.inf
        if weight:
            best = known.get(metric, limits.highest) if weight > 0.0 else limits.lowest
            highest += weight * best
    return highest


def require_metrics(design: Design, objective: str) -> None:
    """Raise InputError unless a design has all metrics of an objective."""
    for name in parse_objective(objective).terms:
        if problem := metric_problem(design, name):
            raise InputError(f"objective: {name}: {problem}")
