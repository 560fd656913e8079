"""Estimates keep their range, and differences have intervals, paired or independent."""

import json
import math

import numpy as np
import pytest

from chamberopt.common.estimate import (
    Estimate,
    estimate,
    independent_difference,
    jackknife,
    normal_quantile,
    paired_difference,
    student_quantile,
    sum_of_shared,
    welch_half_width,
)


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


def test_an_interval_is_that_of_student_with_the_shared_errors_and_the_bias() -> None:
    """Of three values with s = 1: t of two degrees of freedom is 4.303, over sqrt(3)."""
    scatter, wide = 4.30265 / math.sqrt(3.0), 1.959964 * 5.0
    assert normal_quantile(0.95) == pytest.approx(1.959964)
    assert student_quantile(2) == pytest.approx(4.30265)
    values = [1.0, 2.0, 3.0]
    assert estimate(values).half_width == pytest.approx(scatter)
    found = estimate(values, bias=0.5, shared=(3.0, -4.0))
    assert found.value == 2.0
    assert found.half_width == pytest.approx(math.hypot(scatter, wide) + 0.5)
    assert found.beyond_scatter == pytest.approx(0.5)
    assert (found.low, found.high) == pytest.approx(
        (2.0 - found.half_width, 2.0 + found.half_width)
    )
    later = estimate(values, bias=0.5, shared=(3.0,)).with_shared(3, [-4.0])
    assert later.shared == (3.0, 0.0, 0.0, -4.0)
    assert later.half_width == pytest.approx(found.half_width)
    twice = found.times(2.0)
    assert (twice.value, twice.half_width, twice.bias) == pytest.approx(
        (4.0, 2.0 * found.half_width, 1.0)
    )
    assert twice == estimate(twice.pseudovalues, bias=1.0, shared=twice.shared)
    with pytest.raises(ValueError, match="2 shared errors, at most 1"):
        found.with_shared(1, [1.0])
    clipped = estimate([0.8, 1.0, 1.4], highest=1.0)  # its pseudo-values move with it
    assert np.mean(clipped.pseudovalues) == pytest.approx(1.0)


def test_an_interval_is_widened_and_never_narrowed() -> None:
    one = Estimate(2.0, 0.5)
    assert one.at_least_as_wide(0.4) == one
    assert one.at_least_as_wide(0.6) == Estimate(2.0, 0.6)
    assert Estimate(0.0, 0.0).at_least_as_wide(0.6) == Estimate(0.0, 0.0)
    assert Estimate(2.0, 0.0).at_least_as_wide(0.6) == Estimate(2.0, 0.6)


def test_errors_by_common_causes_cancel_in_a_difference() -> None:
    one, other = estimate([1.0, 2.0, 3.0], shared=(3.0, 1.0)), estimate([0.0, 0.1], shared=(3.0,))
    assert sum_of_shared([(2.0, one), (-1.0, other)]) == (3.0, 2.0)
    gap = independent_difference(one, other)
    assert gap.shared == (0.0, 1.0)
    welch = welch_half_width(one.pseudovalues, other.pseudovalues)
    assert gap.half_width == pytest.approx(math.hypot(welch, normal_quantile(0.95)))
    rough = independent_difference(Estimate(1.0, 3.0), Estimate(0.2, 4.0))
    assert (rough.value, rough.half_width) == pytest.approx((0.8, 5.0))


def test_welchs_interval_is_students_for_samples_alike() -> None:
    """Two samples of n with one variance have 2 n - 2 degrees of freedom, an error s sqrt(2/n)."""
    sample = np.array([1.0, 2.0, 4.0, 7.0])
    error = np.std(sample, ddof=1) * math.sqrt(2.0 / 4.0)
    assert welch_half_width(sample, sample + 9.0) == pytest.approx(student_quantile(6) * error)
    larger = welch_half_width(sample, sample, times=4.0)
    assert larger == pytest.approx(student_quantile(30) * error / 2.0)
    # One sample without scatter adds nothing.
    assert welch_half_width(sample, [3.0, 3.0]) == pytest.approx(
        student_quantile(3) * np.std(sample, ddof=1) / 2.0
    )


def test_pseudo_values_of_a_mean_are_the_values_and_theirs_have_the_mean_of_all() -> None:
    sample = np.array([1.0, 2.0, 4.0, 7.0])
    left_out = [np.delete(sample, k) for k in range(4)]
    np.testing.assert_allclose(
        jackknife(np.array([sample.mean(), *(one.mean() for one in left_out)])), sample
    )
    cubes = np.array([sample.mean() ** 3, *(one.mean() ** 3 for one in left_out)])
    found = jackknife(cubes)
    assert found.mean() == pytest.approx(cubes[0])
    assert np.diff(found) == pytest.approx(-3.0 * np.diff(cubes[1:]))
    assert jackknife(np.array([5.0, 4.0])).tolist() == [5.0]
