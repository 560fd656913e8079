"""Proposed points are new and reproducible; the recommended point is the maximum."""

import numpy as np

from chamberopt.optimize.search.acquisition import propose_point, recommend_point
from chamberopt.optimize.search.gaussian_process import GaussianProcess
from tests.helpers.known_optima import PEAK, hill


def test_proposals_are_new_and_the_same_for_the_same_seed() -> None:
    rng = np.random.default_rng(3)
    points = np.vstack([rng.random((15, 2)), [[1.0, 0.0]]])
    model = GaussianProcess(
        points, points[:, 0] - points[:, 1]
    )  # best in the corner, which was seen
    one, two = (propose_point(model, np.random.default_rng(5)) for _ in range(2))
    np.testing.assert_array_equal(one, two)
    assert np.abs(points - one).max(axis=1).min() >= 0.005


def test_the_model_of_the_scores_recommends_the_hilltop() -> None:
    rng = np.random.default_rng(0)
    points = rng.random((40, 3))
    scores = np.array([hill(x) for x in points]) + rng.normal(0, 0.03, 40)
    model = GaussianProcess(points, scores)
    assert hill(recommend_point(model, 1)) > PEAK - 0.03
    np.testing.assert_array_equal(
        recommend_point(model, 1), recommend_point(GaussianProcess(points, scores), 1)
    )
