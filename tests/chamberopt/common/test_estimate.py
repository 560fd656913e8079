"""Estimates keep their range, and differences have intervals, paired or independent."""

import json
import math

import numpy as np
import pytest

from chamberopt.common.estimate import Estimate, estimate, independent_difference, paired_difference


def test_differences() -> None:
    rng = np.random.default_rng(3)
    common = rng.normal(0.0, 1.0, 10)
    before = estimate(common)
    after = estimate(common + 0.1 + rng.normal(0, 0.01, 10))
    paired, apart = paired_difference(after, before), independent_difference(after, before)
    assert paired.value == pytest.approx(0.1, abs=0.02)
    assert paired.half_width < 0.02  # what is common to both cancels
    assert apart.half_width > 0.5  # not so when they are taken as independent
    same = paired_difference(before, before)
    assert (same.value, same.half_width) == (0.0, 0.0)
    assert (
        independent_difference(
            Estimate(1.0, 0.0, (1.0, 1.0)), Estimate(0.0, 0.0, (0.0, 0.0))
        ).half_width
        == 0
    )


@pytest.mark.parametrize("correlation", [0.0, 0.3, 0.9])
@pytest.mark.parametrize("replicas", [3, 8, 30])
def test_intervals_of_differences_hold_whether_or_not_pairs_are_chosen(
    replicas: int, correlation: float
) -> None:
    rng, tries, held, width, of_pairs = np.random.default_rng(replicas), 1000, 0, 0.0, 0.0
    for _ in range(tries):
        one, own = rng.normal(size=(2, replicas))
        two = correlation * one + math.sqrt(1.0 - correlation**2) * own
        gap = paired_difference(estimate(one), estimate(two))
        held += abs(gap.value) <= gap.half_width
        width, of_pairs = width + gap.half_width, of_pairs + estimate(one - two).half_width
    assert 0.93 <= held / tries <= 0.98
    if not correlation:
        assert width < 0.995 * of_pairs
    if correlation * replicas > 8:
        assert width < 1.1 * of_pairs  # as taken independent it would be three times as wide


def test_value_stays_in_its_range_and_one_replica_has_no_interval() -> None:
    assert estimate([1.02, 1.01, 1.03], 0.0, 1.0).value == 1.0
    assert estimate([0.5], 0.0, 1.0).half_width == np.inf


def test_differences_of_unequal_numbers_of_replicas_are_taken_as_independent() -> None:
    one, other = estimate([0.5, 0.6, 0.55, 0.52]), estimate([0.4, 0.3, 0.35], bias=0.1)
    gap = paired_difference(one, other)
    assert gap == independent_difference(one, other)
    assert gap.half_width > 0.1
    assert paired_difference(other, other).bias == pytest.approx(0.2)


def test_an_estimate_comes_back_from_json() -> None:
    one = estimate([0.5, 0.6, 0.8], bias=0.01)
    assert Estimate.from_json(json.loads(json.dumps(one.to_json()))) == one
    interval = json.loads(json.dumps(one.interval_json()))
    assert Estimate.from_interval_json(interval) == Estimate(one.value, one.half_width)
    with pytest.raises(KeyError):
        Estimate.from_json(interval)
    single = json.dumps(estimate([0.5]).to_json(), allow_nan=False)  # its half-width is infinite
    assert Estimate.from_json(json.loads(single)) == estimate([0.5])
    without_dents = estimate([0.0, 0.0, 0.0], bias=math.inf)
    written = json.dumps(without_dents.to_json(), allow_nan=False)
    assert Estimate.from_json(json.loads(written)) == without_dents
