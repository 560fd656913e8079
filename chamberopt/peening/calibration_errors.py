"""Evaluate a design with intervals that hold what its calibration leaves open.

Notation
    p   logarithm of a calibrated parameter, see design/peening/calibration.py
    h   how far p is moved in a run on the same replicas and seeds          (step_of)
    g   slope of a figure by p, (figure moved - figure) / h

Amplitude, restitution, yield speed and friction take a run each. Hardness changes the dents of the
impacts that are known, d ~ B^(-1/4), and K and beta are factors on figures. The standard errors L'g
are the same causes in the same order for all designs with one calibration: what two designs have in
common cancels in their difference.

Chaos makes paired runs differ by noise that a long step drowns, at the price of curvature. A step
is five standard deviations, but no more than MAX_STEP. What noise is left makes intervals wider.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import replace
from typing import TYPE_CHECKING

from chamberopt.common.estimate import FIRST_OF_CALIBRATION, Estimate
from chamberopt.coverage.metrics import parse_objective
from chamberopt.design.calibration import TIME_ERROR
from chamberopt.simulation.estimates import weighted_sum
from chamberopt.simulation.evaluate import ReplicaPlan, evaluate

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.common.progress import Progress
    from chamberopt.design.calibration import Parameter
    from chamberopt.design.load import Design
    from chamberopt.simulation.evaluation import Evaluation
    from chamberopt.simulation.replicas import Replica
    from sim_core import AnalyticCavity

# C0 goes down, because no restitution is above 1.
MAX_STEP: dict[Parameter, float] = {
    "amplitude": 0.3, "C0": -0.08, "v0": 0.6, "mu": 0.6, "hardness": 0.4,
}  # fmt: skip
STANDARD_DEVIATIONS, MIN_STEP = 5.0, 0.02


def evaluate_calibrated(
    design: Design,
    chamber: Chamber,
    executor: Executor,
    progress: Progress | None = None,
    plan: ReplicaPlan | None = None,
    cavity: AnalyticCavity | None = None,
    done: list[Replica] | None = None,
) -> Evaluation:
    """As `evaluate`, whose arguments and errors it has, with the errors of the calibration."""
    calibration = design.calibration
    done = [] if done is None else done
    if calibration is None:
        return evaluate(design, chamber, executor, progress, plan, cavity, done)
    steps = {name: step_of(name, calibration.log_sd(name)) for name in moved_parameters(design)}
    simulated = [name for name in steps if name != "hardness"]
    runs = 0

    def whole(finished: int, total: int, best: float | None) -> None:
        if progress:
            progress(runs * total + finished, (1 + len(simulated)) * total, best)

    found = evaluate(design, chamber, executor, whole, plan, cavity, done)
    again = ReplicaPlan(found.replicas, found.stream, found.objective_name)
    slopes = {"metrics": _factors(found.metrics), "wide": _factors(found.metrics_of_wide)}
    for name, step in steps.items():
        known = _with_other_dents(done, math.exp(-0.25 * step)) if name == "hardness" else []
        runs += not known
        moved = with_moved(design, name, step)
        other = evaluate(moved, chamber, executor, whole, again, cavity, known)
        for which, one, two in (
            ("metrics", found.metrics, other.metrics),
            ("wide", found.metrics_of_wide, other.metrics_of_wide),
        ):
            for figure in one:
                slopes[which][figure][name] = _slope(one[figure], two[figure], step)

    def widened(figures: Mapping[str, Estimate], which: str) -> dict[str, Estimate]:
        return {
            name: one.with_shared(
                FIRST_OF_CALIBRATION, calibration.errors(slopes[which][name], _of_model(name, one))
            )
            for name, one in figures.items()
        }

    metrics = widened(found.metrics, "metrics")
    note = (
        "intervals hold the scatter of the replicas and what the calibration leaves open, by "
        f"{len(simulated)} more runs on the same seeds"
    )
    return replace(
        found,
        metrics=metrics,
        metrics_of_wide=widened(found.metrics_of_wide, "wide"),
        objective=weighted_sum(parse_objective(found.objective_name), metrics),
        notes=(*found.notes, note),
    )


def moved_parameters(design: Design) -> list[Parameter]:
    """The calibrated parameters that take a run, or other dents, and are not known exactly."""
    calibration = design.calibration
    if calibration is None:
        return []
    names = [name for name in MAX_STEP if calibration.log_sd(name) > 0.0]
    return [name for name in names if name != "mu" or design.effects.friction is not None]


def step_of(name: Parameter, sd: float) -> float:
    """How far the logarithm of a parameter of this standard deviation is moved."""
    most = MAX_STEP[name]
    return math.copysign(min(max(STANDARD_DEVIATIONS * sd, MIN_STEP), abs(most)), most)


def with_moved(design: Design, name: Parameter, step: float) -> Design:
    """The design with the mean of one calibrated logarithm moved by a step."""
    calibration = design.calibration
    assert calibration is not None
    means = list(calibration.log_mean)
    means[calibration.parameters.index(name)] += step
    # Not checked again: a step may leave the limits of a design.
    moved = calibration.model_copy(update={"log_mean": tuple(means)})
    return design.model_copy(update={"calibration": moved})


def _with_other_dents(done: list[Replica], factor: float) -> list[Replica]:
    """Replicas whose dents on the part are so many times as wide."""
    return [replace(one, hits=replace(one.hits, dent=one.hits.dent * factor)) for one in done]


def _factors(figures: Mapping[str, Estimate]) -> dict[str, dict[Parameter, float]]:
    """Slopes by K and beta, which are factors."""
    slopes: dict[str, dict[Parameter, float]] = {name: {} for name in figures}
    for name, one in figures.items():
        figure = name.rpartition(".")[2]
        if figure.startswith("almen_intensity"):
            slopes[name] = {"K": one.value}
        elif figure == "saturation_time_s":
            slopes[name] = {"beta": -one.value}
    return slopes


def _of_model(name: str, one: Estimate) -> float:
    """Standard error of a figure by what the model leaves out."""
    return TIME_ERROR * one.value if name.rpartition(".")[2] == "saturation_time_s" else 0.0


def _slope(one: Estimate, two: Estimate, step: float) -> float:
    """Slope of a figure; 0 where it has no number."""
    known = all(math.isfinite(e.value) and e.has_number for e in (one, two))
    return (two.value - one.value) / step if known else 0.0
