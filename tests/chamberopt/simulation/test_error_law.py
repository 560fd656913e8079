"""Errors of batches and the power law through them, on noise whose truth is known."""

import math

import numpy as np
import pytest

from chamberopt.common.estimate import student_quantile
from chamberopt.simulation.error_law import (
    NORMAL,
    BatchSize,
    ErrorLaw,
    fit_error_law,
    rms_error,
    rms_interval,
)


def normal_batches(draws: int, size: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Standard normal replicas: means of batches (draws, size / count), and of all (draws,)."""
    values = np.random.default_rng(1).normal(size=(draws, size))
    return values.reshape(draws, -1, count).mean(axis=2), values.mean(axis=1)


@pytest.mark.parametrize("count", [4, 16, 32])
def test_error_of_a_batch_is_against_the_truth_not_against_its_own_pool(count: int) -> None:
    parts, whole = normal_batches(4000, 64, count)
    square = np.mean(
        [rms_error(part, one, count / 64) ** 2 for part, one in zip(parts, whole, strict=True)]
    )
    assert square == pytest.approx(1.0 / count, rel=0.05)
    assert np.mean((parts - whole[:, None]) ** 2) == pytest.approx(
        (1 - count / 64) / count, rel=0.05
    )


def test_interval_of_an_error_contains_it_in_95_percent() -> None:
    parts, whole = normal_batches(2000, 64, 8)
    ends = [
        rms_interval(rms_error(part, one, 1 / 8), 8) for part, one in zip(parts, whole, strict=True)
    ]
    covered = np.mean([low <= 8**-0.5 <= high for low, high in ends])
    assert 0.93 <= covered <= 0.97


def batch_sizes(pool: np.ndarray) -> list[BatchSize]:
    """4, 8, 16 ... replicas of a pool, a CPU second each."""
    sizes = []
    for count in (4, 8, 16, 32, 64):
        parts = pool[: len(pool) // count * count].reshape(-1, count).mean(axis=1)
        rms = rms_error(parts, pool.mean(), count / len(pool))
        half_width = student_quantile(count - 1) / np.sqrt(count)
        sizes.append(BatchSize(count, len(parts), rms, half_width, float(count)))
    return sizes


def test_law_is_found_exactly_and_its_interval_contains_the_truth() -> None:
    exact = fit_error_law(
        [
            BatchSize(1, batches, 3.0 * cost**-0.5 / NORMAL, 0.0, cost)
            for cost, batches in ((1.0, 9), (2.0, 5), (5.0, 4))
        ]
    )
    assert (exact.scale, exact.power) == (pytest.approx(3.0), pytest.approx(0.5))
    assert exact.halving is None  # from so few batches
    rng = np.random.default_rng(2)
    laws = [fit_error_law(batch_sizes(pool)) for pool in rng.normal(size=(40, 256))]
    assert np.mean([abs(law.power - 0.5) <= law.half_width for law in laws]) >= 0.85
    assert np.mean([law.power for law in laws]) == pytest.approx(0.5, abs=0.05)
    assert ErrorLaw(1.0, 0.2, 0.3).halving is None  # an interval that includes "never"
    assert ErrorLaw(1.0, 0.2, 0.12).halving is None  # or what is hardly better
    known = ErrorLaw(1.0, 0.5, 0.2).halving
    assert known == pytest.approx((4.0, 2.0 ** (1 / 0.7), 2.0 ** (1 / 0.3)))


def test_batches_with_too_few_dents_are_left_out_of_the_law() -> None:
    first, *others = batch_sizes(np.random.default_rng(3).normal(size=256))
    poor = BatchSize(4, first.batches, 30.0, 30.0, 4.0, is_resolved=False)
    assert fit_error_law([poor, *others]) == fit_error_law(others)
    # With fewer than two that are resolved, all count.
    only = [poor, BatchSize(8, 8, 15.0, 15.0, 8.0, is_resolved=False), others[-1]]
    resolved = [
        BatchSize(one.replicas, one.batches, one.rms, one.half_width, one.cpu_s) for one in only
    ]
    assert fit_error_law(only) == fit_error_law(resolved)


def test_the_power_of_the_law_has_the_interval_of_its_scatter() -> None:
    """Between two sizes: the standard deviation of the slope is that of both ends over the way."""
    sizes = [
        BatchSize(1, batches, error, 0.0, cost)
        for cost, batches, error in ((1.0, 9, 2.0), (math.e**2, 5, 1.0))
    ]
    law = fit_error_law(sizes)
    sd = math.sqrt(1.0 / (2.0 * 8.0) + 1.0 / (2.0 * 4.0)) / 2.0
    assert law.power == pytest.approx(0.5 * math.log(sizes[0].error / sizes[1].error))
    assert law.half_width == pytest.approx(NORMAL * sd)


def test_the_interval_of_an_error_of_two_batches_is_that_of_a_squared_normal_number() -> None:
    """Of one degree of freedom: chi-square is the square of z, at 0.9875 and 0.5125."""
    assert rms_interval(3.0, 2) == pytest.approx((3.0 / 2.241403, 3.0 / 0.031338), rel=1e-4)
