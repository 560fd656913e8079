"""A short run that tells how long a first run must be."""

import math

import pytest

from chamberopt.chamber.build import build_chamber
from chamberopt.chamber.propose.proposed_budget import TooSlowError
from chamberopt.common.estimate import NOT_RESOLVED
from chamberopt.common.executor import local_executor
from chamberopt.design.intensity import PredictedIntensity
from chamberopt.simulation.budget_pilot import _least_time, at_slow_end, measure_budget
from chamberopt.simulation.evaluate import ReplicaPlan, evaluate
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


def test_few_dents_tell_an_intensity_roughly_that_more_dents_confirm() -> None:
    """Places are not resolved by a tenth of a second."""
    accuracy = {
        "process.accuracy.simulated_time_s": 0.1,
        "process.accuracy.objective_half_width": None,
    }
    chamber, plan = build_chamber(PLATE), ReplicaPlan(count=4)
    longer = PLATE.changed(accuracy | {"process.accuracy.simulated_time_s": 4.0})
    with local_executor() as executor:
        short = evaluate(PLATE.changed(accuracy), chamber, executor, plan=plan)
        full = PredictedIntensity.of(evaluate(longer, chamber, executor, plan=plan).metrics, None)
    rough = PredictedIntensity.of(short.metrics, None)
    assert short.metrics["strength_um"].in_words == NOT_RESOLVED
    assert full is not None
    assert rough is not None
    assert rough.value == pytest.approx(full.value, rel=0.1)


@pytest.mark.long
def test_what_takes_too_long_is_not_looked_at_to_its_end() -> None:
    """Even dents cover 98 % after ln 50 over the rate of their areas; 95 % of it is a bound."""
    design = PLATE.changed({"effects.friction": None})
    chamber = build_chamber(design)
    with local_executor() as executor:
        found = measure_budget(design, chamber, executor)
        assert measure_budget(design, chamber, executor, longest=found.time_to_98) == found
        brief = measure_budget(design, chamber, executor, is_brief=True)
        with pytest.raises(TooSlowError, match="98 % after more than") as told:
            measure_budget(design, chamber, executor, longest=0.1 * found.time_to_98)
    assert brief.simulated <= found.simulated
    assert brief == found or not brief.settled
    least = float(str(told.value).split()[-2])
    assert 0.1 * found.time_to_98 < least < found.time_to_98
    rate, hits = 0.25 * math.pi * 1e-6 * 400, 400  # of dents of 1 mm: area in each m² and second
    bound = _least_time(1e-6 * hits, hits, 1.0)
    assert bound == pytest.approx(0.95 * math.log(50.0) / (rate * (1.0 + 1.96 / 20.0)), rel=1e-3)
    assert _least_time(1e-6 * 20, 20, 1.0) == 0.0
