"""Axes show every value, and no interval that says nothing."""

import numpy as np

from chamberopt.common.estimate import Estimate
from chamberopt.pictures.charts.figure_style import value_range


def test_an_interval_without_information_does_not_spoil_the_axis() -> None:
    low, high = value_range([Estimate(-43.0, 5e5), Estimate(-6.0, 4.0), Estimate(-12.0, np.inf)])
    assert -150 < low < -43 - 37
    assert -2 < high < 60  # an infinite one has no bar
    assert value_range([Estimate(1.0, np.inf)]) == (0.5, 1.5)
    low, high = value_range([Estimate(0.4, 0.1), Estimate(0.8, 0.1)])  # all of what says something
    assert low < 0.3
    assert high > 0.9
