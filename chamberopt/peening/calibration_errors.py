"""Evaluate a design with intervals that hold the errors of its calibration.

Notation
    p   logarithm of a calibrated parameter, see design/calibration.py
    h   step of p in a second simulation with the same seeds       (Moved.step)
    g   slope of a figure by p, (figure moved - figure) / h
    L   factor of the covariance of all p

Amplitude, restitution, yield speed and friction take a simulation each, with the parameter changed.
Hardness B changes the diameter d of the dents of the same impacts, d ~ B^(-1/4). K and beta are
factors on figures. The standard errors of a figure are L'g. They have the same causes in the same
order for all designs with this calibration, so that errors that two designs have in common cancel
in the difference of these designs.

Chaos makes two simulations with the same seeds differ by noise. A long step drowns the noise, but
the figure's curvature then falsifies the slope. A step is five standard deviations, but at most
MAX_STEP. The noise that is left widens intervals.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from chamberopt.common.estimate import FIRST_OF_CALIBRATION, Estimate
from chamberopt.design.calibration import TIME_ERROR, Parameter
from chamberopt.simulation.estimates import objective_estimate
from chamberopt.simulation.replicas import ReplicaSet
from chamberopt.simulation.variations import RunsProgress, Variations

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.common.progress import Progress
    from chamberopt.design.load import Design
    from chamberopt.simulation.evaluate import ReplicaPlan
    from chamberopt.simulation.evaluation import Evaluation
    from chamberopt.simulation.replicas import Replica
    from sim_core import AnalyticCavity

SIMULATED: tuple[Parameter, ...] = ("amplitude", "C0", "v0", "mu")  # parameters that take a run
# The step of C0 is negative, because no restitution is above 1.
MAX_STEP: dict[Parameter, float] = {
    "amplitude": 0.3, "C0": -0.08, "v0": 0.6, "mu": 0.6, "hardness": 0.4,
}  # fmt: skip
STANDARD_DEVIATIONS, MIN_STEP = 5.0, 0.02
WIDE = ".wide."  # prefix of the figures of wide windows, which is the name of no zone


class Moved(NamedTuple):
    """A copy of a design in which one calibrated parameter is moved by a step of its logarithm."""

    name: Parameter
    step: float
    design: Design


def evaluate_calibrated(
    design: Design,
    chamber: Chamber,
    executor: Executor,
    progress: Progress | None = None,
    plan: ReplicaPlan | None = None,
    cavity: AnalyticCavity | None = None,
    known: ReplicaSet | None = None,
) -> Evaluation:
    """Simulate a design, and widen the intervals of its figures by the errors of its calibration.

    `evaluate` in simulation/evaluate.py has the same arguments.
    """
    of_all = RunsProgress(progress, 1 + len(moved_designs(design)))
    known = known or ReplicaSet()
    return with_open_errors(Variations(design, chamber, executor, of_all, plan, cavity, known))


def with_open_errors(runs: Variations) -> Evaluation:
    """Return a design's evaluation, with intervals widened by the errors of its calibration.

    Args:
        runs: simulates the design, and changed copies of it with the same seeds.
    """
    found, calibration = runs.nominal, runs.design.calibration
    if calibration is None:
        return found
    figures, moves = _figures(found), moved_designs(runs.design)
    harder = moved_designs(runs.design, ("hardness",))
    slopes = {name: _factors(name, one) for name, one in figures.items()}
    for parameter, step, moved in (*moves, *harder):
        wider = math.exp(-0.25 * step)
        dents = _with_other_dents(runs.known.replicas, wider) if parameter == "hardness" else []
        others = _figures(runs.run(moved, replicas=dents))
        for name, one in figures.items():
            slopes[name][parameter] = slope(one, others[name], step)
    for name, one in figures.items():
        errors = calibration.errors(slopes[name], _of_model(name, one))
        figures[name] = one.with_shared(FIRST_OF_CALIBRATION, errors)
    metrics = {name: figures[name] for name in found.metrics}
    note = (
        "intervals hold the scatter of the replicas and what the calibration leaves open, by "
        f"{len(moves)} more runs on the same seeds"
    )
    return replace(
        found,
        metrics=metrics,
        metrics_of_wide={name: figures[WIDE + name] for name in found.metrics_of_wide},
        objective=objective_estimate(found.objective_name, metrics, runs.design),
        notes=(*found.notes, note),
    )


def moved_designs(design: Design, names: Sequence[Parameter] = SIMULATED) -> list[Moved]:
    """Return copies of the design, in each of which a step moves another calibrated parameter.

    Parameters that are known exactly are left out. So is friction if the design has no friction.

    Args:
        names: parameters to move.
    """
    calibration = design.calibration
    if calibration is None:
        return []
    moves = []
    for name in names:
        sd, most = calibration.log_sd(name), MAX_STEP[name]
        if sd > 0.0 and (name != "mu" or design.effects.friction is not None):
            step = math.copysign(min(max(STANDARD_DEVIATIONS * sd, MIN_STEP), abs(most)), most)
            means = list(calibration.log_mean)
            means[calibration.parameters.index(name)] += step
            # The copies are not validated, because a step may leave the limits of a design.
            moved = calibration.model_copy(update={"log_mean": tuple(means)})
            moves.append(Moved(name, step, design.model_copy(update={"calibration": moved})))
    return moves


def slope(one: Estimate, two: Estimate, step: float) -> float:
    """Return the slope of a figure by a parameter's logarithm; 0 if the figure is no finite number.

    Args:
        one: the figure of the design.
        two: the figure simulated with the parameter moved.
        step: difference of the parameter's logarithm between both simulations.
    """
    known = all(math.isfinite(e.value) and e.has_number for e in (one, two))
    return (two.value - one.value) / step if known else 0.0


def _figures(found: Evaluation) -> dict[str, Estimate]:
    """Return all metrics of an evaluation by name.

    Metrics of coverage in wide windows, discs of twice the usual radius, have the prefix WIDE.
    """
    return found.metrics | {WIDE + name: one for name, one in found.metrics_of_wide.items()}


def _with_other_dents(replicas: Sequence[Replica], factor: float) -> list[Replica]:
    """Return copies of the replicas and of their steps, with the part's dents wider by a factor."""
    return [
        replace(
            one,
            hits=replace(one.hits, dent=one.hits.dent * factor),
            steps=tuple(_with_other_dents(one.steps, factor)),
        )
        for one in replicas
    ]


def _factors(name: str, one: Estimate) -> dict[Parameter, float]:
    """Return the slopes of a figure by the logarithms of K and beta.

    Almen intensities are proportional to K, and saturation times to 1 / beta. Other figures depend
    on neither, and have no slope.
    """
    figure = name.rpartition(".")[2]
    if figure.startswith("almen_intensity"):
        return {"K": one.value}
    return {"beta": -one.value} if figure == "saturation_time_s" else {}


def _of_model(name: str, one: Estimate) -> float:
    """Return the standard error that the simplifications of the model cause in a figure.

    It is 0 for all figures but saturation times.
    """
    return TIME_ERROR * one.value if name.rpartition(".")[2] == "saturation_time_s" else 0.0
