"""The model holds the truth in its interval, and the variances of its scores are pooled."""

import numpy as np
import pytest

from chamberopt.optimize.search.gaussian_process import GaussianProcess, pool_variances
from tests.helpers.known_optima import bowl


def test_the_model_holds_the_truth_in_its_interval() -> None:
    rng = np.random.default_rng(4)
    points = rng.random((60, 2))
    scores = np.array([bowl(x) for x in points]) + rng.normal(0.0, 0.05, 60)
    model = GaussianProcess(points, scores, np.full(60, 0.05**2))
    at = rng.random((300, 2))
    mean, deviation = model(at)
    truth = np.array([bowl(x) for x in at])
    assert np.mean(np.abs(mean - truth) < 1.96 * deviation) > 0.85
    assert np.sqrt(np.mean((mean - truth) ** 2)) < 0.04
    np.testing.assert_allclose(
        np.diag(model.covariance(at[:5], at[:5])), deviation[:5] ** 2, rtol=1e-6
    )


@pytest.mark.parametrize("length_factor", [1.0, 0.5])
def test_a_running_evaluation_takes_away_uncertainty_only(length_factor: float) -> None:
    """Its mean is the same; its variance is that of one more noisy score, in closed form."""
    rng = np.random.default_rng(5)
    points, at = rng.random((25, 2)), rng.random((50, 2))
    scores = np.array([bowl(x) for x in points]) + rng.normal(0.0, 0.05, 25)
    without = GaussianProcess(points, scores, np.full(25, 0.05**2), length_factor)
    running = np.array([[0.2, 0.9]])
    model = GaussianProcess(points, scores, np.full(25, 0.05**2), length_factor, running)
    np.testing.assert_array_equal(model.points[-1], running[0])
    (before, deviation), (after, less) = without(at), model(at)
    np.testing.assert_allclose(after, before, atol=1e-9)
    (_, there), moves = without(running), without.covariance(at, running)[:, 0]
    expected = deviation**2 - moves**2 / (there[0] ** 2 + without.noise)
    np.testing.assert_allclose(less**2, expected, rtol=1e-6)


def test_spreads_are_pooled() -> None:
    np.testing.assert_allclose(
        pool_variances(np.array([1.0, 3.0, np.nan]), np.array([2, 4, 1])), [1.0, 0.5, 2.0]
    )
    wild = pool_variances(
        np.array([1.0, 3.0, 1e9]), np.array([2, 2, 2])
    )  # must not drown the others
    np.testing.assert_allclose(wild, [1.0, 1.0, 5e8])
    assert not pool_variances(np.full(2, np.nan), np.ones(2)).any()
