"""Flat ranges and main effects are those of the function that the model learnt."""

from pathlib import Path

import numpy as np
import pytest

from chamberopt.optimize.search.gaussian_process import GaussianProcess
from chamberopt.optimize.sensitivity import analyse_sensitivity
from chamberopt.output.plots.study import slices_picture
from tests.helpers.known_optima import VARY, bowl, bowl_shares, run_bowl
from tests.helpers.synthetic import judged


def test_flat_directions_and_effects_are_those_of_the_function(tmp_path: Path) -> None:
    points = np.random.default_rng(1).random((40, 2))
    scores = 0.8 - 4.0 * (points[:, 0] - 0.5) ** 2
    got = analyse_sensitivity(
        GaussianProcess(points, scores),
        {"a": (0.0, 10.0), "b": (-1.0, 1.0)},
        {"a": 5.0, "b": 0.0},
        noise=0.04,
    )
    steep, idle = got.slices
    assert steep.flat == pytest.approx((4.0, 6.0), abs=0.25)  # 4 (x - 0.5)² = 0.04 at 0.4 and 0.6
    assert idle.flat == pytest.approx((-1.0, 1.0))
    assert steep.share > 0.95
    assert idle.share < 0.05
    assert got.together > 0.9
    np.testing.assert_allclose(steep.mean, 0.8 - 4.0 * (steep.values / 10.0 - 0.5) ** 2, atol=0.05)
    assert "a may go from" in got.sentences()[0]


def test_a_study_says_what_its_model_found(tmp_path: Path) -> None:
    result = run_bowl(
        tmp_path / "out", lambda d, s, n: judged(bowl(bowl_shares(d)) + np.linspace(-0.01, 0.01, 4))
    )
    assert [one.name for one in result.sensitivity.slices] == list(VARY)
    slices_picture(tmp_path / "slices.png", result, result.sensitivity)
    assert (tmp_path / "slices.png").stat().st_size > 10000
    short = run_bowl(
        tmp_path / "short",
        lambda d, s, n: judged(np.full(3, bowl(bowl_shares(d)))),
        {"evaluations": 5},
    )
    assert short.sensitivity is None
