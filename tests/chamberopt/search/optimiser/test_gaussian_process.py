"""The model holds the truth in its interval, and the variances of its scores are moderated."""

import numpy as np
import pytest

from chamberopt.search.optimiser.gaussian_process import GaussianProcess, moderate_variances
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


def test_a_score_is_told_by_the_others_as_if_it_were_not_there() -> None:
    rng = np.random.default_rng(8)
    points = rng.random((20, 2))
    scores = np.array([bowl(x) for x in points]) + rng.normal(0.0, 0.05, 20)
    model = GaussianProcess(points, scores, np.full(20, 0.05**2))
    mean, deviation = model.left_out()
    covariance = np.linalg.inv(model._inverse.T @ model._inverse)
    values = (scores - scores.mean()) / scores.std()
    for k in range(20):
        rest = np.arange(20) != k
        weights = np.linalg.solve(covariance[np.ix_(rest, rest)], covariance[rest, k])
        variance = covariance[k, k] - weights @ covariance[rest, k]
        expected = scores.mean() + scores.std() * weights @ values[rest]
        np.testing.assert_allclose(mean[k], expected, rtol=1e-6)
        np.testing.assert_allclose(deviation[k], scores.std() * np.sqrt(variance), rtol=1e-6)


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


def test_far_from_all_points_its_mean_is_not_that_of_the_points_that_gather() -> None:
    """29 points on a top of 0.8 and 10 elsewhere, of 0.2: the mean far away is nearer to these."""
    rng = np.random.default_rng(6)
    near = np.clip(0.9 + 0.02 * rng.normal(size=(29, 2)), 0.0, 1.0)
    points = np.vstack([near, 0.6 * rng.random((10, 2))])
    scores = np.where(np.arange(39) < 29, 0.8, 0.2) + rng.normal(0.0, 0.01, 39)
    mean, _ = GaussianProcess(points, scores, np.full(39, 1e-4))(np.array([[30.0, 30.0]]))
    assert scores.mean() > 0.6
    assert 0.25 < mean[0] < 0.55


def test_variances_are_drawn_towards_those_of_all() -> None:
    """Alike, they are all but common; different by far more than chance, each keeps its own."""
    rng = np.random.default_rng(7)
    alike = rng.normal(0.0, 0.1, (200, 4)).var(axis=1, ddof=1)
    pooled = moderate_variances(alike, np.full(200, 4))
    np.testing.assert_allclose(pooled.mean(), 0.01 / 4, rtol=0.2)
    assert np.log(pooled).std() < 0.2 * np.log(alike).std()
    true = np.exp(rng.normal(0.0, 3.0, 200))
    own = (np.sqrt(true)[:, None] * rng.normal(size=(200, 40))).var(axis=1, ddof=1)
    np.testing.assert_allclose(
        moderate_variances(own, np.full(200, 40)), own / 40, rtol=0.02, atol=5e-4
    )
    wild = np.append(alike, [1e9, np.nan])
    found = moderate_variances(wild, np.full(202, 4))
    assert found[200] > 1e6  # must not drown the others
    assert np.median(found[:200]) < 0.02
    assert not moderate_variances(np.full(2, np.nan), np.ones(2)).any()
