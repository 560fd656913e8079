"""Averages over discs keep the mean and do not cross edges."""

import numpy as np
import pytest

from chamberopt.output.disc_averages import average_over_discs


def test_averaging_keeps_the_mean_and_does_not_cross_edges() -> None:
    # Two faces back to back, densities 1 and 3 with noise: each is smoothed to itself.
    rng = np.random.default_rng(0)
    grid = np.stack(np.meshgrid(np.arange(30.0), np.arange(30.0)), axis=-1).reshape(-1, 2)
    centre = np.vstack([np.column_stack([grid, np.zeros(900)])] * 2)
    normal = np.repeat([[0, 0, 1.0], [0, 0, -1.0]], 900, axis=0)
    truth = np.repeat([1.0, 3.0], 900)
    dents = rng.poisson(truth)
    shown, reach = average_over_discs(centre, normal, dents.astype(float), np.ones(1800), dents)
    assert 1.0 < reach < 3.0
    for side in (slice(0, 900), slice(900, 1800)):
        assert shown[side].std() < 0.5 * dents[side].std()
        assert shown[side].mean() == pytest.approx(truth[side].mean(), rel=0.1)
    plenty = np.full(1800, 100)
    np.testing.assert_array_equal(
        average_over_discs(centre, normal, truth, np.ones(1800), plenty)[0], truth
    )
