"""Axes show every value, and no interval that says nothing."""

import numpy as np
import pytest

from chamberopt.common.estimate import Estimate
from chamberopt.documents.wording import objective_label
from chamberopt.pictures.charts.figure_style import keep_below, new_figure, value_range


def test_an_interval_without_information_does_not_spoil_the_axis() -> None:
    low, high = value_range([Estimate(-43.0, 5e5), Estimate(-6.0, 4.0), Estimate(-12.0, np.inf)])
    assert -150 < low < -43 - 37
    assert -2 < high < 60  # an infinite one has no bar
    assert value_range([Estimate(1.0, np.inf)]) == (0.5, 1.5)
    low, high = value_range([Estimate(0.4, 0.1), Estimate(0.8, 0.1)])  # all of what says something
    assert low < 0.3
    assert high > 0.9


def test_the_axis_of_a_share_ends_at_one() -> None:
    shares = [Estimate(0.9, 0.05), Estimate(0.99, 0.04)]
    assert value_range(shares, 1.0)[1] == 1.0
    assert value_range(shares[:1], 1.0)[1] == pytest.approx(0.955)
    axes = new_figure(3.0, 3.0).subplots()
    axes.plot([0.8, 1.0])
    keep_below(axes, 1.0)
    assert axes.get_ylim()[1] == 1.0
    assert objective_label("1 mean_coverage").most == 100.0
    assert objective_label("uniform_coverage").most == 1.0
    assert objective_label("2 mean_coverage + -0.001 time_to_98_s").most >= 2.0
    assert objective_label("minus_time_to_98_s").most == np.inf
