"""A short run that tells how long a first run must be."""

import pytest

from chamberopt.chamber.build import build_chamber
from chamberopt.common.executor import local_executor
from chamberopt.simulation.budget_pilot import at_slow_end, measure_budget
from chamberopt.simulation.evaluate import evaluate
from tests.helpers.synthetic import plate_design

PLATE = plate_design()


def test_the_slow_end_has_the_most_friction() -> None:
    design = PLATE.changed({"effects.friction": {"mu": 0.2, "beta0": 0.4}})
    slow, changed = at_slow_end(design)
    assert changed
    assert slow.effects.friction is not None
    assert slow.effects.friction.mu == pytest.approx(1.5 * 0.2)
    without = PLATE.changed({"effects.friction": None})
    assert at_slow_end(without) == (without, False)


@pytest.mark.long
def test_a_pilot_foretells_a_longer_run() -> None:
    """The rate of dents in the median window, and the time to 98 %, within their errors."""
    design = PLATE.changed({"effects.friction": None, "process.accuracy.simulated_time_s": 5.0})
    chamber = build_chamber(design)
    with local_executor() as executor:
        pilot = measure_budget(design, chamber, executor)
        full = evaluate(design, chamber, executor)
    rate = full.resolution.dents / (full.simulated_time * design.process.accuracy.gauge)
    assert pilot.dent_rate == pytest.approx(rate, rel=0.2)
    time = full.metrics["time_to_98_s"]
    assert pilot.places
    assert abs(pilot.time_to_98 - time.value) < pilot.spread + time.half_width
    per_second = full.collisions["total"] / (
        full.simulated_time + full.replicas * design.process.accuracy.warmup_time
    )
    assert pilot.collision_rate == pytest.approx(per_second, rel=0.1)
