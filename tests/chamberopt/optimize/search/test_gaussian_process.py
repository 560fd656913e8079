"""The model holds the truth in its interval, and the variances of its scores are pooled."""

import numpy as np

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


def test_spreads_are_pooled() -> None:
    np.testing.assert_allclose(
        pool_variances(np.array([1.0, 3.0, np.nan]), np.array([2, 4, 1])), [1.0, 0.5, 2.0]
    )
    wild = pool_variances(
        np.array([1.0, 3.0, 1e9]), np.array([2, 2, 2])
    )  # must not drown the others
    np.testing.assert_allclose(wild, [1.0, 1.0, 5e8])
    assert not pool_variances(np.full(2, np.nan), np.ones(2)).any()
