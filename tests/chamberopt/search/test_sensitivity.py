"""Flat ranges and main effects are those of the function that the model learnt."""

from pathlib import Path

import numpy as np
import pytest

from chamberopt.documents.wording import Label
from chamberopt.pictures.charts.study import slices_picture
from chamberopt.search.optimiser.search_model import LimitedFigure, Observations, SearchModel
from chamberopt.search.sensitivity import Sensitivity, analyse_sensitivity, is_supported
from chamberopt.search.study import Study
from chamberopt.search.study.parameters import ParameterSpace
from tests.helpers.known_optima import GEAR, VARY, bowl, bowl_shares, run_bowl
from tests.helpers.synthetic import judged


def analyse(
    points: np.ndarray,
    scores: np.ndarray,
    space: ParameterSpace,
    best: dict,
    noise: float,
    variances: np.ndarray | None = None,
    figures: tuple[LimitedFigure, ...] = (),
) -> Sensitivity:
    known = np.zeros(len(scores)) if variances is None else variances
    seen = Observations(scores, known, np.ones(len(scores), dtype=bool), figures)
    return analyse_sensitivity(SearchModel(space.domain, points, seen), space, best, noise)


def test_a_range_ends_at_the_limit_of_a_figure() -> None:
    points = np.random.default_rng(1).random((30, 1))
    space = ParameterSpace(GEAR, Study(design=GEAR, vary={"shot.mass_g": (1.0, 11.0)}).vary)
    limited = LimitedFigure(points[:, 0], np.zeros(30), -np.inf, 0.7)  # up to 8 g
    scores = 0.8 - 0.01 * points[:, 0]
    got = analyse(points, scores, space, {"shot.mass_g": 5.0}, noise=0.1, figures=(limited,))
    assert got.slices[0].flat == pytest.approx((1.0, 8.0), abs=0.2)


def test_flat_directions_and_effects_are_those_of_the_function(tmp_path: Path) -> None:
    points = np.random.default_rng(1).random((40, 2))
    scores = 0.8 - 4.0 * (points[:, 0] - 0.5) ** 2
    vary = {"shot.mass_g": (1.0, 11.0), "chamber.height_mm": {"choose": [30.0, 45.0, 50.0]}}
    space = Study(design=GEAR, vary=vary).vary
    best = {"shot.mass_g": 6.0, "chamber.height_mm": 45.0}
    got = analyse(points, scores, ParameterSpace(GEAR, space), best, noise=0.04)
    steep, idle = got.slices
    assert steep.flat == pytest.approx((5.0, 7.0), abs=0.25)  # 4 (x - 0.5)² = 0.04 at 0.4 and 0.6
    assert idle.flat == pytest.approx((30.0, 50.0))
    assert steep.share > 0.95
    assert idle.share < 0.05
    assert got.together > 0.9
    np.testing.assert_allclose(
        steep.mean, 0.8 - 4.0 * ((steep.values - 1.0) / 10.0 - 0.5) ** 2, atol=0.05
    )


def test_a_loss_below_what_the_model_can_tell_is_none() -> None:
    points = np.random.default_rng(1).random((12, 1))
    scores = 0.8 - 0.1 * points[:, 0] + 0.05 * np.random.default_rng(2).normal(size=12)
    vary = Study(design=GEAR, vary={"shot.mass_g": (1.0, 11.0)}).vary
    space, errors = ParameterSpace(GEAR, vary), np.full(12, 0.05**2)
    got = analyse(points, scores, space, {"shot.mass_g": 5.0}, noise=1e-8, variances=errors)
    assert got.noise == pytest.approx(got.expected.half_width)
    assert got.noise > 0.01


def test_a_range_ends_at_values_that_the_parameter_can_have() -> None:
    points = np.random.default_rng(1).integers(0, 5, (40, 1)) / 4.0
    vary = Study(design=GEAR, vary={"chamber.height_mm": {"low": 35, "high": 55, "step": 5}}).vary
    space, scores = ParameterSpace(GEAR, vary), 0.8 - 4.0 * (points[:, 0] - 0.5) ** 2
    got = analyse(points, scores, space, {"chamber.height_mm": 45.0}, noise=0.5)
    assert got.slices[0].flat == pytest.approx((40.0, 50.0))  # 4 (x - 0.5)² = 0.5 at 0.15 and 0.85
    assert got.together == 1.0


def test_a_curve_is_supported_where_evaluations_are() -> None:
    points = 0.5 * np.random.default_rng(1).random((20, 1))  # up to 11 of 1 to 21
    space = ParameterSpace(GEAR, Study(design=GEAR, vary={"shot.mass_g": (1.0, 21.0)}).vary)
    scores = np.sin(12.0 * points[:, 0])
    seen = Observations(scores, np.zeros(20), np.ones(20, dtype=bool))
    model = SearchModel(space.domain, points, seen)
    (one,) = analyse_sensitivity(model, space, {"shot.mass_g": 3.0}, 0.1).slices
    supported = is_supported(model, one)
    assert supported[one.values < 10.0].all()
    assert not supported[one.values > 17.0].any()


def test_effects_that_only_add_up_are_all_of_the_variance() -> None:
    points = np.random.default_rng(1).random((20, 2))
    space = ParameterSpace(GEAR, Study(design=GEAR, vary=VARY).vary)
    got = analyse(points, points.sum(axis=1), space, space.values_at(space.start), noise=0.01)
    assert sum(one.share for one in got.slices) == pytest.approx(1.0, abs=0.02)


def test_a_study_says_what_its_model_found(tmp_path: Path) -> None:
    result = run_bowl(
        tmp_path / "out", lambda d, s, n: judged(bowl(bowl_shares(d)) + np.linspace(-0.01, 0.01, 4))
    )
    assert [one.name for one in result.sensitivity.slices] == list(VARY)
    slices_picture(tmp_path / "slices.png", result, result.sensitivity, Label("score"))
    assert (tmp_path / "slices.png").stat().st_size > 10000
    short = run_bowl(
        tmp_path / "short",
        lambda d, s, n: judged(np.full(3, bowl(bowl_shares(d)))),
        {"evaluations": 5},
    )
    assert short.sensitivity is None


def test_no_interval_is_given_where_scores_were_raised_for_the_model() -> None:
    """A cliff: below 0.3 all scores are -5, which would bend the model."""
    points = np.linspace(0.0, 1.0, 40)[:, None]
    scores = np.where(points[:, 0] < 0.3, -5.0, 0.8 - (points[:, 0] - 0.6) ** 2)
    space = ParameterSpace(GEAR, Study(design=GEAR, vary={"shot.mass_g": (1.0, 11.0)}).vary)
    one = analyse(points, scores, space, {"shot.mass_g": 7.0}, noise=0.01).slices[0]
    share = (one.values - 1.0) / 10.0
    assert one.or_worse[share < 0.25].all()
    sure = ~one.or_worse
    assert sure[np.abs(share - 0.6) < 0.2].all()
    truth = np.where(share < 0.3, -5.0, 0.8 - (share - 0.6) ** 2)
    assert (np.abs(one.mean - truth)[sure] <= one.half_width[sure] + 0.02).mean() > 0.9


def test_a_range_does_not_reach_where_nothing_was_tried() -> None:
    """Candidates lie in a fifth of the bounds. Beyond, the model's mean returns to their mean."""
    points = 0.4 + 0.2 * np.random.default_rng(1).random((20, 1))
    scores = 0.8 - 10.0 * (points[:, 0] - 0.5) ** 2
    space = ParameterSpace(GEAR, Study(design=GEAR, vary={"shot.mass_g": (1.0, 11.0)}).vary)
    one = analyse(points, scores, space, {"shot.mass_g": 6.0}, noise=0.1).slices[0]
    assert (one.mean[one.values < 4.0] > 0.7).all()
    assert one.flat == pytest.approx((5.0, 7.0), abs=0.3)  # 10 (x - 0.5)² = 0.1 at 0.4 and 0.6
