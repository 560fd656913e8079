"""Predict the Almen intensity of a design by a short simulation.

Strength is that of single places, as in `chamberopt simulate`, and its mean over wide windows is a
little too large where places differ. So the run ends once strength is known to PRECISION in wide
windows; then it is taken in windows as narrow as its dents resolve, and what that changes is added
to the interval. The run is bounded by its collisions, never by a clock, so that the same design has
the same result on any computer. Friction is that of the design.
"""

from __future__ import annotations

import math
from concurrent.futures import Executor
from dataclasses import replace
from typing import TYPE_CHECKING

from chamberopt.chamber.propose.proposed_budget import MARGIN, WIDEST
from chamberopt.chamber.propose.proposed_intensity import IntensityPilot
from chamberopt.common.progress import Progress
from chamberopt.coverage.strength_intervals import MAX_STEP
from chamberopt.design.intensity import PredictedIntensity
from chamberopt.peening.calibration_errors import evaluate_calibrated
from chamberopt.simulation.evaluate import ReplicaPlan, evaluate
from chamberopt.simulation.replicas import ReplicaSet

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.common.estimate import Estimate
    from chamberopt.design.load import Design
    from chamberopt.simulation.evaluation import Evaluation

REPLICAS = 4
FIRST_TIME, GROWTH = 0.125, 4.0  # s of each replica; over that of the run before
COLLISIONS = 2e6  # of all replicas: a run that would have more is not begun, unless it is the first
PRECISION = 0.05  # half-width of the strength's interval over its value
POINTS = 2000  # middles of windows; strength differs little from place to place
# Least step of the strength, from half of the dents to all, over its value: below it is chance.
LEAST_STEP = 0.01
FIGURES = "strength_um", "almen_intensity"


def predict_intensity(
    design: Design, chamber: Chamber, executor: Executor, progress: Progress | None = None
) -> IntensityPilot | None:
    """Simulate a design briefly, and return its Almen intensity; None if hardly a dent fell.

    Where single places are not resolved it is a rough one.

    Raises:
        InputError: the shot does not fit, or the target has no figures.
        sim_core.SimulationError: a replica cannot be simulated.
    """
    area = 1e6 * float(chamber.part.area[chamber.part.target].sum())
    time = FIRST_TIME
    plan = ReplicaPlan(count=REPLICAS, wide_windows=False, single_steps=False)
    while True:
        accuracy = {
            "simulated_time_s": time,
            "gauge_mm2": max(1.0, WIDEST * area),
            "points": POINTS,
            "objective_half_width": None,
        }
        short = design.changed({f"process.accuracy.{key}": one for key, one in accuracy.items()})
        known = ReplicaSet()
        wide = evaluate(short, chamber, executor, progress, plan, known=known)
        if _is_known(wide, PRECISION) or GROWTH * wide.collisions["total"] > COLLISIONS:
            break
        time *= GROWTH
    if not _is_known(wide, math.inf):
        rough = PredictedIntensity.of(wide.metrics, design.calibration)
        return None if rough is None else IntensityPilot(rough, 0.0)
    found, dents = wide, _dents_needed(wide)
    narrow = short.process.accuracy.gauge_mm2 * dents / wide.resolution.dents
    if narrow < short.process.accuracy.gauge_mm2:
        narrower = short.changed({"process.accuracy.gauge_mm2": max(1.0, narrow)})
        again = ReplicaSet(list(known.replicas))
        one = evaluate(narrower, chamber, executor, progress, plan, known=again)
        if _is_known(one, math.inf):
            short, found, known = narrower, one, again
    moved = wide.metrics["strength_um"].value / found.metrics["strength_um"].value - 1.0
    if design.calibration is not None:
        found = evaluate_calibrated(short, chamber, executor, progress, plan, known=known)
    metrics = {name: _wider(one, moved) for name, one in found.metrics.items() if name in FIGURES}
    predicted = PredictedIntensity.of(metrics, design.calibration)
    return None if predicted is None else IntensityPilot(predicted, dents)


def _is_known(found: Evaluation, precision: float) -> bool:
    """Return whether the strength is resolved, with an interval that is narrow enough.

    Args:
        precision: largest half-width over the value.
    """
    one = found.metrics["strength_um"]
    if one.in_words or one.value <= 0.0 or not math.isfinite(one.half_width):
        return False
    return one.half_width <= precision * one.value


def _dents_needed(found: Evaluation) -> float:
    """Return how many dents in the median window the strength takes, with a margin.

    The step from half of the dents to all falls as one over their number.
    """
    one = found.metrics["strength_um"]
    step = max(one.bias / one.value, LEAST_STEP)
    return MARGIN * found.resolution.dents * step / MAX_STEP


def _wider(one: Estimate, moved: float) -> Estimate:
    """Return an estimate with an interval that holds a relative change too."""
    return replace(one, half_width=one.half_width + abs(moved) * one.value)
