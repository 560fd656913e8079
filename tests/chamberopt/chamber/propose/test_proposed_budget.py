"""What `new` proposes after a pilot: treatment time, simulated time and windows."""

import pytest

from chamberopt.chamber.propose.proposal import MOST_REPLICAS, REPLICAS
from chamberopt.chamber.propose.proposed_budget import (
    COLLISIONS,
    DENTS,
    LEAST_TIME,
    WIDEST,
    Measured,
    propose_budget,
    settable,
)

PILOT = Measured(
    dent_rate=1e5,  # 0.1 dents in 1 mm² and a second
    collision_rate=1e4,
    time_to_98=250.0,
    places=True,
    spread=60.0,
    friction=True,
    dents_for_mean=0.01,
    target=5e-3,
    simulated=6.4,
    mean_time=200.0,
)
MEMORY = "process.accuracy.max_replicas"
TIME, GAUGE = "process.accuracy.simulated_time_s", "process.accuracy.gauge_mm2"


@pytest.mark.parametrize("rate", [1e4, 1e5, 1e6, 1e7])
@pytest.mark.parametrize("for_mean", [0.0, 0.2])
def test_windows_get_the_dents_that_are_needed(rate: float, for_mean: float) -> None:
    """Dents are rate times gauge times the time of all replicas."""
    budget = propose_budget(
        PILOT._replace(dent_rate=rate, collision_rate=1e3, dents_for_mean=for_mean)
    )
    dents = rate * 1e-6 * budget.gauge_mm2 * REPLICAS * budget.time
    assert dents >= max(DENTS, for_mean * budget.treatment)
    assert budget.gauge_mm2 == 1.0
    assert GAUGE not in budget.reasons
    assert "TOO FEW" not in budget.reasons[TIME]
    if budget.time > LEAST_TIME:
        assert dents <= 2.5 * max(DENTS, for_mean * budget.treatment)


def test_windows_widen_where_the_time_would_be_too_long_and_it_is_said() -> None:
    budget = propose_budget(PILOT._replace(collision_rate=1e5))
    assert REPLICAS * budget.time * 1e5 <= 1.5 * COLLISIONS
    assert budget.gauge_mm2 > 1.0
    assert 1e5 * 1e-6 * budget.gauge_mm2 * REPLICAS * budget.time >= DENTS
    assert budget.reasons[GAUGE].startswith("wider than the usual 1 mm²")


def test_what_does_not_resolve_in_the_time_is_said() -> None:
    budget = propose_budget(PILOT._replace(collision_rate=1e8))
    assert budget.gauge_mm2 == pytest.approx(1e6 * WIDEST * PILOT.target)
    assert (
        "TOO FEW DENTS are simulated in 6 minutes of two cores: simulate longer"
        in budget.reasons[TIME]
    )


@pytest.mark.parametrize("room", [1e6, 200.0, 60.0, 17.0, 4.2])
def test_what_is_simulated_stays_within_a_modest_memory(room: float) -> None:
    """One replica takes 7 s, so that 24 take 168 s, and 10 take 70 s."""
    free = propose_budget(PILOT._replace(dent_rate=5e5))
    budget = propose_budget(PILOT._replace(dent_rate=5e5, room=room))
    assert free.time == 7.0
    assert budget.most_replicas * budget.time <= room
    assert budget.most_replicas == (MOST_REPLICAS if room > 168.0 else REPLICAS)
    assert (MEMORY in budget.reasons) == (room < 168.0)
    assert ("stay within 2 GB" in budget.reasons[TIME]) == (room < 70.0)
    dents = 5e5 * 1e-6 * budget.gauge_mm2 * REPLICAS * budget.time
    assert dents >= DENTS
    assert (GAUGE in budget.reasons) == (budget.gauge_mm2 > 1.0)
    if budget.gauge_mm2 > 1.0:
        assert budget.reasons[GAUGE].endswith("enough dents within 2 GB of memory")


def test_the_treatment_time_is_rounded_up_and_says_what_it_rests_on() -> None:
    budget = propose_budget(PILOT)
    assert budget.treatment == 360.0  # 250 s and 30 % more
    said = budget.reasons["process.treatment_time_s"]
    assert said.startswith("an estimate, rounded up: after about 250 ± 60 s 95 % of the target is")
    assert "slow end of friction" in said
    assert said.endswith("simulated s, and 30% more, in all 1.4 times as long")
    assert budget.search_time == pytest.approx(REPLICAS * budget.time, rel=0.5)
    of_mean = propose_budget(PILOT._replace(places=False, friction=False))
    said = of_mean.reasons["process.treatment_time_s"]
    assert "has the dents of 98 % coverage ON AVERAGE" in said
    assert "friction" not in said
    assert of_mean.treatment == 900.0  # three times 250 s, rounded up
    assert of_mean.search_time == REPLICAS * of_mean.time


def test_what_makes_a_time_long_is_said() -> None:
    def said(**changes: float) -> str:
        budget = propose_budget(PILOT._replace(**changes))
        return budget.reasons["process.treatment_time_s"]

    assert "LONG" not in said(time_to_98=1700.0)
    assert "take 3 times as long as the target on average" in said(
        time_to_98=2400.0, mean_time=800.0
    )
    assert "LONG: few balls get to the target" in said(time_to_98=2400.0, mean_time=2000.0)


@pytest.mark.parametrize(
    ("seconds", "set_to"),
    [(0.3, 1), (4.2, 5), (11, 15), (60, 60), (61, 90), (1000, 1200), (3601, 4500), (9e4, 9e4)],
)
def test_times_are_those_that_a_machine_is_set_to(seconds: float, set_to: float) -> None:
    assert settable(seconds) == set_to


def test_a_time_leaves_room_for_what_its_pilot_is_not_sure_of() -> None:
    """At least 30 % more; from ± 40 % on it is a matter to settle."""
    for spread, treatment, is_rough in ((50.0, 300.0, False), (150.0, 360.0, True)):
        budget = propose_budget(
            Measured(1e6, 1e4, 200.0, True, spread, True, 0.0, 1e-3, 8.0, 200.0)
        )
        assert budget.treatment == treatment
        reason = budget.reasons["process.treatment_time_s"]
        assert ("; TIME KNOWN ROUGHLY, to ± 75%: simulate" in reason) == is_rough
