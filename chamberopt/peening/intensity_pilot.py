"""Predict the Almen intensity of a design by a short simulation.

The run ends once the strength is known to PRECISION. It is bounded by its collisions, never by a
clock, so that the same design has the same result on any computer. Friction is that of the design,
as in `chamberopt simulate`.
"""

from __future__ import annotations

import math
from concurrent.futures import Executor
from typing import TYPE_CHECKING

from chamberopt.chamber.propose.proposed_budget import WIDEST
from chamberopt.common.progress import Progress
from chamberopt.design.intensity import PredictedIntensity
from chamberopt.peening.calibration_errors import evaluate_calibrated
from chamberopt.simulation.evaluate import ReplicaPlan, evaluate
from chamberopt.simulation.replicas import ReplicaSet

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design

REPLICAS = 4
FIRST_TIME, GROWTH = 0.125, 4.0  # s of each replica; over that of the run before
COLLISIONS = 2e6  # of all replicas: a run that would have more is not begun, unless it is the first
PRECISION = 0.05  # half-width of the strength's interval over its value
POINTS = 2000  # middles of windows; strength differs little from place to place


def predict_intensity(
    design: Design, chamber: Chamber, executor: Executor, progress: Progress | None = None
) -> PredictedIntensity | None:
    """Simulate a design briefly, and return its Almen intensity; None if it is not resolved.

    Raises:
        InputError: the shot does not fit, or the target has no figures.
        sim_core.SimulationError: a replica cannot be simulated.
    """
    area = 1e6 * float(chamber.part.area[chamber.part.target].sum())
    time, plan = FIRST_TIME, ReplicaPlan(count=REPLICAS)
    while True:
        accuracy = {
            "simulated_time_s": time,
            "gauge_mm2": max(1.0, WIDEST * area),
            "points": POINTS,
            "objective_half_width": None,
        }
        short = design.changed({f"process.accuracy.{key}": one for key, one in accuracy.items()})
        known = ReplicaSet()
        found = evaluate(short, chamber, executor, progress, plan, known=known)
        strength = found.metrics["strength_um"]
        enough = strength.half_width <= PRECISION * strength.value and not strength.in_words
        if enough or GROWTH * found.collisions["total"] > COLLISIONS:
            break
        time *= GROWTH
    if design.calibration is not None and math.isfinite(strength.half_width):
        found = evaluate_calibrated(short, chamber, executor, progress, plan, known=known)
    return PredictedIntensity.of(found.metrics, design.calibration)
