"""Proposed points are new, feasible and reproducible; the recommended point is the maximum."""

import numpy as np
import pytest

from chamberopt.search.optimiser.acquisition import (
    DOUBT,
    _choices,
    _knowledge_gradient,
    possible_gain,
    propose_point,
    recommend_points,
)
from chamberopt.search.optimiser.domain import Axis, Domain
from chamberopt.search.optimiser.search_model import LimitedFigure, Observations, SearchModel
from tests.helpers.known_optima import PEAK, hill


def model_of(
    points: np.ndarray, scores: np.ndarray, *figures: LimitedFigure, **kinds
) -> SearchModel:
    count = len(scores)
    simulated = kinds.get("simulated", np.ones(count, dtype=bool))
    domain = kinds.get("domain", Domain([Axis()] * points.shape[1]))
    seen = Observations(scores, np.zeros(count), simulated, figures)
    return SearchModel(domain, points, seen)


def test_proposals_are_new_and_the_same_for_the_same_seed() -> None:
    rng = np.random.default_rng(3)
    points = np.vstack([rng.random((15, 2)), [[1.0, 0.0]]])
    model = model_of(points, points[:, 0] - points[:, 1])  # best in the corner, which was seen
    one, two = (propose_point(model, np.random.default_rng(5)) for _ in range(2))
    np.testing.assert_array_equal(one, two)
    assert np.abs(points - one).max(axis=1).min() >= 0.005


def test_an_evaluation_is_worth_the_mean_rise_of_the_best_mean() -> None:
    """Against many normal outcomes of the evaluation: it moves the means of both leaders."""
    points = np.array([[0.1, 0.1], [0.9, 0.9], [0.1, 0.9], [0.9, 0.1], [0.5, 0.5]])
    model = model_of(points, np.array([1.0, 1.0, 0.0, 0.0, 0.2]))
    at = points[:1]
    gradient = float(np.exp(_knowledge_gradient(model, points[:2])(at)[0]))
    own, noise = model.score(at)[1][0], model.score.noise
    moves = model.covariance(at, points[:2])[0] / np.hypot(own, np.sqrt(noise))
    draws = np.random.default_rng(0).normal(size=(200_000, 1))
    means = model.expected(points[:2])[0]
    exact = float((means + draws * moves).max(axis=1).mean() - means.max())
    assert gradient == pytest.approx(exact, rel=0.1)


def test_what_may_be_gained_has_the_unit_of_the_score_and_shrinks_with_points() -> None:
    points = np.random.default_rng(4).random((60, 3))
    scores = np.array([hill(x) for x in points])
    few, many = (possible_gain(model_of(points[:n], scores[:n]), 1) for n in (15, 60))
    assert PEAK - scores.max() < many < 0.5 * few
    twice = possible_gain(model_of(points, 2.0 * scores + 5.0), 1)
    assert twice == pytest.approx(2.0 * many, rel=1e-4)


def test_nothing_tells_the_gain_before_a_point_is_within_the_limits() -> None:
    points = np.random.default_rng(4).random((30, 2))
    above = LimitedFigure(1.0 + points[:, 0], np.full(30, 1e-4), -np.inf, 0.5)
    assert possible_gain(model_of(points, points[:, 1], above), 1) == np.inf
    below = LimitedFigure(points[:, 0], np.full(30, 1e-4), -np.inf, 0.5)
    free, limited = (
        possible_gain(model_of(points, points[:, 0], *one), 1) for one in ([], [below])
    )
    assert free < 0.2 < 0.5 < possible_gain(model_of(points, -points[:, 0], above), 1)
    assert limited < 0.3


def test_the_model_of_the_scores_recommends_the_hilltop() -> None:
    rng = np.random.default_rng(0)
    points = rng.random((40, 3))
    scores = np.array([hill(x) for x in points]) + rng.normal(0, 0.03, 40)
    (seen, best), again = (recommend_points(model_of(points, scores), 1) for _ in range(2))
    assert hill(best) > PEAK - 0.03
    assert seen in points
    np.testing.assert_array_equal(best, again[1])


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_what_is_recommended_is_within_the_limit_by_a_margin(side: float) -> None:
    """The score rises with x0, which a figure measured with an error of 0.02 limits to 0.6."""
    rng = np.random.default_rng(1)
    points = rng.random((30, 2))
    values, error = side * points[:, 0] + rng.normal(0.0, 0.02, 30), np.full(30, 0.02**2)
    low, high = (-np.inf, 0.6) if side > 0.0 else (-0.6, np.inf)
    model = model_of(points, points[:, 0], LimitedFigure(values, error, low, high))
    _, best = recommend_points(model, 1)
    assert 0.5 < best[0] < 0.59
    inside, outside = model.feasible(np.array([[0.3, 0.5], [0.9, 0.5]]))
    assert inside > 0.99
    assert outside < 0.01


def test_where_nothing_can_be_simulated_nothing_is_proposed() -> None:
    points = np.random.default_rng(2).random((40, 2))
    simulated = points[:, 0] < 0.7
    model = model_of(points, points[:, 0], simulated=simulated)
    proposed = propose_point(model, np.random.default_rng(0))
    assert 0.5 < proposed[0] < 0.8
    assert model.feasible(np.array([[0.95, 0.5]]))[0] < 0.1


def test_levels_and_choices_are_searched_on_their_values() -> None:
    """Best at level 5 of 7 and the third of three choices, which no evaluation has had together."""
    domain = Domain([Axis(), Axis(8), Axis(3, ordered=False)])
    points = domain.snap(np.random.default_rng(4).random((45, 3)))
    points = points[(np.abs(points[:, 1] - 5 / 7) > 0.01) | (points[:, 2] < 0.9)]

    def score(x: np.ndarray) -> np.ndarray:
        choice = np.array([0.2, 0.0, 0.4])[np.rint(2 * x[:, 2]).astype(int)]
        return choice - (x[:, 1] - 5 / 7) ** 2 - (x[:, 0] - 0.4) ** 2

    model = model_of(points, score(points), domain=domain)
    _, best = recommend_points(model, 1)
    np.testing.assert_allclose(best, [0.4, 5 / 7, 1.0], atol=0.05)
    assert best[1] in np.arange(8) / 7
    proposed = propose_point(model, np.random.default_rng(0))
    np.testing.assert_array_equal(domain.snap(proposed[None])[0], proposed)


def test_a_shop_that_may_miss_is_kept_away_from_a_steep_side() -> None:
    """A ramp up to a cliff at 0.7: aimed at with a miss of 0.1, the best is some 0.1 before it."""
    points = np.random.default_rng(8).random((60, 2))
    scores = np.where(points[:, 0] < 0.7, points[:, 0], 0.0)
    exact, missing = (
        Domain([Axis(), Axis()], np.stack([np.outer([-1.0, 1.0], [miss, 0.0])] * 2))
        for miss in (0.0, 0.1)
    )
    _, best = recommend_points(model_of(points, scores, domain=exact), 1)
    _, robust = recommend_points(model_of(points, scores, domain=missing), 1)
    assert best[0] - 0.15 < robust[0] < best[0] - 0.03
    model = model_of(points, scores, domain=missing)
    at = np.array([[0.3, 0.5]])
    around = at + np.array([[-0.1, 0.0], [0.1, 0.0]])
    assert model.expected(at)[0][0] == pytest.approx(model.score(around)[0].mean(), abs=0.03)
    assert propose_point(model, np.random.default_rng(0)).shape == (2,)


def test_where_the_worst_counts_a_plateau_wins_over_a_peak() -> None:
    """Over 0.1 to both sides the peak of 0.9 at 0.7 has a mean of 0.67 and a worst of 0.43."""
    points = np.random.default_rng(2).random((90, 2))
    scores = np.maximum(0.55 - 0.5 * np.maximum(points[:, 0] - 0.4, 0.0),
                        0.9 - 0.7 / 0.15 * np.abs(points[:, 0] - 0.7))  # fmt: skip
    misses = np.stack([np.outer([-1.0, 1.0], [0.1, 0.0])] * 2)
    by_mean, by_worst = (
        model_of(points, scores, domain=Domain([Axis(), Axis()], misses, counts_worst=one))
        for one in (False, True)
    )
    (_, mean), (_, worst) = (recommend_points(one, 1) for one in (by_mean, by_worst))
    assert worst[0] < 0.45
    assert mean[0] == pytest.approx(0.7, abs=0.03)
    at = np.array([[0.7, 0.5]])
    assert by_worst.expected(at)[0][0] == pytest.approx(0.43, abs=0.08)
    assert by_mean.expected(at)[0][0] == pytest.approx(0.67, abs=0.08)
    assert by_worst.covariance(at, at).shape == (1, 1)
    assert propose_point(by_worst, np.random.default_rng(0)).shape == (2,)


@pytest.mark.parametrize("by_geometry", [True, False])
def test_what_geometry_refuses_does_not_depend_on_the_mass(by_geometry: bool) -> None:
    """All refused points have a large first coordinate, and by chance a large second one too."""
    points = np.array([[0.1, 0.1], [0.3, 0.2], [0.5, 0.1], [0.4, 0.3], [0.8, 0.8], [0.9, 0.9]])
    there = points[:, 0] < 0.6
    seen = Observations(points[:, 0], np.full(6, 1e-4), there, by_geometry=by_geometry)
    model = SearchModel(Domain([Axis(), Axis(shapes=False)]), points, seen)
    at = np.array([[0.4, 0.2], [0.4, 0.9], [0.85, 0.2]])
    light, heavy, far = (float(one) for one in model.feasible(at))
    assert light > 0.9
    assert (heavy > 0.9) is by_geometry  # else either coordinate may be the reason
    assert (far < 0.1) is by_geometry


def test_choices_are_round_the_leaders_and_anywhere() -> None:
    """Five leaders in the middle: half of their choices are 0.03 away in each number, half 0.1."""
    rng = np.random.default_rng(6)
    middle, rest = 0.5 + 1e-3 * rng.random((5, 3)), rng.choice([0.05, 0.95], (20, 3))
    model = model_of(np.vstack([middle, rest]), np.r_[np.ones(5), np.zeros(20)])
    choices = _choices(model, np.random.default_rng(0))
    spread = len(choices) - 500
    away = choices[:500] - 0.5
    assert np.abs(away.mean(axis=0)).max() < 0.02
    assert away.std() == pytest.approx(np.sqrt(0.5 * (0.03**2 + 0.1**2)), rel=0.1)
    of_point = np.abs(away).mean(axis=1)
    assert (of_point > 0.12).mean() < 0.2 < (of_point < 0.03).mean()
    assert choices.min() >= 0.0
    assert choices.max() <= 1.0
    anywhere = choices[-spread:]
    assert np.abs(anywhere.mean(axis=0) - 0.5).max() < 0.01
    assert anywhere.std() == pytest.approx(np.sqrt(1.0 / 12.0), rel=0.02)


def test_the_gain_is_at_least_what_the_evaluated_points_leave_open() -> None:
    """Their scores have an error of 0.1: the best may be that of another one."""
    points = np.random.default_rng(4).random((20, 2))
    domain, every = Domain([Axis()] * 2), np.ones(20, dtype=bool)
    scores = np.random.default_rng(5).normal(0.0, 0.1, 20)
    model = SearchModel(domain, points, Observations(scores, np.full(20, 0.01), every))
    mean, deviation = model.expected(points)
    open_gain = (mean + DOUBT * deviation).max() - (mean - DOUBT * deviation).max()
    assert open_gain > 0.01
    assert possible_gain(model, 1) >= open_gain
