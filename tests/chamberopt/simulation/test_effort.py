"""Replicas are added as long as they bring something, until the interval is narrow enough."""

import math
from dataclasses import replace

import numpy as np
import pytest

from chamberopt.common.estimate import Estimate, estimate, shared_half_width
from chamberopt.design.load import load_design
from chamberopt.simulation.effort import (
    MIN_REPLICAS_TO_STOP,
    Effort,
    Step,
    _growth,
    narrows,
    points_remedy,
    scaled,
)
from tests.helpers.synthetic import DESIGNS

ASKED = Effort(first=10, most=200, points=20_000, wanted=0.01)


def figure(half_width: float, shared: float = 0.0) -> Estimate:
    """An estimate of which this half-width is in all replicas."""
    return Estimate(0.5, half_width, shared=(shared / shared_half_width([1.0]),))


def next_count(done: int, half_width: float, shared: float = 0.0) -> int:
    return ASKED.after(done, figure(half_width, shared), 1.0, Step(done)).replicas


def test_a_quick_look_is_short_and_a_thorough_one_long() -> None:
    key = "process.accuracy."
    asked = load_design(DESIGNS / "gear.toml").changed(
        {f"{key}simulated_time_s": 2.0, f"{key}objective_half_width": 0.01}
    )
    quick, thorough = (scaled(asked, one).process.accuracy for one in ("quick", "thorough"))
    assert (quick.simulated_time_s, thorough.simulated_time_s) == (0.5, 8.0)
    assert (quick.objective_half_width, thorough.objective_half_width) == (None, 0.01)
    assert scaled(asked, None) is asked
    longest = asked.changed({f"{key}simulated_time_s": 9000.0})
    assert scaled(longest, "thorough").process.accuracy.simulated_time_s == 1e4


def test_how_many_replicas_come_next() -> None:
    assert next_count(10, 0.01) == 10  # reached
    assert next_count(10, 0.0101) == 13  # at least a quarter more: few looks, little luck
    assert next_count(10, 0.013) == 17  # as foretold
    assert next_count(10, 1.0) == 20  # but no more than twice: what foretells is rough
    assert next_count(150, 1.0) == 200
    assert next_count(200, 1.0) == 200  # spent
    assert next_count(10, 0.011, shared=0.008) == 16  # part of it stays


def test_the_wanted_accuracy_of_a_time_is_a_share_of_it() -> None:
    """The next replicas are the same whether a time is in seconds or a part of a second."""
    for unit in (1.0, 1800.0):
        time = Estimate(-unit, 0.013 * unit)
        assert ASKED.after(10, time, 1.0, Step(10), unit).replicas == 17
        end = ASKED.after(20, replace(time, half_width=0.0099 * unit), 1.0, Step(20), unit)
        assert end.stopped_by == "accuracy"
    assert "± 18 was reached" in end.note


def test_replicas_for_dents_are_as_many_as_their_number_asks_for() -> None:
    """Without an interval the dents foretell the number, however far it is."""
    unknown = figure(math.inf)
    step = ASKED.after(10, unknown, 8.53, Step(10))
    assert step == Step(86, for_dents=True)
    assert ASKED.after(10, unknown, math.inf, Step(10)).replicas == 20  # no dents: not known
    assert ASKED.after(10, unknown, 0.9, Step(10)).replicas == 20  # dents are not what lacks
    assert ASKED.after(86, unknown, 1.001, step).replicas == 91
    end = ASKED.after(86, figure(0.002), 1.0, step)
    assert end.stopped_by == "accuracy"
    assert "± 0.002: so many were needed for enough dents" in end.note
    plain = ASKED.after(86, figure(0.002), 1.0, Step(86)).note
    assert plain == "the wanted accuracy of ± 0.01 was reached after 86 replicas"


def test_replicas_end_where_they_bring_nothing() -> None:
    stuck = ASKED.after(10, figure(0.0225, shared=0.02), 1.0, Step(10))
    assert (stuck.stopped_by, stuck.replicas) == ("points", 10)
    assert "± 0.02 come from the choice of the points" in stuck.note
    assert "from 20,000 to about 100,000" in stuck.note
    # Not before replicas bring little: the half-width may be as much too wide by chance.
    assert ASKED.after(10, figure(0.04, shared=0.02), 1.0, Step(10)).replicas == 20
    # Near the wanted one, they end if more than the largest number would be needed.
    assert next_count(60, 0.0108, shared=0.0096) == 120
    spent = ASKED.after(200, figure(0.02, shared=0.009), 1.0, Step(200))
    assert spent.stopped_by == "max_replicas"
    assert "of which ± 0.009 come from" in spent.note
    assert spent.note.endswith("or simulated_time_s and process.accuracy.points")
    alone = ASKED.after(200, figure(0.02, shared=0.001), 1.0, Step(200)).note
    assert "about 807 replicas would be needed" in alone
    near = ASKED.after(100, figure(0.0108, shared=0.0096), 1.0, Step(10))
    assert near.stopped_by == "points"


def test_what_more_replicas_narrow() -> None:
    assert narrows(figure(0.01))
    assert narrows(figure(math.inf, shared=1.0))
    assert narrows(figure(0.01, shared=0.0087))
    assert not narrows(figure(0.01, shared=0.0088))
    assert not narrows(Estimate(1.0, 0.0))  # exact


@pytest.mark.parametrize("shared", [0.0, 0.2])
def test_stopping_when_it_looks_good_keeps_the_95_percent(shared: float) -> None:
    rng = np.random.default_rng(8)
    effort, held, runs = replace(ASKED, most=400, wanted=0.45), 0, 2000
    for _ in range(runs):
        common = shared * rng.normal()
        sample, step = common + rng.normal(size=400), Step(MIN_REPLICAS_TO_STOP)
        while not step.stopped_by:
            got = estimate(sample[: step.replicas], shared=[shared])
            step = effort.after(step.replicas, got, 1.0, step)
        held += got.low <= 0.0 <= got.high
    assert 0.92 <= held / runs <= 0.98, held / runs


@pytest.mark.parametrize("shared", [0.1, 0.3, 1.0, 3.0])
def test_an_end_after_few_replicas_keeps_the_95_percent(shared: float) -> None:
    """Four replicas, and eight if they narrow the interval, whatever the part in common."""
    rng = np.random.default_rng(9)
    held, runs = 0, 2000
    for _ in range(runs):
        sample = shared * rng.normal() + rng.normal(size=8)
        got = estimate(sample[:4], shared=[shared])
        if narrows(got):
            got = estimate(sample, shared=[shared])
        held += got.low <= 0.0 <= got.high
    assert 0.93 <= held / runs <= 0.97, held / runs


@pytest.mark.parametrize("unit", [1.0, 100.0])
def test_points_are_raised_by_the_square_of_what_their_choice_is_too_much(unit: float) -> None:
    """Seven eighths of the wanted half-width may be of their choice."""
    shared, wanted = 0.0175 * unit, 0.01 * unit
    remedy = points_remedy(20_000, shared, wanted)
    assert remedy == "raise process.accuracy.points from 20,000 to about 80,000"
    assert "to about 20,000" in points_remedy(20_000, 0.5 * shared, wanted)
    assert points_remedy(300_000, shared, wanted).startswith("not even 1,000,000 points")


def test_replicas_narrow_the_scatter_alone() -> None:
    """Four times as many halve it, beside what they share."""
    assert _growth(0.2, 0.0, 0.1) == pytest.approx(4.0)
    wide, shared = math.hypot(0.2, 0.03), 0.03
    assert _growth(wide, shared, math.hypot(0.1, shared)) == pytest.approx(4.0)
    assert _growth(wide, shared, shared) == math.inf
