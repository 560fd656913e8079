"""Measure by a short run how fast a proposed design dents its target, and what simulating costs.

The run is at the slow end of what is known of friction, with windows (discs in which dents are
counted) so wide that few impacts resolve them. It is bounded by its collisions, never by a clock,
so that the same design has the same result on any computer.
"""

from __future__ import annotations

import math
from concurrent.futures import Executor
from typing import TYPE_CHECKING

from chamberopt.chamber.propose.proposed_budget import WIDEST, Measured
from chamberopt.chamber.scene import chamber_mesh
from chamberopt.common.errors import InputError
from chamberopt.common.progress import Progress
from chamberopt.coverage.metrics import NEVER, exposed_target
from chamberopt.design.ranges import variants
from chamberopt.simulation.evaluate import ReplicaPlan, evaluate, require_figures
from chamberopt.simulation.replicas import ReplicaSet, ReplicaSetting, simulate_replicas

if TYPE_CHECKING:
    from chamberopt.chamber.build import Chamber
    from chamberopt.design.load import Design

REPLICAS = 4
WARMUP = 0.1  # s: balls cross the chamber some times
FIRST_TIME, GROWTH = 0.025, 4.0  # s of each replica; over that of the run before
DENTS = 100  # in a wide window
COLLISIONS = 2e6  # of all replicas: a run that would have more is not begun, unless it is the first


def at_slow_end(design: Design) -> tuple[Design, bool]:
    """Return a design with the most friction that may be, and whether that is a change."""
    ends = variants(design).get("friction")
    return (ends[1], True) if ends else (design, False)


def measure_budget(
    design: Design, chamber: Chamber, executor: Executor, progress: Progress | None = None
) -> Measured:
    """Simulate a design briefly, and return what its budget follows from.

    Raises:
        InputError: the shot does not fit, the target has no figures, or it was not hit.
        sim_core.SimulationError: a replica cannot be simulated.
    """
    slow, friction = at_slow_end(design)
    area = float(chamber.part.area[chamber.part.target].sum())
    target, mesh, time = exposed_target(chamber), chamber_mesh(chamber), FIRST_TIME
    while True:
        accuracy = {
            "replicas": REPLICAS,
            "simulated_time_s": time,
            "warmup_time_s": WARMUP,
            "gauge_mm2": max(1.0, 1e6 * WIDEST * area),
            "objective_half_width": None,
        }
        slow = slow.changed({f"process.accuracy.{key}": one for key, one in accuracy.items()})
        require_figures(slow, chamber, mesh)
        replicas = simulate_replicas(ReplicaSetting(slow, chamber, mesh), executor, progress)
        hits = sum(int(target[one.hits.triangle].sum()) for one in replicas)
        collisions = sum(one.collisions["total"] for one in replicas)
        if hits >= DENTS / WIDEST or GROWTH * collisions > COLLISIONS:
            break
        time *= GROWTH
    found = evaluate(
        slow, chamber, executor, plan=ReplicaPlan(count=REPLICAS), known=ReplicaSet(replicas)
    )
    places, mean = found.metrics["time_to_98_s"], found.metrics["exposure"].value
    dents, simulated = found.resolution.dents, found.simulated_time
    if not dents or not mean > 0.0:
        raise InputError(f"the shot hardly hits the target in {simulated:.3g} simulated s")
    resolved = math.isfinite(places.half_width) and places.value < NEVER
    mean_time = slow.process.treatment_time / mean
    return Measured(
        dent_rate=dents / (simulated * slow.process.accuracy.gauge),
        collision_rate=collisions / (simulated + REPLICAS * WARMUP),
        time_to_98=places.value if resolved else mean_time,
        places=resolved,
        spread=places.half_width if resolved else math.inf,
        friction=friction,
        dents_for_mean=found.resolution.needed_for_mean / slow.process.treatment_time,
        target=area,
        simulated=simulated,
        mean_time=mean_time,
    )
