"""Percentiles of dent densities without the scatter of counting, against known densities."""

import numpy as np
import pytest

from chamberopt.coverage.true_densities import TrueDensities, count_roots, true_densities

BATCHES, WINDOWS = 8, 20_000
WEIGHT = 0.01  # share of a window that a dent takes


def found_from(density: np.ndarray, clusters: np.ndarray | float = 1.0) -> TrueDensities:
    """The densities that are found where dents fall at random, `clusters` of them at a time.

    Args:
        density: true dent density of each window, per replica, (p,).
    """
    rng = np.random.default_rng(1)
    mean = density / (WEIGHT * clusters)
    shares = WEIGHT * clusters * rng.poisson(mean, (BATCHES, len(density)))
    return true_densities(count_roots(shares, np.ones(BATCHES, dtype=int)))


def test_an_even_surface_has_the_same_density_at_all_percentiles() -> None:
    found = found_from(np.full(WINDOWS, 0.125))  # 100 dents in all, whose counts scatter by 10 %
    assert [found.at(share) for share in (0.05, 0.5, 0.95)] == pytest.approx([0.125] * 3, rel=0.03)


def test_a_normal_distribution_of_roots_is_found() -> None:
    # 5 % of a normal distribution lie below its mean less 1.645 standard deviations.
    root = np.random.default_rng(2).normal(0.4, 0.04, WINDOWS)
    found = found_from(root**2)
    for share, sign in ((0.05, -1.0), (0.95, 1.0)):
        assert found.at(share) == pytest.approx((0.4 + sign * 1.645 * 0.04) ** 2, rel=0.02)


def test_a_small_dense_part_does_not_move_the_rest() -> None:
    # Roots that are moved towards their mean in proportion would have the 5th percentile at 0.107,
    # hardly above that of the counted roots, 0.106.
    density = np.where(np.arange(WINDOWS) < 0.8 * WINDOWS, 0.125, 0.5)
    found = found_from(density)
    assert found.at(0.05) == pytest.approx(0.125, rel=0.07)
    assert found.at(0.95) == pytest.approx(0.5, rel=0.04)


def test_dents_that_fall_in_clusters_scatter_more_where_they_do() -> None:
    dense = np.arange(WINDOWS) >= 0.8 * WINDOWS
    found = found_from(np.where(dense, 0.5, 0.125), clusters=np.where(dense, 4.0, 1.0))
    assert found.at(0.05) == pytest.approx(0.125, rel=0.07)
    assert found.at(0.95) == pytest.approx(0.5, rel=0.06)


def test_counts_without_scatter_are_taken_as_they_are() -> None:
    density = np.linspace(0.1, 0.2, 2001)
    shares = np.tile(density, (BATCHES, 1))
    found = true_densities(count_roots(shares, np.ones(BATCHES, dtype=int)))
    assert found.at(0.25) == pytest.approx(0.125, rel=0.003)
    single = true_densities(count_roots(shares[:1], np.ones(1, dtype=int)))
    assert single.at(0.25) == pytest.approx(0.125, rel=0.003)


def test_a_target_without_dents_has_no_density() -> None:
    found = true_densities(count_roots(np.zeros((BATCHES, 50)), np.ones(BATCHES, dtype=int)))
    assert found.at(0.95) == 0.0
